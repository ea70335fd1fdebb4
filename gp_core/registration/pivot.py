"""Pivot calibration: the tip of a probe, from the poses of its marker while the tip rests in one place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.argument_types import checks_arguments
from gp_core.errors import GeometryError, GpError
from gp_core.validation import FloatArray, freeze_arrays

__all__ = ["PivotCalibration", "calibrate_pivot"]

_FEWEST = 10
_LEAST_SPREAD_DEG = 5.0
_MOST_LEFT_OUT = 0.5
_OUTLYING = 5.0
"""Distance over its scale from which a frame is an outlier; good frames exceed it once in 70 000."""

_MAXWELL_MEDIAN = 1.5382  # of the length of a Gaussian vector of scale one
_EXACT_MM = 1e-6
_NOT_RIGID = 1e-2
_SHORTEST_PROBE_MM = 3.0
_LONGEST_PROBE_MM = 500.0
_NO_TRACKER_MM = 5.0
_LARGE_RMS_MM = 1.0
_LARGEST_RMS_MM = 5.0
_KEEP_STILL = (
    "Keep the tip in its dimple while turning the probe, and check that the poses are rigid 4x4 matrices, "
    "marker to tracker, mm."
)
_FARTHEST_MM = 1e5
_N_REWEIGHTED = 40
_N_ROUNDS = 5


@dataclass(frozen=True)
class PivotCalibration:
    """The tip of a probe in the frame of its marker.

    Attributes
    ----------
    tip_offset : (3,) array
        The tip in the marker's frame, mm.
    pivot : (3,) array
        The fixed point that the tip rested in, in the tracker's frame, mm.
    rms_mm : float
        Root mean square distance of the tip from the pivot, over the frames used.
    covariance : (3, 3) array
        Of the tip offset, mm^2, if the errors of the frames are independent and isotropic.
    spread_deg : float
        Rotation of the marker about its mean orientation, root mean square, in the direction that moved
        least.
    n_frames : int
        Number of frames given.
    left_out : tuple of int
        Frames that contradict the others, or that are no rigid transform.
    unseen : tuple of int
        Frames with numbers that are not finite: the marker was not visible.
    """

    tip_offset: FloatArray
    pivot: FloatArray
    rms_mm: float
    covariance: FloatArray
    spread_deg: float
    n_frames: int
    left_out: tuple[int, ...]
    unseen: tuple[int, ...]

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def standard_error_mm(self) -> float:
        """Standard error of the tip offset as a length, mm."""
        return float(np.sqrt(np.trace(self.covariance)))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before using the tip."""
        found = []
        if self.left_out:
            found.append(f"{len(self.left_out)} of {self.n_frames} frames do not fit the others: left out")
        if self.rms_mm > _LARGE_RMS_MM:
            found.append(f"the tip moved by {self.rms_mm:.1f} mm rms: it may have slipped")
        length = float(np.linalg.norm(self.tip_offset))
        if length < _SHORTEST_PROBE_MM:
            found.append(f"the tip lies only {length:.2g} mm from its marker: check that the poses are in mm")
        return tuple(found)

    def as_dict(self) -> dict[str, Any]:
        """Return the calibration as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return {
            "gpPivot": 1,
            "tip_offset_mm": self.tip_offset.tolist(),
            "pivot_mm": self.pivot.tolist(),
            "rms_mm": self.rms_mm,
            "standard_error_mm": self.standard_error_mm,
            "covariance_mm2": self.covariance.tolist(),
            "spread_deg": self.spread_deg,
            "n_frames": self.n_frames,
            "left_out": list(self.left_out),
            "unseen": list(self.unseen),
            "warnings": list(self.warnings),
        }


@checks_arguments
def calibrate_pivot(T_tracker_marker: ArrayLike) -> PivotCalibration:
    """Find the tip of a probe that was rotated about its resting tip.

    In every frame, R_i tip + t_i = pivot; linear least squares solves for both at once (the "algebraic one
    step" method of the reference). Bad frames are first down-weighted, then excluded and listed.

    Parameters
    ----------
    T_tracker_marker : (N, 4, 4) array_like
        Poses of the marker in the tracker's frame, mm; ten or more. Frames of NaN: the marker was not
        visible.

    Returns
    -------
    PivotCalibration
        Tip and pivot with their errors.

    Raises
    ------
    GpError
        Not such an array.
    GeometryError
        Too few frames, too little rotation or about one axis only, or more bad frames than good ones.

    References
    ----------
    Yaniv, "Which pivot calibration?", Proc. SPIE 9415, 2015. https://doi.org/10.1117/12.2081348

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> turns = np.linalg.qr(rng.normal(size=(50, 3, 3)))[0]
    >>> turns *= np.linalg.det(turns)[:, None, None]
    >>> poses = np.tile(np.eye(4), (50, 1, 1))
    >>> poses[:, :3, :3], poses[:, :3, 3] = turns, [10, 20, 30] - turns @ [0, 0, 150]
    >>> bool(np.allclose(calibrate_pivot(poses).tip_offset, [0, 0, 150]))
    True
    """
    poses = _as_poses(T_tracker_marker)
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
    sound = seen & _is_rigid(poses)
    _check_frames(poses, sound, seen)
    kept, residuals = sound, _reweighted_residuals(poses, sound)
    for _ in range(_N_ROUNDS):
        scale = max(float(np.median(residuals[kept])) / _MAXWELL_MEDIAN, _EXACT_MM)
        fitting = sound & (residuals <= _OUTLYING * scale)
        _check_frames(poses, fitting, seen)
        tip, pivot, residuals = _solve(poses, fitting.astype(np.float64))
        if np.array_equal(fitting, kept):
            break
        kept = fitting
    rms = float(np.sqrt(np.mean(residuals[kept] ** 2)))
    if rms > _LARGEST_RMS_MM:
        raise GeometryError(
            f"the tip was not at rest, or the poses are not in mm: it moved by {rms:.3g} mm rms",
            remedy=_KEEP_STILL,
        )
    _check_plausible(poses[kept], tip, pivot)
    rotations = poses[kept, :3, :3]
    return PivotCalibration(
        tip_offset=tip,
        pivot=pivot,
        rms_mm=rms,
        covariance=_tip_covariance(rotations, rms),
        spread_deg=_spread_deg(rotations),
        n_frames=len(poses),
        left_out=tuple(np.flatnonzero(seen & ~kept).tolist()),
        unseen=tuple(np.flatnonzero(~seen).tolist()),
    )


def _check_plausible(poses: FloatArray, tip: FloatArray, pivot: FloatArray) -> None:
    """Reject poses in metres, and poses of the tracker in the marker's frame.

    The latter fit equally well, with tip and pivot exchanged; only the lengths reveal them.
    """
    if np.abs(poses[:, :3, 3]).max() < _NO_TRACKER_MM:
        raise GeometryError(
            f"the poses seem to be in metres: the marker stays within {_NO_TRACKER_MM:g} mm of its tracker",
            remedy="Give them in mm.",
        )
    length, distance = (float(np.linalg.norm(vector)) for vector in (tip, pivot))
    if length > _LONGEST_PROBE_MM and distance < _LONGEST_PROBE_MM:
        raise GeometryError(
            f"the tip would lie {length:.0f} mm from its marker, and {distance:.0f} mm from the tracker: "
            "the poses seem to be those of the tracker in the marker's frame",
            remedy="Give marker to tracker: invert each matrix.",
        )


def _tip_covariance(rotations: FloatArray, rms: float) -> FloatArray:
    """Return the covariance of the least-squares tip, with 3 n - 6 degrees of freedom."""
    n, mean = len(rotations), rotations.mean(axis=0)
    information = np.einsum("nij,nik->jk", rotations, rotations) - n * mean.T @ mean
    covariance: FloatArray = n * rms**2 / (3 * n - 6) * np.linalg.inv(information)
    return covariance


def _as_poses(value: ArrayLike) -> FloatArray:
    try:
        poses = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise GpError("marker poses must be numbers in (N, 4, 4)") from None
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise GpError(f"marker poses must have the shape (N, 4, 4), got {poses.shape}")
    return poses


def _is_rigid(poses: FloatArray) -> NDArray[np.bool_]:
    """Return (N,): which matrices are rigid transforms, up to the rounding of trackers."""
    with np.errstate(invalid="ignore", over="ignore"):
        rotations = poses[:, :3, :3]
        off = np.abs(rotations.transpose(0, 2, 1) @ rotations - np.eye(3)).max(axis=(1, 2))
        proper = np.linalg.det(np.nan_to_num(rotations)) > 0
        last = np.abs(poses[:, 3] - [0, 0, 0, 1]).max(axis=1)
        near = np.abs(poses[:, :3, 3]).max(axis=1) < _FARTHEST_MM
        rigid: NDArray[np.bool_] = (off < _NOT_RIGID) & proper & (last < _NOT_RIGID) & near
    return rigid


def _check_frames(poses: FloatArray, kept: NDArray[np.bool_], seen: NDArray[np.bool_]) -> None:
    n_kept, n_seen = int(kept.sum()), int(seen.sum())
    if n_seen >= _FEWEST and not _is_rigid(poses[seen]).any():
        raise GeometryError(
            f"none of the {n_seen} poses is a rigid motion",
            remedy="Export 4x4 matrices row by row, or quaternions under a header (qw,qx,qy,qz,tx,ty,tz).",
        )
    if n_seen < _FEWEST:
        raise GeometryError(
            f"a pivot calibration needs at least {_FEWEST} frames, got {n_seen}"
            f"{f', and {len(poses) - n_seen} without the marker' if n_seen < len(poses) else ''}",
            remedy="Record for some ten seconds while turning the probe.",
        )
    if n_kept < _FEWEST or n_kept < (1 - _MOST_LEFT_OUT) * n_seen:
        raise GeometryError(
            f"only {n_kept} of {n_seen} frames agree on where the tip is",
            remedy=_KEEP_STILL,
        )
    spread = _spread_deg(poses[kept, :3, :3])
    if spread < _LEAST_SPREAD_DEG:
        raise GeometryError(
            f"the marker turned too little, or about one axis only, to show its tip: {spread:.1f} degrees in "
            f"the direction that moved least, at least {_LEAST_SPREAD_DEG:g} needed",
            remedy="Tilt the probe by 30 degrees to all sides, its tip at rest.",
        )


def _spread_deg(rotations: FloatArray) -> float:
    """Return the rms rotation, about its mean, of the marker-fixed direction that rotates least."""
    mean = rotations.mean(axis=0)
    shortest = 1 - np.linalg.svd(mean, compute_uv=False)[0] ** 2
    return float(np.degrees(np.arcsin(np.sqrt(np.clip(shortest, 0, 1)))))


def _reweighted_residuals(poses: FloatArray, sound: NDArray[np.bool_]) -> FloatArray:
    """Return the distances from the solution with the smallest sum of distances: robust to bad frames."""
    weights = sound.astype(np.float64)
    for _ in range(_N_REWEIGHTED):
        _, _, residuals = _solve(poses, weights)
        floor = max(_EXACT_MM, 0.1 * float(np.median(residuals[sound])))
        weights = np.where(sound, 1 / np.maximum(residuals, floor), 0.0)
        weights /= weights.max()
    return residuals


def _solve(poses: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return tip, pivot, and the distance (N,) of the tip from the pivot; infinite where a weight is zero."""
    counts = weights > 0
    shares = weights[counts] / weights.sum()
    rotations, places = poses[counts, :3, :3], poses[counts, :3, 3]
    middle = shares @ places
    arms = places - middle
    mean = np.einsum("n,nij->ij", shares, rotations)
    information = np.einsum("n,nij,nik->jk", shares, rotations, rotations) - mean.T @ mean
    pull = -np.einsum("n,nij,ni->j", shares, rotations, arms)
    tip = np.linalg.solve(information, pull)
    residuals = np.full(len(poses), np.inf)
    residuals[counts] = np.linalg.norm(rotations @ tip + arms - mean @ tip, axis=1)
    return tip, mean @ tip + middle, residuals
