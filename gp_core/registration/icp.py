"""Iterative closest point: register unnamed points to other points, or to a surface."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import FrameError, GeometryError
from gp_core.frames import RigidTransform
from gp_core.registration.icp_targets import Cloud, Target, TriangleMesh
from gp_core.registration.procrustes import weighted_procrustes
from gp_core.validation import FloatArray, as_points

__all__ = ["Cloud", "IcpResult", "TriangleMesh", "icp"]

_FEWEST_POINTS = 3


@dataclass(frozen=True)
class IcpResult:
    """A rigid transform found by iterative closest point.

    Attributes
    ----------
    transform : RigidTransform
        ``T_dst_src``.
    distances : (N,) array
        From each moved source point to the nearest point of the target, mm.
    rms : float
        Their root mean square, mm.
    n_iterations : int
        Iterations that were run.
    converged : bool
        Whether the last iteration moved no point by more than the tolerance.
    """

    transform: RigidTransform
    distances: FloatArray
    rms: float
    n_iterations: int
    converged: bool


def icp(
    source: ArrayLike,
    target: Target,
    *,
    start: RigidTransform | None = None,
    dst: str,
    src: str,
    max_iterations: int = 500,
    tolerance: float = 1e-6,
) -> IcpResult:
    """Register points to a target without known correspondence.

    Parameters
    ----------
    source : (N, 3) array_like
        Points in frame `src`, mm; at least three, not collinear.
    target : Cloud or TriangleMesh
        In frame `dst`, mm.
    start : RigidTransform, optional
        ``T_dst_src`` to start from. By default the centroids and principal axes are superimposed in all 24
        proper ways, and the best result is returned: good for whole point sets, not for points on part of a
        surface.
    dst, src : str
        Frame names, destination first.
    max_iterations : int
        Maximum number of iterations from each start.
    tolerance : float
        Largest motion of a point, mm, at which the iteration counts as converged.

    Returns
    -------
    IcpResult
        The transform and its residuals.

    Raises
    ------
    GeometryError
        The points, or the points nearest to them, are collinear.
    FrameError
        `start` is between other frames.

    References
    ----------
    Besl and McKay, "A method for registration of 3-D shapes", IEEE TPAMI 14(2), 1992.
    https://doi.org/10.1109/34.121791

    Examples
    --------
    >>> corners = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1.0]])
    >>> found = icp(corners, Cloud(corners[::-1] + 5), dst="scan", src="tracker")
    >>> bool(found.rms < 1e-9)
    True
    """
    points = as_points(source, "source")
    if len(points) < _FEWEST_POINTS:
        raise GeometryError(f"ICP needs at least {_FEWEST_POINTS} points, got {len(points)}")
    if start is not None and (start.dst, start.src) != (dst, src):
        raise FrameError(f"T_{start.dst}_{start.src} cannot start a search for T_{dst}_{src}")
    starts = _starts(points, target.points, dst, src) if start is None else iter([start])
    results = [
        r for s in starts if (r := _icp_from(points, target, s, max_iterations, tolerance)) is not None
    ]
    if not results:
        raise GeometryError(
            "the points nearest to the source lie on one line, so the rotation about it is undetermined",
            remedy="Start nearer to the answer, or touch points farther apart.",
        )
    return min(results, key=lambda result: result.rms)


def _icp_from(
    points: FloatArray, target: Target, start: RigidTransform, max_iterations: int, tolerance: float
) -> IcpResult | None:
    """Iterate from one start; None where the nearest points determine no rotation."""
    transform, moved = start, start.apply(points)
    nearest = target.nearest(moved)
    converged = False
    for iteration in range(1, max_iterations + 1):  # noqa: B007  (its last value is part of the result)
        try:
            rotation, translation = weighted_procrustes(points, nearest)
        except GeometryError:
            return None
        transform = RigidTransform.from_parts(rotation, translation, dst=start.dst, src=start.src)
        previous, moved = moved, transform.apply(points)
        nearest = target.nearest(moved)
        converged = bool(np.abs(moved - previous).max() <= tolerance)
        if converged:
            break
    distances = np.linalg.norm(moved - nearest, axis=1)
    return IcpResult(transform, distances, float(np.sqrt(np.mean(distances**2))), iteration, converged)


def _starts(points: FloatArray, target: FloatArray, dst: str, src: str) -> Iterator[RigidTransform]:
    """Yield the 24 proper ways to superimpose the principal axes of two point sets, centroid on centroid."""
    centre, target_centre = points.mean(axis=0), target.mean(axis=0)
    axes, target_axes = _principal_axes(points - centre), _principal_axes(target - target_centre)
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        signed_permutation = np.zeros((3, 3))
        signed_permutation[range(3), order] = signs
        rotation = target_axes @ signed_permutation @ axes.T
        if np.linalg.det(rotation) > 0:
            yield RigidTransform.from_parts(rotation, target_centre - rotation @ centre, dst=dst, src=src)


def _principal_axes(centred: FloatArray) -> FloatArray:
    """Return the directions of largest, middle and smallest spread in columns."""
    _, vectors = np.linalg.eigh(centred.T @ centred)
    axes: FloatArray = vectors[:, ::-1]
    return axes
