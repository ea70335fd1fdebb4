"""The rigid transform between two lists of corresponding points (weighted Procrustes)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.errors import GeometryError, GpError
from gp_core.frames import RigidTransform
from gp_core.validation import FloatArray, as_points

__all__ = [
    "RigidFit",
    "align",
    "certainly_not_collinear",
    "fit_rigid",
    "rms_without_each",
    "weighted_procrustes",
]

COLLINEAR = 1e-3
"""Width over length below which points count as one line: 1 µm a mm, finer than any touch or voxel."""

_AMBIGUOUS = 1e-9


@dataclass(frozen=True)
class RigidFit:
    """A rigid transform fitted to corresponding points.

    Parameters
    ----------
    transform : RigidTransform
        ``T_dst_src``.
    residuals : (N,) array
        Distance between each moved source point and its target, mm.
    rms : float
        Fiducial registration error: root of the (weighted) mean squared residual, mm.
    """

    transform: RigidTransform
    residuals: FloatArray
    rms: float


def fit_rigid(
    source: ArrayLike,
    target: ArrayLike,
    *,
    weights: ArrayLike | None = None,
    dst: str,
    src: str,
    names: Sequence[str] | None = None,
) -> RigidFit:
    """Fit ``T_dst_src`` to corresponding points.

    Parameters
    ----------
    source, target : (N, 3) array_like
        Corresponding points in frame `src` and frame `dst`, mm.
    weights : (N,) array_like, optional
        Not negative; equal by default.
    dst, src : str
        Frame names, destination first.
    names : sequence of str, optional
        Names of the points, for messages.

    Returns
    -------
    RigidFit
        The transform and its residuals.

    Raises
    ------
    GeometryError
        The points do not determine a rotation; see `weighted_procrustes`.
    GpError
        Shapes, values or weights are wrong.

    Examples
    --------
    >>> corners = np.eye(3)
    >>> fit_rigid(corners, corners + 1.0, dst="scan", src="tracker").transform.translation
    array([1., 1., 1.])
    """
    rotation, translation = weighted_procrustes(source, target, weights, names=names)
    transform = RigidTransform.from_parts(rotation, translation, dst=dst, src=src)
    residuals = np.linalg.norm(transform.apply(source) - as_points(target, "target"), axis=1)
    rms = float(np.sqrt(np.average(residuals**2, weights=_as_weights(weights, len(residuals)))))
    return RigidFit(transform, residuals, rms)


def weighted_procrustes(
    source: ArrayLike,
    target: ArrayLike,
    weights: ArrayLike | None = None,
    *,
    names: Sequence[str] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the rotation and translation with ``target ~ rotation @ source + translation``.

    Parameters
    ----------
    source, target : (N, 3) array_like
        Corresponding points, mm.
    weights : (N,) array_like, optional
        Not negative; equal by default. Points of weight zero do not count.
    names : sequence of str, optional
        Names of the points, for messages.

    Returns
    -------
    rotation : (3, 3) array
        Proper rotation, det +1 always.
    translation : (3,) array
        Translation, mm.

    Raises
    ------
    GeometryError
        Fewer than three points count, they lie on one line (`COLLINEAR`), or every rotation about
        some axis fits equally well (the target is the source's mirror image).
    GpError
        Shapes, values or weights are wrong.

    References
    ----------
    Umeyama, "Least-squares estimation of transformation parameters between two point patterns",
    IEEE TPAMI 13(4), 1991. https://doi.org/10.1109/34.88573
    """
    points, targets = as_points(source, "source"), as_points(target, "target")
    if points.shape != targets.shape:
        raise GpError(f"source and target must hold as many points, got {len(points)} and {len(targets)}")
    shares = _as_weights(weights, len(points))
    _check_rank(points, targets, shares, _as_names(names, len(points)))
    return align(points, targets, shares)


