"""Landmarks in the 3D view: solid where they are seen, faint where bone hides them, each with its label."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersSources import vtkPlatonicSolidSource, vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper, vtkRenderer

from gp_core.checks import FloatArray
from gp_labeler.imaging.vtk_arrays import points_of, to_vtk
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.labels import Label
from gp_labeler.scene.lines2d import PixelLines
from gp_labeler.scene.sprites import Text
from gp_labeler.scene.stage import Stage, release

__all__ = ["GlyphSize", "Mark", "MarkActor"]

_SHAPES = {"computed": 1, "doubtful": 2}
"""A state shows by shape as well as by colour: ball, octahedron, tetrahedron."""

_FAINT = 0.30
_ACTIVE_GROWS = 1.35
_RING_PIXELS = 5.0


@dataclass(frozen=True)
class GlyphSize:
    """How large marks are drawn.

    Parameters
    ----------
    diameter : float
        In mm, or in logical pixels.
    unit : str
        ``mm`` or ``px``.
    """

    diameter: float = 10.0
    unit: str = "px"


@dataclass(frozen=True, eq=False)
class Mark:
    """A landmark to draw.

    Parameters
    ----------
    key : str
        Its name among all marks, such as ``"L:CA"``.
    position : (3,) float array
        Scan frame, mm.
    label : str
        What stands beside it; empty for none.
    state : str
        ``placed``, ``computed``, ``doubtful``, ``other`` (the other side) or any other state of the theme.
    active : bool
        Whether it is the one being worked on: larger, and its label is never left out.
    """

    key: str
    position: FloatArray
    label: str = ""
    state: str = "placed"
    active: bool = False


class MarkActor:
    """Draws landmarks.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._marks: tuple[Mark, ...] = ()
        self.size = GlyphSize()
        self.show_hidden = True
        self._solid = _GlyphLayer(stage.base, 1.0)
        self._faint = _GlyphLayer(stage.overlay, _FAINT)
        self._rings = PixelLines(stage.overlay)

    def show(self, marks: Sequence[Mark]) -> None:
        """Draw these marks in place of those before."""
        self._marks = tuple(mark for mark in marks if np.isfinite(mark.position).all())

    @property
    def marks(self) -> tuple[Mark, ...]:
        """What is drawn."""
        return self._marks

    @property
    def positions(self) -> FloatArray:
        """(N, 3) scan positions of the marks, mm."""
        return np.array([mark.position for mark in self._marks], dtype=np.float64).reshape(-1, 3)

    def diameters(self, view: Viewpoint) -> FloatArray:
        """Return how large the marks are now, (N,) mm."""
        if self.size.unit == "mm":
            sizes = np.full(len(self._marks), self.size.diameter)
        else:
            sizes = self.size.diameter * self._stage.scale * view.pixel_sizes(self.positions)
        grown: FloatArray = sizes * [_ACTIVE_GROWS if mark.active else 1.0 for mark in self._marks]
        return grown

    def refresh(
        self, view: Viewpoint, hidden: NDArray[np.bool_], *, bone_opacity: float = 1.0
    ) -> list[Label]:
        """Bring sizes and faintness up to date with the camera, and return the labels to draw.

        Parameters
        ----------
        view : Viewpoint
            The projection of this frame.
        hidden : (N,) bool array
            Which marks lie behind bone.
        bone_opacity : float
            From 0 to 1; the fainter bone is, the clearer what lies behind it.
        """
        sizes, pixels = self.diameters(view), view.display(self.positions)[:, :2]
        colours = np.array([rgb(self._colour(mark)) for mark in self._marks]).reshape(-1, 3)
        shapes = np.array([_SHAPES.get(mark.state, 0) for mark in self._marks], dtype=int)
        seen = ~hidden | (bone_opacity == 1)  # solid bone hides by its depths, be it a part of a ball only
        self._solid.set(self.positions[seen], sizes[seen], colours[seen], shapes[seen])
        faint = hidden & self.show_hidden
        self._faint.fade(1.0 - (1.0 - _FAINT) * bone_opacity)
        self._faint.set(self.positions[faint], sizes[faint], colours[faint], shapes[faint])
        radii = 0.5 * sizes / view.pixel_sizes(self.positions)
        self._ring_active(pixels, radii)
        return [
            self._label(mark, pixel, float(radius), bool(behind))
            for mark, pixel, radius, behind in zip(self._marks, pixels, radii, hidden, strict=True)
            if mark.label and (self.show_hidden or not behind or mark.active)
        ]

    def _colour(self, mark: Mark) -> str:
        colours = self._stage.colours
        return colours.states.get(mark.state, colours.text)

    def _label(self, mark: Mark, pixel: FloatArray, radius: float, hidden: bool) -> Label:
        gap = (
            max(radius, 4.0)
            + 2.0 * self._stage.scale
            + (_RING_PIXELS * self._stage.scale if mark.active else 0.0)
        )
        rank = 2.0 if mark.active else -float(hidden)
        return Label(Text(mark.label, self._colour(mark)), pixel, gap, rank, hidden and not mark.active)

    def _ring_active(self, pixels: FloatArray, radii: FloatArray) -> None:
        scale, turn = self._stage.scale, np.linspace(0, 2 * np.pi, 49)
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        rings = [
            pixel + (radius + _RING_PIXELS * scale) * circle
            for mark, pixel, radius in zip(self._marks, pixels, radii, strict=True)
            if mark.active
        ]
        self._rings.draw(
            rings, [self._stage.colours.states["active"]] * len(rings), [2.0 * scale] * len(rings)
        )

    def close(self) -> None:
        """Let go of the glyphs."""
        self._marks = ()
        self._solid.close()
        self._faint.close()
        self._rings.close()


