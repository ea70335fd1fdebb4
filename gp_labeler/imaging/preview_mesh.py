"""A surface of few triangles that looks like one of many, made in a moment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from gp_core.validation import FloatArray
from gp_labeler.imaging.mesh import Surface
from gp_labeler.imaging.vtk_arrays import cells_of, points_of, poly_data, to_numpy, to_vtk

__all__ = ["coarse_surface"]

_GROWTH = 1.05
_FIRST_VOXELS = 2.0
_FINE_SHARE = 0.4
"""Edge of the boxes where detail is kept, as a share of that elsewhere."""
_TRIANGLES_EACH = 3.1
"""Triangles that are left of the surface for each square as large as a side of a box: 2.4 to 3.1 on synthetic
heads and on balls."""
_SAMPLE = 16
"""One triangle of so many is measured for the area of the surface."""


def coarse_surface(
    surface: Surface | Sequence[Surface], n_triangles: int, *, detailed: Sequence[FloatArray] = ()
) -> Surface:
    """Return a preview mesh of at most so many triangles, to be looked at while the camera moves.

    All points in a box that face the same way become one, their mean. So the two sides of a thin wall stay
    apart, walls that a coarser isosurface would lose stay, and no triangle is turned inside out.

    Parameters
    ----------
    surface : Surface or sequence of Surface
        The surface, or parts of it that meet: they are joined where they do. A single one is returned itself
        where it has no more triangles.
    n_triangles : int
        At most so many.
    detailed : sequence of (2, 3) float array
        Boxes, scan frame, mm, in which more detail is kept.

    References
    ----------
    Rossignac and Borrel 1993, Multi-resolution 3D approximations, doi:10.1007/978-3-642-78114-8_29.
    """
    parts = (surface,) if isinstance(surface, Surface) else tuple(surface)
    if len(parts) == 1 and parts[0].n_triangles <= n_triangles:
        return parts[0]
    first = parts[0]
    points, normals, triangles = _as_one(parts)
    fine = _inside(points, detailed)
    share = np.where(fine, _FINE_SHARE, 1.0)
    expected = (_TRIANGLES_EACH * _relative_area(points, triangles, share) / n_triangles) ** 0.5
    box = max(_FIRST_VOXELS * max(part.voxel_mm for part in parts), expected)
    while True:
        made = _clustered(points, normals, triangles, share * box)
        n_made = made.GetNumberOfPolys()
        if n_made <= n_triangles:
            return Surface(poly_data(made), first.level, first.T_voxel_scan, first.region, first.stride)
        box *= max(_GROWTH, (n_made / n_triangles) ** 0.5)


def _as_one(parts: Sequence[Surface]) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Return points, normals and triangles of all parts."""
    offsets = np.cumsum([0, *(len(part.points) for part in parts)])
    points = np.concatenate([part.points for part in parts]).astype(np.float64)
    normals = np.concatenate([to_numpy(part.mesh.GetPointData().GetNormals()) for part in parts])
    triangles = np.concatenate([part.triangles + n for part, n in zip(parts, offsets[:-1], strict=True)])
    return points, normals.astype(np.float64), triangles


def _relative_area(points: FloatArray, triangles: NDArray[np.int64], share: FloatArray) -> float:
    """Return the area of a surface, mm², enlarged where the edges of the boxes are these (N,) shares."""
    a, b, c = triangles[::_SAMPLE].T
    doubled = np.linalg.norm(np.cross(points[b] - points[a], points[c] - points[a]), axis=1)
    return float(_SAMPLE / 2 * (doubled / share[a] ** 2).sum())


def _inside(points: FloatArray, boxes: Sequence[FloatArray]) -> NDArray[np.bool_]:
    inside = np.zeros(len(points), dtype=bool)
    for low, high in boxes:
        inside |= ((points > low) & (points < high)).all(axis=1)
    return inside


def _clustered(
    points: FloatArray, normals: FloatArray, triangles: NDArray[np.int64], edges: FloatArray
) -> vtkPolyData:
    """Return a mesh in which points in one box of a grid, of these (N,) edges, that face one way are one."""
    cells = np.floor((points - points.min(axis=0)) / edges[:, None]).astype(np.int64)
    across = int(cells.max()) + 1
    key = ((cells[:, 0] * across + cells[:, 1]) * across + cells[:, 2]) * 2 + (edges < edges.max())
    _, first, cell = np.unique(key, return_index=True, return_inverse=True)
    faces_back = np.einsum("ij,ij->i", normals, normals[first][cell]) < 0
    cluster = _numbered(2 * cell + faces_back)
    places, facing = _means(points, cluster), _means(normals, cluster)
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-12)
    corners = cluster[triangles]
    a, b, c = corners.T
    corners = _turned_outwards(corners[(a != b) & (b != c) & (c != a)], places, facing)
    mesh = vtkPolyData()
    mesh.SetPoints(points_of(places.astype(np.float32)))
    mesh.SetPolys(cells_of(corners))
    mesh.GetPointData().SetNormals(to_vtk(facing.astype(np.float32), share=True))
    return mesh


def _numbered(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return labels counted from 0 without gaps, in their order."""
    occurs = np.bincount(labels) > 0
    return (np.cumsum(occurs) - 1)[labels]


def _means(values: FloatArray, cluster: NDArray[np.int64]) -> FloatArray:
    counts = np.bincount(cluster)
    return np.stack([np.bincount(cluster, column) / counts for column in values.T], axis=1)


def _turned_outwards(corners: NDArray[np.int64], places: FloatArray, facing: FloatArray) -> NDArray[np.int64]:
    """Return triangles, each once, whose corners run counter-clockwise as seen from where its points face."""
    lowest_first = np.take_along_axis(corners, (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    a, b, c = (places[lowest_first[:, n]] for n in range(3))
    outwards = facing[lowest_first].sum(axis=1)
    backwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), outwards) < 0
    lowest_first[backwards] = lowest_first[backwards][:, [0, 2, 1]]
    n = len(places)
    _, once = np.unique(
        (lowest_first[:, 0] * n + lowest_first[:, 1]) * n + lowest_first[:, 2], return_index=True
    )
    return np.asarray(lowest_first[np.sort(once)])
