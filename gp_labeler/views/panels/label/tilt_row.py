"""A head may lie tilted in its scan: the step Label offers to straighten it, before anything is placed."""

from __future__ import annotations

from qtpy.QtWidgets import QPushButton, QWidget

from gp_core.landmarks.features import Side
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import in_row, wide
from gp_labeler.views.panels.action_button import Actions, action_button
from gp_labeler.views.panels.parts import text_label
from gp_labeler.views.signals import follow

__all__ = ["TiltRow"]


class TiltRow(QWidget):
    """A line and a button, while a scan without a label has no head frame; else nothing.

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
        self.words = text_label("", "hint", wrap=True)
        self.straighten = action_button(actions["head.straighten"], "Straighten")
        self.stop = QPushButton("Stop")
        self.stop.clicked.connect(workspace.head.cancel)
        self.other_ways = action_button(actions["view.step_scan"], "1 Scan", "Shows the card Head")
        in_row(wide(self.words), self.straighten, self.stop, self.other_ways, margins=(12, 0, 12, 0), of=self)
        for signal in (
            workspace.head.changed,
            workspace.document.landmarks_changed,
            workspace.document.reset,
            workspace.scan.opened,
        ):
            follow(self, signal, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Offer it, say what became of it, or hide."""
        head = self._workspace.head
        self.words.setText(self._text())
        self.stop.setVisible(head.is_running)
        self.other_ways.setVisible(bool(head.refusal) and not head.is_running)
        self.straighten.setVisible(not head.refusal and not head.is_running)
        self.setVisible(head.frame is None and (self._is_new() or head.is_running))

    def _is_new(self) -> bool:
        sides = [self._workspace.document.landmarks(side) for side in Side]
        is_labelled = any(landmarks.placed or landmarks.suggested for landmarks in sides)
        return self._workspace.scan.volume is not None and not is_labelled

    def _text(self) -> str:
        head = self._workspace.head
        if head.is_running:
            return "Searching for the plane of symmetry…"
        if head.heads:
            return f"The scan contains {len(head.heads)} heads: choose one in 1 Scan > Head."
        if head.refusal:
            return "The head could not be straightened automatically: 1 Scan > Head shows other ways."
        return "Is the head tilted in the scan? The views can be aligned with it."
