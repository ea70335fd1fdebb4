"""A coarse slice of a scan that is not loaded yet, with the letters of its sides."""

from __future__ import annotations

from qtpy.QtCore import QRectF, QSize, Qt
from qtpy.QtGui import QColor, QImage, QPainter, QPaintEvent
from qtpy.QtWidgets import QWidget

from gp_labeler.imaging.preview import PreviewPlane
from gp_labeler.views.fonts import TEXT, fit, font_of, pixels
from gp_labeler.views.theme import theme_of

__all__ = ["PreviewPicture"]


class PreviewPicture(QWidget):
    """Shows one plane, or says that it is being read."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._plane: PreviewPlane | None = None
        self._words = "Reading a preview…"
        fit(self, lambda: self.setMinimumSize(pixels(self, 140), pixels(self, 120)))

    @property
    def plane(self) -> PreviewPlane | None:
        """What is shown."""
        return self._plane

    def show_plane(self, plane: PreviewPlane | None, words: str = "Reading a preview…") -> None:
        """Show a plane; None shows words instead."""
        self._plane, self._words = plane, words
        self.setAccessibleName(words if plane is None else f"Preview, {plane.name} slice, {plane.letters}")
        self.update()

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(220, 170)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102, N802 - Qt's name
        theme = theme_of(self)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        frame = QRectF(self.rect())
        painter.fillRect(frame, QColor("#000000"))
        if self._plane is None:
            painter.setPen(QColor("#B8C2CC"))
            painter.drawText(frame.adjusted(8, 0, -8, 0), _CENTRE | Qt.TextFlag.TextWordWrap, self._words)
        else:
            self._paint_plane(painter, self._plane, frame)
            painter.fillRect(QRectF(0, 0, 3, frame.height()), QColor(theme.views[self._plane.name]))
        painter.end()

    def _paint_plane(self, painter: QPainter, plane: PreviewPlane, frame: QRectF) -> None:
        rows, columns = plane.grey.shape
        image = QImage(plane.grey.data, columns, rows, columns, QImage.Format.Format_Grayscale8)
        room = frame.adjusted(14, 14, -14, -14)
        scale = min(room.width() / columns, room.height() / (rows * plane.aspect))
        box = QRectF(0, 0, columns * scale, rows * plane.aspect * scale)
        box.moveCenter(frame.center())
        painter.drawImage(box, image)
        painter.setFont(font_of(self, TEXT, bold=True))
        painter.setPen(QColor("#FFFFFF"))
        inner, flag = frame.adjusted(6, 2, -4, -2), Qt.AlignmentFlag
        left, right, bottom, top = tuple(plane.letters)
        for letter, where in (
            (left, flag.AlignLeft | flag.AlignVCenter),
            (right, flag.AlignRight | flag.AlignVCenter),
            (bottom, flag.AlignHCenter | flag.AlignBottom),
            (top, flag.AlignHCenter | flag.AlignTop),
        ):
            painter.drawText(inner, where, letter)


_CENTRE = Qt.AlignmentFlag.AlignCenter
