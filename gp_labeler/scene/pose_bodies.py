"""The translucent bodies of an estimate: 95 % ellipsoid, cone, and the coiled cochlea, moved by matrices."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
from vtkmodules.vtkFiltersSources import vtkConeSource, vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor

from gp_core.checks import FloatArray
from gp_core.landmarks.features import Side
from gp_labeler.imaging.vtk_arrays import cells_of, matrix_of, points_of
from gp_labeler.scene.coil import Tube, cochlea_tubes
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.ghosts import RADIUS_95
from gp_labeler.scene.pose_data import AXIS_MM, DrawnPose, PoseScene
from gp_labeler.scene.stage import Stage, release, solid_actor

__all__ = ["PoseBodies"]

_OPACITY = {"region": 0.25, "cone": 0.10, "duct": 0.22, "core": 0.18}
_PARTS = {"region": "region", "cone": "region", "duct": "cochlea", "core": "cochlea"}


class PoseBodies:
    """Draws the bodies of one estimate over the bone; made once, then only moved.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._meshes = {side: [_mesh(tube) for tube in cochlea_tubes(side)] for side in Side}
        shapes = {"region": _ball(), "cone": _cone(), "duct": vtkPolyData(), "core": vtkPolyData()}
        self._actors = {name: self._add(shape) for name, shape in shapes.items()}

    def show(self, pose: DrawnPose | None, scene: PoseScene) -> None:
        """Draw an estimate with what is shown of the scene, or nothing."""
        for name, actor in self._actors.items():
            actor.SetVisibility(pose is not None and scene.shows(_PARTS[name]) and scene.opacity > 0)
        if pose is None:
            return
        duct, core = self._meshes[pose.side]
        self._actors["duct"].GetMapper().SetInputDataObject(duct)
        self._actors["core"].GetMapper().SetInputDataObject(core)
        radius = pose.cone_radius
        places = {
            "region": _ellipsoid(pose),
            "cone": pose.T_scan_cochlea @ np.diag([AXIS_MM, radius, radius, 1.0]),
        }
        colour = rgb(self._stage.colours.states[pose.role])
        for name, actor in self._actors.items():
            actor.SetUserMatrix(matrix_of(places.get(name, pose.T_scan_cochlea)))
            actor.GetProperty().SetColor(*colour)
            actor.GetProperty().SetOpacity(_OPACITY[name] * scene.opacity)

    def close(self) -> None:
        """Let go of the actors."""
        for actor in self._actors.values():
            release(self._stage.overlay, actor)
        self._actors = {}

    def _add(self, shape: vtkPolyData) -> vtkActor:
        actor = solid_actor(shape, self._stage.colours.states["pose"])
        actor.VisibilityOff()
        actor.GetProperty().SetAmbient(0.3)
        actor.GetProperty().SetDiffuse(0.8)
        actor.GetProperty().BackfaceCullingOn()
        self._stage.overlay.AddActor(actor)
        return actor


def _mesh(tube: Tube) -> vtkPolyData:
    data = vtkPolyData()
    data.SetPoints(points_of(tube.points.copy()))
    data.SetPolys(cells_of(tube.triangles.copy()))
    normals = vtkPolyDataNormals()
    normals.SetInputData(data)
    normals.SplittingOff()
    normals.Update()
    mesh: vtkPolyData = normals.GetOutput()
    return mesh


def _ball() -> vtkPolyData:
    source = vtkSphereSource()
    source.SetRadius(1.0)
    source.SetThetaResolution(40)
    source.SetPhiResolution(24)
    source.Update()
    solid: vtkPolyData = source.GetOutput()
    return solid


def _cone() -> vtkPolyData:
    """Return the cone from its apex in the origin to a rim of radius 1 about x = 1."""
    source = vtkConeSource()
    source.SetResolution(48)
    source.SetCapping(False)
    source.SetCenter(0.5, 0.0, 0.0)
    source.SetDirection(-1.0, 0.0, 0.0)
    source.SetRadius(1.0)
    source.Update()
    solid: vtkPolyData = source.GetOutput()
    return solid


def _ellipsoid(pose: DrawnPose) -> FloatArray:
    """Place the unit ball as the 95 % ellipsoid of CO."""
    values, axes = np.linalg.eigh(pose.covariance[:3, :3])
    axes[:, 0] *= np.sign(np.linalg.det(axes))  # a mirrored ball would turn its faces inward
    matrix = np.eye(4)
    matrix[:3, :3] = RADIUS_95 * axes * np.sqrt(values.clip(1e-12))
    matrix[:3, 3] = pose.origin
    return matrix
