"""Many small solids as one mesh, each with its own place, direction, size and colour."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer

from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import cells_of, points_of, to_vtk
from gp_labeler.scene.pose_solids import solid_mesh
from gp_labeler.scene.render_layers import RenderLayers, release

__all__ = ["SolidActor"]


class SolidActor:
    """Draws solids: full where they are seen, fainter where bone hides them.

    They are laid out again as one mesh whenever they change. The glyph filter of VTK and pyvista scales a
    glyph by one number, while a rod that grows longer keeps its thickness.

    Parameters
    ----------
    layers : RenderLayers
        Where to draw.
    through : float
        Opacity of what bone hides.
    """

    def __init__(self, layers: RenderLayers, through: float = 0.5) -> None:
        self._data = vtkPolyData()
        opacities = ((layers.base, 1.0), (layers.overlay, through))
        self._actors = [
            (renderer, _actor(self._data, renderer), opacity)
            for renderer, opacity in opacities
            if through < 1.0 or renderer is layers.overlay
        ]

    def set(
        self,
        places: FloatArray,
        along: FloatArray,
        sizes: FloatArray,
        colours: NDArray[np.uint8],
        shapes: NDArray[np.int_],
        opacity: float = 1.0,
    ) -> None:
        """Draw these in place of those before.

        Parameters
        ----------
        places, along : (N, 3) float array
            Scan frame, mm, and unit vectors.
        sizes : (N, 3) float array
            Along the direction and across it, mm.
        colours : (N, 3) uint8 array
            Red, green, blue.
        shapes : (N,) int array
            Which solid, see `pose_solids`.
        opacity : float
            From 0 to 1.
        """
        for _, actor, full in self._actors:
            actor.SetVisibility(len(places) > 0 and opacity > 0)
            actor.GetProperty().SetOpacity(full * opacity)
        if not len(places):
            return
        turns = _turns(along)
        parts = [self._part(shape, shapes == shape, places, turns, sizes, colours) for shape in set(shapes)]
        starts = np.cumsum([0, *(len(part[0]) for part in parts[:-1])])
        points, normals, paint = (np.concatenate([part[k] for part in parts]) for k in range(3))
        corners = np.concatenate([part[3] + start for part, start in zip(parts, starts, strict=True)])
        self._data.SetPoints(points_of(points))
        self._data.SetPolys(cells_of(corners))
        self._data.GetPointData().SetNormals(to_vtk(normals.astype(np.float32), "Normals"))
        self._data.GetPointData().SetScalars(to_vtk(paint, "colour"))

    def close(self) -> None:
        """Let go of the actors."""
        for renderer, actor, _ in self._actors:
            release(renderer, actor)
        self._actors = []

    @staticmethod
    def _part(
        shape: int,
        chosen: NDArray[np.bool_],
        places: FloatArray,
        turns: FloatArray,
        sizes: FloatArray,
        colours: NDArray[np.uint8],
    ) -> tuple[Any, Any, Any, Any]:
        """Return points, normals, colours and triangles of all solids of one shape."""
        solid, size, turn = solid_mesh(shape), sizes[chosen][:, None], turns[chosen].transpose(0, 2, 1)
        points = (solid.points * size) @ turn + places[chosen][:, None]
        normals = solid.normals / size
        normals /= np.linalg.norm(normals, axis=2, keepdims=True)
        normals = normals @ turn
        n, k = points.shape[:2]
        triangles = solid.triangles[None] + k * np.arange(n)[:, None, None]
        paint = np.repeat(colours[chosen], k, axis=0)
        return points.reshape(-1, 3), normals.reshape(-1, 3), paint, triangles.reshape(-1, 3)


def _turns(along: FloatArray) -> FloatArray:
    """Return (N, 3, 3) rotations that bring x onto unit vectors (N, 3)."""
    aside = np.eye(3)[np.abs(along).argmin(axis=1)]
    second = np.cross(along, aside)
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    return np.stack([along, second, np.cross(along, second)], axis=2)


def _actor(data: vtkPolyData, renderer: vtkRenderer) -> vtkActor:
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.PickableOff()
    look = actor.GetProperty()
    look.BackfaceCullingOn()
    look.SetAmbient(0.5)
    look.SetDiffuse(0.6)
    look.SetSpecular(0.2)
    look.SetSpecularPower(30.0)
    actor.VisibilityOff()
    renderer.AddActor(actor)
    return actor
