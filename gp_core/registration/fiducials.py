"""Register a tracker to a scan by named points, with rejection of outliers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gp_core.argument_types import checks_arguments
from gp_core.errors import GeometryError, GpError
from gp_core.landmarks.features import feature
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.procrustes import RigidFit, fit_rigid, rms_without_each
from gp_core.registration.result import RegistrationResult
from gp_core.validation import FloatArray, as_points

__all__ = ["points_by_name", "register_fiducials"]

_FEWEST = 3
_FEWEST_TO_REJECT = 6
_OUTLIER_RMS_RATIO = 0.5
"""A point is an outlier if leaving it out halves the RMS. False-positive rate 0.3 % with 8 points."""

_EXACT_MM = 1e-6
_LARGEST_SCALE = (
    2.5  # between the distances of the same points: touches are off by millimetres, units by tens
)


@checks_arguments
def register_fiducials(
    touches: Mapping[str, ArrayLike],
    scan: Mapping[str, ArrayLike],
    *,
    dst: str = "scan",
    src: str = "tracker",
) -> RegistrationResult:
    """Register points by the names they have in common; outliers are left out.

    Parameters
    ----------
    touches, scan : mapping of str to (3,) array_like
        Named points in the tracker and in the scan, mm. Names in one of them only do not count.
    dst, src : str
        Frames of `scan` and of `touches`.

    Returns
    -------
    RegistrationResult
        The transform, its residuals, and which points were left out.

    Raises
    ------
    GeometryError
        Fewer than three names in common, points on one line, or distances between the points that differ
        in the two frames as if one were not in mm.
    GpError
        A position is not three finite numbers.

    Examples
    --------
    >>> corners = {"A": [0, 0, 0], "B": [9, 0, 0], "C": [0, 7, 0], "D": [0, 0, 5]}
    >>> found = register_fiducials(corners, {name: np.add(p, 1.0) for name, p in corners.items()})
    >>> found.T_scan_tracker.translation.round(9)
    array([1., 1., 1.])
    """
    names = _shared_names(touches, scan, dst=dst, src=src)
    pairs = _Pairs(names, _rows(touches, names, src), _rows(scan, names, dst), dst, src)
    _check_scale(pairs)
    suspects = _suspects(pairs)
    kept = [i for i in range(len(names)) if i not in suspects]
    fit = pairs.fit(kept)
    lengths = np.linalg.norm(fit.transform.apply(pairs.touched) - pairs.targets, axis=1)
    return RegistrationResult(
        T_scan_tracker=fit.transform,
        names=names,
        residuals_mm=dict(zip(names, lengths.tolist(), strict=True)),
        fre_mm=fit.rms,
        suspects=tuple(names[i] for i in suspects),
        fiducials=pairs.targets[kept],
    )


def points_by_name(landmarks: LandmarkSet) -> dict[str, FloatArray]:
    """Return every placed point of a set by its name, features and others; without CO, which is computed.

    Parameters
    ----------
    landmarks : LandmarkSet
        Landmarks of one side, mm.

    Returns
    -------
    dict of str to (3,) array, mm
        In the frame of the set.
    """
    placed = landmarks.as_mapping(code for code in landmarks.placed if not feature(code).computed)
    return {**placed, **landmarks.extra}


@dataclass(frozen=True)
class _Pairs:
    """Points by the same names in two frames."""

    names: tuple[str, ...]
    touched: FloatArray
    targets: FloatArray
    dst: str
    src: str

    def fit(self, kept: Sequence[int]) -> RigidFit:
        names = [self.names[i] for i in kept]
        return fit_rigid(self.touched[kept], self.targets[kept], names=names, dst=self.dst, src=self.src)


def _check_scale(pairs: _Pairs) -> None:
    """Raise `GeometryError` where most distances between the points differ by far in the two frames."""
    touched, targets = _distances(pairs.touched), _distances(pairs.targets)
    apart = (touched > _EXACT_MM) & (targets > _EXACT_MM)
    scale = float(np.median(targets[apart] / touched[apart])) if apart.any() else 1.0
    if not 1 / _LARGEST_SCALE < scale < _LARGEST_SCALE:
        larger, smaller = (pairs.dst, pairs.src) if scale > 1 else (pairs.src, pairs.dst)
        raise GeometryError(
            f"the points of the {larger} are {max(scale, 1 / scale):.4g} times as far apart as those of the "
            f"{smaller}",
            remedy="Both must be in mm: check their units, and the names of the points.",
        )


def _distances(points: FloatArray) -> FloatArray:
    """Return the distance of every pair of points."""
    first, second = np.triu_indices(len(points), k=1)
    distances: FloatArray = np.linalg.norm(points[first] - points[second], axis=1)
    return distances


def _suspects(pairs: _Pairs) -> list[int]:
    """Return the points without which the others fit much better, the worst first."""
    kept = list(range(len(pairs.names)))
    found: list[int] = []
    rms = pairs.fit(kept).rms
    while len(kept) >= _FEWEST_TO_REJECT and rms > _EXACT_MM:
        without = rms_without_each(pairs.touched[kept], pairs.targets[kept])
        best = int(without.argmin())
        if without[best] > _OUTLIER_RMS_RATIO * rms:
            break
        found.append(kept.pop(best))
        rms = without[best]
    return found


def _shared_names(
    touches: Mapping[str, ArrayLike], scan: Mapping[str, ArrayLike], *, dst: str, src: str
) -> tuple[str, ...]:
    names = tuple(name for name in touches if name in scan)
    if len(names) < _FEWEST:
        raise GeometryError(
            f"a registration needs at least {_FEWEST} points by the same names, got {len(names)} "
            f"({src}: {_listed(touches)}; {dst}: {_listed(scan)})",
            remedy="Name them alike in both, or add points.",
        )
    return names


def _listed(points: Mapping[str, ArrayLike]) -> str:
    names = list(points)
    return (" ".join(names[:20]) or "none") + (" ..." if len(names) > 20 else "")


def _rows(points: Mapping[str, ArrayLike], names: Sequence[str], frame: str) -> FloatArray:
    rows = np.empty((len(names), 3))
    for row, name in enumerate(names):
        try:
            rows[row] = as_points(np.asarray(points[name])[None], "position")
        except (GpError, TypeError, ValueError, OverflowError):
            raise GpError(
                f"position in the {frame} frame must be three finite numbers in mm, got {points[name]!r}",
                landmark=name,
                remedy="Leave the point out if it was not seen.",
            ) from None
    return rows
