"""A ring around a view that has the keyboard, where it was reached by the keyboard."""

from __future__ import annotations

from qtpy.QtCore import QEvent, QObject, Qt
from qtpy.QtGui import QColor, QFocusEvent, QPainter, QPaintEvent, QPen
from qtpy.QtWidgets import QWidget

from gp_labeler.views.theme import theme_of

__all__ = ["BY_KEYBOARD", "FocusRing"]

_WIDTH, _EDGE = 2, 1
"""Of the border, and of the edge inside of it that parts it from a picture; logical pixels."""
BY_KEYBOARD = (
    Qt.FocusReason.TabFocusReason,
    Qt.FocusReason.BacktabFocusReason,
    Qt.FocusReason.ShortcutFocusReason,
)
"""Why a widget gets the focus, where a key did it."""


class FocusRing(QWidget):
    """A border over a view while it has the focus; a click, which shows where it goes, draws none.

    Parameters
    ----------
    view : QWidget
        What it lies over, and its parent.
    """

    def __init__(self, view: QWidget) -> None:
        super().__init__(view)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.hide()
        self._view = view
        view.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        """Appear, go, and keep the size of the view."""
        if watched is self._view:
            if isinstance(event, QFocusEvent):
                self.setVisible(event.gotFocus() and event.reason() in BY_KEYBOARD)
                self.raise_()
            elif event.type() in (QEvent.Type.Resize, QEvent.Type.Show):
                self.resize(self._view.size())
        return False

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        """Draw the border."""
        painter = QPainter(self)
        theme, square = theme_of(self), Qt.PenJoinStyle.MiterJoin
        for width, colour in ((_WIDTH + _EDGE, theme.card), (_WIDTH, theme.focus)):  # on black, on bone
            pen = QPen(QColor(colour), 2 * width)
            pen.setJoinStyle(square)
            painter.setPen(pen)
            painter.drawRect(self.rect())
        painter.end()
