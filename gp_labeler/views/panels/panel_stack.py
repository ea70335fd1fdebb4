"""The place beside the views that shows the panel of the current step."""

from __future__ import annotations

from qtpy.QtCore import QSize
from qtpy.QtWidgets import QSizePolicy, QStackedWidget, QWidget

from gp_labeler.views.fonts import pixels

__all__ = ["PanelStack"]

_SHARE = 0.37
"""Of the window: what panels take at most while they need less."""

_LEAST_WIDTH = 200
"""In a very narrow window, where panels scroll sideways; logical pixels at the normal text size."""


class PanelStack(QStackedWidget):
    """All panels, one shown.

    Beside the views it is as wide as the widest panel asks for, so that the views keep their size from one
    step to the next, and gives way where the window is too narrow for both.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.set_alone(False)

    @property
    def needed_width(self) -> int:
        """The least width at which no panel has to scroll sideways, logical pixels."""
        panels = filter(None, map(self.widget, range(self.count())))
        return max((panel.minimumSizeHint().width() for panel in panels), default=0)

    @property
    def preferred_width(self) -> int:
        """The width that the widest panel asks for, logical pixels."""
        panels = filter(None, map(self.widget, range(self.count())))
        return max((panel.sizeHint().width() for panel in panels), default=0)

    def set_alone(self, alone: bool) -> None:
        """Take all the width there is, where no views are beside it."""
        ways = QSizePolicy.Policy
        self.setSizePolicy(ways.Expanding if alone else ways.Maximum, ways.Expanding)

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Return the preferred width in a wide window; in a narrow one less, but what panels need."""
        share = max(round(_SHARE * self.window().width()), self.needed_width)
        return QSize(min(self.preferred_width, share), super().sizeHint().height())

    def minimumSizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(pixels(self, _LEAST_WIDTH), super().minimumSizeHint().height())
