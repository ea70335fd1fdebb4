"""The touches of one side as a Qt model: one row for whatever can be touched."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from qtpy.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, Qt

from gp_core.errors import GpError
from gp_core.landmarks.features import CODES
from gp_core.landmarks.repeats import combine_repeats
from gp_labeler.document.touches import Touch, TouchHow, frame_of
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.pose.wording import fine_mm, parse_position, touch_text, triple

__all__ = ["CLEAR", "NAME", "RESIDUAL", "ROW_ROLE", "USE", "XYZ", "TouchRow", "TouchTableModel"]

NAME, XYZ, RESIDUAL, USE, CLEAR = range(5)
_HEADINGS = ("Point", "x, y, z in mm", "Residual, mm", "Use", "")
ROW_ROLE = int(Qt.ItemDataRole.UserRole) + 1

Index = QModelIndex | QPersistentModelIndex


@dataclass(frozen=True)
class TouchRow:
    """What one row shows.

    Parameters
    ----------
    name : str
    touch : Touch, optional
    state : str
        A shape, see `chips.SHAPES`.
    residual : float, optional
        Distance from where the others expect the point, mm.
    suspect, target : bool
    """

    name: str
    touch: Touch | None
    state: str
    residual: float | None
    suspect: bool
    target: bool

    @property
    def is_skull(self) -> bool:
        """Whether it is a skull feature, which serves the registration only."""
        return self.name not in CODES

    @property
    def n_touches(self) -> int:
        """How often it was touched."""
        return 0 if self.touch is None else len(self.touch.positions)

    @property
    def label(self) -> str:
        """Its name, with the number of touches where there are several: ``MN ×3``."""
        return f"{self.name} ×{self.n_touches}" if self.n_touches > 1 else self.name  # noqa: RUF001 - times

    @cached_property
    def position(self) -> tuple[float, float, float] | None:
        """Position that the estimate uses, mm: the mean of the touches, without an outlier among them."""
        if self.touch is None or self.n_touches < 2:
            return None if self.touch is None else self.touch.position
        (one,) = combine_repeats({self.name: self.touch.positions}).values()
        x, y, z = one.mean.tolist()
        return x, y, z


class TouchTableModel(QAbstractTableModel):
    """Names, positions and residuals of the touches of the side in work.

    Parameters
    ----------
    workspace : Workspace
        Whose touches it shows and edits.
    tell : callable
        Is told of a `GpError` that an edit came to, and of None where one was made.
    """

    def __init__(
        self, workspace: Workspace, tell: Callable[[GpError | None], object], parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._workspace, self._tell = workspace, tell
        self.rows: tuple[TouchRow, ...] = ()
        self.n_skull = 0
        self.skull_shown = False
        self.refresh()

    def refresh(self) -> None:
        """Ask the workspace again."""
        known = [self._row(name) for name in self._workspace.pose.names]
        self.n_skull = sum(row.is_skull for row in known)
        rows = tuple(row for row in known if not row.is_skull or self._is_worth_a_row(row))
        if [row.name for row in rows] != [row.name for row in self.rows]:
            self.beginResetModel()
            self.rows = rows
            self.endResetModel()
            return
        before, largest = self.rows, self.largest
        self.rows = rows
        is_rescaled = self.largest != largest
        for n, (new, old) in enumerate(zip(rows, before, strict=True)):
            if replace(new, residual=old.residual) != old:
                self.dataChanged.emit(self.index(n, 0), self.index(n, CLEAR))
            elif is_rescaled or new.residual != old.residual:  # most rows, with every touch
                self.dataChanged.emit(self.index(n, RESIDUAL), self.index(n, RESIDUAL))

    @property
    def largest(self) -> float:
        """The longest residual, mm: full length of the bars, which are of 1 mm at least."""
        return max([1.0, *(row.residual for row in self.rows if row.residual is not None)])

    def row_of(self, name: str | None) -> int:
        """Return the number of a row by its name; -1 where there is none."""
        return next((n for n, row in enumerate(self.rows) if row.name == name), -1)

    def show_skull(self, shown: bool) -> None:
        """Show a row for every skull feature, or only for those that ask for attention."""
        self.skull_shown = shown
        self.refresh()

    def record(self, name: str, text: str) -> bool:
        """Take a typed position; return whether it could be taken."""
        pose = self._workspace.pose
        try:
            position = parse_position(text, name)
            on_scan = frame_of(self._workspace.document.state.touches, pose.side) == "scan"
            pose.record(position, TouchHow.SCAN if on_scan else TouchHow.TYPED, name=name)
        except GpError as error:
            self._tell(error)
            return False
        self._tell(None)
        return True

    def _is_worth_a_row(self, skull: TouchRow) -> bool:
        return self.skull_shown or skull.target or skull.suspect

    def _row(self, name: str) -> TouchRow:
        pose = self._workspace.pose
        touch = self._workspace.document.state.touches.get((pose.side, name))
        residual, suspect = self._residual(name)
        target = pose.target == name
        state = "active" if target else "to do"
        if touch is not None:
            state = "unseen" if touch.left_out else "doubtful" if suspect else "placed"
        return TouchRow(name, touch, state, residual, suspect, target)

    def _residual(self, name: str) -> tuple[float | None, bool]:
        estimate = self._workspace.pose.estimate
        if estimate is None:
            return None, False
        if name in CODES:
            found = estimate.pose
            return (None, False) if found is None else (found.residuals.get(name), name in found.suspects)
        fiducials = estimate.registered and estimate.registered.fiducials
        if not fiducials:
            return None, False
        return fiducials.residuals_mm.get(name), name in fiducials.suspects

    # Qt's methods

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's name
        return 0 if parent.isValid() else len(self.rows)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's name
        return 0 if parent.isValid() else len(_HEADINGS)

    def headerData(self, section: int, way: Qt.Orientation, role: int = 0) -> Any:  # noqa: D102, N802
        if way is Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return _HEADINGS[section]
        if role == Qt.ItemDataRole.TextAlignmentRole and section == XYZ:
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        if role == Qt.ItemDataRole.ToolTipRole and way is Qt.Orientation.Horizontal:
            return _HEADING_HINTS[section]
        return None

    def flags(self, index: Index) -> Qt.ItemFlag:  # noqa: D102
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        return flags | Qt.ItemFlag.ItemIsEditable if index.column() == XYZ else flags

    def data(self, index: Index, role: int = int(Qt.ItemDataRole.DisplayRole)) -> Any:  # noqa: D102
        if not index.isValid():
            return None
        row = self.rows[index.row()]
        if role == ROW_ROLE:
            return row
        if role == Qt.ItemDataRole.EditRole and index.column() == XYZ:
            return "" if row.position is None else " ".join(f"{x:.6g}" for x in row.position)
        if role == Qt.ItemDataRole.DisplayRole:
            return self._words(row, index.column())
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            return self._hint(row, index.column())
        return None

    def setData(self, index: Index, value: Any, role: int = 0) -> bool:  # noqa: D102, N802 - Qt's name
        if index.column() != XYZ or str(value) == self.data(index, Qt.ItemDataRole.EditRole):
            return False
        return self.record(self.rows[index.row()].name, str(value))

    def _words(self, row: TouchRow, column: int) -> str:
        if column == NAME:
            return row.label
        if column == XYZ:
            return "" if row.position is None else triple(row.position)
        return fine_mm(row.residual) if column == RESIDUAL and row.residual is not None else ""

    def _hint(self, row: TouchRow, column: int) -> str:
        if row.touch is not None and column == USE:
            return (
                f"Include {row.name} again" if row.touch.left_out else f"Leave {row.name} out of the estimate"
            )
        if row.touch is not None and column == CLEAR:
            return f"Clear {row.name}"
        return touch_text(row.name, row.touch, self._workspace.pose.estimate)


_HEADING_HINTS = (
    "Features to touch; the next one is highlighted",
    "Position of the touch; double-click or type to change it",
    "Distance of the touch from its prediction by the other touches",
    "Whether the estimate uses the touch",
    None,
)
