"""Strokes and outlines that several drawings share."""

from __future__ import annotations

from collections.abc import Iterator

from qtpy.QtCore import QPointF, QRectF, Qt
from qtpy.QtGui import QColor, QPen

__all__ = ["beside", "round_pen"]


def beside(where: QPointF, width: float, height: float, gap: float) -> Iterator[QRectF]:
    """Yield boxes for a label around a point, the best place first."""
    x, y = where.x(), where.y()
    yield QRectF(x + gap, y - height / 2, width, height)
    yield QRectF(x - gap - width, y - height / 2, width, height)
    yield QRectF(x - width / 2, y - gap - height, width, height)
    yield QRectF(x - width / 2, y + gap, width, height)
    yield QRectF(x + 0.7 * gap, y - 0.7 * gap - height, width, height)
    yield QRectF(x - 0.7 * gap - width, y - 0.7 * gap - height, width, height)


def round_pen(colour: QColor, width: float) -> QPen:
    """Return a pen with round ends and corners."""
    return QPen(colour, width, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin)
