"""A large mesh in chunks, each of which is drawn in a moment."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPlane, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkProperty, vtkRenderer

from gp_core.validation import FloatArray
from gp_labeler.imaging.surface import Surface
from gp_labeler.imaging.vtk_arrays import cells_of, points_of, to_numpy, to_vtk
from gp_labeler.scene.render_layers import release

__all__ = ["CHUNK_TRIANGLES", "MeshChunk", "chunks_of"]

CHUNK_TRIANGLES = 16_000
"""About 10 ms without a graphics card: input waits for one chunk at most."""

_SAMPLES = 200
_SPREAD = 4
"""A chunk whose corners are spread over more of the table of points, in times its size, gets its own."""


class MeshChunk:
    """Some triangles of a surface, which become an actor when they are drawn for the first time.

    Parameters
    ----------
    surface : Surface
        The whole.
    first, last : int
        Rows of triangles, the last not included.
    """

    def __init__(self, surface: Surface, first: int, last: int) -> None:
        self._surface, self._rows = surface, slice(first, last)
        self._actor: vtkActor | None = None
        sample = surface.triangles[first : last : max(1, (last - first) // _SAMPLES)]
        self.middle: FloatArray = surface.points[sample.ravel()].mean(axis=0, dtype=np.float64)

    def actor(self, renderer: vtkRenderer, look: vtkProperty, plane: vtkPlane | None) -> vtkActor:
        """Return what draws it, made and added to a renderer when it is first asked for."""
        if self._actor is None:
            mapper = vtkPolyDataMapper()
            mapper.SetInputData(self._mesh())
            mapper.ScalarVisibilityOff()
            mapper.SetStatic(True)  # the mesh never changes: spare a walk over it every frame
            self._actor = vtkActor()
            self._actor.SetMapper(mapper)
            self._actor.SetProperty(look)
            self._actor.PickableOff()
            self._actor.VisibilityOff()
            renderer.AddActor(self._actor)
        _clip(self._actor, plane)
        return self._actor

    def close(self, renderer: vtkRenderer) -> None:
        """Let go of the actor."""
        if self._actor is not None:
            release(renderer, self._actor)
            self._actor = None

    def _mesh(self) -> vtkPolyData:
        """Return the triangles with the stretch of points that they use; points and normals are shared."""
        triangles = self._surface.triangles[self._rows]
        normals = self._surface.mesh.GetPointData().GetNormals()
        if len(triangles) == self._surface.n_triangles:
            return self._surface.mesh
        low, high = int(triangles.min()), int(triangles.max()) + 1
        used: slice | NDArray[np.integer[Any]] = slice(low, high)
        number = triangles - low
        if high - low > _SPREAD * len(triangles):
            used, flat = np.unique(triangles, return_inverse=True)
            number = flat.reshape(-1, 3)
        mesh = vtkPolyData()
        mesh.SetPoints(points_of(self._surface.points[used]))
        mesh.SetPolys(cells_of(number))
        if normals is not None:
            mesh.GetPointData().SetNormals(to_vtk(to_numpy(normals)[used], share=True))
        return mesh


def chunks_of(surface: Surface, n_triangles: int = CHUNK_TRIANGLES) -> list[MeshChunk]:
    """Return a surface in chunks of about so many triangles, neighbours in the mesh together."""
    n = surface.n_triangles
    edges = np.linspace(0, n, max(1, round(n / n_triangles)) + 1).astype(int).tolist()
    return [MeshChunk(surface, first, last) for first, last in pairwise(edges) if last > first]


def _clip(actor: vtkActor, plane: vtkPlane | None) -> None:
    mapper = actor.GetMapper()
    planes = mapper.GetClippingPlanes()
    here = planes.GetItem(0) if planes is not None and planes.GetNumberOfItems() else None
    if here is not plane:
        mapper.RemoveAllClippingPlanes()
        if plane is not None:
            mapper.AddClippingPlane(plane)
