"""What is painted over a frame of the 3D view: landmarks, outlines, names, scale bar, crosshair, pointer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from qtpy.QtCore import QRectF, Qt
from qtpy.QtGui import QColor, QFontMetricsF, QPainter, QPen, QPolygonF
from qtpy.QtWidgets import QWidget

from gp_core.validation import FloatArray
from gp_labeler.imaging.anatomical_frame import SCAN_FRAME, AnatomicalFrame
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.models.view import Cut, ViewModel
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.colours import DARK, SceneColours
from gp_labeler.scene.ghosts import GhostEllipsoid, outline_in
from gp_labeler.scene.measurements import DrawnMeasurement
from gp_labeler.scene.pose_data import PoseScene
from gp_labeler.scene.pose_names import written_in
from gp_labeler.scene.pose_outlines import outlines_of
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.views.fonts import TEXT, font_of
from gp_labeler.views.mouse import painted
from gp_labeler.views.painting.marks import PlacedMark, paint_mark, place_marks, tags_of
from gp_labeler.views.painting.measurement_strokes import (
    Strokes,
    paint_strokes,
    strokes_in_scene,
    tags_of_strokes,
)
from gp_labeler.views.painting.name_tags import NameTag, PlacedWord, paint_words, place_names, pose_tags
from gp_labeler.views.painting.qt_paths import polygon
from gp_labeler.views.painting.scale_bar import paint_scale_bar
from gp_labeler.views.theme import theme_of

__all__ = ["SceneOverlay", "cut_text", "paint_crosshair", "paint_cut", "paint_pointer"]

_GAP_MM, _ARM_MM = 0.8, 4.0
_ALONG = float(np.cos(np.radians(1.0)))
_CHIP_ROOM = 26
"""Beside words on a card: a chip before them, and some air, logical pixels."""

_BAR_PIXELS, _BAR_SHARE = 110.0, 0.45
"""Of the width of a small view: there the scale bar leaves room for the cube."""

_WORDS = {"R": "right", "L": "left", "A": "anterior", "P": "posterior", "S": "superior", "I": "inferior"}


class _Line(NamedTuple):
    points: QPolygonF
    colour: str
    width: float
    opacity: float


class SceneOverlay:
    """Landmarks, outlines, names and scale bar of a 3D scene: placed once for a frame, then painted with it.

    Attributes
    ----------
    names_visible, scale_bar_visible : bool
        What is painted.
    measurements : sequence of DrawnMeasurement
        Rulers and angles to place with the next frame.
    """

    def __init__(self) -> None:
        self.names_visible = self.scale_bar_visible = True
        self._colours = DARK
        self._ratio, self._text, self._mm_per_pixel = 1.0, float(TEXT), 1.0
        self._size: tuple[int, int] | None = None  # before anything is placed
        self._marks: list[PlacedMark] = []
        self.measurements: Sequence[DrawnMeasurement] = ()
        self._strokes: list[Strokes] = []
        self._lines: list[_Line] = []
        self._words: list[PlacedWord] = []

    def place(self, scene: Scene3D, colours: SceneColours, text: float = TEXT) -> None:
        """Find where everything lies in the frame that the scene shows now.

        Parameters
        ----------
        scene : Scene3D
        colours : SceneColours
        text : float
            Size of the letters, logical pixels.
        """
        view, ratio, pose = scene.camera.viewpoint(), scene.scale, scene.pose.scene
        self._colours, self._ratio, self._text, self._size = colours, ratio, text, view.size
        self._mm_per_pixel = float(view.pixel_sizes(scene.camera.focus[None])[0])  # true at the middle
        hidden = scene.hidden(scene.marks.positions)
        self._marks = place_marks(scene.marks, view, hidden, ratio=ratio, bone_opacity=scene.bone.opacity)
        rings = [outline_in(view, ghost.mean, ghost.covariance) for ghost in scene.ghosts.ghosts]
        self._lines = self._outlines(scene.ghosts.ghosts, rings) + self._pose_lines(pose, view)
        self._strokes = [strokes_in_scene(each, view, scene) for each in self.measurements]
        tags: list[NameTag] = []
        if self.names_visible:
            tags = tags_of_strokes(self._strokes, colours)
            tags += tags_of(self._marks, colours, ratio) + _ghost_tags(scene.ghosts.ghosts, rings, colours)
            written = written_in(pose)
            tags += pose_tags(written, view.display(written.places)[:, :2] + 0.5, colours)
        self._words = place_names(tags, view.size, ratio=ratio, text=text, halo=colours.halo)

    @property
    def text_size(self) -> float:
        """Size of the letters, logical pixels."""
        return self._text

    @property
    def names(self) -> list[str]:
        """What is written, beside the scale bar."""
        return [word.text for word in self._words]

    def paint(self, painter: QPainter) -> None:
        """Paint everything where it was placed, in device pixels."""
        if self._size is None:
            return
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for line in self._lines:
            painter.setOpacity(line.opacity)
            painter.setPen(QPen(QColor(line.colour), line.width))
            painter.drawPolyline(line.points)
        paint_strokes(painter, self._strokes, self._colours, self._ratio)
        for mark, pixel, radius, opacity, _ in self._marks:
            paint_mark(
                painter, mark, pixel, radius, self._colours, ratio=self._ratio, opacity=opacity, lit=True
            )
        paint_words(painter, self._words)
        if self.scale_bar_visible:
            paint_scale_bar(
                painter,
                self._mm_per_pixel,
                self._size,
                self._colours,
                ratio=self._ratio,
                text=self._text,
                longest=_BAR_PIXELS,
                share=_BAR_SHARE,
            )

    def paint_moving(self, painter: QPainter, scene: Scene3D, moving: Sequence[DrawnMeasurement]) -> None:
        """Paint rulers and angles that follow the pointer over the last frame, in logical pixels."""
        if not moving or self._size is None:
            return
        view, ratio = scene.camera.viewpoint(), self._ratio
        strokes = [strokes_in_scene(each, view, None) for each in moving]
        painter.save()
        painter.scale(1 / ratio, 1 / ratio)
        paint_strokes(painter, strokes, self._colours, ratio)
        tags = tags_of_strokes(strokes, self._colours)
        paint_words(
            painter, place_names(tags, view.size, ratio=ratio, text=self._text, halo=self._colours.halo)
        )
        painter.restore()

    def _outlines(self, ghosts: Sequence[GhostEllipsoid], rings: Sequence[FloatArray]) -> list[_Line]:
        colour = self._colours.states["ghost"]
        return [
            _Line(polygon(ring + 0.5), colour, (2.5 if ghost.active else 1.2) * self._ratio, 1.0)
            for ghost, ring in zip(ghosts, rings, strict=True)
        ]

    def _pose_lines(self, pose: PoseScene, view: Viewpoint) -> list[_Line]:
        colours = {"halo": self._colours.halo, **self._colours.states}
        return [
            _Line(polygon(line.pixels + 0.5), colours[line.role], line.width * self._ratio, pose.opacity)
            for line in outlines_of(pose, view, self._ratio)
        ]


def _ghost_tags(
    ghosts: Sequence[GhostEllipsoid], rings: Sequence[FloatArray], colours: SceneColours
) -> list[NameTag]:
    return [
        NameTag(ghost.label, _upper_right(ring) + 0.5, colours.word("ghost"), 3.0, float(ghost.active))
        for ghost, ring in zip(ghosts, rings, strict=True)
        if ghost.label
    ]


def _upper_right(ring: FloatArray) -> FloatArray:
    corner: FloatArray = ring[int((ring[:, 0] - ring[:, 1]).argmax())]
    return corner


def paint_crosshair(
    painter: QPainter, view: QWidget, scene: Scene3D, middle: FloatArray, planes: Mapping[str, SlicePlane]
) -> None:
    """Paint a cross with an open centre, each arm in the colour of the plane that it stands upon."""
    normals = [plane.normal for plane in planes.values()]
    ends = [middle + sign * r * normal for normal in normals for sign in (-1, 1) for r in (_GAP_MM, _ARM_MM)]
    pixels, colours = scene.display_of(np.array(ends)), theme_of(view).views
    for n, name in enumerate(name for name in planes for _ in range(2)):
        painter.setPen(QPen(QColor(colours[name]), 1.4))
        near, far = (painted(view, *pixels[2 * n + k]) for k in range(2))
        painter.drawLine(near, far)


def cut_text(cut: Cut, frame: AnatomicalFrame = SCAN_FRAME) -> str:
    """Say where bone is cut open, such as ``Cut axial at S 12.4 mm, inferior side stays``."""
    if cut.plane == "view":
        return "Cut across the view"
    plane, kept = frame.plane(cut.plane), _WORDS[frame.letter(cut.normal)]
    if (
        abs(plane.normal @ np.asarray(cut.normal)) < _ALONG
    ):  # it was cut in an oblique plane, or in another frame
        return f"Cut oblique, {kept} side stays"
    where = frame.position_text(plane, plane.position_of(cut.origin))
    return f"Cut {cut.plane} at {where}, {kept} side stays"


def paint_cut(painter: QPainter, view: QWidget, model: ViewModel) -> None:
    """Say in the upper left corner that bone is cut open, and where."""
    cut = model.state.cut
    if cut is None:
        return
    theme, font = theme_of(view), font_of(view)
    painter.setFont(font)
    text = cut_text(cut, model.frame)
    room = QRectF(0, 0, max(view.width() - 20 - _CHIP_ROOM, 1), view.height())
    words = QFontMetricsF(font).boundingRect(room, Qt.TextFlag.TextWordWrap, text)
    box = QRectF(10, 10, words.width() + _CHIP_ROOM, words.height() + 8)
    painter.setPen(Qt.PenStyle.NoPen)
    ground = QColor(theme.card)
    ground.setAlpha(225)
    painter.setBrush(ground)
    painter.drawRoundedRect(box, 5, 5)
    painter.setBrush(QColor(theme.views["3d" if cut.plane == "view" else cut.plane]))
    painter.drawRoundedRect(QRectF(box.left() + 6, box.center().y() - 4, 8, 8), 2, 2)
    painter.setPen(QColor(theme.text))
    wrapped = Qt.AlignmentFlag.AlignVCenter | Qt.TextFlag.TextWordWrap
    painter.drawText(box.adjusted(20, 0, -2, 0), wrapped, text)


def paint_pointer(
    painter: QPainter, view: QWidget, scene: Scene3D, point: FloatArray | None, holds: bool
) -> None:
    """Paint a ring at a (3,) scan position, filled while a point is held there."""
    if point is None:
        return
    colours = theme_of(view).scene
    centre = painted(view, *scene.display_of(point[None])[0])
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for colour, width in ((colours.halo, 4.0), (colours.states["active"], 1.8)):
        painter.setPen(QPen(QColor(colour), width))
        painter.drawEllipse(centre, 6.0, 6.0)
    if holds:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(colours.states["placed"]))
        painter.drawEllipse(centre, 4.0, 4.0)
