"""Limits that the inner loops of JRMPC share, whether they run in NumPy or compiled."""

from __future__ import annotations

__all__ = ["LEAST_SPREAD", "NOTHING"]

NOTHING = 1e-290
"""Smaller than any weight of a point."""

LEAST_SPREAD = 1e-10
"""Of a centre, relative to the size: keeps one that collapsed onto a point finite at epsilon 0."""
