"""Which side is left: asked at the top of the step Label until it is answered."""

from __future__ import annotations

from qtpy.QtWidgets import QWidget

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import in_column
from gp_labeler.views.panels.action_button import Actions, action_button
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.parts import text_label
from gp_labeler.views.signals import follow

__all__ = ["LeftRow"]


class LeftRow(QWidget):
    """A question while a straightened head has no side that a person has confirmed; else nothing.

    Parameters
    ----------
    workspace : Workspace
        Whose head it is.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.confirm = action_button(actions["head.confirm_left"], "Left is correct")
        self.exchanged = action_button(actions["head.left_is_right"], "The scan is mirrored…")
        words = "Which side is left? The file states it, but a scan cannot prove it."
        self.question = text_label(words, "warning", wrap=True)
        answers = QWidget()
        row = FlowLayout(spacing=6)
        answers.setLayout(row)
        for button in (self.confirm, self.exchanged):
            row.addWidget(button)
        in_column(self.question, answers, margins=(12, 4, 12, 0), spacing=4, of=self)
        for signal in (workspace.head.changed, workspace.document.reset):
            follow(self, signal, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Ask, or not."""
        self.setVisible(self._workspace.head.asks_left)
        self.setToolTip(self._workspace.head.left_text)
