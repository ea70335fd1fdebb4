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
    pass upwards leads from roots to numbers. Most triangles join nothing new, which three numbers tell.
    """
    for i in range(len(part)):
        part[i] = i
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        a, b, c = part[i], part[j], part[k]
        if a == b and b == c:
            continue
        a, b, c = _find(part, a), _find(part, b), _find(part, c)
        root = min(a, b, c)
        part[a] = part[b] = part[c] = root
        part[i] = part[j] = part[k] = root
    n_parts = 0
    for i in range(len(part)):
        if part[i] == i:
            part[i] = n_parts
            n_parts += 1
        else:
            part[i] = part[part[i]]
    return n_parts


@njit(nogil=True, cache=True)
def _reach(points: Any, part: Any, n_parts: int, length: float) -> Any:
    """Return which parts have a bounding box with a diagonal of `length` or more."""
    box = np.empty((n_parts, 2, 3))
    box[:, 0] = np.inf
    box[:, 1] = -np.inf
    reaches = np.zeros(n_parts, np.bool_)
    for i in range(len(points)):
        p = part[i]
        if reaches[p]:  # the rest of it need not be looked at
            continue
        squared = 0.0
        for axis in range(3):
            value = points[i, axis]
            box[p, 0, axis] = min(value, box[p, 0, axis])
            box[p, 1, axis] = max(value, box[p, 1, axis])
            squared += (box[p, 1, axis] - box[p, 0, axis]) ** 2
        reaches[p] = squared >= length * length
    return reaches


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
            for axis in range(3):  # ten times as fast as to copy rows, which numba makes arrays of
                out_points[n_points, axis] = points[i, axis]
            if len(normals):
                for axis in range(3):
                    out_normals[n_points, axis] = normals[i, axis]
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
    taken = np.empty((n_triangles, 3), triangles.dtype)
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
    kept = _reach(points, part, n_parts, smallest_mm)
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
) -> tuple[NDArray[Any], NDArray[Any], _Numbers]:
    """Return the points, normals and triangles of some triangles, (T,) bool; `normals` may be empty."""
    used, number = np.zeros(len(points), np.bool_), np.empty(len(points), np.int32)
    taken, n_points = _take(triangles, chosen, used, number)
    of_points = np.empty((n_points, 3), points.dtype)
    of_normals = np.empty((n_points if len(normals) else 0, 3), normals.dtype)
    _move(points, normals, taken[:0], used, number, (of_points, of_normals, taken[:0]))
    return of_points, of_normals, taken
