"""One surface laid onto another: a similarity found by robust ICP in both directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray

__all__ = [
    "SCALES_OF_A_SPECIES",
    "BoneSurface",
    "Similarity",
    "angle_deg",
    "distance_score",
    "fit_similarity",
    "fit_surface",
]

SCALES_OF_A_SPECIES = (0.75, 1.33)
"""Of one head over another of its species."""

_FEWEST_INSIDE = 50


class BoneSurface(Protocol):
    """A surface as points."""

    @property
    def points(self) -> FloatArray:
        """(N, 3) mm."""
        ...

    @property
    def tree(self) -> Any:
        """A ``scipy.spatial.cKDTree`` of the points."""
        ...

    def inside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which points (N, 3), mm, lie where the surface would have been seen."""
        ...


@dataclass(frozen=True, eq=False)
class Similarity:
    """A turn, one scale and a shift: ``p = scale * rotation @ q + shift``.

    Parameters
    ----------
    scale : float
    rotation : (3, 3) array
        det +1.
    shift : (3,) array, mm
    """

    scale: float
    rotation: FloatArray
    shift: FloatArray

    def forth(self, points: FloatArray) -> FloatArray:
        """Return points (N, 3) moved."""
        moved: FloatArray = self.scale * points @ self.rotation.T + self.shift
        return moved

    def back(self, points: FloatArray) -> FloatArray:
        """Return points (N, 3) moved by the inverse."""
        moved: FloatArray = (points - self.shift) @ self.rotation / self.scale
        return moved

    def after(self, first: Similarity) -> Similarity:
        """Return the similarity that does `first`, then this one."""
        shift = self.forth(first.shift[None])[0]
        return Similarity(self.scale * first.scale, self.rotation @ first.rotation, shift)


def angle_deg(first: FloatArray, second: FloatArray) -> float:
    """Return the angle between two rotations (3, 3), degrees."""
    cosine = (float(np.trace(first.T @ second)) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def fit_similarity(
    a: FloatArray, b: FloatArray, weights: FloatArray, scales: tuple[float, float]
) -> Similarity:
    """Return the weighted least-squares similarity from points a to points b (N, 3).

    Parameters
    ----------
    a, b : (N, 3) array
        Corresponding points, mm.
    weights : (N,) array
        They add up to 1.
    scales : (float, float)
        Least and greatest scale.
    """
    ca, cb = weights @ a, weights @ b
    u, s, vt = np.linalg.svd(((a - ca) * weights[:, None]).T @ (b - cb))
    signs = np.array([1.0, 1.0, np.linalg.det(vt.T @ u.T)])
    rotation = vt.T @ np.diag(signs) @ u.T
    spread = float(weights @ ((a - ca) ** 2).sum(axis=1))
    scale = float(np.clip((s * signs).sum() / spread, *scales))
    return Similarity(scale, rotation, cb - scale * rotation @ ca)


def fit_surface(
    target: BoneSurface,
    source: BoneSurface,
    start: Similarity,
    *,
    widths: tuple[float, float],
    steps: int,
    scales: tuple[float, float],
    every: int = 1,
) -> Similarity:
    """Return the similarity that lays one surface onto another, near a first one.

    ICP in both directions with weights that fall with distance. A point that lies where the other surface
    would not have been seen does not count.

    Parameters
    ----------
    target, source : BoneSurface
    start : Similarity
        From the source to the target.
    widths : (float, float)
        Distance, mm, at which a pair of points counts a quarter: in the first and the last step.
    steps : int
    scales : (float, float)
        Least and greatest scale.
    every : int
        Use every n-th point only.
    """
    own, other = source.points[::every], target.points[::every]
    fit = start
    for width in np.geomspace(*widths, steps):
        there, back = fit.forth(own), fit.back(other)
        d, j = target.tree.query(there)
        e, k = source.tree.query(back)
        weights = np.concatenate(
            [
                target.inside(there) / (1 + (d / width) ** 2) ** 2,
                source.inside(back) / (1 + (fit.scale * e / width) ** 2) ** 2,
            ]
        )
        if not weights.sum() > 0:
            break
        weights /= weights.sum()
        a = np.concatenate([own, source.points[k]])
        b = np.concatenate([target.points[j], other])
        fit = fit_similarity(a, b, weights, scales)
    return fit


def distance_score(
    target: BoneSurface, source: BoneSurface, fit: Similarity, clip: float, *, every: int = 1
) -> float:
    """Return the mean clipped distance between two surfaces: 0 where they meet, 1 where nothing does.

    Parameters
    ----------
    target, source : BoneSurface
    fit : Similarity
        From the source to the target.
    clip : float
        Greatest distance that counts, mm.
    every : int
        Use every n-th point only.
    """
    there = fit.forth(source.points[::every])
    d = np.minimum(target.tree.query(there, distance_upper_bound=clip)[0], clip)
    back = fit.back(target.points[::every])
    e = np.minimum(source.tree.query(back, distance_upper_bound=clip / fit.scale)[0] * fit.scale, clip)
    shares = [_mean_inside(d, target.inside(there), clip), _mean_inside(e, source.inside(back), clip)]
    return sum(shares) / (2 * clip)


def _mean_inside(distances: FloatArray, inside: NDArray[np.bool_], clip: float) -> float:
    return float(distances[inside].mean()) if inside.sum() > _FEWEST_INSIDE else clip
