"""Targets of iterative closest point: a point cloud or a surface."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.errors import GeometryError, GpError
from gp_core.validation import FloatArray, as_points

__all__ = ["Cloud", "Target", "TriangleMesh"]

_FEWEST_POINTS = 3
_SMALLEST_AREA_MM2 = 1e-12


class Target(Protocol):
    """What points can be registered to."""

    @property
    def points(self) -> FloatArray:
        """(V, 3) points that give its position and orientation, mm."""

    def nearest(self, points: FloatArray) -> FloatArray:
        """Return the nearest point of the target to each point.

        Parameters
        ----------
        points : (N, 3) array
            Points, mm.

        Returns
        -------
        (N, 3) array, mm
            Nearest points.
        """


class Cloud:
    """A point cloud as a target.

    Parameters
    ----------
    points : (V, 3) array_like, mm
        At least three.

    Raises
    ------
    GeometryError
        Fewer than three points.
    """

    def __init__(self, points: ArrayLike) -> None:
        from scipy.spatial import cKDTree

        self._points = as_points(points, "target")
        if len(self._points) < _FEWEST_POINTS:
            raise GeometryError(f"the target needs at least {_FEWEST_POINTS} points, got {len(self._points)}")
        self._tree = cKDTree(self._points)

    @property
    def points(self) -> FloatArray:
        """(V, 3) points, mm."""
        return self._points

    def nearest(self, points: FloatArray) -> FloatArray:
        """Return the nearest point of the cloud to each point.

        Parameters
        ----------
        points : (N, 3) array
            Points, mm.

        Returns
        -------
        (N, 3) array, mm
            Nearest points.
        """
        _, index = self._tree.query(points)
        found: FloatArray = self._points[index]
        return found


class TriangleMesh:
    """A triangle mesh as a target; nearest points are exact, inside triangles as well as at their corners.

    Parameters
    ----------
    vertices : (V, 3) array_like, mm
        Corners of the triangles.
    triangles : (T, 3) array_like of int
        Rows of `vertices`; triangles of zero area are ignored.

    Raises
    ------
    GpError
        Shapes or indices are wrong, or no triangle has an area.
    """

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike) -> None:
        corners = _as_corners(as_points(vertices, "vertices"), triangles)
        self._corners = corners
        self._centres: FloatArray = corners.mean(axis=1)
        radii = np.linalg.norm(corners - self._centres[:, None], axis=2).max(axis=1)
        self._groups = _by_size(self._centres, radii)

    @property
    def points(self) -> FloatArray:
        """(T, 3) centroids of the triangles, mm."""
        return self._centres

    def nearest(self, points: FloatArray) -> FloatArray:
        """Return the nearest point of the surface to each point.

        A triangle can be nearer than the best so far only if its centroid is nearer than that plus its
        radius. So triangles are grouped by size, each group with a search radius of its own.

        Parameters
        ----------
        points : (N, 3) array
            Points, mm.

        Returns
        -------
        (N, 3) array, mm
            Nearest points.
        """
        best = np.full(len(points), np.inf)
        found = np.empty_like(points)
        for tree, which, _ in self._groups:
            _, index = tree.query(points)
            self._improve(points, np.arange(len(points)), which[index], best, found)
        for tree, which, radius in self._groups:
            lists = tree.query_ball_point(points, np.sqrt(best) + radius)
            counts = np.array([len(near) for near in lists])
            if counts.any():
                rows = np.repeat(np.arange(len(points)), counts)
                index = np.concatenate([np.array(near, dtype=np.intp) for near in lists])
                self._improve(points, rows, which[index], best, found)
        return found

    def _improve(
        self,
        points: FloatArray,
        rows: NDArray[np.intp],
        triangles: NDArray[np.intp],
        best: FloatArray,
        found: FloatArray,
    ) -> None:
        """Keep the candidates that are nearer than the best squared distance so far."""
        candidates = _nearest_in_triangles(points[rows], self._corners[triangles])
        squared = np.sum((candidates - points[rows]) ** 2, axis=1)
        order = np.argsort(-squared, kind="stable")  # the nearest is written last, and stays
        rows, candidates, squared = rows[order], candidates[order], squared[order]
        better = squared < best[rows]
        best[rows[better]] = squared[better]
        found[rows[better]] = candidates[better]


def _as_corners(vertices: FloatArray, triangles: ArrayLike) -> FloatArray:
    """Return the corners (T, 3, 3) of the triangles that have an area."""
    rows = np.asarray(triangles)
    if rows.ndim != 2 or rows.shape[1] != 3 or rows.dtype.kind not in "iu":
        raise GpError(f"triangles must be whole numbers in (T, 3), got {rows.dtype} in {rows.shape}")
    if rows.size and (rows.min() < 0 or rows.max() >= len(vertices)):
        raise GpError(f"triangles must name vertices from 0 to {len(vertices) - 1}")
    corners: FloatArray = vertices[rows]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corners = corners[np.linalg.norm(across, axis=1) > _SMALLEST_AREA_MM2]
    if not len(corners):
        raise GeometryError("the surface has no triangle with an area", remedy="Give another mesh.")
    return corners


def _by_size(centres: FloatArray, radii: FloatArray) -> list[tuple[Any, NDArray[np.intp], float]]:
    """Return search trees over the centroids of triangles of similar size.

    Each is (tree, which triangles, largest radius).
    """
    from scipy.spatial import cKDTree

    sizes = np.floor(np.log2(radii)).astype(int)
    groups = [np.flatnonzero(sizes == size) for size in np.unique(sizes)]
    return [(cKDTree(centres[which]), which, float(radii[which].max())) for which in groups]


def _nearest_in_triangles(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the nearest point (P, 3) of triangle p (P, 3, 3) to point p (P, 3)."""
    found = _foot_in_plane(points, corners)
    squared = np.sum((found - points) ** 2, axis=1)
    squared[np.isnan(squared)] = np.inf
    for i in range(3):
        begin, edge = corners[:, i], corners[:, (i + 1) % 3] - corners[:, i]
        along = np.sum((points - begin) * edge, axis=1) / np.sum(edge * edge, axis=1)
        candidate = begin + np.clip(along, 0.0, 1.0)[:, None] * edge
        distance = np.sum((candidate - points) ** 2, axis=1)
        better = distance < squared
        squared = np.where(better, distance, squared)
        found = np.where(better[:, None], candidate, found)
    return found


def _foot_in_plane(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the perpendicular foot (P, 3) of each point on the plane of its triangle; NaN if outside it."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    offset = points - corners[:, 0]
    area = np.sum(normal * normal, axis=1)
    u = np.sum(np.cross(offset, second) * normal, axis=1) / area
    v = np.sum(np.cross(first, offset) * normal, axis=1) / area
    inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    foot = corners[:, 0] + u[:, None] * first + v[:, None] * second
    found: FloatArray = np.where(inside[:, None], foot, np.nan)
    return found
