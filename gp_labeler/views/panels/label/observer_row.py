"""Who labels, and in which round: asked once at the top of the step Label, then shown there."""

from __future__ import annotations

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QLineEdit, QPushButton, QVBoxLayout, QWidget

from gp_labeler.document.labelling_edits import labelling_text
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import in_column, in_row, wide
from gp_labeler.views.panels.action_button import Actions, action_button
from gp_labeler.views.panels.parts import ElidedLabel, text_label
from gp_labeler.views.signals import attempt, follow
from gp_labeler.views.stylesheet import set_role

__all__ = ["ObserverRow"]


class ObserverRow(QWidget):
    """A question until it is answered, then a line.

    Parameters
    ----------
    workspace : Workspace
        Whose observer it asks for.
    actions : mapping of str to QAction
        What its button does.
    """

    named = Signal()
    """The question was answered."""

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.name = QLineEdit()
        self.name.setPlaceholderText("Your name or initials")
        self.name.setAccessibleName("Observer")
        self.name.returnPressed.connect(self._keep)
        self.keep = QPushButton("Save")
        self.keep.setToolTip("Stored on this computer; the name of your account is never used")
        self.keep.clicked.connect(self._keep)
        self._asked = QWidget()
        line = in_row(wide(self.name), self.keep, spacing=6)
        question = QVBoxLayout(self._asked)
        question.setContentsMargins(12, 4, 12, 0)
        question.setSpacing(4)
        words = "Who labels? Every label stores this name."
        question.addWidget(text_label(words, "warning", wrap=True))
        question.addLayout(line)
        self.words = ElidedLabel("", "hint")
        self.labellings = action_button(
            actions["labelling.show"], "Labellings…", "Label again (blind), other observers and rounds"
        )
        self._told = QWidget()
        in_row(wide(self.words), self.labellings, margins=(12, 0, 12, 0), of=self._told)
        in_column(self._asked, self._told, margins=0, of=self)
        document = workspace.document
        for signal in (document.reset, document.author_changed, document.labelling_changed):
            follow(self, signal, self.refresh)
        follow(self, document.landmarks_changed, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show who labels, or ask."""
        document = self._workspace.document
        author, state = document.author, document.state
        self._asked.setVisible(not author)
        self._told.setVisible(bool(author))
        labeller = state.labeller or author
        words = labelling_text(labeller, state.round) + (", blind" if state.blind else "")
        is_other = bool(author) and labeller.casefold() != author.casefold()
        self.words.set_words(f"Labels of {words}; you are {author}" if is_other else f"Labelled by {words}")
        set_role(self.words, "warning" if is_other else "hint")

    def _keep(self) -> None:
        if attempt(self._workspace, lambda: self._workspace.set_observer(self.name.text())):
            self.named.emit()
