"""A surface of few triangles that looks like one of many, made in a moment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

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

_AT_A_TIME = 1 << 17
"""Points, and triangles, of a surface: what is computed of all of them at once would take several times its
memory."""


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
    first, area = parts[0], sum(_relative_area(part, detailed) for part in parts)
    expected = (_TRIANGLES_EACH * area / n_triangles) ** 0.5
    edge = max(_FIRST_VOXELS * max(part.voxel_mm for part in parts), expected)
    grid = _Grid(np.min([part.bounds[0] for part in parts], axis=0), edge, detailed)
    mesh = _joined([_clustered(_corners_of(part), grid, _AT_A_TIME) for part in parts])
    while True:
        mesh = _turned_outwards(_clustered(mesh, grid, len(mesh.points)))
        n_made = len(mesh.triangles)
        if n_made <= n_triangles:
            made = poly_data(mesh.to_vtk())
            return Surface(made, first.level, first.T_voxel_scan, first.region, first.stride)
        grid = replace(grid, edge=grid.edge * max(_GROWTH, (n_made / n_triangles) ** 0.5))


@dataclass(frozen=True, eq=False)
class _Mesh:
    """(N, 3) points and normals, and (T, 3) triangles."""

    points: NDArray[np.floating[Any]]
    normals: NDArray[np.floating[Any]]
    triangles: NDArray[np.integer[Any]]

    def to_vtk(self) -> vtkPolyData:
        """Return it as VTK has them."""
        mesh = vtkPolyData()
        mesh.SetPoints(points_of(self.points.astype(np.float32)))
        mesh.SetPolys(cells_of(self.triangles))
        mesh.GetPointData().SetNormals(to_vtk(self.normals.astype(np.float32), share=True))
        return mesh


@dataclass(frozen=True, eq=False)
class _Grid:
    """Boxes side by side from a corner on, smaller ones within the boxes where detail is kept."""

    origin: FloatArray
    edge: float
    detailed: Sequence[FloatArray]

    def boxes_of(self, points: FloatArray) -> NDArray[np.int64]:
        """Return the number of the box of each of (N, 3) points."""
        fine = _inside(points, self.detailed)
        edges = np.where(fine, _FINE_SHARE * self.edge, self.edge)
        i, j, k = np.floor((points - self.origin).T / edges).astype(np.int64)
        across = 1 + max(int(i.max()), int(j.max()), int(k.max()))
        box: NDArray[np.int64] = ((i * across + j) * across + k) * 2 + fine
        return box


def _relative_area(part: Surface, detailed: Sequence[FloatArray]) -> float:
    """Return the area of a surface, mm², enlarged where smaller boxes keep detail."""
    a, b, c = (part.points[corner] for corner in part.triangles[::_SAMPLE].T)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return float(_SAMPLE / 2 * (doubled / np.where(_inside(a, detailed), _FINE_SHARE, 1.0) ** 2).sum())


def _inside(points: NDArray[np.floating[Any]], boxes: Sequence[FloatArray]) -> NDArray[np.bool_]:
    inside = np.zeros(len(points), dtype=bool)
    for low, high in boxes:
        inside |= ((points > low) & (points < high)).all(axis=1)
    return inside


def _corners_of(part: Surface) -> _Mesh:
    return _Mesh(part.points, to_numpy(part.mesh.GetPointData().GetNormals()), part.triangles)


def _joined(meshes: Sequence[_Mesh]) -> _Mesh:
    offsets = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    return _Mesh(
        np.concatenate([mesh.points for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.triangles + n for mesh, n in zip(meshes, offsets[:-1], strict=True)]),
    )


def _clustered(mesh: _Mesh, grid: _Grid, at_a_time: int) -> _Mesh:
    """Return a mesh in which points in one box that face one way are one, of so many points at a time.

    Points that follow each other lie side by side, so a box has points of few such runs.
    """
    number = np.empty(len(mesh.points), np.int64)
    points, normals, n_made = [], [], 0
    for run in _runs(len(mesh.points), at_a_time):
        places, facing = mesh.points[run].astype(np.float64), mesh.normals[run].astype(np.float64)
        cluster = _clusters(grid.boxes_of(places), facing)
        number[run] = cluster + n_made
        points.append(_means(places, cluster))
        normals.append(_unit(_means(facing, cluster)))
        n_made += len(points[-1])
    triangles = [_not_flat(number[mesh.triangles[run]]) for run in _runs(len(mesh.triangles), at_a_time)]
    return _Mesh(np.concatenate(points), np.concatenate(normals), np.concatenate(triangles))


def _runs(n: int, at_a_time: int) -> Iterator[slice]:
    return (slice(first, first + at_a_time) for first in range(0, n, at_a_time))


def _clusters(box: NDArray[np.int64], normals: FloatArray) -> NDArray[np.int64]:
    """Return which (N,) points become one: those in one box that face as the first one there, or the rest."""
    _, first, cell = np.unique(box, return_index=True, return_inverse=True)
    faces_back = np.einsum("ij,ij->i", normals, normals[first][cell]) < 0
    return _numbered(2 * cell + faces_back)


def _numbered(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return labels counted from 0 without gaps, in their order."""
    occurs = np.bincount(labels) > 0
    return (np.cumsum(occurs) - 1)[labels]


def _means(values: FloatArray, cluster: NDArray[np.int64]) -> FloatArray:
    counts = np.bincount(cluster)
    return np.stack([np.bincount(cluster, column) / counts for column in values.T], axis=1)


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
    return unit


def _not_flat(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    a, b, c = corners.T
    left: NDArray[np.int64] = corners[(a != b) & (b != c) & (c != a)]
    return left


def _turned_outwards(mesh: _Mesh) -> _Mesh:
    """Return triangles, each once, whose corners run counter-clockwise as seen from where its points face."""
    places, facing, corners = mesh.points, mesh.normals, mesh.triangles
    lowest_first = np.take_along_axis(corners, (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    a, b, c = (places[lowest_first[:, n]] for n in range(3))
    outwards = facing[lowest_first].sum(axis=1)
    backwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), outwards) < 0
    lowest_first[backwards] = lowest_first[backwards][:, [0, 2, 1]]
    n = len(places)
    _, once = np.unique(
        (lowest_first[:, 0] * n + lowest_first[:, 1]) * n + lowest_first[:, 2], return_index=True
    )
    return replace(mesh, triangles=lowest_first[np.sort(once)])
