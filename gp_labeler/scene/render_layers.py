"""What every adapter draws on: layers that share a camera, and the theme."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer

from gp_labeler.scene.colours import DARK, SceneColours, rgb

__all__ = ["RenderLayers", "release", "solid_actor"]


@dataclass
class RenderLayers:
    """The renderers of one scene.

    Parameters
    ----------
    bone : vtkRenderer
        Bone alone: drawn when it or the camera changes, and kept (`BoneFrameCache`).
    base : vtkRenderer
        What bone may hide: drawn over it, against its depths.
    overlay : vtkRenderer
        What is seen through bone: drawn over the base, with the same camera.
    colours : SceneColours
        Theme.
    scale : float
        Device pixels per logical pixel (high-DPI), by which lines grow.
    """

    bone: vtkRenderer
    base: vtkRenderer
    overlay: vtkRenderer
    colours: SceneColours = DARK
    scale: float = 1.0


def solid_actor(data: Any, colour: str, opacity: float = 1.0) -> vtkActor:
    """Make an actor of one colour that no picker finds."""
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.ScalarVisibilityOff()
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.PickableOff()
    actor.GetProperty().SetColor(*rgb(colour))
    actor.GetProperty().SetOpacity(opacity)
    return actor


def release(renderer: vtkRenderer, prop: Any) -> None:
    """Take a prop out of a renderer, with what it holds on the graphics card."""
    renderer.RemoveViewProp(prop)
    window = renderer.GetRenderWindow()
    if window is not None:
        prop.ReleaseGraphicsResources(window)
