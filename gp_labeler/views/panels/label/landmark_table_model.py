"""The table of features as a Qt model: one row for each feature, one column for each side."""

from __future__ import annotations

from typing import Any, NamedTuple

from qtpy.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, Qt, Signal

from gp_core.landmarks.features import CODES, Side, feature, index_of
from gp_labeler.models.workflow import PointState
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.formatting import mm_text, suggestion_text
from gp_labeler.views.signals import follow

__all__ = ["ACTIVE_ROLE", "CODE_ROLE", "LOCKED_ROLE", "SIDES", "STATE_ROLE", "LandmarkTableModel"]

SIDES = (Side.LEFT, Side.RIGHT)
"""Of the columns after the first."""

_USER = int(Qt.ItemDataRole.UserRole)
STATE_ROLE, ACTIVE_ROLE, LOCKED_ROLE, CODE_ROLE = (_USER + n for n in range(1, 5))

Index = QModelIndex | QPersistentModelIndex


class _Cell(NamedTuple):
    """Everything that the table shows of one feature of one side."""

    state: PointState
    is_active: bool
    is_locked: bool
    word: str


class LandmarkTableModel(QAbstractTableModel):
    """States of the 20 features on both sides, as words and as roles for the chips.

    It tells of each cell that changed, and of no other: the table then draws these alone.

    Parameters
    ----------
    workspace : Workspace
        What it shows.
    """

    headings_changed = Signal()
    """Words of the header; for `headerDataChanged` Qt would lay out and draw the whole table again."""

    def __init__(self, workspace: Workspace, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self._cells: dict[tuple[int, int], _Cell] = {}
        self._headings: tuple[str, ...] = ()
        for signal in (
            workspace.document.reset,
            workspace.document.landmarks_changed,
            workspace.labels.ghosts_changed,
            workspace.labels.problems_changed,
            workspace.labels.active_changed,
        ):
            follow(self, signal, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Read the models again, and announce the cells that changed."""
        cells, headings, labels = self._cells, self._headings, self._workspace.labels
        self._cells = {
            (index_of(code), column): self._cell(code, side, state)
            for column, side in enumerate(SIDES, 1)
            for code, state in labels.point_states(side, wait=False).items()
        }
        self._headings = ("Feature", *(self._heading(side) for side in SIDES))
        for where, cell in self._cells.items():
            if cell != cells.get(where):
                index = self.index(*where)
                self.dataChanged.emit(index, index)
        if self._headings != headings:
            self.headings_changed.emit()

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's way
        return 0 if parent.isValid() else len(CODES)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's way
        return 0 if parent.isValid() else 1 + len(SIDES)

    def headerData(  # noqa: D102, N802 - Qt's name
        self, section: int, orientation: Qt.Orientation, role: int = int(Qt.ItemDataRole.DisplayRole)
    ) -> Any:
        if orientation is not Qt.Orientation.Horizontal:
            return None
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole) and section:
            side = SIDES[section - 1]
            return f"{side.word.capitalize()}: {self._workspace.labels.progress(side).text}"
        return self._headings[section] if role == Qt.ItemDataRole.DisplayRole else None

    def data(self, index: Index, role: int = int(Qt.ItemDataRole.DisplayRole)) -> Any:  # noqa: D102
        if not index.isValid():
            return None
        code, column = CODES[index.row()], index.column()
        if role == CODE_ROLE:
            return code
        if column == 0:
            return self._name(code, role)
        cell = self._cells[index.row(), column]
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            return self._sentence(code, SIDES[column - 1], cell.state)
        shown = {
            STATE_ROLE: cell.state.value,
            ACTIVE_ROLE: cell.is_active,
            LOCKED_ROLE: cell.is_locked,
            int(Qt.ItemDataRole.DisplayRole): cell.word,
        }
        return shown.get(role)

    def _name(self, code: str, role: int) -> Any:
        row = feature(code)
        if role == Qt.ItemDataRole.DisplayRole:
            return row.name
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            return f"{code}: {row.name}. {row.definition}"
        return None

    def _heading(self, side: Side) -> str:
        progress = self._workspace.labels.progress(side)
        return f"{side.word.capitalize()} {progress.n_placed}/{progress.n_total}"

    def _cell(self, code: str, side: Side, state: PointState) -> _Cell:
        row, document, labels = feature(code), self._workspace.document, self._workspace.labels
        active = labels.active
        is_active = active.code == code and (active.side is side or row.shared)
        is_locked = not row.computed and document.state.landmark(side, code).locked
        return _Cell(state, is_active, is_locked, self._word(code, side, state, is_active))

    def _word(self, code: str, side: Side, state: PointState, is_active: bool) -> str:
        if is_active and state in (PointState.TO_DO, PointState.GHOST):
            return "place"
        if state is PointState.DOUBTFUL and (
            problem := self._workspace.labels.known_problems(side).get(code)
        ):
            return problem.word
        if feature(code).computed and state is PointState.TO_DO:
            return "automatic"
        return str(state.value)

    def _sentence(self, code: str, side: Side, state: PointState) -> str:
        text = f"{code} {side.word}: {state.value}"
        if feature(code).computed and state is PointState.TO_DO:
            return f"{code} {side.word}: computed when CA, CB, RWA and RWP are placed"
        if state is PointState.DOUBTFUL and (
            problem := self._workspace.labels.known_problems(side).get(code)
        ):
            text += f", {problem.text}"
        if state is PointState.SUGGESTED:
            said = suggestion_text(self._workspace.document.landmarks(side).suggested[code])
            text += f", not confirmed{f' ({said})' if said else ''}"
        if state is PointState.GHOST:
            text += f", expected within {mm_text(self._workspace.labels.ghosts(side)[code].radius_95)} (95 %)"
        return text + self._annotation(code, side)

    def _annotation(self, code: str, side: Side) -> str:
        if feature(code).computed:
            return ""
        mark = self._workspace.document.state.landmark(side, code)
        certainty = f", {mark.certainty.value}" if mark.certainty else ""
        return certainty + (f": {mark.note}" if mark.note else "")
