"""The table of the atlas: how much each feature varies, and how well the labels of the specimen fit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from qtpy.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, QRectF, QSize, Qt
from qtpy.QtGui import QColor, QPainter, QPen
from qtpy.QtWidgets import (
    QAbstractItemView,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
    QWidget,
)

from gp_core.atlas.label_check import HEAD_MM, Deviation
from gp_core.landmarks.features import CODES, FEATURES, Side, feature
from gp_labeler.document.edits import point_text
from gp_labeler.models.workflow import PointState
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.chips import draw_chip
from gp_labeler.views.fonts import fit, font_of, heading_width, line_height, pixels, text_width
from gp_labeler.views.formatting import NONE
from gp_labeler.views.panels.parts import fix_headers
from gp_labeler.views.signals import attempt, follow
from gp_labeler.views.theme import theme_of

__all__ = ["FeatureTable", "FeatureTableModel"]

_SIDES = (Side.LEFT, Side.RIGHT)
_HEADINGS = ("Feature", "SD, mm", "Left, mm · SD", "Right, mm · SD")
_HINTS = (
    "",
    "Variation between animals: standard deviation of a coordinate, mm",
    "Distance of the label from its prediction by the other labels, in mm and in standard deviations",
)
_ROW, _CHIP, _PAD = 22, 11, 8
_WIDEST = ("0.00", "10.00 · 10.0", "10.00 · 10.0")
"""The longest text below each heading after the first."""
DOUBTFUL_ROLE = int(Qt.ItemDataRole.UserRole) + 1

Index = QModelIndex | QPersistentModelIndex


class FeatureTableModel(QAbstractTableModel):
    """A row for each feature of the atlas in use.

    Parameters
    ----------
    workspace : Workspace
        Whose atlas and labels it shows.
    """

    def __init__(self, workspace: Workspace, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.codes: tuple[str, ...] = ()
        self._sd: dict[str, float] = {}
        self._away: dict[Side, Mapping[str, Deviation]] = {}
        self.refresh_atlas()

    def refresh_atlas(self) -> None:
        """Ask for the atlas again."""
        atlas = self._workspace.atlas.current
        self.beginResetModel()
        self.codes = () if atlas is None else atlas.codes
        spread = () if atlas is None else np.sqrt(atlas.variances(atlas.codes)).tolist()
        self._sd = dict(zip(self.codes, spread, strict=True))
        self.endResetModel()
        self.refresh_labels()

    def refresh_labels(self) -> None:
        """Ask how well the labels fit."""
        self._away = {side: self._workspace.labels.deviations(side) or {} for side in _SIDES}
        if self.codes:
            self.dataChanged.emit(self.index(0, 2), self.index(len(self.codes) - 1, 3))

    @property
    def n_judged(self) -> int:
        """Labels of both sides that were compared with the atlas."""
        return sum(len(away) for away in self._away.values())

    @property
    def n_doubtful(self) -> int:
        """Those of them that should be looked at again."""
        return sum(found.is_outlier for away in self._away.values() for found in away.values())

    @property
    def with_other_problems(self) -> tuple[str, ...]:
        """Points with another problem than their distance, such as ``IN`` or ``MN left``."""
        labels = self._workspace.labels
        found = {
            code if feature(code).shared else point_text(side, code): None
            for side in _SIDES
            for code, state in labels.point_states(side, wait=False).items()
            if state is PointState.DOUBTFUL
            and not (code in self._away[side] and self._away[side][code].is_outlier)
        }
        return tuple(found)

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's
        return 0 if parent.isValid() else len(self.codes)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's
        return len(_HEADINGS)

    def headerData(  # noqa: D102, N802 - Qt's name
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        if orientation is not Qt.Orientation.Horizontal:
            return None
        if role == Qt.ItemDataRole.DisplayRole:
            return _HEADINGS[section]
        if role == Qt.ItemDataRole.ToolTipRole:
            return _HINTS[min(section, 2)]
        if role == Qt.ItemDataRole.TextAlignmentRole and section:
            return int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        return None

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:  # noqa: D102
        code = self.codes[index.row()]
        found = self._found(index)
        if role == Qt.ItemDataRole.DisplayRole:
            return (code, f"{self._sd[code]:.2f}", "", "")[index.column()] or _words(found)
        if role == DOUBTFUL_ROLE:
            return found is not None and found.is_outlier
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            return self._sentence(code, index, found)
        return None

    def _found(self, index: Index) -> Deviation | None:
        if index.column() < 2:
            return None
        return self._away[_SIDES[index.column() - 2]].get(self.codes[index.row()])

    def _sentence(self, code: str, index: Index, found: Deviation | None) -> str:
        name = f"{code}, {feature(code).name}"
        if index.column() == 0:
            return name
        if index.column() == 1:
            return f"{name}: {self._sd[code]:.2f} mm between animals"
        side = _SIDES[index.column() - 2].word
        if found is None:
            return f"{name}, {side}: not placed, or too few other labels"
        return f"{name}, {side}: {found.text} ({found.n_sd:.1f} SD)"


def _words(found: Deviation | None) -> str:
    if found is None:
        return NONE
    return f"{found.distance:.2f} · {found.n_sd:.1f}" if found.distance <= HEAD_MM else found.word


class FeatureTable(QTableView):
    """The table; a click on a label goes to it.

    Parameters
    ----------
    workspace : Workspace
        Whose atlas and labels it shows.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.rows = FeatureTableModel(workspace, self)
        self.setModel(self.rows)
        self.setItemDelegate(_Cells(self))
        self.setAccessibleName("Features of the atlas")
        self.setShowGrid(False)
        self.setMouseTracking(True)
        self.setTabKeyNavigation(False)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        for policy in (self.setHorizontalScrollBarPolicy, self.setVerticalScrollBarPolicy):
            policy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._arrange()
        self.clicked.connect(self._go_to)
        self.activated.connect(self._go_to)
        follow(self, workspace.atlas.changed, self._on_atlas)
        for signal in (
            workspace.labels.checked,
            workspace.document.landmarks_changed,
            workspace.document.reset,
        ):
            follow(self, signal, self._on_labels)

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        least = self.minimumSizeHint()
        return QSize(least.width() + names_width(self), least.height())

    def minimumSizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Return the room that all but the names take: in a narrow window the codes alone are shown."""
        row = self.verticalHeader().defaultSectionSize()
        height = self.horizontalHeader().height() + row * max(len(self.rows.codes), 1) + 4
        first = max(_PAD + _code_width(self), heading_width(self, _HEADINGS[0]))
        return QSize(first + sum(self._widths()) + 4, height)

    def _arrange(self) -> None:
        fix_headers(self)
        fit(self, self._fit)

    def _fit(self) -> None:
        """Give columns and rows the room that their words take."""
        self.horizontalHeader().setFixedHeight(line_height(self) + 10)
        self.verticalHeader().setDefaultSectionSize(max(pixels(self, _ROW), line_height(self)))
        for column, width in enumerate(self._widths(), 1):
            self.setColumnWidth(column, width)
        self.updateGeometry()

    def _widths(self) -> list[int]:
        chip = pixels(self, _CHIP) + 5
        needed = [text_width(self, words) + (chip if n else 0) for n, words in enumerate(_WIDEST)]
        return [
            max(heading_width(self, heading), words + 2 * _PAD)
            for heading, words in zip(_HEADINGS[1:], needed, strict=True)
        ]

    def _on_atlas(self, *_: object) -> None:
        self.rows.refresh_atlas()
        self.updateGeometry()

    def _on_labels(self, *_: object) -> None:
        self.rows.refresh_labels()

    def _go_to(self, index: QModelIndex) -> None:
        if index.column() >= 2:
            side, code = _SIDES[index.column() - 2], self.rows.codes[index.row()]
            attempt(self._workspace, lambda: self._workspace.labels.go_to(side, code))


class _Cells(QStyledItemDelegate):
    """Paints code and name, numbers on the right, and a shape before what is doubtful."""

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        view = self.parent()
        assert isinstance(view, QTableView)
        theme, box = theme_of(view), QRectF(option.rect)
        painter.save()
        if option.state & QStyle.StateFlag.State_MouseOver:
            painter.fillRect(box, QColor(theme.hover))
        if view.hasFocus() and view.currentIndex() == index:
            painter.setPen(QPen(QColor(theme.focus), 2))
            painter.drawRect(box.adjusted(1, 1, -1, -1))
        font = font_of(view)
        words, middle = str(index.data()), Qt.AlignmentFlag.AlignVCenter
        if index.column() == 0:
            self._name(painter, view, box.adjusted(_PAD, 0, 0, 0), words)
        else:
            doubtful = bool(index.data(DOUBTFUL_ROLE))
            painter.setFont(font)
            painter.setPen(theme.state("doubtful") if doubtful else QColor(theme.text))
            if words == NONE:
                painter.setPen(QColor(theme.faint))
            painter.drawText(box.adjusted(0, 0, -7, 0), middle | Qt.AlignmentFlag.AlignRight, words)
            if doubtful:
                side = pixels(view, _CHIP)
                left = box.right() - 7 - text_width(view, words) - side - 4
                chip = QRectF(left, box.center().y() - side / 2, side, side)
                draw_chip(painter, "doubtful", chip, theme)
        painter.restore()

    def _name(self, painter: QPainter, view: QTableView, box: QRectF, code: str) -> None:
        theme, middle = theme_of(view), Qt.AlignmentFlag.AlignVCenter
        painter.setFont(font_of(view, bold=True))
        painter.setPen(QColor(theme.text))
        painter.drawText(box, middle, code)
        words = box.adjusted(_code_width(view), 0, 0, 0)
        if words.width() >= names_width(view):
            painter.setFont(font_of(view))
            painter.setPen(QColor(theme.muted))
            painter.drawText(words, middle, feature(code).name)


def names_width(view: QWidget) -> int:
    """Return what the longest name of a feature takes, logical pixels."""
    return text_width(view, *(row.name for row in FEATURES))


def _code_width(view: QWidget) -> int:
    return text_width(view, *CODES, bold=True) + pixels(view, 6)
