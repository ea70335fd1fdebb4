"""Icons, drawn as vectors in the theme's colour: sharp at any pixel ratio, and no files to carry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from qtpy.QtCore import QPointF, QRectF, Qt
from qtpy.QtGui import QColor, QIcon, QPainter, QPainterPath, QPen, QPixmap, QPolygonF

__all__ = ["ICONS", "draw_icon", "icon", "icon_pixmap"]

_UNIT = 24.0


def icon(name: str, colour: str, *, disabled: str | None = None, size: int = 16) -> QIcon:
    """Return an icon by its name in `ICONS`, in ``#RRGGBB`` colours."""
    made = QIcon()
    for ratio in (1.0, 2.0, 3.0):
        made.addPixmap(icon_pixmap(name, colour, size, ratio))
        if disabled is not None:
            made.addPixmap(icon_pixmap(name, disabled, size, ratio), QIcon.Mode.Disabled)
    return made


def icon_pixmap(name: str, colour: str, size: int = 16, ratio: float = 2.0) -> QPixmap:
    """Return an icon as a picture, `size` logical pixels wide."""
    pixmap = QPixmap(round(size * ratio), round(size * ratio))
    pixmap.setDevicePixelRatio(ratio)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    draw_icon(painter, name, QRectF(0, 0, size, size), QColor(colour))
    painter.end()
    return pixmap


