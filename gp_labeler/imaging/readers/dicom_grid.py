"""Slices in their order: on a regular grid along their normal, and what stands against it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.imaging.readers.dicom_tags import DicomSlice
from gp_labeler.imaging.readers.problems import Problem, names, warning

__all__ = ["Grid", "doubled_places", "on_grid"]

_SAME = 0.25
"""Positions nearer than this part of the slice distance are the same one; all tolerances are relative, for a
whole slice of a micro-CT may measure less than the absolute 0.01 mm that suffices for people."""

_NOTICEABLE = 0.1
"""Part of a voxel by which slices may lie off their grid without a word, but for what rounding explains."""

_ROUNDING_MM = 0.0051
"""Half of the last digit of positions with two decimals, as some scanners write them."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Slices along their normal: None where one is missing.

    Parameters
    ----------
    slices : tuple of DicomSlice or None
        In order.
    distance : float, mm, optional
        From slice to slice; None where the files do not say.
    axes : (3, 3) array, optional
        Columns: where x, y and the normal point; None where the files do not say.
    placed : bool
        Whether positions and orientations are known.
    origin : (3,) array, mm, optional
        Where the first slice lies, if only that is known.
    problems : tuple of Problem
        What stands against it.
    """

    slices: tuple[DicomSlice | None, ...]
    distance: float | None
    axes: FloatArray | None
    placed: bool
    problems: tuple[Problem, ...]
    origin: FloatArray | None = None

    @property
    def there(self) -> list[DicomSlice]:
        """The slices that are not missing."""
        return [one for one in self.slices if one is not None]


def on_grid(slices: Sequence[DicomSlice]) -> Grid:
    """Sort slices by their positions, else by their locations, else by their numbers."""
    positions, axes = _positions(slices), _common_axes(slices)
    if positions is not None and axes is not None and np.ptp(positions @ axes[:, 2]) > 0:
        return _sorted(slices, positions @ axes[:, 2], axes, ())
    if positions is not None and axes is None and np.ptp(positions, axis=0).max() > 0:
        text = "the slices have positions, but no ImageOrientationPatient: how they are turned is unknown"
        along = positions @ _line(positions)
        return _sorted(slices, along, None, (warning("no-orientation", text),))
    locations = [one.location for one in slices if one.location is not None]
    if len(locations) == len(slices) and np.ptp(locations) > 0:
        text = f"{_lacking(slices)}: they are ordered by their SliceLocation, and lie as far apart"
        return _sorted(slices, np.array(locations), None, (warning("no-positions", text),))
    return _by_number(slices, axes)


def _positions(slices: Sequence[DicomSlice]) -> FloatArray | None:
    known = [one.position for one in slices if one.position is not None]
    return np.array(known) if len(known) == len(slices) else None


def _common_axes(slices: Sequence[DicomSlice]) -> FloatArray | None:
    """Return the mean orientation, at right angles again."""
    known = [one.axes for one in slices if one.axes is not None]
    if len(known) < len(slices):
        return None
    if all(axes is known[0] for axes in known):
        return known[0]
    u, _, vt = np.linalg.svd(np.mean(known, axis=0))
    axes: FloatArray = u @ vt
    return axes


def _line(positions: FloatArray) -> FloatArray:
    """Return the direction along which positions lie, its largest part positive."""
    direction: FloatArray = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)[2][0]
    main = float(direction[np.abs(direction).argmax()])
    return direction * (1.0 if main > 0 else -1.0)


def _sorted(
    slices: Sequence[DicomSlice], along: FloatArray, axes: FloatArray | None, said: tuple[Problem, ...]
) -> Grid:
    order = np.argsort(along, kind="stable")
    ordered, along = [slices[n] for n in order], along[order]
    same = doubled_places(along)
    problems = [*said, *_doubled(ordered, same)]
    kept = [one for one, doubled in zip(ordered, same, strict=True) if not doubled]
    along = along[~same]
    step = _usual_step(along)
    places = np.concatenate([[0], np.cumsum(np.maximum(1, np.rint(np.diff(along) / step)))]).astype(int)
    distance, start = np.polyfit(places, along, 1) if len(kept) > 1 else (step, along[0])
    if np.abs(along - (start + distance * places)).max() > _tolerance(distance):
        problems.append(_uneven(along))
    every: list[DicomSlice | None] = [None] * (int(places[-1]) + 1)
    for place, one in zip(places, kept, strict=True):
        every[place] = one
    if len(kept) < len(every):
        problems.append(_gap(kept, places, along, float(distance)))
    if axes is not None:
        problems += [*_leaning(kept, along, axes, float(distance)), *_turning(kept, axes)]
    return Grid(tuple(every), float(distance), axes, axes is not None, tuple(problems))


def doubled_places(along: FloatArray) -> NDArray[np.bool_]:
    """Return for sorted places whether each is that of the one before."""
    if len(along) < 2 or np.ptp(along) == 0:
        return np.arange(len(along)) > 0
    return np.diff(along, prepend=-math.inf) < _SAME * _usual_step(along)


def _usual_step(along: FloatArray) -> float:
    steps = np.diff(along)
    return float(np.median(steps[steps > 1e-3 * steps.max()])) if len(steps) and steps.max() > 0 else 1.0


def _tolerance(step: float) -> float:
    return min(_SAME * step, max(_NOTICEABLE * step, _ROUNDING_MM))


def _doubled(ordered: Sequence[DicomSlice], same: NDArray[np.bool_]) -> list[Problem]:
    found = [one.name for one, doubled in zip(ordered, same, strict=True) if doubled]
    if not found:
        return []
    slices_lie = "1 slice lies" if len(found) == 1 else f"{len(found)} slices lie"
    text = f"{slices_lie} where another one lies: {names(found)}"
    remedy = "Remove one of each, or accept the first (--accept doubled)."
    return [Problem("doubled", text, remedy=remedy, resolved_by=("accept",))]


def _uneven(along: FloatArray) -> Problem:
    steps = np.diff(along)
    text = f"the slices lie unevenly: their distances run from {steps.min():.4g} to {steps.max():.4g} mm"
    remedy = "Choose another series, or accept their mean distance (--accept uneven)."
    return Problem("uneven", text, remedy=remedy, resolved_by=("accept",))


def _gap(kept: Sequence[DicomSlice], places: FloatArray, along: FloatArray, step: float) -> Problem:
    before = np.flatnonzero(np.diff(places) > 1)
    where = [
        f"between {kept[n].name} ({along[n]:.4g} mm) and {kept[n + 1].name} ({along[n + 1]:.4g} mm)"
        for n in before.tolist()
    ]
    n_missing = int(places[-1]) + 1 - len(kept)
    are = "is" if n_missing == 1 else "are"
    text = f"{n_missing} of its slices, {step:.4g} mm apart, {are} missing: {names(where, 3)}"
    remedy = "Find the missing files, or accept copies of the neighbouring slices (--accept gap)."
    return Problem("gap", text, remedy=remedy, resolved_by=("accept",))


def _leaning(kept: Sequence[DicomSlice], along: FloatArray, axes: FloatArray, step: float) -> list[Problem]:
    """Find a tilted gantry, and single slices that are shifted: sideways against each other."""
    positions = _positions(kept)
    if positions is None or len(kept) < 2:
        return []
    sideways = (positions - positions[0]) @ axes[:, :2]
    slope, start = np.polyfit(along - along[0], sideways, 1)
    drift = np.abs(slope * (along[-1] - along[0])).max()
    jumps = np.abs(sideways - start - np.outer(along - along[0], slope)).max()
    if max(drift, jumps) <= _tolerance(min(kept[0].pixel) if kept[0].pixel else step):
        return []
    text = f"the slices are shifted sideways by {max(drift, jumps):.3g} mm from the first to the last"
    if jumps > drift:
        text = f"slices are shifted sideways by up to {jumps:.3g} mm against each other"
    remedy = "Resample the scan to a rectangular grid first, or accept it unshifted (--accept tilted)."
    return [Problem("tilted", text, remedy=remedy, resolved_by=("accept",))]


def _turning(kept: Sequence[DicomSlice], axes: FloatArray) -> list[Problem]:
    """Find orientations that differ, or are rounded, by more than a part of a voxel at the slice's edge."""
    first = kept[0]
    if first.pixel is None:
        return []
    reach = max(n * size for n, size in zip(first.file.shape[::-1], first.pixel, strict=True))
    allowed = _NOTICEABLE * min(first.pixel)
    turned = max(kept, key=lambda one: _apart(one, axes))
    skewed = max(kept, key=lambda one: abs(one.skew))
    if _apart(turned, axes) * reach > allowed:
        text = f"ImageOrientationPatient differs between the slices, most in {turned.name}"
    elif abs(skewed.skew) * reach > allowed:
        angle = math.degrees(math.acos(skewed.skew))
        text = f"ImageOrientationPatient of {skewed.name} is rounded: its axes are {angle:.4g} deg apart"
    else:
        return []
    remedy = "Export it again with more digits, or accept the mean orientation (--accept orientation)."
    return [Problem("orientation", text, remedy=remedy, resolved_by=("accept",))]


def _apart(one: DicomSlice, axes: FloatArray) -> float:
    return 0.0 if one.axes is None else float(np.abs(one.axes - axes).max())


def _lacking(slices: Sequence[DicomSlice]) -> str:
    """Say that slices have no positions, or which."""
    lacking = [one.name for one in slices if one.position is None]
    if not 0 < len(lacking) < len(slices):
        return "the slices have no positions"
    return f"slices have no ImagePositionPatient, {names(lacking)}"


def _by_number(slices: Sequence[DicomSlice], axes: FloatArray | None) -> Grid:
    """Sort slices without places by number and name; the one position of a file is its first frame's."""
    ordered = sorted(slices, key=lambda one: (one.number, one.file.path.name, one.frame))
    first = ordered[0]
    distance, origin = first.file.between, first.file_position if first.file.n_frames > 1 else None
    text = f"{_lacking(slices)}: they are ordered by their instance numbers"
    if origin is not None and axes is not None:
        text = "its frames have one position, taken for the first: the others follow it along the normal"
    if distance is not None:
        text += f", and lie {distance:.4g} mm apart (SpacingBetweenSlices)"
    found = (warning("no-positions", text),)
    return Grid(tuple(ordered), distance, axes, placed=False, problems=found, origin=origin)
