"""Strokes and outlines that several drawings share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from qtpy.QtCore import QPointF, QRectF, Qt
from qtpy.QtGui import QColor, QPainterPath, QPen

__all__ = ["beside", "round_pen", "smooth"]


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


def smooth(corners: Sequence[QPointF]) -> QPainterPath:
    """Return a closed curve through points (Catmull and Rom's spline as cubic pieces)."""
    n, path = len(corners), QPainterPath(corners[0])
    for i in range(n):
        before, a, b, after = (corners[(i + k) % n] for k in (-1, 0, 1, 2))
        path.cubicTo(a + (b - before) / 6, b - (after - a) / 6, b)
    return path
