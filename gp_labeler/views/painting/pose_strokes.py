"""Strokes of an estimate on a slice, each with a dark edge that keeps it legible on bone."""

from __future__ import annotations

import numpy as np
from qtpy.QtCore import Qt
from qtpy.QtGui import QColor, QPainter, QPainterPath, QPen

from gp_core.validation import FloatArray
from gp_labeler.scene.colours import DARK
from gp_labeler.views.painting.marker_pictures import marker_picture
from gp_labeler.views.painting.qt_paths import polygon

__all__ = ["area", "arrow", "colour_of", "hull", "line", "marker"]

_Corner = tuple[float, float]

_HALO = QColor(DARK.halo)
_DASHES = {"solid": None, "dashed": [4.0, 2.2], "dotted": [1.2, 1.7]}


def colour_of(role: str) -> QColor:
    """Return the colour of a state on slices, which are black in every theme."""
    return QColor(DARK.states[role])


def line(
    painter: QPainter, points: FloatArray, colour: QColor, width: float, *, style: str = "solid"
) -> None:
    """Draw an open line of (N, 2) pixels."""
    path = QPainterPath()
    path.addPolygon(polygon(points))
    pen = QPen(colour, width, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap, Qt.PenJoinStyle.RoundJoin)
    halo = QPen(pen)
    halo.setColor(_HALO)
    halo.setWidthF(1.7 * width)
    dashes = _DASHES[style]
    if dashes is not None:
        pen.setDashPattern(dashes)
        halo.setDashPattern([n / 1.7 for n in dashes])
    painter.strokePath(path, halo)
    painter.strokePath(path, pen)


def area(painter: QPainter, outlines: list[FloatArray], colour: QColor, alpha: int, width: float) -> None:
    """Fill closed outlines faintly, and draw their edges."""
    path = QPainterPath()
    for outline in outlines:
        path.addPolygon(polygon(outline))
        path.closeSubpath()
    fill = QColor(colour)
    fill.setAlpha(alpha)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)  # steps of so faint an edge are not seen
    painter.fillPath(path, fill)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    if width > 0:
        painter.strokePath(path, QPen(_HALO, 2.0 * width))
        painter.strokePath(path, QPen(colour, width))


def marker(
    painter: QPainter, pixel: FloatArray, shape: str, radius: float, colour: QColor, *, full: bool = True
) -> None:
    """Draw a ``ball``, ``diamond``, ``tall`` diamond or ``square`` about a pixel, or its outline only."""
    look = {"full": full, "line": 0.35 * radius, "halo": 0.75 * radius}
    marker_picture(shape, radius, colour.name(), **look).draw(painter, pixel)


def arrow(painter: QPainter, start: FloatArray, end: FloatArray, length: float, colour: QColor) -> None:
    """Draw the head of an arrow, its point at `end`."""
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    across = np.array([-along[1], along[0]])
    shape = np.array([[0.0, 0.0], [-1.0, 0.42], [-1.0, -0.42]])
    path = QPainterPath()
    path.addPolygon(polygon(end + length * shape @ np.stack([along, across])))
    path.closeSubpath()
    painter.strokePath(path, QPen(_HALO, 0.25 * length))
    painter.fillPath(path, colour)


def hull(points: FloatArray) -> FloatArray:
    """Return the corners of the convex hull of (N, 2) points, in order (Andrew's monotone chain)."""
    ordered = sorted(map(tuple, points.tolist()))
    corners: list[_Corner] = []
    for run in (ordered, ordered[::-1]):
        chain: list[_Corner] = []
        for point in run:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        corners += chain[:-1]
    return np.array(corners)


def _turn(a: _Corner, b: _Corner, c: _Corner) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
