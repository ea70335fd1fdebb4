"""Finding triangles of a mesh along rays and near points, through boxes around runs of its triangles.

Triangles that follow each other in an isosurface lie side by side. So boxes around every few of them, boxes
around every few of those, and so on, make a search tree that needs no sorting: one pass over the mesh builds
it, and it takes some 3 bytes a triangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gp_core.validation import FloatArray

__all__ = ["TriangleSearch"]

_IN_A_BOX = 8
"""Triangles, or smaller boxes."""

_MOST_WAITING = 8 * 16
"""Boxes that a search has still to look at: 16 levels are more than a mesh can have."""

_TOLERANCE = 1e-4
"""So much beyond its edges, in their lengths, a triangle is met: a way may pass exactly between two."""

_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class TriangleSearch:
    """Boxes around runs of triangles, and the mesh they were made of.

    Parameters
    ----------
    points : (N, 3) float32 array
        Corners.
    triangles : (T, 3) int array
        Rows of `points`.
    boxes : (B, 2, 3) float32 array
        Lowest and highest coordinates, level by level: those around triangles first, that around all last.
    starts : (L + 1,) int array
        Row of the first box of each level, and the number of boxes.
    """

    points: NDArray[np.float32]
    triangles: NDArray[np.integer[Any]]
    boxes: NDArray[np.float32]
    starts: NDArray[np.int64]

    @classmethod
    def of(cls, points: NDArray[np.float32], triangles: NDArray[np.integer[Any]]) -> TriangleSearch:
        """Build the boxes of a mesh with at least one triangle; other threads run in the meantime."""
        levels = [_boxes_of_triangles(points, triangles)]
        while len(levels[-1]) > 1:
            first = np.arange(0, len(levels[-1]), _IN_A_BOX)
            low = np.minimum.reduceat(levels[-1][:, 0], first)
            high = np.maximum.reduceat(levels[-1][:, 1], first)
            levels.append(np.stack([low, high], axis=1))
        starts = np.cumsum([0, *(len(level) for level in levels)])
        return cls(points, triangles, np.concatenate(levels), starts)

    def first_along(self, start: FloatArray, along: FloatArray) -> tuple[int, float] | None:
        """Return the first triangle on the way from a place, and after what share of the way; None if none.

        Parameters
        ----------
        start, along : (3,) float array
            A place, and from there to the end of the way.
        """
        if not along.any():
            return None
        triangle, share = _search(self.points, self.triangles, self.boxes, self.starts, start, along)
        return (triangle, share) if triangle >= 0 else None

    def nearest(self, place: FloatArray) -> tuple[int, FloatArray]:
        """Return the triangle that is nearest to a place, and its point that is, (3,)."""
        nowhere = np.zeros(3)
        triangle, _ = _search(self.points, self.triangles, self.boxes, self.starts, place, nowhere)
        a, b, c = _corners(self.points, self.triangles[triangle])
        return triangle, _nearest_point(a, b, c, place)


@njit(nogil=True, cache=True)
def _boxes_of_triangles(points: Any, triangles: Any) -> Any:
    """Return boxes around runs of triangles, (B, 2, 3)."""
    boxes = np.empty((-(-len(triangles) // _IN_A_BOX), 2, 3), np.float32)
    boxes[:, 0] = np.inf
    boxes[:, 1] = -np.inf
    for t in range(len(triangles)):
        box = boxes[t // _IN_A_BOX]
        for corner in range(3):
            point = triangles[t, corner]
            for axis in range(3):
                value = points[point, axis]
                box[0, axis] = min(box[0, axis], value)
                box[1, axis] = max(box[1, axis], value)
    return boxes


@njit(nogil=True, cache=True)
def _search(points: Any, triangles: Any, boxes: Any, starts: Any, place: Any, along: Any) -> Any:
    """Return the first triangle along a way, or the nearest one where there is none to go; -1 if none.

    With it comes after what share of the way it is met, or its squared distance. The nearest boxes are looked
    into first; those that are farther than what was found are left out.
    """
    goes = bool(np.any(along != 0))
    found, best = -1, 1.0 if goes else np.inf
    levels, rows = np.zeros(_MOST_WAITING, np.int64), np.zeros(_MOST_WAITING, np.int64)
    bounds = np.zeros(_MOST_WAITING)
    levels[0], n = len(starts) - 2, 1
    while n:
        n -= 1
        if bounds[n] > best:
            continue
        level, first, last_before = levels[n], rows[n] * _IN_A_BOX, n
        if level == 0:
            for t in range(first, min(first + _IN_A_BOX, len(triangles))):
                away = _to_triangle(points, triangles[t], place, along, goes)
                if away <= best and (away < best or found < 0):
                    found, best = t, away
            continue
        for row in range(first, min(first + _IN_A_BOX, starts[level] - starts[level - 1])):
            bound = _to_box(boxes[starts[level - 1] + row], place, along, goes)
            if bound <= best:
                at = n
                while at > last_before and bounds[at - 1] < bound:  # the nearest one comes last: it is next
                    levels[at], rows[at], bounds[at] = levels[at - 1], rows[at - 1], bounds[at - 1]
                    at -= 1
                levels[at], rows[at], bounds[at] = level - 1, row, bound
                n += 1
    return found, best


@njit(nogil=True, cache=True)
def _to_triangle(points: Any, triangle: Any, place: Any, along: Any, goes: bool) -> Any:
    """Return after what share of the way a triangle is met, or its squared distance."""
    a, b, c = _corners(points, triangle)
    return _share(a, b, c, place, along) if goes else _squared(_nearest_point(a, b, c, place) - place)


@njit(nogil=True, cache=True)
def _to_box(box: Any, place: Any, along: Any, goes: bool) -> float:
    """Return after what share of the way a box is entered, or its squared distance."""
    return _share_of_box(box, place, along) if goes else _squared_to_box(box, place)


@njit(nogil=True, cache=True)
def _corners(points: Any, triangle: Any) -> Any:
    corners = np.empty((3, 3))
    for corner in range(3):
        for axis in range(3):
            corners[corner, axis] = points[triangle[corner], axis]
    return corners[0], corners[1], corners[2]


@njit(nogil=True, cache=True)
def _share_of_box(box: Any, place: Any, along: Any) -> float:
    """Return after what share of a way it enters a box; infinity where it does not."""
    enters, leaves = 0.0, 1.0
    for axis in range(3):
        low, high = box[0, axis] - place[axis], box[1, axis] - place[axis]
        if along[axis] == 0:
            if low > 0 or high < 0:
                return np.inf
            continue
        near, far = low / along[axis], high / along[axis]
        enters, leaves = max(enters, min(near, far)), min(leaves, max(near, far))
    return enters if enters <= leaves + _ROUNDING else np.inf


@njit(nogil=True, cache=True)
def _squared_to_box(box: Any, place: Any) -> float:
    squared = 0.0
    for axis in range(3):
        away = max(box[0, axis] - place[axis], place[axis] - box[1, axis], 0.0)
        squared += away * away
    return squared


@njit(nogil=True, cache=True)
def _share(a: Any, b: Any, c: Any, place: Any, along: Any) -> float:
    """Return after what share of a way it meets a triangle (Moeller and Trumbore 1997); infinity if not."""
    one, other = b - a, c - a
    across = _cross(along, other)
    volume = _dot(one, across)
    if volume == 0:
        return np.inf
    away = place - a
    u = _dot(away, across) / volume
    across = _cross(away, one)
    v = _dot(along, across) / volume
    share = _dot(other, across) / volume
    met = u >= -_TOLERANCE and v >= -_TOLERANCE and u + v <= 1 + _TOLERANCE and share >= 0
    return share if met else np.inf


@njit(nogil=True, cache=True)
def _nearest_point(a: Any, b: Any, c: Any, place: Any) -> Any:
    """Return the point of a triangle that is nearest to a place: on its face, or else on one of its edges."""
    one, other, away = b - a, c - a, place - a
    normal = _cross(one, other)
    size = _squared(normal)
    if size > 0:
        u, v = _dot(_cross(away, other), normal) / size, _dot(_cross(one, away), normal) / size
        if u >= 0 and v >= 0 and u + v <= 1:
            return a + u * one + v * other
    best = a
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        length = _squared(edge)
        share = min(max(_dot(place - start, edge) / length, 0.0), 1.0) if length > 0 else 0.0
        point = start + share * edge
        if _squared(point - place) < _squared(best - place):
            best = point
    return best


@njit(nogil=True, cache=True)
def _cross(a: Any, b: Any) -> Any:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@njit(nogil=True, cache=True)
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(nogil=True, cache=True)
def _squared(a: Any) -> Any:
    return _dot(a, a)
