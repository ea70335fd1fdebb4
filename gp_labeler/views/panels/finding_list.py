"""A list of findings: the first few, the rest on demand; those that have a place open it at a click."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from qtpy.QtCore import Qt, Signal
from qtpy.QtGui import QMouseEvent
from qtpy.QtWidgets import QPushButton, QVBoxLayout, QWidget

from gp_labeler.views.layouts import in_row, wide
from gp_labeler.views.panels.parts import Notice, emptied

__all__ = ["FindingList", "FindingRow"]

N_SHOWN = 5


@dataclass(frozen=True)
class FindingRow:
    """One finding.

    Parameters
    ----------
    words, remedy : str
        What is said, and what to do about it.
    target : object
        What a click opens; None where there is nothing to open.
    level : str
        As for `Notice`.
    """

    words: str
    remedy: str = ""
    target: object = None
    level: str = "warning"


class FindingList(QWidget):
    """The findings, the first `N_SHOWN` of them until the user asks for all."""

    chosen = Signal(object)
    """The target of the finding that was clicked."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._rows: tuple[FindingRow, ...] = ()
        self._all = False
        self._layout = QVBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setSpacing(5)
        self.hide()

    def show_rows(self, rows: Sequence[FindingRow]) -> None:
        """Show other findings; as many as before where they are the same."""
        self._all = self._all and tuple(rows) == self._rows
        self._rows = tuple(rows)
        self._refresh()

    def _refresh(self) -> None:
        emptied(self._layout)
        self.setVisible(bool(self._rows))
        for row in self._rows if self._all else self._rows[:N_SHOWN]:
            self._layout.addWidget(_ClickableNotice(row, self.chosen.emit))
        n_more = len(self._rows) - N_SHOWN
        if n_more > 0:
            self._layout.addWidget(self._more_button(n_more))

    def _more_button(self, n_more: int) -> QPushButton:
        button = QPushButton("Show fewer" if self._all else f"and {n_more} more")
        button.setProperty("role", "link")
        button.clicked.connect(self._toggle)
        return button

    def _toggle(self) -> None:
        self._all = not self._all
        self._refresh()


class _ClickableNotice(QWidget):
    """A notice, and beside it a button that opens what it is about; a click on the words does the same."""

    def __init__(self, row: FindingRow, open_target: object) -> None:
        super().__init__()
        self._row, self._open = row, open_target
        layout = in_row(wide(Notice(row.level, row.words, row.remedy)), margins=0, spacing=6, of=self)
        if row.target is not None:
            self.setCursor(Qt.CursorShape.PointingHandCursor)
            show = QPushButton("Show")
            show.setProperty("role", "link")
            show.setToolTip("Open this animal at this point")
            show.setAccessibleName(f"Show {row.words}")
            show.clicked.connect(self._choose)
            layout.addWidget(show, 0, Qt.AlignmentFlag.AlignTop)

    def _choose(self) -> None:
        if self._row.target is not None and callable(self._open):
            self._open(self._row.target)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: N802 - Qt's name
        if event.button() is Qt.MouseButton.LeftButton and self.rect().contains(event.position().toPoint()):
            self._choose()
