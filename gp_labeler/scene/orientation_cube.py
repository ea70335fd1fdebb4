"""The cube that tells directions in the 3D view."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkRenderingAnnotation import vtkAnnotatedCubeActor
from vtkmodules.vtkRenderingCore import vtkRenderer

from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import triple
from gp_labeler.scene.camera import SceneCamera, Viewpoint
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.render_layers import RenderLayers

__all__ = ["OrientationCube"]

_CUBE_PIXELS = 76
_MARGIN_PIXELS = 14
_CUBE_SHARE = 0.35
"""Of the width of a small view: there it leaves room for the scale bar."""


class OrientationCube:
    """A cube with the letters R L A P S I, at the lower left, turning with the camera.

    Attributes
    ----------
    axes : (3, 3) float array
        Columns: left, posterior and superior, in the scan.

    Parameters
    ----------
    layers : RenderLayers
        Its renderer joins the same window.
    """

    def __init__(self, layers: RenderLayers) -> None:
        self._layers = layers
        self.visible = True
        self.axes: FloatArray = np.eye(3)
        self.renderer = vtkRenderer()
        self.renderer.SetLayer(1)
        self.renderer.InteractiveOff()
        self.renderer.SetBackgroundAlpha(0.0)
        self._cube = vtkAnnotatedCubeActor()
        self._cube.SetXPlusFaceText("L")
        self._cube.SetXMinusFaceText("R")
        self._cube.SetYPlusFaceText("P")
        self._cube.SetYMinusFaceText("A")
        self._cube.SetZPlusFaceText("S")
        self._cube.SetZMinusFaceText("I")
        self._cube.SetZFaceTextRotation(90)
        self._cube.SetFaceTextScale(0.62)
        self._cube.GetTextEdgesProperty().SetLineWidth(1)
        self._cube.PickableOff()
        self.renderer.AddActor(self._cube)
        self.renderer.GetActiveCamera().ParallelProjectionOn()
        self.recolour()

    def recolour(self) -> None:
        """Take the colours of the theme."""
        colours = self._layers.colours
        face = self._cube.GetCubeProperty()
        face.SetColor(rgb(colours.bone))
        face.SetAmbient(0.35)
        face.SetDiffuse(0.65)
        self._cube.GetTextEdgesProperty().SetColor(rgb("#2A3138"))
        for faces in (
            (self._cube.GetXPlusFaceProperty(), self._cube.GetXMinusFaceProperty()),
            (self._cube.GetYPlusFaceProperty(), self._cube.GetYMinusFaceProperty()),
            (self._cube.GetZPlusFaceProperty(), self._cube.GetZMinusFaceProperty()),
        ):
            for letter in faces:
                letter.SetColor(rgb("#2A3138"))
                letter.SetInterpolationToFlat()

    def refresh(self, view: Viewpoint, camera: SceneCamera) -> None:
        """Turn with the camera, and keep the size in pixels."""
        width, height = view.size
        scale = self._layers.scale
        side, margin = min(_CUBE_PIXELS * scale, _CUBE_SHARE * width), _MARGIN_PIXELS * scale / 2
        self.renderer.SetViewport(
            margin / width,
            margin / height,
            min(1.0, (margin + side) / width),
            min(1.0, (margin + side) / height),
        )
        eye = self.renderer.GetActiveCamera()
        eye.SetFocalPoint(0, 0, 0)
        eye.SetPosition(
            triple(-4 * camera.direction @ self.axes)
        )  # the cube stands still, the eye goes round
        eye.SetViewUp(triple(camera.up @ self.axes))
        eye.SetParallelScale(0.95)
        self.renderer.ResetCameraClippingRange()

    def close(self) -> None:
        """Let go of the cube."""
        self.renderer.RemoveAllViewProps()
        window = self.renderer.GetRenderWindow()
        if window is not None:
            self._cube.ReleaseGraphicsResources(window)
            window.RemoveRenderer(self.renderer)
