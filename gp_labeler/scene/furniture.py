"""What tells size and direction in the 3D view: the scale bar and the orientation cube."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkRenderingAnnotation import vtkAnnotatedCubeActor
from vtkmodules.vtkRenderingCore import vtkRenderer

from gp_labeler.imaging.vtk_arrays import triple
from gp_labeler.scene.camera import SceneCamera, Viewpoint
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.labels import LABEL_PIXELS
from gp_labeler.scene.lines2d import PixelLines
from gp_labeler.scene.slice_view import scale_bar_length
from gp_labeler.scene.sprites import SpriteSheet, Text
from gp_labeler.scene.stage import Stage

__all__ = ["OrientationCube", "ScaleBar"]

_CUBE_PIXELS = 76
_MARGIN_PIXELS = 14
_BAR_PIXELS = 110
_CUBE_SHARE, _BAR_SHARE = 0.35, 0.45
"""Of the width of a small view: there neither lies on the other."""


class ScaleBar:
    """A bar of a round number of millimetres at the lower right.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self.visible = True
        self._written: tuple[object, ...] = ()
        self._drawn: tuple[object, ...] = ()
        self._line = PixelLines(stage.overlay)
        self._sheet = SpriteSheet(stage.overlay)

    def refresh(self, view: Viewpoint, camera: SceneCamera) -> None:
        """Bring it up to date with the zoom; in perspective it is true at the middle of the view."""
        if not self.visible:
            self._line.draw([], [], [])
            self._sheet.draw([], np.empty((0, 2)))
            self._drawn = ()
            return
        colours, scale = self._stage.colours, self._stage.scale
        height = LABEL_PIXELS * scale * self._stage.text_scale
        now = (view.matrix.tobytes(), view.size, scale, height, colours)
        if now == self._drawn:
            return
        self._drawn = now
        longest = min(_BAR_PIXELS * scale, _BAR_SHARE * view.size[0])
        length, pixels = scale_bar_length(float(view.pixel_sizes(camera.focus[None])[0]), longest)
        wanted = (length, height, colours)
        if wanted != self._written:
            self._sheet.write([Text(f"{length:g} mm", colours.text, bold=False)], height, colours.halo)
            self._written = wanted
        right, bottom = np.array(view.size) - (_MARGIN_PIXELS + 2) * scale
        left = right - pixels
        bar = np.array([[left, bottom], [right, bottom]])
        self._line.draw(
            [np.array([[left - 1, bottom], [right + 1, bottom]]), bar],
            [colours.halo, colours.text],
            [4.5 * scale, 2.5 * scale],
        )
        width, height = self._sheet.sizes[0]
        begin = min((left + right - width) / 2, view.size[0] - width)
        self._sheet.draw([0], [[begin, bottom - height - 2 * scale]])

    def close(self) -> None:
        """Let go of the bar."""
        self._line.close()
        self._sheet.close()


class OrientationCube:
    """A cube with the letters R L A P S I, at the lower left, turning with the camera.

    Parameters
    ----------
    stage : Stage
        Its renderer joins the same window.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self.visible = True
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
        """Take the colours of the stage's theme."""
        colours = self._stage.colours
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
        scale = self._stage.scale
        side, margin = min(_CUBE_PIXELS * scale, _CUBE_SHARE * width), _MARGIN_PIXELS * scale / 2
        self.renderer.SetViewport(
            margin / width,
            margin / height,
            min(1.0, (margin + side) / width),
            min(1.0, (margin + side) / height),
        )
        eye = self.renderer.GetActiveCamera()
        eye.SetFocalPoint(0, 0, 0)
        eye.SetPosition(triple(-4 * camera.direction))
        eye.SetViewUp(triple(camera.up))
        eye.SetParallelScale(0.95)
        self.renderer.ResetCameraClippingRange()

    def close(self) -> None:
        """Let go of the cube."""
        self.renderer.RemoveAllViewProps()
        window = self.renderer.GetRenderWindow()
        if window is not None:
            self._cube.ReleaseGraphicsResources(window)
            window.RemoveRenderer(self.renderer)
