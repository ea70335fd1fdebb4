"""Strokes and handles of rulers and angles, painted over slices and over the 3D view alike."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from qtpy.QtCore import QPointF, Qt
from qtpy.QtGui import QColor, QPainter, QPen

from gp_core.validation import FloatArray
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.colours import SceneColours
from gp_labeler.scene.measurements import DrawnMeasurement
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.scene.slice_viewport import SliceViewport
from gp_labeler.views.painting.name_tags import NameTag
from gp_labeler.views.painting.qt_paths import polygon
from gp_labeler.views.painting.slice_lines import near_part

__all__ = ["Strokes", "paint_strokes", "strokes_in_scene", "strokes_on_slice", "tags_of_strokes"]

_FAINT = 0.35
_LINE, _STRONG, _EDGE = 1.8, 2.8, 2.2
"""Widths of a line, of one that is selected, and of the dark edge around either; logical pixels."""

_HANDLE = 4.5
_PIECES = 10
"""In so many pieces a line is tested for bone in front of it."""


class Strokes(NamedTuple):
    """What is seen of one measurement: pieces of lines, and handles, in painter's coordinates.

    `lines` are (M, 2) polylines with their opacities, `handles` (2,) pixels with their opacities and whether
    they are filled, `anchor` is where the label stands.
    """

    lines: list[tuple[FloatArray, float]]
    handles: list[tuple[FloatArray, float, bool]]
    drawn: DrawnMeasurement
    anchor: FloatArray | None


def strokes_on_slice(
    drawn: DrawnMeasurement, shown: SliceViewport, *, reach: float, in_slice: float
) -> Strokes:
    """Return the part of a measurement that lies within `reach` of a slice, mm.

    Parameters
    ----------
    drawn : DrawnMeasurement
    shown : SliceViewport
        The slice.
    reach, in_slice : float
        How far from the slice it is still drawn, and how far a handle lies in it, mm.
    """
    lines, anchor = [], None
    for line in drawn.lines():
        depths = shown.off_slice(line)
        for n in range(len(line) - 1):
            part = near_part(line[n], line[n + 1], (float(depths[n]), float(depths[n + 1])), reach)
            if part is not None:
                pixels = shown.scan_to_pixel(part) + 0.5
                lines.append((pixels, 1.0))
                anchor = pixels.mean(axis=0) if anchor is None else anchor
    off = np.abs(shown.off_slice(drawn.points))
    pixels = shown.scan_to_pixel(drawn.points) + 0.5
    handles = [
        (pixels[n], 1.0 - 0.65 * float(off[n]) / reach, bool(off[n] <= in_slice))
        for n in np.flatnonzero(off <= reach)
    ]
    if abs(float(shown.off_slice(drawn.anchor[None])[0])) <= reach:
        anchor = shown.scan_to_pixel(drawn.anchor[None])[0] + 0.5
    return Strokes(lines, handles, drawn, anchor if lines or handles else None)


def strokes_in_scene(drawn: DrawnMeasurement, view: Viewpoint, scene: Scene3D | None) -> Strokes:
    """Return a measurement in the 3D view, faint where bone of `scene` hides it; with None nothing does."""
    lines = []
    for line in drawn.lines():
        fine = _refined(line) if line is drawn.points else line
        pixels = view.display(fine)[:, :2] + 0.5
        hidden = np.zeros(len(fine), dtype=bool) if scene is None else scene.hidden(fine)
        for start, end in _runs(hidden):
            lines.append((pixels[start : end + 1], _FAINT if hidden[start] else 1.0))
    ends = view.display(drawn.points)[:, :2] + 0.5
    behind = np.zeros(len(ends), dtype=bool) if scene is None else scene.hidden(drawn.points)
    handles = [(ends[n], _FAINT if behind[n] else 1.0, not behind[n]) for n in range(len(ends))]
    return Strokes(lines, handles, drawn, view.display(drawn.anchor[None])[0, :2] + 0.5)


def paint_strokes(
    painter: QPainter, all_strokes: Iterable[Strokes], colours: SceneColours, ratio: float
) -> None:
    """Paint measurements, in device pixels; `ratio` of them are a logical one."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    colour, halo = QColor(colours.states["measure"]), QColor(colours.halo)
    for strokes in all_strokes:
        width = (_STRONG if strokes.drawn.selected else _LINE) * ratio
        for pen in (_pen(halo, width + _EDGE * ratio), _pen(colour, width, broken=strokes.drawn.broken)):
            painter.setPen(pen)
            for pixels, opacity in strokes.lines:
                painter.setOpacity(opacity)
                painter.drawPolyline(polygon(pixels))
        for pixel, opacity, full in strokes.handles:
            painter.setOpacity(opacity)
            radius = (_HANDLE + strokes.drawn.selected) * ratio
            painter.setPen(_pen(halo, 3.5 * ratio))
            painter.drawEllipse(QPointF(*pixel), radius, radius)
            painter.setPen(_pen(colour, 1.6 * ratio))
            painter.setBrush(colour if full else Qt.BrushStyle.NoBrush)
            painter.drawEllipse(QPointF(*pixel), radius, radius)
            painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setOpacity(1.0)


def tags_of_strokes(all_strokes: Sequence[Strokes], colours: SceneColours) -> list[NameTag]:
    """Return what is written beside measurements."""
    colour = colours.word("measure")
    return [
        NameTag(strokes.drawn.label, strokes.anchor, colour, 8.0, 1.0 + strokes.drawn.selected)
        for strokes in all_strokes
        if strokes.drawn.label and strokes.anchor is not None
    ]


def _pen(colour: QColor, width: float, *, broken: bool = False) -> QPen:
    pen = QPen(colour, width)
    pen.setCapStyle(Qt.PenCapStyle.FlatCap if broken else Qt.PenCapStyle.RoundCap)
    if broken:
        pen.setDashPattern([4, 2.5])
    return pen


def _refined(line: FloatArray) -> FloatArray:
    """Return a polyline with points in between."""
    steps = np.linspace(0.0, 1.0, _PIECES, endpoint=False)[:, None]
    pieces = [line[n] + steps * (line[n + 1] - line[n]) for n in range(len(line) - 1)]
    return np.concatenate([*pieces, line[-1:]])


def _runs(hidden: np.ndarray) -> Iterable[tuple[int, int]]:
    """Yield first and last point of runs of pieces that are all seen or all hidden, by where they start."""
    start = 0
    for n in range(1, len(hidden)):
        if n == len(hidden) - 1 or hidden[n] != hidden[start]:
            yield start, n
            start = n
