"""Many small solids as one actor a layer, each with its own place, direction, size and colour."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersSources import (
    vtkConeSource,
    vtkCubeSource,
    vtkCylinderSource,
    vtkPlatonicSolidSource,
    vtkSphereSource,
)
from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper, vtkRenderer

from gp_core.checks import FloatArray
from gp_labeler.imaging.vtk_arrays import points_of, to_numpy, to_vtk
from gp_labeler.scene.stage import Stage, release

__all__ = ["SolidActor"]


class SolidActor:
    """Draws solids: full where they are seen, fainter where bone hides them.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    through : float
        Opacity of what bone hides.
    """

    def __init__(self, stage: Stage, through: float = 0.5) -> None:
        self._data = vtkPolyData()
        self._layers = [
            (renderer, _actor(self._data, renderer), opacity)
            for renderer, opacity in ((stage.base, 1.0), (stage.overlay, through))
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
            Which solids, in the order of `pose_rows`.
        opacity : float
            From 0 to 1.
        """
        for _, actor, full in self._layers:
            actor.SetVisibility(len(places) > 0 and opacity > 0)
            actor.GetProperty().SetOpacity(full * opacity)
        if not len(places):
            return
        self._data.SetPoints(points_of(places))
        data = self._data.GetPointData()
        for name, values in (("along", along), ("size", sizes), ("colour", colours), ("shape", shapes)):
            data.AddArray(to_vtk(values, name))

    def close(self) -> None:
        """Let go of the actors."""
        for renderer, actor, _ in self._layers:
            release(renderer, actor)
        self._layers = []


def _actor(data: vtkPolyData, renderer: vtkRenderer) -> vtkActor:
    mapper = vtkGlyph3DMapper()
    mapper.SetInputData(data)
    for n, solid in enumerate(_solids()):
        mapper.SetSourceData(n, solid)
    mapper.SourceIndexingOn()
    mapper.SetSourceIndexArray("shape")
    mapper.SetScaleArray("size")
    mapper.SetScaleModeToScaleByVectorComponents()
    mapper.SetScaleFactor(1.0)
    mapper.SetOrientationArray("along")
    mapper.SetOrientationModeToDirection()
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray("colour")
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.PickableOff()
    look = actor.GetProperty()
    look.SetAmbient(0.35)
    look.SetDiffuse(0.7)
    look.SetSpecular(0.2)
    look.SetSpecularPower(30.0)
    actor.VisibilityOff()
    renderer.AddActor(actor)
    return actor


def _solids() -> list[vtkPolyData]:
    """Solids of length and thickness 1 along x, in the order of `pose_rows`."""
    rod, head, ball = vtkCylinderSource(), vtkConeSource(), vtkSphereSource()
    rod.SetResolution(14)
    rod.SetRadius(0.5)
    head.SetResolution(24)
    head.SetRadius(0.5)
    head.SetHeight(1.0)
    ball.SetRadius(0.5)
    ball.SetThetaResolution(24)
    ball.SetPhiResolution(16)
    diamond = vtkPlatonicSolidSource()
    diamond.SetSolidTypeToOctahedron()
    return [
        _turned(rod, np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), 0.5),  # y along x
        _turned(head, np.eye(3), -0.5),
        _turned(ball, np.eye(3)),
        _turned(diamond, 0.5 * np.eye(3)),
        _turned(vtkCubeSource(), np.eye(3)),
    ]


def _turned(source: Any, turn: FloatArray, shift: float = 0.0) -> vtkPolyData:
    """Turn a solid, and shift it along x."""
    source.Update()
    solid: vtkPolyData = source.GetOutput()
    flat = to_numpy(solid.GetPoints().GetData())
    solid.SetPoints(points_of(flat @ turn.T + np.array([shift, 0.0, 0.0])))
    normals = solid.GetPointData().GetNormals()
    if normals is not None:
        turned = to_vtk((to_numpy(normals) @ turn.T).astype(np.float32), "Normals")
        solid.GetPointData().SetNormals(turned)
    solid.GetCellData().Initialize()
    return solid
