"""The translucent bodies of an estimate: 95 % ellipsoid, cone, and the coiled cochlea, moved by matrices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from vtkmodules.vtkRenderingCore import vtkActor

from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray
from gp_labeler.imaging.mean_cochlea import cochlea_tubes
from gp_labeler.imaging.vtk_arrays import matrix_of
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.ghosts import RADIUS_95
from gp_labeler.scene.pose_data import AXIS_MM, DrawnPose, PoseScene
from gp_labeler.scene.render_layers import RenderLayers, release, solid_actor

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["PoseBodies"]

_OPACITY = {"region": 0.25, "cone": 0.10, "duct": 0.22, "core": 0.18}
_PARTS = {"region": "region", "cone": "region", "duct": "cochlea", "core": "cochlea"}


class PoseBodies:
    """Draws the bodies of one estimate over the bone; made once, then only moved.

    Parameters
    ----------
    layers : RenderLayers
        Where to draw.
    """

    def __init__(self, layers: RenderLayers) -> None:
        import pyvista as pv  # takes 0.6 s: not before there is an estimate to draw

        self._layers = layers
        duct, core = cochlea_tubes(Side.LEFT)
        ball = pv.Sphere(radius=1.0, theta_resolution=40, phi_resolution=24)
        cone = pv.Cone(  # from its apex in the origin to a rim of radius 1 about x = 1
            center=(0.5, 0.0, 0.0), direction=(-1.0, 0.0, 0.0), radius=1.0, resolution=48, capping=False
        )
        shapes = {"region": ball, "cone": cone, "duct": duct, "core": core}
        self._actors = {name: self._add(shape) for name, shape in shapes.items()}

    def show(self, pose: DrawnPose | None, scene: PoseScene) -> None:
        """Draw an estimate with what is shown of the scene, or nothing."""
        for name, actor in self._actors.items():
            actor.SetVisibility(pose is not None and scene.shows(_PARTS[name]) and scene.opacity > 0)
        if pose is None:
            return
        duct, core = cochlea_tubes(pose.side)
        self._actors["duct"].GetMapper().SetInputDataObject(duct)
        self._actors["core"].GetMapper().SetInputDataObject(core)
        radius = pose.cone_radius
        places = {
            "region": _ellipsoid(pose),
            "cone": pose.T_scan_cochlea @ np.diag([AXIS_MM, radius, radius, 1.0]),
        }
        colour = rgb(self._layers.colours.states[pose.role])
        for name, actor in self._actors.items():
            actor.SetUserMatrix(matrix_of(places.get(name, pose.T_scan_cochlea)))
            actor.GetProperty().SetColor(*colour)
            actor.GetProperty().SetOpacity(_OPACITY[name] * scene.opacity)

    def close(self) -> None:
        """Let go of the actors."""
        for actor in self._actors.values():
            release(self._layers.overlay, actor)
        self._actors = {}

    def _add(self, shape: pv.PolyData) -> vtkActor:
        actor = solid_actor(shape, self._layers.colours.states["pose"])
        actor.VisibilityOff()
        actor.GetProperty().SetAmbient(0.3)
        actor.GetProperty().SetDiffuse(0.8)
        actor.GetProperty().BackfaceCullingOn()
        self._layers.overlay.AddActor(actor)
        return actor


def _ellipsoid(pose: DrawnPose) -> FloatArray:
    """Place the unit ball as the 95 % ellipsoid of CO."""
    values, axes = np.linalg.eigh(pose.covariance[:3, :3])
    axes[:, 0] *= np.sign(np.linalg.det(axes))  # a mirrored ball would turn its faces inward
    matrix = np.eye(4)
    matrix[:3, :3] = RADIUS_95 * axes * np.sqrt(values.clip(1e-12))
    matrix[:3, 3] = pose.origin
    return matrix
