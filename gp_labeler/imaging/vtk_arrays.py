"""Between numpy and VTK, with types."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4

if TYPE_CHECKING:
    import pyvista as pv

__all__ = [
    "cells_of",
    "matrix_of",
    "narrow_cells",
    "points_of",
    "poly_data",
    "to_numpy",
    "to_vtk",
    "triangles_of",
    "triple",
    "vtk_ready",
]

_AT_A_TIME = 1 << 16


def to_numpy(array: Any) -> NDArray[Any]:
    """Return a view of a VTK data array."""
    view: NDArray[Any] = vtk_to_numpy(array)  # type: ignore[no-untyped-call]
    return view


def to_vtk(array: NDArray[Any], name: str = "", *, share: bool = False) -> Any:
    """Return a VTK data array of the values of (N,) or (N, components).

    Parameters
    ----------
    array : array
        Values.
    name : str
        Name in VTK.
    share : bool
        Use the same memory, which VTK then keeps alive, where the array is contiguous.
    """
    made = numpy_to_vtk(np.ascontiguousarray(array), deep=not share)  # type: ignore[no-untyped-call]
    if name:
        made.SetName(name)
    return made


def vtk_ready(array: NDArray[Any]) -> NDArray[Any]:
    """Return voxels contiguous and of a type that VTK has; a copy only where they are not."""
    if array.dtype == bool:
        array = array.astype(np.uint8)
    elif array.dtype == np.float16:
        array = array.astype(np.float32)
    return np.ascontiguousarray(array)


def points_of(positions: NDArray[Any]) -> vtkPoints:
    """Return (N, 3) positions as VTK points; they share memory, so leave the array alone afterwards."""
    points = vtkPoints()
    points.SetData(to_vtk(positions, share=True))
    return points


def cells_of(corners: NDArray[Any]) -> vtkCellArray:
    """Return (M, n) point numbers as cells of n corners; like `points_of`, of int32 without a copy."""
    cells = vtkCellArray()
    cells.SetData(corners.shape[1], to_vtk(np.asarray(corners, dtype=np.int32).ravel(), share=True))
    return cells


def narrow_cells(mesh: vtkPolyData) -> None:
    """Hold the point numbers of a mesh of triangles in 32 bits, in place: VTK's own take twice the memory."""
    wide = mesh.GetPolys().GetConnectivityArray()
    numbers = to_numpy(wide)
    if numbers.dtype.itemsize == 4:
        return
    narrow, n = numbers.view(np.int32), len(numbers)
    for first in range(0, n, _AT_A_TIME):  # what is written lies before all that is still to be read
        narrow[first : first + _AT_A_TIME][: n - first] = numbers[first : first + _AT_A_TIME]
    wide.SetNumberOfTuples(-(-n // 2))
    wide.Squeeze()  # gives the memory back
    mesh.SetPolys(cells_of(to_numpy(wide).view(np.int32)[:n].reshape(-1, 3)))


def triangles_of(mesh: vtkPolyData) -> NDArray[np.integer[Any]]:
    """Return the (T, 3) point numbers of a mesh of triangles, a view."""
    corners = to_numpy(mesh.GetPolys().GetConnectivityArray())
    return corners.reshape(-1, 3)


def poly_data(mesh: vtkPolyData) -> pv.PolyData:
    """Return a mesh as pyvista's, sharing points, cells and data."""
    import pyvista as pv  # takes 0.6 s: not before the window shows

    return mesh if isinstance(mesh, pv.PolyData) else pv.PolyData(mesh)


def matrix_of(values: ArrayLike) -> vtkMatrix4x4:
    """Return a (4, 4) matrix as VTK has them."""
    matrix = vtkMatrix4x4()
    matrix.DeepCopy(np.asarray(values, dtype=np.float64).ravel().tolist())
    return matrix


def triple(values: ArrayLike) -> tuple[float, float, float]:
    """Return three numbers as VTK takes them."""
    x, y, z = np.asarray(values, dtype=np.float64).tolist()
    return x, y, z
