"""An estimated cochlea: its origin, its axis, and where both are with 95 %."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkFiltersSources import vtkConeSource, vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor

from gp_core.checks import FloatArray
from gp_labeler.imaging.vtk_arrays import triple
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.ghosts import Ghost, GhostActor
from gp_labeler.scene.labels import Label
from gp_labeler.scene.pose_data import DrawnPose, PoseScene
from gp_labeler.scene.segments import Segment, SegmentActor
from gp_labeler.scene.stage import Stage, release, solid_actor

__all__ = ["DrawnPose", "PoseActor", "PoseScene"]

_HEAD_MM = (0.9, 0.32)
_BALL_MM = 0.35
_CONE_OPACITY = 0.16
_CORNERS = 48


class PoseActor:
    """Draws estimated cochleae: what bone hides shows through it faintly.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._poses: tuple[DrawnPose, ...] = ()
        self._solids: list[vtkActor] = []
        self._shafts = SegmentActor(stage)
        self._balls_95 = GhostActor(stage, state="pose")

    @property
    def poses(self) -> tuple[DrawnPose, ...]:
        """What is drawn."""
        return self._poses

    def show(self, scene: PoseScene) -> None:
        """Draw this in place of what was before."""
        self._drop()
        poses = scene.poses
        self._poses, colour = poses, self._stage.colours.states["pose"]
        self._shafts.show([Segment(pose.tail, pose.tip, colour, 3.0) for pose in poses])
        self._balls_95.show(
            [Ghost(pose.key, pose.origin, pose.covariance[:3, :3], pose.label, active=True) for pose in poses]
        )
        for pose in poses:
            for solid, opacity in (
                (_ball(pose), 1.0),
                (_head(pose), 1.0),
                (_cone(pose.origin, pose.tip, pose.cone_radius), _CONE_OPACITY),
            ):
                actor = solid_actor(solid, colour, opacity)
                self._stage.overlay.AddActor(actor)
                self._solids.append(actor)

    def refresh(self, view: Viewpoint) -> list[Label]:
        """Bring outlines up to date with the camera, and return the labels to draw."""
        return self._balls_95.refresh(view)

    def close(self) -> None:
        """Let go of everything drawn."""
        self._drop()
        self._poses = ()
        self._shafts.close()
        self._balls_95.close()

    def _drop(self) -> None:
        for actor in self._solids:
            release(self._stage.overlay, actor)
        self._solids = []


def _ball(pose: DrawnPose) -> object:
    source = vtkSphereSource()
    source.SetCenter(*triple(pose.origin))
    source.SetRadius(_BALL_MM)
    source.SetThetaResolution(24)
    source.SetPhiResolution(16)
    source.Update()
    return source.GetOutput()


def _head(pose: DrawnPose) -> object:
    length, radius = _HEAD_MM
    return _cone(pose.tip, pose.tip - length * pose.axis, radius)


def _cone(apex: FloatArray, base: FloatArray, radius: float) -> object:
    """Return a cone from its apex to the middle of its base."""
    source = vtkConeSource()
    source.SetResolution(_CORNERS)
    source.SetHeight(float(np.linalg.norm(apex - base)))
    source.SetRadius(radius)
    source.SetCenter(*triple((apex + base) / 2))
    source.SetDirection(*triple(apex - base))
    source.SetCapping(False)
    source.Update()
    return source.GetOutput()
