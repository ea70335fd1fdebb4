"""The labellings of a specimen: who made them, how far they are; another one is begun, or opened, here."""

from __future__ import annotations

from qtpy.QtCore import Qt
from qtpy.QtWidgets import (
    QDialog,
    QHeaderView,
    QLineEdit,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from gp_core.landmarks.features import Side
from gp_labeler.document.labelling_edits import labelling_text, next_round
from gp_labeler.models.labellings import LabellingRow, labelling_rows
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit
from gp_labeler.views.layouts import STRETCH, in_column, in_row, wide
from gp_labeler.views.panels.parts import fix_headers, open_at, text_label
from gp_labeler.views.signals import attempt, follow
from gp_labeler.views.times import time_text

__all__ = ["LabellingsDialog"]

_HEADINGS = ("Observer", "Round", "Left", "Right", "Blind", "Last change")
_HINT = (
    "Repeated labelling measures how repeatable labels are. While you label blind, earlier points, "
    "the ghosts that follow from them, and what other observers placed stay hidden."
)


class LabellingsDialog(QDialog):
    """Lists the labellings of the open specimen.

    Parameters
    ----------
    workspace : Workspace
        Whose specimen it is.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self._rows: tuple[LabellingRow, ...] = ()
        self.setWindowTitle("Labellings")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setModal(True)
        self.table = QTableWidget(0, len(_HEADINGS))
        self.table.setHorizontalHeaderLabels(_HEADINGS)
        self.table.setAccessibleName("Labellings of this specimen")
        self.table.setSelectionBehavior(QTableWidget.SelectionBehavior.SelectRows)
        self.table.setSelectionMode(QTableWidget.SelectionMode.SingleSelection)
        self.table.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        self.table.setShowGrid(False)
        fix_headers(self.table)
        header = self.table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.table.itemSelectionChanged.connect(self._refresh_buttons)
        self.table.itemActivated.connect(self._open)
        self.observer = QLineEdit(workspace.document.author)
        self.observer.setPlaceholderText("Your name or initials")
        self.observer.setAccessibleName("Observer")
        self.observer.textChanged.connect(self._refresh_buttons)
        self.again, self.open_chosen, self.close_button = (
            QPushButton(w) for w in ("Label again", "Open", "Close")
        )
        self.again.setProperty("role", "primary")
        self.again.clicked.connect(self._begin)
        self.open_chosen.clicked.connect(self._open)
        self.close_button.clicked.connect(self._close)
        self._lay_out()
        follow(self, workspace.document.labelling_changed, self.refresh)
        self.refresh()
        fit(self, self._fit_columns)
        open_at(self, 620, 380)

    def refresh(self, *_: object) -> None:
        """Show the labellings as they are."""
        self._rows = labelling_rows(self._workspace.document.state)
        self.table.setRowCount(len(self._rows))
        for n, row in enumerate(self._rows):
            for column, words in enumerate(_words(row)):
                item = QTableWidgetItem(words)
                font = item.font()
                font.setBold(row.is_open)
                item.setFont(font)
                self.table.setItem(n, column, item)
            if row.is_open:
                self.table.selectRow(n)
        self._fit_columns()
        self._refresh_buttons()

    def _fit_columns(self) -> None:
        """Make the table so wide that no heading is cut; the column of names takes what is left."""
        header, table = self.table.horizontalHeader(), self.table
        others = range(1, header.count())
        widths = [max(header.sectionSizeHint(n), table.sizeHintForColumn(n)) for n in others]
        margins = 2 * table.frameWidth() + table.verticalScrollBar().sizeHint().width()
        table.setMinimumWidth(header.sectionSizeHint(0) + sum(widths) + margins)

    def _lay_out(self) -> None:
        in_column(
            text_label(_HINT, "hint", wrap=True),
            wide(self.table),
            in_row(text_label("You are", "heading"), wide(self.observer)),
            in_row(self.open_chosen, STRETCH, self.close_button, self.again),
            margins=(20, 16, 20, 14),
            spacing=10,
            of=self,
        )

    def _refresh_buttons(self, *_: object) -> None:
        name, state = self.observer.text().strip(), self._workspace.document.state
        row = self._chosen()
        self.open_chosen.setEnabled(row is not None and not row.is_open)
        self.again.setEnabled(bool(name) and self._workspace.document.in_use)
        said = f"Begin {labelling_text(name, next_round(state, name))}, blind"
        self.again.setText(said if name else "Label again, blind")
        lacking = "" if name else "Type your name or initials first"
        self.again.setToolTip(lacking if self._workspace.document.in_use else "Open a scan first")

    def _chosen(self) -> LabellingRow | None:
        chosen = self.table.selectionModel().selectedRows()
        return self._rows[chosen[0].row()] if chosen and chosen[0].row() < len(self._rows) else None

    def _begin(self) -> None:
        if attempt(self._workspace, lambda: self._workspace.label_again(self.observer.text().strip())):
            self.accept()

    def _open(self, *_: object) -> None:
        row = self._chosen()
        if row is not None and not row.is_open:
            attempt(self._workspace, lambda: self._workspace.open_labelling(row.observer, row.round))

    def _close(self) -> None:
        """Keep the observer, where another name was written."""
        name = self.observer.text().strip()
        if name and name != self._workspace.document.author:
            attempt(self._workspace, lambda: self._workspace.set_observer(name))
        self.reject()


def _words(row: LabellingRow) -> tuple[str, ...]:
    counts = (f"{row.progress[side].n_placed}/{row.progress[side].n_total}" for side in Side)
    blind = "yes" if row.blind else "no"
    return (row.observer or "unnamed", str(row.round), *counts, blind, time_text(row.changed))
