"""How certain the observer is of a point, and a note on what was seen: a row of the feature card."""

from __future__ import annotations

from qtpy.QtWidgets import QLineEdit, QToolButton, QWidget

from gp_core.landmarks.provenance import Certainty
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import in_row, wide
from gp_labeler.views.panels.label.certainty import CERTAINTY_HINTS
from gp_labeler.views.signals import attempt, blocked

__all__ = ["AnnotationRow"]


class AnnotationRow(QWidget):
    """Three buttons and a text field, for the active point once it is placed or marked as not seen.

    Parameters
    ----------
    workspace : Workspace
        Whose labels it annotates.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.buttons = {each: self._button(each) for each in Certainty}
        self.note = QLineEdit()
        self.note.setPlaceholderText("Note: fluid…")
        self.note.setAccessibleName("Note on this label")
        self.note.setToolTip(
            "What you saw there, such as a broken bulla, fluid or an artefact; stored with the label"
        )
        self.note.editingFinished.connect(self._keep_note)
        in_row(*self.buttons.values(), wide(self.note), margins=0, spacing=4, of=self)

    def refresh(self) -> None:
        """Show what is known of the active point; hidden while there is nothing to annotate."""
        active, state = self._workspace.labels.active, self._workspace.document.state
        mark = None if active.code is None else state.landmark(active.side, active.code)
        is_decided = mark is not None and mark.decided
        self.setVisible(is_decided)
        if mark is None or not is_decided:
            return
        self.setEnabled(not mark.locked)
        for certainty, button in self.buttons.items():
            with blocked(button):
                button.setChecked(mark.certainty is certainty)
        if not self.note.hasFocus() or not self.note.isModified():
            self.note.setText(mark.note)

    def _button(self, certainty: Certainty) -> QToolButton:
        button = QToolButton()
        button.setText(certainty.value.capitalize())
        button.setCheckable(True)
        button.setAccessibleName(f"certainty: {certainty.value}")
        button.setToolTip(CERTAINTY_HINTS[certainty])
        button.clicked.connect(lambda on: self._annotate(certainty.value if on else ""))
        return button

    def _annotate(self, certainty: str) -> None:
        attempt(self._workspace, lambda: self._workspace.labels.annotate(certainty))
        self.refresh()

    def _keep_note(self) -> None:
        active, state = self._workspace.labels.active, self._workspace.document.state
        if active.code is None or not self.note.isModified():
            return
        self.note.setModified(False)
        if self.note.text() != state.landmark(active.side, active.code).note:
            attempt(self._workspace, lambda: self._workspace.labels.annotate(note=self.note.text()))
