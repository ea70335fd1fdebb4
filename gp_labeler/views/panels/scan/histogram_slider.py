"""A slider over the histogram of a scan, to choose where bone begins."""

from __future__ import annotations

from qtpy.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from qtpy.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF
from qtpy.QtWidgets import QSizePolicy, QWidget

from gp_labeler.imaging.histogram import Histogram
from gp_labeler.views.fonts import fit, font_of, line_height, pixels
from gp_labeler.views.formatting import value_text
from gp_labeler.views.theme import theme_of

__all__ = ["HistogramSlider"]

_EDGE, _HEIGHT = 8.0, 76
_STEPS = {
    Qt.Key.Key_Left: -0.004,
    Qt.Key.Key_Down: -0.004,
    Qt.Key.Key_Right: 0.004,
    Qt.Key.Key_Up: 0.004,
    Qt.Key.Key_PageDown: -0.05,
    Qt.Key.Key_PageUp: 0.05,
}


class HistogramSlider(QWidget):
    """Shows how often each grey value occurs, and where the threshold lies among them.

    While the handle moves it tells `previewed`; once it is let go, `chosen`: one gesture, one choice.
    """

    previewed = Signal(float)
    chosen = Signal(float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._histogram: Histogram | None = None
        self._value: float | None = None
        self._dragging = False
        self._key_moved = False
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Bone threshold")
        self.setToolTip("Drag to set the bone threshold; use the arrow keys for small steps")
        self.setCursor(Qt.CursorShape.SplitHCursor)
        fit(self, self.updateGeometry)

    @property
    def value(self) -> float | None:
        """The threshold shown; None while there is none."""
        return self._value

    def set_histogram(self, histogram: Histogram | None) -> None:
        """Show another scan's grey values."""
        self._histogram = histogram
        self.setEnabled(histogram is not None)
        self.update()

    def set_value(self, value: float | None) -> None:
        """Show a threshold without a signal; a drag in progress continues."""
        if not self._dragging:
            self._value = value
            self.setAccessibleDescription(value_text(value))
            self.update()

    def x_of(self, value: float) -> float:
        """Return where a value lies, logical pixels from the left."""
        fraction = self._histogram.fraction(value) if self._histogram else 0.0
        return _EDGE + fraction * (self.width() - 2 * _EDGE)

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(240, pixels(self, _HEIGHT) + self._foot)

    def minimumSizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(120, self.sizeHint().height())

    @property
    def _foot(self) -> int:
        """Height of the line of words below the bins, logical pixels."""
        return line_height(self) + 1

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802 - Qt's name
        if event.button() is Qt.MouseButton.LeftButton and self._histogram is not None:
            self._dragging = True
            self._move_to(event.position().x())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802 - Qt's name
        if self._dragging:
            self._move_to(event.position().x())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802 - Qt's name
        if self._dragging and event.button() is Qt.MouseButton.LeftButton:
            self._dragging = False
            self._choose()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102, N802 - Qt's name
        step = _STEPS.get(Qt.Key(event.key()))
        if step is None or self._histogram is None or self._value is None:
            super().keyPressEvent(event)
            return
        self._show(self._histogram.value(self._histogram.fraction(self._value) + step))
        self._key_moved = True

    def keyReleaseEvent(self, event: QKeyEvent) -> None:  # noqa: D102, N802 - Qt's name
        if self._key_moved and not event.isAutoRepeat():
            self._key_moved = False
            self._choose()
        else:
            super().keyReleaseEvent(event)

    def _move_to(self, x: float) -> None:
        if self._histogram is not None:
            self._show(self._histogram.value((x - _EDGE) / (self.width() - 2 * _EDGE)))

    def _show(self, value: float) -> None:
        self._value = value
        self.setAccessibleDescription(value_text(value))
        self.update()
        self.previewed.emit(value)

    def _choose(self) -> None:
        if self._value is not None:
            self.chosen.emit(self._value)

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().changeEvent(event)
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102, N802 - Qt's name
        theme = theme_of(self)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(font_of(self))
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        painter.setPen(QPen(QColor(theme.focus), 3) if self.hasFocus() else QColor(theme.border_strong))
        painter.setBrush(QColor(theme.field))
        painter.drawRoundedRect(frame, 5, 5)
        if self._histogram is None:
            painter.setPen(QColor(theme.faint))
            painter.drawText(frame, Qt.AlignmentFlag.AlignCenter, "no scan")
        else:
            self._paint_histogram(painter, self._histogram)
            self._paint_ends(painter, self._histogram)
            if self._value is not None:
                self._paint_handle(painter, self._value)
        painter.end()

    def _paint_histogram(self, painter: QPainter, histogram: Histogram) -> None:
        """Draw the bins: those of bone in bone's colour, the others in grey."""
        theme = theme_of(self)
        floor, room = self.height() - self._foot, self.height() - self._foot - 8
        width = (self.width() - 2 * _EDGE) / len(histogram.heights)
        bone = QColor(theme.scene.bone if theme.is_dark else "#A98F5F")
        painter.setPen(Qt.PenStyle.NoPen)
        for n, height in enumerate(histogram.heights):
            is_bone = self._value is not None and histogram.edges[n] >= self._value
            painter.setBrush(bone if is_bone else QColor(theme.border_strong))
            tall = min(1.0, float(height)) * room
            painter.drawRect(QRectF(_EDGE + n * width, floor - tall, width + 0.5, tall))

    def _paint_ends(self, painter: QPainter, histogram: Histogram) -> None:
        painter.setPen(QColor(theme_of(self).muted))
        foot = QRectF(_EDGE, self.height() - self._foot, self.width() - 2 * _EDGE, self._foot)
        middle = Qt.AlignmentFlag.AlignVCenter
        painter.drawText(foot, Qt.AlignmentFlag.AlignLeft | middle, value_text(histogram.low))
        painter.drawText(foot, Qt.AlignmentFlag.AlignRight | middle, value_text(histogram.high))

    def _paint_handle(self, painter: QPainter, value: float) -> None:
        theme, x = theme_of(self), self.x_of(value)
        floor = self.height() - self._foot
        painter.setPen(QPen(QColor(theme.accent_text), 2))
        painter.drawLine(QPointF(x, 4), QPointF(x, floor))
        painter.setBrush(QColor(theme.accent_text))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.drawPolygon(
            QPolygonF([QPointF(x - 6, floor + 9), QPointF(x + 6, floor + 9), QPointF(x, floor)])
        )
        painter.drawEllipse(QPointF(x, 6), 4, 4)
