"""Connected parts of a triangle mesh, and dropping the small ones."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["kept_triangles", "part_of_points"]

_IntArray = NDArray[np.int64]


@njit(nogil=True, cache=True)
def _find(parent: Any, i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(nogil=True, cache=True)
def _roots(triangles: Any, n_points: int) -> Any:
    """Union-find over the corners of each triangle; the root of a part is its smallest point number."""
    parent = np.arange(n_points)
    for t in range(triangles.shape[0]):
        for corner in (1, 2):
            a = _find(parent, triangles[t, 0])
            b = _find(parent, triangles[t, corner])
            if a < b:
                parent[b] = a
            else:
                parent[a] = b
    for i in range(n_points):
        parent[i] = _find(parent, i)
    return parent


@njit(nogil=True, cache=True)
def _extents(points: Any, part: Any, n_parts: int) -> Any:
    """Return the bounding box of each part as (P, 2, 3)."""
    box = np.empty((n_parts, 2, 3))
    box[:, 0] = np.inf
    box[:, 1] = -np.inf
    for i in range(points.shape[0]):
        for axis in range(3):
            value = points[i, axis]
            box[part[i], 0, axis] = min(value, box[part[i], 0, axis])
            box[part[i], 1, axis] = max(value, box[part[i], 1, axis])
    return box


def part_of_points(triangles: _IntArray, n_points: int) -> _IntArray:
    """Return, for each point, the number of the connected part it belongs to, from 0."""
    root: _IntArray = _roots(triangles, n_points)
    number = np.cumsum(root == np.arange(n_points)) - 1
    return number[root]


def kept_triangles(
    points: NDArray[np.floating[Any]], triangles: _IntArray, *, smallest_mm: float, largest: int | None = None
) -> NDArray[np.bool_]:
    """Say which triangles belong to a part that is kept.

    Parameters
    ----------
    points : (N, 3) float array, mm
        Corners.
    triangles : (T, 3) int array
        Rows of point numbers.
    smallest_mm : float
        Parts whose bounding box has a shorter diagonal are dropped.
    largest : int, optional
        Keep at most so many parts, those of the most triangles.

    Returns
    -------
    (T,) bool array
    """
    part = part_of_points(triangles, len(points))
    n_parts = int(part.max()) + 1 if len(part) else 0
    box = _extents(points, part, n_parts)
    kept = np.linalg.norm(box[:, 1] - box[:, 0], axis=1) >= smallest_mm
    part_of_triangle = part[triangles[:, 0]]
    if largest is not None:
        size = np.bincount(part_of_triangle, minlength=n_parts) * kept
        kept[np.argsort(-size, kind="stable")[largest:]] = False
    return np.asarray(kept[part_of_triangle])
