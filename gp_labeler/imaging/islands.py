"""Connected parts of a triangle mesh, and dropping the small ones: compiled passes over its arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["compact", "kept_points", "subset"]

_Numbers = NDArray[np.integer[Any]]


@njit(nogil=True, cache=True)
def _find(parent: Any, i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(nogil=True, cache=True)
def _parts(triangles: Any, part: Any) -> int:
    """Write the number of its part for each point, and return how many parts there are.

    Union-find over the corners of each triangle; the root of a part is its smallest point number, so that one
    pass upwards leads from roots to numbers.
    """
    for i in range(len(part)):
        part[i] = i
    for t in range(len(triangles)):
        a = _find(part, triangles[t, 0])
        for corner in (1, 2):
            b = _find(part, triangles[t, corner])
            if a < b:
                part[b] = a
            elif b < a:
                part[a] = b
                a = b
    n_parts = 0
    for i in range(len(part)):
        if part[i] == i:
            part[i] = n_parts
            n_parts += 1
        else:
            part[i] = part[part[i]]
    return n_parts


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


@njit(nogil=True, cache=True)
def _n_triangles(triangles: Any, part: Any, n_parts: int) -> Any:
    """Return how many triangles each part has."""
    count = np.zeros(n_parts, np.int64)
    for t in range(len(triangles)):
        count[part[triangles[t, 0]]] += 1
    return count


@njit(nogil=True, cache=True)
def _move(points: Any, normals: Any, triangles: Any, kept: Any, number: Any, out: Any) -> tuple[int, int]:
    """Copy the kept points, normals and triangles to the beginning of others, or of the same arrays.

    Rows only move towards the beginning, so what is still to be read is never written over.
    """
    out_points, out_normals, out_triangles = out
    n_points = 0
    for i in range(len(points)):
        if kept[i]:
            number[i] = n_points
            out_points[n_points] = points[i]
            if len(normals):
                out_normals[n_points] = normals[i]
            n_points += 1
    n_triangles = 0
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if kept[a] and kept[b] and kept[c]:
            out_triangles[n_triangles, 0] = number[a]
            out_triangles[n_triangles, 1] = number[b]
            out_triangles[n_triangles, 2] = number[c]
            n_triangles += 1
    return n_points, n_triangles


@njit(nogil=True, cache=True)
def _take(triangles: Any, chosen: Any, used: Any, number: Any) -> tuple[Any, int]:
    """Return the chosen triangles with the numbers that their points get, and how many points they use."""
    n_triangles = 0
    for t in range(len(triangles)):
        if chosen[t]:
            n_triangles += 1
            for corner in range(3):
                used[triangles[t, corner]] = True
    n_points = 0
    for i in range(len(used)):
        number[i] = n_points
        n_points += used[i]
    taken = np.empty((n_triangles, 3), np.int64)
    n_triangles = 0
    for t in range(len(triangles)):
        if chosen[t]:
            for corner in range(3):
                taken[n_triangles, corner] = number[triangles[t, corner]]
            n_triangles += 1
    return taken, n_points


def kept_points(
    points: NDArray[np.floating[Any]],
    triangles: _Numbers,
    *,
    smallest_mm: float,
    largest: int | None = None,
) -> NDArray[np.bool_]:
    """Say which points belong to a part that is kept.

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
    (N,) bool array
    """
    part = np.empty(len(points), np.int32)
    n_parts = _parts(triangles, part)
    box = _extents(points, part, n_parts)
    kept = np.linalg.norm(box[:, 1] - box[:, 0], axis=1) >= smallest_mm
    if largest is not None:
        size = _n_triangles(triangles, part, n_parts) * kept
        kept[np.argsort(-size, kind="stable")[largest:]] = False
    return np.asarray(kept[part])


def compact(
    points: NDArray[Any], normals: NDArray[Any], triangles: _Numbers, kept: NDArray[np.bool_]
) -> tuple[int, int]:
    """Move the kept points, and the triangles between them, to the beginning of their arrays, in place.

    Parameters
    ----------
    points, normals : (N, 3) arrays
        Changed; `normals` may be empty.
    triangles : (T, 3) int array
        Changed.
    kept : (N,) bool array
        Which points.

    Returns
    -------
    int, int
        How many points and triangles there are now; the rows after them mean nothing.
    """
    number = np.empty(len(points), np.int32)
    return _move(points, normals, triangles, kept, number, (points, normals, triangles))


def subset(
    points: NDArray[Any], normals: NDArray[Any], triangles: _Numbers, chosen: NDArray[np.bool_]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.int64]]:
    """Return the points, normals and triangles of some triangles, (T,) bool; `normals` may be empty."""
    used, number = np.zeros(len(points), np.bool_), np.empty(len(points), np.int32)
    taken, n_points = _take(triangles, chosen, used, number)
    of_points = np.empty((n_points, 3), points.dtype)
    of_normals = np.empty((n_points if len(normals) else 0, 3), normals.dtype)
    _move(points, normals, taken[:0], used, number, (of_points, of_normals, taken[:0]))
    return of_points, of_normals, taken
