"""Notes on the specimen: free text, kept with it while it is being typed."""

from __future__ import annotations

from qtpy.QtCore import QEvent, QObject, QTimer
from qtpy.QtWidgets import QPlainTextEdit, QWidget

from gp_labeler.document.specimen_edits import SetNotes
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.parts import Card
from gp_labeler.views.signals import attempt, blocked, follow

__all__ = ["NotesCard"]

_PAUSE_MS = 600


class NotesCard(Card):
    """A text field; all that is typed before the field is left is one undo.

    Parameters
    ----------
    workspace : Workspace
        Whose specimen the notes are on.
    """

    def __init__(self, workspace: Workspace, actions: object = None, parent: QWidget | None = None) -> None:
        super().__init__("Notes", parent)
        self._workspace = workspace
        self._continues = False
        self.text = QPlainTextEdit()
        self.text.setAccessibleName("Notes on the specimen")
        self.text.setPlaceholderText("Animal, weight, scanner, damage…")
        self.text.setTabChangesFocus(True)
        self.text.setFixedHeight(84)
        self.text.textChanged.connect(self._on_typed)
        self.text.installEventFilter(self)
        self.add(self.text)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(_PAUSE_MS)
        self._timer.timeout.connect(self.keep)
        follow(self, workspace.document.details_changed, self.refresh)
        follow(self, workspace.document.reset, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show the notes as they are kept."""
        notes = self._workspace.document.state.notes
        if notes != self.text.toPlainText() and not self._timer.isActive():
            with blocked(self.text):
                self.text.setPlainText(notes)

    def keep(self) -> None:
        """Make what was typed an edit of the specimen."""
        self._timer.stop()
        notes = self.text.toPlainText()
        if notes == self._workspace.document.state.notes:
            return
        merge, self._continues = self._continues, True
        attempt(self._workspace, lambda: self._workspace.document.do(SetNotes(notes), merge=merge))

    def _on_typed(self) -> None:
        self._timer.start()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: D102, N802 - Qt's name
        if watched is self.text and event.type() is QEvent.Type.FocusOut:
            self.keep()
            self._continues = False
        return super().eventFilter(watched, event)
