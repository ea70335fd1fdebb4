"""Camera positions that show an estimated cochlea: along its axis, and through the round window."""

from __future__ import annotations

from dataclasses import dataclass

from gp_core.validation import FloatArray
from gp_labeler.scene.camera import SceneCamera
from gp_labeler.scene.pose_data import DrawnPose

__all__ = ["CameraPlacement", "along_axis", "place_camera", "through_round_window"]

_ACROSS_MM = 12.0


@dataclass(frozen=True, eq=False)
class CameraPlacement:
    """Where a camera looks.

    Parameters
    ----------
    direction : (3,) float array
        From the eye into the scene, scan frame.
    up : (3,) float array
        What is up on the screen.
    focus : (3,) float array
        Scan position in the middle of the view, mm.
    across_mm : float
        How much is seen from top to bottom.
    """

    direction: FloatArray
    up: FloatArray
    focus: FloatArray
    across_mm: float = _ACROSS_MM


def along_axis(pose: DrawnPose) -> CameraPlacement:
    """Look at the apex from outside, along the modiolar axis; CO is in the middle, the round window up."""
    return CameraPlacement(-pose.axis, pose.towards_window, pose.origin)


def through_round_window(pose: DrawnPose) -> CameraPlacement:
    """Look from outside through the middle of the round window to CO; the top of the head is up."""
    return CameraPlacement(-pose.towards_window, pose.up, pose.origin)


def place_camera(camera: SceneCamera, placement: CameraPlacement) -> None:
    """Move a camera there; the scene is to be drawn again."""
    camera.focus_on(placement.focus, across_mm=placement.across_mm)
    camera.look(placement.direction, placement.up)
