"""Constants of the method that several modules share."""

from __future__ import annotations

__all__ = [
    "CHI2_3_95",
    "CHI2_3_MEDIAN",
    "DEFINING_FEATURES",
    "METHODS",
    "METHOD_NAMES",
    "MM_PER_DEGREE",
]

DEFINING_FEATURES = ("CA", "CB", "RWA", "RWP")
"""The features that define the pose of a cochlea: its origin CO and its axis are computed from them."""

METHODS = ("robust", "jrmpc")
"""The estimators of a cochlea's pose."""

METHOD_NAMES = {"robust": "Robust", "jrmpc": "JRMPC"}
"""Display names of the estimators."""

MM_PER_DEGREE = 0.2
"""Weight of a degree of axis error against a millimetre of origin error, in the paper's total error E_T."""

CHI2_3_95 = 7.814727903251179
"""95 % quantile of the chi-squared distribution with 3 degrees of freedom."""

CHI2_3_MEDIAN = 2.366
"""Median of the chi-squared distribution with 3 degrees of freedom."""