def align(points: FloatArray, targets: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Do what `weighted_procrustes` does, for points already known to be finite and not collinear.

    Parameters
    ----------
    points, targets : (N, 3) array
        Corresponding points, mm.
    weights : (N,) array
        Not negative, not all zero.

    Returns
    -------
    rotation : (3, 3) array
        Proper rotation, det +1.
    translation : (3,) array
        Translation, mm.

    Raises
    ------
    GeometryError
        Many rotations fit equally well.
    """
    shares = weights / weights.sum()
    source_centre, target_centre = shares @ points, shares @ targets
    covariance = (targets - target_centre).T @ (shares[:, None] * (points - source_centre))
    rotation = _nearest_rotation(covariance)
    return rotation, target_centre - rotation @ source_centre


def rms_without_each(points: FloatArray, targets: FloatArray) -> FloatArray:
    """Return the registration error of all pairs but one, each left out in turn.

    Parameters
    ----------
    points, targets : (N, 3) array
        Corresponding points, known to be finite, mm.

    Returns
    -------
    (N,) array, mm
        Infinite where the other pairs determine no rotation.
    """
    n = len(points)
    others = np.nonzero(~np.eye(n, dtype=bool))[1].reshape(n, n - 1)
    moving, fixed = (cloud[others] - cloud[others].mean(axis=1, keepdims=True) for cloud in (points, targets))
    left, spread, right = np.linalg.svd(fixed.transpose(0, 2, 1) @ moving)
    sign = np.where(np.linalg.det(left @ right) > 0, 1.0, -1.0)
    is_ambiguous = spread[:, 1] + sign * spread[:, 2] <= _AMBIGUOUS * spread[:, 0]
    for centred, cloud in ((moving, points), (fixed, targets)):
        is_ambiguous |= _are_collinear(centred, float(np.abs(cloud).max()))
    left[:, :, 2] *= sign[:, None]
    off = moving @ (left @ right).transpose(0, 2, 1) - fixed
    rms: FloatArray = np.sqrt((off**2).sum(axis=(1, 2)) / (n - 1))
    rms[is_ambiguous] = np.inf
    return rms


def _nearest_rotation(covariance: FloatArray) -> FloatArray:
    left, spread, right = np.linalg.svd(covariance)
    sign = 1.0 if np.linalg.det(left @ right) > 0 else -1.0
    if spread[1] + sign * spread[2] <= _AMBIGUOUS * spread[0]:
        raise GeometryError(
            "source and target do not determine a rotation: many fit equally well",
            remedy="Check that the points correspond and that neither list is a mirror image of the other.",
        )
    left[:, 2] *= sign
    rotation: FloatArray = left @ right
    return rotation


def _check_rank(points: FloatArray, targets: FloatArray, weights: FloatArray, names: tuple[str, ...]) -> None:
    counts = np.flatnonzero(weights > 0)
    which = ", ".join(names[i] for i in counts[:12]) + (", ..." if len(counts) > 12 else "")
    if len(counts) < 3:
        raise GeometryError(
            f"a rigid fit needs at least three points, got {len(counts)}" + (f": {which}" if which else ""),
            remedy="Add points that do not lie on one line.",
        )
    for label, cloud in (("source", points), ("target", targets)):
        if _is_collinear(cloud[counts], weights[counts]):
            raise GeometryError(
                f"the {label} points lie on one line, so the rotation about it is undetermined: {which}",
                remedy="Add a point away from that line.",
            )


def _is_collinear(points: FloatArray, weights: FloatArray) -> bool:
    centred = points - weights @ points / weights.sum()
    rounded = float(np.sqrt(weights.mean())) * float(np.abs(points).max())
    return bool(_are_collinear((np.sqrt(weights)[:, None] * centred)[None], rounded)[0])


def _are_collinear(centred: FloatArray, largest: float) -> NDArray[np.bool_]:
    """Return which of M centred point sets (M, N, 3) are collinear.

    No original coordinate exceeds `largest`.
    """
    length, width, _ = np.linalg.svd(centred, compute_uv=False).T
    # Coincident points leave only rounding, as wide as long: compare with the coordinates as well.
    rounding = 1e-13 * float(np.sqrt(centred.shape[1])) * largest
    lines: NDArray[np.bool_] = width <= np.maximum(COLLINEAR * length, rounding)
    return lines


def certainly_not_collinear(points: FloatArray) -> bool:
    """Return whether points surely span a plane: cheap, and False where only a closer look could tell.

    With the squared lengths of the three principal axes as a, b, c, it compares ab + ac + bc to the square of
    their sum: on a line b and c are 0, and up to `COLLINEAR` not above its square.

    Parameters
    ----------
    points : (N, 3) array
        Points, mm.

    Returns
    -------
    bool
        True only if the points are not collinear.
    """
    if len(points) < 3:
        return False
    centred = points - points.mean(axis=0)
    moments = centred.T @ centred
    total = float(moments[0, 0] + moments[1, 1] + moments[2, 2])
    pairs = (total * total - float((moments * moments).sum())) / 2
    largest = float(np.abs(points).max())
    rounding = 1e-12 * largest * largest
    return pairs > 10 * COLLINEAR**2 * total**2 and total > rounding


def _as_weights(weights: ArrayLike | None, n: int) -> FloatArray:
    if weights is None:
        return np.ones(n)
    try:
        values = np.asarray(weights, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise GpError("weights must be numbers") from None
    if values.shape != (n,):
        raise GpError(f"weights must have the shape ({n},), got {values.shape}")
    if not np.isfinite(values).all() or (values < 0).any():
        raise GpError("weights must be finite and not negative")
    return values


def _as_names(names: Sequence[str] | None, n: int) -> tuple[str, ...]:
    if names is None:
        return tuple(f"row {i}" for i in range(n))
    if len(names) != n:
        raise GpError(f"names must hold {n} names, got {len(names)}")
    return tuple(names)
