"""A surface of few triangles that looks like one of many, made in a moment."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkFiltersCore import vtkBinnedDecimation

from gp_labeler.imaging.mesh import Surface
from gp_labeler.imaging.vtk_arrays import poly_data

__all__ = ["coarse_surface"]

_GROWTH = 1.15
_FIRST_VOXELS = 2.0


def coarse_surface(surface: Surface, n_triangles: int) -> Surface:
    """Return a preview mesh of at most so many triangles, to be looked at while the camera moves.

    All points in a box become one, their mean. Thin walls, which a coarser isosurface would lose, stay.

    Parameters
    ----------
    surface : Surface
        The surface; it is returned itself where it has no more triangles.
    n_triangles : int
        At most so many.

    References
    ----------
    Rossignac and Borrel 1993, Multi-resolution 3D approximations, doi:10.1007/978-3-642-78114-8_29.
    """
    box = _FIRST_VOXELS * surface.voxel_mm
    made = surface
    while made.n_triangles > n_triangles:
        made = _in_boxes(surface, box)
        box *= max(_GROWTH, (made.n_triangles / n_triangles) ** 0.5)
    return made


def _in_boxes(surface: Surface, box_mm: float) -> Surface:
    low, high = surface.bounds
    decimation = vtkBinnedDecimation()
    decimation.SetInputData(surface.mesh)
    decimation.AutoAdjustNumberOfDivisionsOff()
    decimation.SetNumberOfDivisions(np.maximum(np.rint((high - low) / box_mm), 1).astype(int).tolist())
    decimation.SetPointGenerationModeToBinAverages()
    decimation.ProducePointDataOn()  # normals
    decimation.Update()
    return Surface(
        poly_data(decimation.GetOutput()), surface.level, surface.T_voxel_scan, surface.region, surface.stride
    )