def draw_icon(painter: QPainter, name: str, box: QRectF, colour: QColor) -> None:
    """Draw an icon into a square box, logical pixels."""
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.translate(box.topLeft())
    painter.scale(box.width() / _UNIT, box.height() / _UNIT)
    painter.setPen(QPen(colour, 2, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    ICONS[name](painter)
    painter.restore()


def _lines(*strokes: list[tuple[float, float]]) -> Callable[[QPainter], None]:
    def draw(painter: QPainter) -> None:
        for stroke in strokes:
            painter.drawPolyline(QPolygonF([QPointF(x, y) for x, y in stroke]))

    return draw


def _scan(painter: QPainter) -> None:
    for y in (16.5, 12, 7.5):
        outline = [(12, y - 4.5), (21, y), (12, y + 4.5), (3, y)]
        visible = [*outline, outline[0]] if y == 7.5 else outline[1:]
        painter.drawPolyline(QPolygonF([QPointF(*p) for p in visible]))


def _label(painter: QPainter) -> None:
    path = QPainterPath(QPointF(12, 21.5))
    path.cubicTo(9, 17.5, 5, 14, 5, 9.5)
    path.arcTo(QRectF(5, 2.5, 14, 14), 180, -180)
    path.cubicTo(19, 14, 15, 17.5, 12, 21.5)
    painter.drawPath(path)
    painter.drawEllipse(QPointF(12, 9.5), 2.3, 2.3)


def _atlas(painter: QPainter) -> None:
    for points in ([(12, 6), (12, 20)], [(12, 6), (3, 4), (3, 18), (12, 20), (21, 18), (21, 4), (12, 6)]):
        painter.drawPolyline(QPolygonF([QPointF(*p) for p in points]))


def _pose(painter: QPainter) -> None:
    painter.drawEllipse(QPointF(10, 14), 7, 7)
    painter.drawEllipse(QPointF(10, 14), 2, 2)
    _lines([(11.5, 12.5), (21, 3)], [(15, 3), (21, 3), (21, 9)])(painter)


def _eye(painter: QPainter) -> None:
    path = QPainterPath(QPointF(2, 12))
    path.quadTo(12, 1, 22, 12)
    path.quadTo(12, 23, 2, 12)
    painter.drawPath(path)
    painter.drawEllipse(QPointF(12, 12), 3, 3)


def _unseen(painter: QPainter) -> None:
    _eye(painter)
    painter.drawLine(QPointF(4, 20), QPointF(20, 4))


def _warning(painter: QPainter) -> None:
    painter.drawPolygon(QPolygonF([QPointF(12, 3), QPointF(22, 20.5), QPointF(2, 20.5)]))
    painter.drawLine(QPointF(12, 9.5), QPointF(12, 14))
    painter.drawPoint(QPointF(12, 17.3))


def _error(painter: QPainter) -> None:
    painter.drawEllipse(QPointF(12, 12), 9.5, 9.5)
    painter.drawLine(QPointF(12, 7), QPointF(12, 13))
    painter.drawPoint(QPointF(12, 16.6))


def _check(painter: QPainter) -> None:
    painter.drawEllipse(QPointF(12, 12), 9.5, 9.5)
    _lines([(7.5, 12.5), (11, 16), (16.5, 8.5)])(painter)


def _info(painter: QPainter) -> None:
    painter.drawEllipse(QPointF(12, 12), 9.5, 9.5)
    painter.drawLine(QPointF(12, 11.5), QPointF(12, 16.5))
    painter.drawPoint(QPointF(12, 7.6))


def _lock(painter: QPainter) -> None:
    painter.drawRoundedRect(QRectF(4, 11, 16, 10), 2, 2)
    path = QPainterPath(QPointF(7.5, 11))
    path.lineTo(7.5, 8)
    path.arcTo(QRectF(7.5, 3, 9, 9), 180, -180)
    path.lineTo(16.5, 11)
    painter.drawPath(path)


def _file(painter: QPainter) -> None:
    _lines(
        [(14, 2.5), (5, 2.5), (5, 21.5), (19, 21.5), (19, 7.5), (14, 2.5), (14, 7.5), (19, 7.5)],
    )(painter)


def _layers(painter: QPainter) -> None:
    for x, y in ((3, 3), (13, 3), (3, 13), (13, 13)):
        painter.drawRoundedRect(QRectF(x, y, 8, 8), 1, 1)


def _moon(painter: QPainter) -> None:
    path = QPainterPath(QPointF(20.5, 14.5))
    path.cubicTo(11, 18, 5.5, 10.5, 10, 3.5)
    path.cubicTo(-1, 7, 3.5, 21, 13, 20.8)
    path.cubicTo(16.5, 20.5, 19, 18.3, 20.5, 14.5)
    painter.drawPath(path)


def _sun(painter: QPainter) -> None:
    painter.drawEllipse(QPointF(12, 12), 4.2, 4.2)
    for dx, dy in ((0, 1), (0, -1), (1, 0), (-1, 0), (0.7, 0.7), (-0.7, 0.7), (0.7, -0.7), (-0.7, -0.7)):
        painter.drawLine(QPointF(12 + 7.5 * dx, 12 + 7.5 * dy), QPointF(12 + 10 * dx, 12 + 10 * dy))


def _undo(painter: QPainter) -> None:
    path = QPainterPath(QPointF(4, 9))
    path.lineTo(14, 9)
    path.arcTo(QRectF(9, 9, 11, 11), 90, -180)
    path.lineTo(8, 20)
    painter.drawPath(path)
    _lines([(8.5, 4.5), (4, 9), (8.5, 13.5)])(painter)


def _redo(painter: QPainter) -> None:
    painter.translate(_UNIT, 0)
    painter.scale(-1, 1)
    _undo(painter)


def _clock(painter: QPainter) -> None:
    painter.drawEllipse(QPointF(12, 12), 9.5, 9.5)
    _lines([(12, 6.5), (12, 12), (16, 14)])(painter)


def _swap(painter: QPainter) -> None:
    _lines([(4, 8), (20, 8)], [(16, 4), (20, 8), (16, 12)], [(20, 17), (4, 17)], [(8, 13), (4, 17), (8, 21)])(
        painter
    )


ICONS: Mapping[str, Callable[[QPainter], None]] = MappingProxyType(
    {
        "atlas": _atlas,
        "axis": _pose,
        "check": _check,
        "clock": _clock,
        "close": _lines([(6, 6), (18, 18)], [(18, 6), (6, 18)]),
        "down": _lines([(5, 9), (12, 16), (19, 9)]),
        "error": _error,
        "export": _lines(
            [(4, 14), (4, 20), (20, 20), (20, 14)], [(12, 15), (12, 3)], [(7, 8), (12, 3), (17, 8)]
        ),
        "eye": _eye,
        "file": _file,
        "folder": _lines([(2.5, 19.5), (2.5, 5), (9, 5), (11, 8), (21.5, 8), (21.5, 19.5), (2.5, 19.5)]),
        "import": _lines(
            [(4, 14), (4, 20), (20, 20), (20, 14)], [(12, 3), (12, 15)], [(7, 10), (12, 15), (17, 10)]
        ),
        "info": _info,
        "label": _label,
        "layout": _layers,
        "lock": _lock,
        "moon": _moon,
        "play": _lines([(7, 4), (20, 12), (7, 20), (7, 4)]),
        "pose": _pose,
        "redo": _redo,
        "save": _lines(
            [(4, 4), (16, 4), (20, 8), (20, 20), (4, 20), (4, 4)],
            [(8, 4), (8, 9), (15, 9), (15, 4)],
            [(7, 20), (7, 14), (17, 14), (17, 20)],
        ),
        "scan": _scan,
        "skip": _lines([(4, 12), (19, 12)], [(13, 6), (19, 12), (13, 18)]),
        "sun": _sun,
        "swap": _swap,
        "tick": _lines([(4, 12.5), (10, 18.5), (20, 6)]),
        "undo": _undo,
        "unseen": _unseen,
        "warning": _warning,
    }
)
