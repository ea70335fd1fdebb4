"""Shading a finer mesh so that no line shows where it meets the coarser one around it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.imaging.mesh import Surface
from gp_labeler.imaging.vtk_arrays import poly_data, to_numpy, to_vtk

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

__all__ = ["shaded_like"]

_WIDTH_MM = 2.5
"""Over so much, inwards from the faces of its box, a finer mesh takes its own shading."""

_NEIGHBOURS = 6
_AT_A_TIME = 1 << 17


def shaded_like(fine: Surface, around: Sequence[Surface], width_mm: float = _WIDTH_MM) -> Surface:
    """Return a mesh of a box with normals that, at the faces of the box, are those of the mesh around it.

    Noise at full resolution shows as grain, the means of an overview do not: the box would stand out. Corners
    and triangles stay as they are, so nothing moves that is picked or measured.

    Parameters
    ----------
    fine : Surface
        Of a box within the volume.
    around : sequence of Surface
        The coarser mesh, before the box was cut out of it.
    width_mm : float
        Over how much the normals go over.
    """
    from scipy.spatial import cKDTree  # takes long to import: not at start-up

    away = _from_faces(fine, around)
    near = np.flatnonzero(away < width_mm)
    points, coarse = _within(around, fine.bounds, width_mm)
    if not len(near) or not len(points):
        return fine
    tree = cKDTree(points)
    normals = to_numpy(fine.mesh.GetPointData().GetNormals()).copy()
    for some in np.array_split(near, 1 + len(near) // _AT_A_TIME):
        own = normals[some].astype(np.float64)
        other, known = _normals_at(fine.points[some].astype(np.float64), own, tree, coarse)
        share = np.clip(away[some] / width_mm, 0.0, 1.0)
        weight = np.where(known, share**2 * (3 - 2 * share), 1.0)[:, None]
        mixed = weight * own + (1 - weight) * other
        normals[some] = mixed / np.maximum(np.linalg.norm(mixed, axis=1, keepdims=True), 1e-12)
    mesh = fine.mesh.copy(deep=False)
    mesh.GetPointData().SetNormals(to_vtk(normals, "Normals", share=True))
    return Surface(poly_data(mesh), fine.level, fine.T_voxel_scan, fine.region, fine.stride)


def _from_faces(fine: Surface, around: Sequence[Surface]) -> FloatArray:
    """Return how far (N,) points are from the faces of their box, mm; those of the scan do not count."""
    spacing = np.linalg.norm(np.linalg.inv(fine.T_voxel_scan[:3, :3]), axis=0)
    whole = np.stack([part.region for part in around])
    first, last = whole[:, 0].min(axis=0), whole[:, 1].max(axis=0)
    away = np.full(len(fine.points), np.inf)
    for axis, row in enumerate(fine.T_voxel_scan[:3]):  # a coordinate at a time: there are millions of points
        index = fine.points @ row[:3] + row[3]
        if fine.region[0, axis] > first[axis]:
            away = np.minimum(away, (index - fine.region[0, axis]) * spacing[axis])
        if fine.region[1, axis] < last[axis]:
            away = np.minimum(away, (fine.region[1, axis] - index) * spacing[axis])
    return away


def _within(around: Sequence[Surface], bounds: FloatArray, margin: float) -> tuple[FloatArray, FloatArray]:
    """Return points and normals of the coarser mesh in and around a box."""
    low, high = bounds[0] - margin, bounds[1] + margin
    points, normals = [], []
    for part in around:
        inside = ((part.points > low) & (part.points < high)).all(axis=1)
        points.append(part.points[inside].astype(np.float64))
        normals.append(to_numpy(part.mesh.GetPointData().GetNormals())[inside].astype(np.float64))
    return np.concatenate(points), np.concatenate(normals)


def _normals_at(
    where: FloatArray, facing: FloatArray, tree: cKDTree, normals: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the mean normals of nearby points that face about as `facing`, and where there are any."""
    k = min(_NEIGHBOURS, tree.n)
    found = tree.query(where, k=k)
    distance, nearest = (np.asarray(each).reshape(-1, k) for each in found)
    near = normals[nearest]
    agrees = np.einsum("nki,ni->nk", near, facing) > 0  # not the other side of a thin wall
    weight = agrees / (distance + 1e-3)
    mean = np.einsum("nk,nki->ni", weight, near)
    length = np.linalg.norm(mean, axis=1)
    return mean / np.maximum(length, 1e-12)[:, None], length > 1e-9
