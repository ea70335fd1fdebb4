"""The table of features as a Qt model: one row a feature, one column a side."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, Qt

from gp_core.landmarks.features import CODES, FEATURES, Side, feature
from gp_labeler.session.workflow import PointState
from gp_labeler.views.bind import follow, mm_text
from gp_labeler.workbench import Workbench

__all__ = ["ACTIVE_ROLE", "CODE_ROLE", "LOCKED_ROLE", "SIDES", "STATE_ROLE", "LandmarkModel"]

SIDES = (Side.LEFT, Side.RIGHT)
"""Of the columns after the first."""

_USER = int(Qt.ItemDataRole.UserRole)
STATE_ROLE, ACTIVE_ROLE, LOCKED_ROLE, CODE_ROLE = (_USER + n for n in range(1, 5))

Index = QModelIndex | QPersistentModelIndex


class LandmarkModel(QAbstractTableModel):
    """States of the 20 features on both sides, as words and as roles for the chips.

    Parameters
    ----------
    workbench : Workbench
        Whose session it shows.
    """

    def __init__(self, workbench: Workbench, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._workbench = workbench
        self._states: dict[Side, dict[str, PointState]] = {}
        self._shown: dict[int, tuple[object, ...]] = {}
        for signal in (
            workbench.session_replaced,
            workbench.landmarks_changed,
            workbench.ghosts_changed,
            workbench.doubts_changed,
            workbench.active_changed,
        ):
            follow(self, signal, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Ask the session anew, and tell of the rows that changed."""
        session, before = self._workbench.session, self._shown
        self._states = {side: session.point_states(side, wait=False) for side in SIDES}
        self._shown = {row: self._row(row) for row in range(len(CODES))}
        for row in range(len(CODES)):
            if self._shown[row] != before.get(row):
                self.dataChanged.emit(self.index(row, 0), self.index(row, len(SIDES)))
        self.headerDataChanged.emit(Qt.Orientation.Horizontal, 0, len(SIDES))

    def _row(self, row: int) -> tuple[object, ...]:
        """Return everything that the table shows of a feature."""
        roles = (STATE_ROLE, ACTIVE_ROLE, LOCKED_ROLE, int(Qt.ItemDataRole.DisplayRole))
        return tuple(self._cell(CODES[row], side, role) for side in SIDES for role in roles)

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's way
        return 0 if parent.isValid() else len(CODES)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's way
        return 0 if parent.isValid() else 1 + len(SIDES)

    def headerData(  # noqa: D102, N802 - Qt's name
        self, section: int, orientation: Qt.Orientation, role: int = int(Qt.ItemDataRole.DisplayRole)
    ) -> Any:
        if orientation is not Qt.Orientation.Horizontal or role != Qt.ItemDataRole.DisplayRole:
            return None
        if section == 0:
            return "Feature"
        side = SIDES[section - 1]
        progress = self._workbench.session.progress(side)
        return f"{side.word.capitalize()} {progress.n_placed}/{progress.n_total}"

    def data(self, index: Index, role: int = int(Qt.ItemDataRole.DisplayRole)) -> Any:  # noqa: D102
        if not index.isValid():
            return None
        row = FEATURES[index.row()]
        if role == CODE_ROLE:
            return row.code
        if index.column() == 0:
            return self._name(row.code, role)
        return self._cell(row.code, SIDES[index.column() - 1], role)

    def _name(self, code: str, role: int) -> Any:
        row = feature(code)
        if role == Qt.ItemDataRole.DisplayRole:
            return row.name
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            return f"{code}: {row.name}. {row.definition}"
        return None

    def _cell(self, code: str, side: Side, role: int) -> Any:
        state = self._states[side][code]
        active = self._workbench.session.active
        is_active = active.code == code and (active.side is side or feature(code).shared)
        if role == STATE_ROLE:
            return state.value
        if role == ACTIVE_ROLE:
            return is_active
        if role == LOCKED_ROLE:
            return not feature(code).computed and self._workbench.session.state.landmark(side, code).locked
        if role == Qt.ItemDataRole.DisplayRole:
            return self._word(code, side, state, is_active)
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            return self._sentence(code, side, state)
        return None

    def _word(self, code: str, side: Side, state: PointState, is_active: bool) -> str:
        if is_active and state in (PointState.TO_DO, PointState.GHOST):
            return "place"
        if state is PointState.DOUBTFUL:
            return self._workbench.session.doubts(side)[code].word
        if feature(code).computed and state is PointState.TO_DO:
            return "by itself"
        return str(state.value)

    def _sentence(self, code: str, side: Side, state: PointState) -> str:
        text = f"{code} {side.word}: {state.value}"
        if feature(code).computed and state is PointState.TO_DO:
            return f"{code} {side.word}: computed once CA, CB, RWA and RWP are placed"
        if state is PointState.DOUBTFUL:
            text += f", {self._workbench.session.doubts(side)[code].text}"
        if state is PointState.GHOST:
            text += (
                f", expected within {mm_text(self._workbench.session.ghosts(side)[code].radius_95)} (95 %)"
            )
        return text
