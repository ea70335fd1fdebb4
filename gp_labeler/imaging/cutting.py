"""Cutting a box out of a mesh exactly along the box's faces, so that a finer mesh fits into the hole."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkBox, vtkPolyData
from vtkmodules.vtkCommonTransforms import vtkTransform
from vtkmodules.vtkFiltersCore import vtkClipPolyData, vtkTriangleFilter

from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import cells_of, matrix_of, points_of, to_numpy, to_vtk, triangles_of

__all__ = ["crossing", "joined", "part_outside"]

_ON_THE_FACE = 1e-3
"""So near to a face, in voxels, a corner counts as lying on it."""


def crossing(
    index: FloatArray, triangles: NDArray[np.integer[Any]], region: FloatArray
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which triangles lie within a region of voxels, and which pass through its faces.

    Parameters
    ----------
    index : (N, 3) float array
        Corners, as voxel indices.
    triangles : (T, 3) int array
        Rows of `index`.
    region : (2, 3) float array
        First and last voxel index.
    """
    within, beyond = np.ones(len(index), dtype=bool), np.zeros(len(index), dtype=bool)
    for axis in range(3):  # a column at a time: meshes have millions of corners
        column = index[:, axis]
        within &= (column > region[0, axis] + _ON_THE_FACE) & (column < region[1, axis] - _ON_THE_FACE)
        beyond |= (column < region[0, axis] - _ON_THE_FACE) | (column > region[1, axis] + _ON_THE_FACE)
    has_within, has_beyond = (np.asarray(corner[triangles].any(axis=1)) for corner in (within, beyond))
    passes = has_beyond & has_within
    enclosed = ~has_beyond
    middle = index[triangles[enclosed]].mean(axis=1)
    enclosed[enclosed] = ((middle > region[0]) & (middle < region[1])).all(axis=1)
    return enclosed, passes


def part_outside(mesh: vtkPolyData, T_voxel_scan: FloatArray, region: FloatArray) -> vtkPolyData:
    """Return what of a mesh lies outside a region of voxels; triangles are cut along its faces."""
    box, to_voxels = vtkBox(), vtkTransform()
    box.SetBounds(region.T.ravel().tolist())
    to_voxels.SetMatrix(matrix_of(T_voxel_scan))
    box.SetTransform(to_voxels)
    clip, triangulate = vtkClipPolyData(), vtkTriangleFilter()
    clip.SetInputData(mesh)
    clip.SetClipFunction(box)
    triangulate.SetInputConnection(clip.GetOutputPort())
    triangulate.PassVertsOff()
    triangulate.PassLinesOff()
    triangulate.Update()
    part: vtkPolyData = triangulate.GetOutput()
    return part


def joined(one: vtkPolyData, other: vtkPolyData) -> vtkPolyData:
    """Return two meshes of triangles as one."""
    if not other.GetNumberOfPolys():
        return one
    parts = (one, other)
    whole = vtkPolyData()
    whole.SetPoints(points_of(np.concatenate([to_numpy(part.GetPoints().GetData()) for part in parts])))
    rows = [triangles_of(one), triangles_of(other) + one.GetNumberOfPoints()]
    whole.SetPolys(cells_of(np.concatenate(rows)))
    normals = [part.GetPointData().GetNormals() for part in parts]
    if all(each is not None for each in normals):
        merged = np.concatenate([to_numpy(each) for each in normals])
        whole.GetPointData().SetNormals(to_vtk(merged, share=True))
    return whole
