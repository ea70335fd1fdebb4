"""Differences of repeated labels against their mean (Bland and Altman), painted in the window's colours."""

from __future__ import annotations

from collections.abc import Sequence

from qtpy.QtCore import QPointF, QRectF, QSize, Qt
from qtpy.QtGui import QColor, QPainter, QPaintEvent, QPen
from qtpy.QtWidgets import QWidget

from gp_core.study.limits_of_agreement import AgreementPanel
from gp_labeler.views.fonts import pixels
from gp_labeler.views.formatting import number_text
from gp_labeler.views.theme import theme_of

__all__ = ["AgreementPlot"]

_DOT = 2.0


class AgreementPlot(QWidget):
    """Three small plots beside each other, one for each direction.

    Solid lines are the mean difference and the limits of agreement between observers, dashed ones those
    between the rounds of one observer.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._panels: tuple[AgreementPanel, ...] = ()
        self.setAccessibleName("Bland-Altman plot of the differences")
        self.setToolTip(
            "Difference of two labels against their mean, mm; lines: mean and 95 % limits of agreement"
        )

    def show_panels(self, panels: Sequence[AgreementPanel]) -> None:
        """Draw these panels, one for each direction."""
        self._panels = tuple(panels)
        self.setVisible(bool(self._panels))
        self.update()

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(pixels(self, 300), pixels(self, 150))

    def minimumSizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(pixels(self, 180), pixels(self, 130))

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102, N802 - Qt's name
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        line = painter.fontMetrics().height()
        left = painter.fontMetrics().horizontalAdvance("\N{MINUS SIGN}0.00 ")
        width = (self.width() - left) / max(len(self._panels), 1)
        for n, panel in enumerate(self._panels):
            area = QRectF(left + n * width + 3, line + 2, width - 6, self.height() - 2 * line - 6)
            self._paint(painter, panel, area, has_scale=n == 0, left=left)

    def _paint(
        self, painter: QPainter, panel: AgreementPanel, area: QRectF, *, has_scale: bool, left: int
    ) -> None:
        theme, line = theme_of(self), painter.fontMetrics().height()
        painter.setPen(QPen(QColor(theme.border), 1))
        painter.drawRect(area)
        painter.setPen(QColor(theme.faint))
        named = QRectF(area.left() - 3, 0, area.width() + 6, line)
        painter.drawText(named, Qt.AlignmentFlag.AlignCenter, panel.direction)
        low, high = panel.mean_range
        below = QRectF(area.left(), area.bottom() + 2, area.width(), line)
        painter.drawText(below, Qt.AlignmentFlag.AlignLeft, _text(low))
        painter.drawText(below, Qt.AlignmentFlag.AlignRight, f"{_text(high)} mm")
        for value in (-panel.largest, 0.0, panel.largest) if has_scale else ():
            y = _height(area, value, panel.largest)
            words = QRectF(0, y - line / 2, left - 2, line)
            painter.drawText(
                words, int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter), _text(value)
            )
        y = _height(area, 0.0, panel.largest)
        painter.setPen(QPen(QColor(theme.border), 1))
        painter.drawLine(QPointF(area.left(), y), QPointF(area.right(), y))
        for kind in panel.kinds:
            colour = QColor(theme.accent_text if kind.is_inter else theme.warning)
            dots = QColor(colour)
            dots.setAlpha(150)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(dots)
            for mean, difference in kind.points:
                x = area.left() + area.width() * (mean - low) / (high - low)
                painter.drawEllipse(QPointF(x, _height(area, difference, panel.largest)), _DOT, _DOT)
            painter.setBrush(Qt.BrushStyle.NoBrush)
            style = Qt.PenStyle.SolidLine if kind.is_inter else Qt.PenStyle.DashLine
            painter.setPen(QPen(colour, 1, style))
            for value in kind.limits:
                y = _height(area, value, panel.largest)
                painter.drawLine(QPointF(area.left(), y), QPointF(area.right(), y))


def _height(area: QRectF, value: float, largest: float) -> float:
    return area.center().y() - value / largest * area.height() / 2


def _text(value: float) -> str:
    return number_text(value, 1)