class _GlyphLayer:
    """Balls, octahedra and tetrahedra in one renderer."""

    def __init__(self, renderer: vtkRenderer, opacity: float) -> None:
        self._renderer = renderer
        self._points = vtkPolyData()
        mapper = vtkGlyph3DMapper()
        mapper.SetInputData(self._points)
        for n, solid in enumerate(_solids()):
            mapper.SetSourceData(n, solid)
        mapper.SourceIndexingOn()
        mapper.SetSourceIndexArray("shape")
        mapper.SetScaleArray("size")
        mapper.SetScaleModeToScaleByMagnitude()
        mapper.SetScaleFactor(1.0)
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray("colour")
        self._actor = vtkActor()
        self._actor.SetMapper(mapper)
        self._actor.PickableOff()
        self._actor.GetProperty().SetOpacity(opacity)
        self._actor.GetProperty().SetAmbient(0.25)
        self._actor.GetProperty().SetDiffuse(0.75)
        self._actor.GetProperty().SetSpecular(0.3)
        self._actor.GetProperty().SetSpecularPower(30.0)
        self._actor.VisibilityOff()
        renderer.AddActor(self._actor)

    def set(
        self, points: FloatArray, sizes: FloatArray, colours: FloatArray, shapes: NDArray[np.int_]
    ) -> None:
        self._actor.SetVisibility(len(points) > 0)
        if not len(points):
            return
        self._points.SetPoints(points_of(points))
        data = self._points.GetPointData()
        data.AddArray(to_vtk(sizes, "size"))
        data.AddArray(to_vtk(shapes, "shape"))
        data.AddArray(to_vtk((colours * 255).astype(np.uint8), "colour"))

    def fade(self, opacity: float) -> None:
        self._actor.GetProperty().SetOpacity(opacity)

    def close(self) -> None:
        release(self._renderer, self._actor)


def _solids() -> list[vtkPolyData]:
    """Solids of diameter 1."""
    ball = vtkSphereSource()
    ball.SetRadius(0.5)
    ball.SetThetaResolution(24)
    ball.SetPhiResolution(16)
    ball.Update()
    octahedron, tetrahedron = vtkPlatonicSolidSource(), vtkPlatonicSolidSource()
    octahedron.SetSolidTypeToOctahedron()
    tetrahedron.SetSolidTypeToTetrahedron()
    return [ball.GetOutput(), *(_shrunk(source) for source in (octahedron, tetrahedron))]


def _shrunk(source: vtkPlatonicSolidSource) -> vtkPolyData:
    """Scale a solid to a circumscribed diameter a little above 1, so that it looks as large as the ball."""
    source.Update()
    solid: vtkPolyData = source.GetOutput()
    points = solid.GetPoints()
    for n in range(points.GetNumberOfPoints()):
        corner = np.array(points.GetPoint(n))
        points.SetPoint(n, 0.62 * corner / np.linalg.norm(corner))
    solid.GetCellData().Initialize()
    return solid
