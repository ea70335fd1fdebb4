"""Unsaved edits of programs that were killed: recover, keep or delete them."""

from __future__ import annotations

from collections.abc import Sequence

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import (
    QDialog,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QWidget,
)

from gp_labeler.document.recovery import Recovery
from gp_labeler.views.fonts import fit
from gp_labeler.views.layouts import STRETCH, in_column, in_row, placed, wide
from gp_labeler.views.panels.parts import IconLabel, open_at, text_label

__all__ = ["RecoverDialog"]


class RecoverDialog(QDialog):
    """Lists what can be recovered.

    Parameters
    ----------
    recoveries : sequence of Recovery
        What was found, the latest first.
    """

    recover_asked = Signal(object)
    """The `Recovery` to go on with."""

    def __init__(self, recoveries: Sequence[Recovery], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Unsaved work was found")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setModal(True)
        self.list = QListWidget()
        self.list.setAccessibleName("Unsaved work")
        self.list.setWordWrap(True)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setResizeMode(QListWidget.ResizeMode.Adjust)
        self.list.setSpacing(2)
        for recovery in recoveries:
            item = QListWidgetItem(_words(recovery), self.list)
            item.setData(Qt.ItemDataRole.UserRole, recovery)
        fit(self.list, self.list.scheduleDelayedItemsLayout)  # rows are as high as their words
        self.list.setCurrentRow(0)
        self.list.currentRowChanged.connect(self._refresh)
        self.list.itemActivated.connect(self._recover)
        self._confirming = False
        self._lay_out()
        self._refresh()
        open_at(self, 560, 340)

    def _lay_out(self) -> None:
        self.recover, self.later = QPushButton("Recover"), QPushButton("Later")
        self.delete = QPushButton("Delete…")
        self.recover.setProperty("role", "primary")
        self.recover.setDefault(True)
        self.later.setToolTip("Keep it; it is offered again at the next start")
        self.recover.clicked.connect(self._recover)
        self.later.clicked.connect(self.reject)
        self.delete.clicked.connect(self._delete)
        top = in_row(placed(IconLabel("clock", "accent_text", 24), Qt.AlignmentFlag.AlignTop), spacing=12)
        words = in_column(text_label("Nothing is lost", "title"), spacing=2)
        hint = "The program ended before this was saved. Every edit was kept, and you can continue."
        words.addWidget(text_label(hint, "hint", wrap=True))
        top.addLayout(words, 1)
        in_column(
            top,
            wide(self.list),
            in_row(self.delete, STRETCH, self.later, self.recover),
            margins=(20, 16, 20, 14),
            spacing=12,
            of=self,
        )

    def _refresh(self, *_: object) -> None:
        chosen = self.list.currentItem() is not None
        self._confirming = False
        self.delete.setText("Delete…")
        self.recover.setEnabled(chosen)
        self.delete.setEnabled(chosen)

    def _recover(self, *_: object) -> None:
        item = self.list.currentItem()
        if item is not None:
            self.recover_asked.emit(item.data(Qt.ItemDataRole.UserRole))
            self.accept()

    def _delete(self) -> None:
        """Delete the chosen one at the second click."""
        item = self.list.currentItem()
        if item is None:
            return
        if not self._confirming:
            self._confirming = True
            self.delete.setText("Delete it permanently?")
            return
        recovery: Recovery = item.data(Qt.ItemDataRole.UserRole)
        recovery.discard()
        self.list.takeItem(self.list.row(item))
        self._refresh()
        if self.list.count() == 0:
            self.accept()


def _words(recovery: Recovery) -> str:
    file = recovery.specimen_file
    where = f"Saved in {file.name}" if file is not None else "Never saved"
    return f"{recovery.text}\n{where}"
