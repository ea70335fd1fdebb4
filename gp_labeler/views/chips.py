"""The shape of each state of a point: told by its form alone, and by its colour as well."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from qtpy.QtCore import QPointF, QRectF, Qt
from qtpy.QtGui import QColor, QPainter, QPainterPath, QPen, QPixmap, QPolygonF

from gp_labeler.views.painting.strokes import round_pen
from gp_labeler.views.theme import Theme

__all__ = ["SHAPES", "chip_pixmap", "draw_chip"]

_CLEAR = Qt.BrushStyle.NoBrush


def draw_chip(painter: QPainter, state: str, box: QRectF, theme: Theme) -> None:
    """Draw the shape of a state into a square box.

    Parameters
    ----------
    painter : QPainter
        What draws.
    state : str
        A key of `SHAPES`.
    box : QRectF
        Logical pixels; 12 is a good size.
    theme : Theme
        Its colours.
    """
    colour = theme.state(state)
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.translate(box.center())
    painter.scale(box.width() / 12, box.height() / 12)
    painter.setPen(QPen(colour, 1.5))
    painter.setBrush(_CLEAR)
    SHAPES[state](painter, colour, QColor(theme.card))
    painter.restore()


def chip_pixmap(state: str, size: int, theme: Theme, ratio: float = 2.0) -> QPixmap:
    """Return the same as a picture, `size` logical pixels wide."""
    pixmap = QPixmap(round(size * ratio), round(size * ratio))
    pixmap.setDevicePixelRatio(ratio)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    draw_chip(painter, state, QRectF(0, 0, size, size), theme)
    painter.end()
    return pixmap


def _ring(painter: QPainter, colour: QColor, ground: QColor) -> None:
    painter.drawEllipse(QPointF(), 4.2, 4.2)


def _dashed_ring(painter: QPainter, colour: QColor, ground: QColor) -> None:
    pen = QPen(colour, 1.6)
    pen.setDashPattern([1.1, 1.1])
    pen.setCapStyle(Qt.PenCapStyle.FlatCap)
    painter.setPen(pen)
    painter.drawEllipse(QPointF(), 4.2, 4.2)


def _disc(painter: QPainter, colour: QColor, ground: QColor) -> None:
    painter.setBrush(colour)
    painter.drawEllipse(QPointF(), 3.9, 3.9)


def _ticked_disc(painter: QPainter, colour: QColor, ground: QColor) -> None:
    painter.setBrush(colour)
    painter.drawEllipse(QPointF(), 5.0, 5.0)
    painter.setPen(round_pen(ground, 1.7))
    painter.drawPolyline(QPolygonF([QPointF(-2.4, 0.2), QPointF(-0.7, 2.0), QPointF(2.5, -1.9)]))


def _triangle(painter: QPainter, colour: QColor, ground: QColor) -> None:
    painter.setPen(round_pen(colour, 1.5))
    painter.setBrush(colour)
    painter.drawPolygon(QPolygonF([QPointF(0, -4.6), QPointF(4.9, 4.0), QPointF(-4.9, 4.0)]))
    painter.setPen(round_pen(ground, 1.4))
    painter.drawLine(QPointF(0, -1.6), QPointF(0, 1.1))
    painter.drawPoint(QPointF(0, 3.1))


def _dash(painter: QPainter, colour: QColor, ground: QColor) -> None:
    painter.setPen(round_pen(colour, 2.0))
    painter.drawLine(QPointF(-4, 0), QPointF(4, 0))


def _diamond(painter: QPainter, colour: QColor, ground: QColor) -> None:
    painter.setBrush(colour)
    painter.drawPolygon(QPolygonF([QPointF(0, -4.9), QPointF(4.9, 0), QPointF(0, 4.9), QPointF(-4.9, 0)]))


def _square(painter: QPainter, colour: QColor, ground: QColor) -> None:
    painter.drawRect(QRectF(-4, -4, 8, 8))
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(colour)
    painter.drawRect(QRectF(-1.3, -1.3, 2.6, 2.6))


def _target(painter: QPainter, colour: QColor, ground: QColor) -> None:
    painter.drawEllipse(QPointF(), 4.8, 4.8)
    painter.setBrush(colour)
    painter.drawEllipse(QPointF(), 1.7, 1.7)


def _padlock(painter: QPainter, colour: QColor, ground: QColor) -> None:
    shackle = QPainterPath(QPointF(-2.6, 0))
    shackle.lineTo(-2.6, -2.0)
    shackle.arcTo(QRectF(-2.6, -4.8, 5.2, 5.4), 180, -180)
    shackle.lineTo(2.6, 0)
    painter.drawPath(shackle)
    painter.setBrush(colour)
    painter.drawRoundedRect(QRectF(-4, -0.4, 8, 5.4), 1, 1)


SHAPES: Mapping[str, Callable[[QPainter, QColor, QColor], None]] = MappingProxyType(
    {
        "to do": _ring,
        "ghost": _dashed_ring,
        "suggested": _square,
        "placed": _disc,
        "checked": _ticked_disc,
        "doubtful": _triangle,
        "unseen": _dash,
        "computed": _diamond,
        "active": _target,
        "locked": _padlock,
    }
)
