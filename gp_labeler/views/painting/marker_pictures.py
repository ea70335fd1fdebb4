"""Markers with an edge that keeps them legible on bone; drawn once each, and kept."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from qtpy.QtCore import QPointF, QRectF, Qt
from qtpy.QtGui import QBrush, QColor, QImage, QPainter, QPainterPath, QPen, QPolygonF, QRadialGradient

from gp_core.validation import FloatArray
from gp_labeler.scene.colours import DARK

__all__ = ["MarkerPicture", "marker_picture"]

_KEPT = 256
_LARGEST = 200.0
"""Radius, device pixels: a point that is zoomed into does not fill the memory."""

_CORNERS = {
    "diamond": ((0.0, -1.25), (1.1, 0.0), (0.0, 1.25), (-1.1, 0.0)),
    "rhomb": ((0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)),
    "square": ((-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)),
    "tall": ((0.0, -1.7), (1.0, 0.0), (0.0, 1.7), (-1.0, 0.0)),
    "triangle": ((0.0, -1.3), (1.17, 0.91), (-1.17, 0.91)),
    "inverted": ((0.0, 1.3), (1.17, -0.91), (-1.17, -0.91)),
}


class MarkerPicture(NamedTuple):
    """A square picture of a marker, its place in the middle."""

    image: QImage

    def draw(self, painter: QPainter, pixel: FloatArray) -> None:
        """Draw it about a (2,) pixel, on whole pixels."""
        corner = (pixel - self.image.width() / 2).round()
        painter.drawImage(QPointF(*corner), self.image)


@lru_cache(_KEPT)
def marker_picture(
    shape: str,
    radius: float,
    colour: str,
    *,
    full: bool,
    line: float,
    halo: float,
    halo_colour: str = DARK.halo,
    lit: bool = False,
) -> MarkerPicture:
    """Return the picture of a marker.

    Parameters
    ----------
    shape : str
        ``ball``, ``diamond``, ``rhomb``, ``square``, ``tall``, ``triangle`` or ``inverted``.
    radius : float
        Device pixels.
    colour : str
        ``#RRGGBB``.
    full : bool
        Whether it is filled, or an outline only.
    line, halo : float
        Widths of the outline and of its edge, device pixels.
    halo_colour : str
        Of the edge.
    lit : bool
        Whether a full one is shaded like a solid, lit from the upper left.
    """
    outline = _outline(shape, min(radius, _LARGEST))
    half = int(outline.boundingRect().height() / 2 + outline.boundingRect().width() / 2 + halo) + 1
    image = QImage(2 * half + 1, 2 * half + 1, QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.translate(half + 0.5, half + 0.5)
    painter.strokePath(outline, QPen(QColor(halo_colour), halo))
    painter.strokePath(outline, QPen(QColor(colour), line))
    if full:
        painter.fillPath(outline, _shading(radius + line, QColor(colour)) if lit else QColor(colour))
    painter.end()
    return MarkerPicture(image)


def _shading(radius: float, colour: QColor) -> QBrush:
    light = QRadialGradient(QPointF(0, 0), radius, QPointF(-0.4 * radius, -0.45 * radius))
    light.setColorAt(0.0, colour.lighter(145))
    light.setColorAt(0.45, colour)
    light.setColorAt(1.0, colour.darker(135))
    return QBrush(light)


def _outline(shape: str, radius: float) -> QPainterPath:
    path = QPainterPath()
    if shape in _CORNERS:
        path.addPolygon(QPolygonF([QPointF(x * radius, y * radius) for x, y in _CORNERS[shape]]))
        path.closeSubpath()
    else:
        path.addEllipse(QRectF(-radius, -radius, 2 * radius, 2 * radius))
    return path
