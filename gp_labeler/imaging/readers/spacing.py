"""Voxel sizes: their units, and which of them cannot be believed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gp_labeler.imaging.readers.options import Spacing
from gp_labeler.imaging.readers.problems import Problem

__all__ = ["LARGEST_MM", "SMALLEST_MM", "is_screen_resolution", "shown", "spacing_problems", "unit_in_mm"]

SMALLEST_MM, LARGEST_MM = 8.0, 250.0
"""A guinea-pig head is 50 to 90 mm long, the part around one ear some 15 mm."""

_SCREEN_DPI = (72, 90, 96, 150, 300, 600)
_UNITS = {
    "am": 1e-15,
    "fm": 1e-12,
    "pm": 1e-9,
    "å": 1e-7,
    "angstrom": 1e-7,
    "ångström": 1e-7,
    "nm": 1e-6,
    "nanometer": 1e-6,
    "nanometre": 1e-6,
    "um": 1e-3,
    "µm": 1e-3,
    "\u03bcm": 1e-3,  # the Greek letter, not the micro sign
    "â\u00b5m": 1e-3,  # UTF-8 read as Latin-1
    "micron": 1e-3,
    "micrometer": 1e-3,
    "micrometre": 1e-3,
    "mm": 1.0,
    "millimeter": 1.0,
    "millimetre": 1.0,
    "cm": 10.0,
    "centimeter": 10.0,
    "centimetre": 10.0,
    "dm": 100.0,
    "decimeter": 100.0,
    "decimetre": 100.0,
    "dam": 1e4,
    "hm": 1e5,
    "km": 1e6,
    "m": 1000.0,
    "meter": 1000.0,
    "metre": 1000.0,
    "in": 25.4,
    "inch": 25.4,
    "inche": 25.4,  # "inches" without its s
    "ft": 304.8,
    "yd": 914.4,
    "mi": 1_609_344.0,
    "li": 25.4 / 12,
    "pt": 25.4 / 72,
    "mil": 0.0254,
    "thou": 0.0254,
    '"': 25.4,
}


def unit_in_mm(unit: str | None) -> float | None:
    """Return the length in mm of a unit as files write it, or None where it is no length (``"pixel"``)."""
    text = (unit or "").strip().strip("\x00").replace("\\u00B5", "µ").replace("\\u00b5", "µ")
    lowered = text.lower()
    return _UNITS.get(lowered, _UNITS.get(lowered.removesuffix("s")))


def is_screen_resolution(length: float) -> bool:
    """Return whether a pixel size in mm is a screen's or printer's, written where none is known."""
    # PNG and BMP hold whole pixels a metre: 2835 for 72 dpi, which is 1.2e-4 off.
    return any(abs(length * dpi / 25.4 - 1) < 3e-4 for dpi in _SCREEN_DPI)


def shown(spacing: Sequence[float]) -> str:
    """Return ``"0.035 mm"``, or ``"0.035 x 0.035 x 0.07 mm"`` where they differ."""
    texts = [f"{length:.6g}" for length in spacing]
    return f"{texts[0] if len(set(texts)) == 1 else ' x '.join(texts)} mm"


def spacing_problems(
    spacing: Spacing | None,
    size: tuple[int, int, int],
    *,
    given: bool,
    suggested: Spacing | None = None,
    reason: str = "",
) -> tuple[Problem, ...]:
    """Say why a voxel size cannot be believed.

    Parameters
    ----------
    spacing : (3,) float, mm, optional
        Voxel size, None where there is none.
    size : (3,) int
        Voxels along x, y, z.
    given : bool
        Whether a person gave it: then only an impossible head stands against it.
    suggested : (3,) float, mm, optional
        What the file hints at; stands in the remedy.
    reason : str
        Why there is none, where the reader knows.
    """
    ask = _remedy(suggested)
    if spacing is None:
        text = reason or "the voxel size is not in the file"
        return (Problem("spacing-missing", text, "error", ask, ("spacing",)),)
    if not given and (unlikely := _implausible(spacing)):
        return (Problem(*unlikely, "error", ask, ("spacing",)),)
    return _size_problem(spacing, size)


def _implausible(spacing: Spacing) -> tuple[str, str] | None:
    if all(abs(length - 1) < 1e-9 for length in spacing):
        return "spacing-unit", "the voxel size in the file is 1 mm, which programs write if it is unknown"
    if abs(spacing[2] - 1) < 1e-9 or abs(spacing[0] - 1) < 1e-9:
        return (
            "spacing-unit",
            f"the voxel size in the file is {shown(spacing)}; a value of 1 usually means unknown",
        )
    if is_screen_resolution(spacing[0]):
        dpi = round(25.4 / spacing[0])
        return (
            "spacing-screen",
            f"the voxel size in the file, {shown(spacing)}, is a screen's or printer's ({dpi} dpi)",
        )
    return None


def _size_problem(spacing: Spacing, size: tuple[int, int, int]) -> tuple[Problem, ...]:
    longest = max(n * length for n, length in zip(size, spacing, strict=True))
    if SMALLEST_MM <= longest <= LARGEST_MM:
        return ()
    better = next((f for f in (1e-3, 1e3) if SMALLEST_MM <= longest * f <= LARGEST_MM), None)
    scaled = None if better is None else tuple(length * better for length in spacing)
    voxels = f"{' x '.join(map(str, size))} voxels of {shown(spacing)}"
    text = (
        f"the scan would be {_length(longest)} long, {voxels}; "
        f"expected are {SMALLEST_MM:g} to {LARGEST_MM:g} mm, a guinea-pig head is 50 to 90 mm long"
    )
    if scaled:
        text += f"; a factor of 1000, as between µm and mm, would make it {longest * better:.3g} mm"  # type: ignore[operator]
    remedy = f"{_remedy(scaled)} If it is right all the same, accept it (--accept extent)."  # type: ignore[arg-type]
    return (Problem("extent", text, "error", remedy, ("spacing", "accept")),)


def _remedy(suggested: Spacing | None) -> str:
    if suggested is None:
        return "Give the true voxel size in mm, from the scanner's log (--spacing 0.05)."
    value = f"{suggested[0]:.6g}" if len(set(suggested)) == 1 else " ".join(f"{v:.6g}" for v in suggested)
    return f"Give the true voxel size in mm, from the scanner's log; perhaps --spacing {value}."


def _length(mm: float) -> str:
    if mm >= 1000:
        return f"{mm / 1000:.3g} m"
    return f"{mm:.3g} mm" if mm >= 0.01 else f"{np.format_float_positional(mm * 1000, 3)} µm"
