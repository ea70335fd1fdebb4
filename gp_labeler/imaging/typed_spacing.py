"""Voxel sizes as people type them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from gp_core.errors import GpError
from gp_labeler.imaging.readers.options import Spacing, as_spacing

__all__ = ["UNITS", "spacing_in", "typed_spacing"]

UNITS: Mapping[str, float] = MappingProxyType({"mm": 1.0, "µm": 1e-3})
"""Units that can be chosen, in mm."""


def typed_spacing(texts: Sequence[str], unit: str) -> Spacing | None:
    """Return the voxel size, mm, that three texts (x, y, z) in a unit of `UNITS` mean.

    Returns
    -------
    (3,) float or None
        None where nothing was typed.

    Raises
    ------
    GpError
        A text is no positive number, or some are empty and others not.
    """
    cleaned = [text.strip().replace(",", ".") for text in texts]
    if not any(cleaned):
        return None
    if not all(cleaned):
        raise GpError("the voxel size lacks a number", remedy="Fill in all three.")
    try:
        values = [round(float(text) * UNITS[unit], 12) for text in cleaned]
    except ValueError:
        raise GpError(f"a voxel size must be numbers, got {' '.join(dict.fromkeys(cleaned))!r}") from None
    return as_spacing(values)


def spacing_in(spacing: Sequence[float], unit: str) -> tuple[str, str, str]:
    """Return a voxel size (3,) in mm as texts in another unit."""
    x, y, z = (f"{length / UNITS[unit]:.6g}" for length in spacing)
    return x, y, z
