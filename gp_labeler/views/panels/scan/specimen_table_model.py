"""The list of specimens as a Qt model: one row for each specimen, with its thumbnail and progress."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from qtpy.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, QSize, Qt
from qtpy.QtGui import QFont, QPixmap

from gp_core.io.file_names import natural_key
from gp_core.landmarks.features import Side
from gp_labeler.document.specimen_list import SIDE_TOTAL, ListedSpecimen
from gp_labeler.imaging.thumbnail import THUMBNAIL_SIZE
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.formatting import NONE
from gp_labeler.views.signals import follow
from gp_labeler.views.times import time_text

__all__ = ["COLUMNS", "SpecimenTableModel"]

COLUMNS = ("", "Specimen", "Left", "Right", "Doubtful", "Labellings", "Last change", "Notes")
_HINTS = (
    "",
    "Double-click to open",
    "Placed or not seen, of 20",
    "Placed or not seen, of 20",
    "Labels that the check with the current atlas finds doubtful",
    "Observers, with the number of rounds",
    "When the file was last written",
    "Notes on the specimen; number of labels with a note or the certainty guess",
)

Index = QModelIndex | QPersistentModelIndex
_Role = Qt.ItemDataRole


class SpecimenTableModel(QAbstractTableModel):
    """The rows that the filter of the list leaves.

    Parameters
    ----------
    workspace : Workspace
        Whose list it shows.
    """

    def __init__(self, workspace: Workspace, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.rows: tuple[ListedSpecimen, ...] = ()
        self._column, self._descending = -1, False
        self._pixmaps: dict[bytes, QPixmap] = {}
        follow(self, workspace.specimens.changed, self.refresh)
        follow(self, workspace.document.reset, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Read the list again."""
        self.beginResetModel()
        self.rows = self._sorted(self._workspace.specimens.rows)
        self.endResetModel()

    def sort(self, column: int, order: Qt.SortOrder = Qt.SortOrder.AscendingOrder) -> None:  # noqa: D102
        self._column, self._descending = column, order == Qt.SortOrder.DescendingOrder
        self.refresh()

    def _sorted(self, rows: tuple[ListedSpecimen, ...]) -> tuple[ListedSpecimen, ...]:
        """Return rows by the chosen column; within equal ones, and without a column, in the list's order."""
        if self._column < 0:
            return rows
        key = partial(_sort_key, self._workspace.specimens.n_problems, self._column)
        return tuple(sorted(rows, key=key, reverse=self._descending))

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's
        return 0 if parent.isValid() else len(self.rows)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's
        return 0 if parent.isValid() else len(COLUMNS)

    def headerData(  # noqa: D102, N802 - Qt's name
        self, section: int, orientation: Qt.Orientation, role: int = _Role.DisplayRole
    ) -> Any:
        if orientation is not Qt.Orientation.Horizontal:
            return None
        shown = {int(_Role.DisplayRole): COLUMNS[section], int(_Role.ToolTipRole): _HINTS[section]}
        return shown.get(int(role))

    def data(self, index: Index, role: int = _Role.DisplayRole) -> Any:  # noqa: D102
        row, column = self.rows[index.row()], index.column()
        if column == 0:
            return self._picture(row, role)
        if role == _Role.DisplayRole:
            return self._words(row, column)
        if role == _Role.ToolTipRole:
            return row.problem or (row.notes if column == len(COLUMNS) - 1 else str(row.path))
        if role == _Role.FontRole and row.path == self._workspace.document.path:
            font = QFont()
            font.setBold(True)
            return font
        return None

    def _picture(self, row: ListedSpecimen, role: int) -> Any:
        if role == _Role.SizeHintRole:
            return QSize(THUMBNAIL_SIZE[0] // 2 + 8, THUMBNAIL_SIZE[1] // 2 + 4)
        if role != _Role.DecorationRole or not row.thumbnail:
            return None
        if row.thumbnail not in self._pixmaps:  # drawn once, however often the table is painted
            pixmap = QPixmap()
            pixmap.loadFromData(row.thumbnail)
            pixmap.setDevicePixelRatio(2.0)
            self._pixmaps[row.thumbnail] = pixmap
        return self._pixmaps[row.thumbnail]

    def _words(self, row: ListedSpecimen, column: int) -> str:
        if column == 1:
            return row.specimen
        if row.problem:
            return f"cannot be read: {row.problem}" if column == len(COLUMNS) - 1 else NONE
        if not row.is_begun:
            return "not begun" if column == len(COLUMNS) - 1 else NONE
        if column in (2, 3):
            side = tuple(Side)[column - 2]
            suggested = row.suggested.get(side, 0)
            return f"{row.done(side)}/{SIDE_TOTAL}" + (f" +{suggested}" if suggested else "")
        if column == 4:
            n = self._workspace.specimens.n_problems(row)
            return NONE if n is None else str(n)
        if column == 5:
            return _labellings(row)
        if column == 6:
            return time_text(row.changed)
        noted = f"{row.n_notes} noted" if row.n_notes else ""
        lost = "" if row.scan_is_there else "scan not found" if row.scan else "no scan"
        return "; ".join(filter(None, (" ".join(row.notes.split()), noted, lost)))


def _sort_key(n_problems: Callable[[ListedSpecimen], int | None], column: int, row: ListedSpecimen) -> Any:
    """Return what rows are ordered by: numbers as numbers, names with theirs, times as times."""
    if column in (2, 3):
        side = tuple(Side)[column - 2]
        return row.done(side), row.suggested.get(side, 0)
    if column == 4:
        n = n_problems(row)
        return -1 if n is None else n
    texts = {1: row.specimen, 5: _labellings(row), 6: row.changed, 7: row.problem or row.notes}
    return natural_key(texts.get(column, ""))


def _labellings(row: ListedSpecimen) -> str:
    """Return observers with their numbers of rounds, such as ``AB 2, CD``."""
    rounds: dict[str, int] = {}
    for text in row.labellings:
        observer = text.rpartition(", round ")[0]
        rounds[observer] = rounds.get(observer, 0) + 1
    return ", ".join(name if n == 1 else f"{name} {n}" for name, n in rounds.items())
