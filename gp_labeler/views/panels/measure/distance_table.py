"""Distances between all landmarks of a side, each above the published one: Figure 2 of the paper."""

from __future__ import annotations

from typing import Any

from qtpy.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QRectF,
    QSize,
    Qt,
    Signal,
)
from qtpy.QtGui import QColor, QPainter, QPen
from qtpy.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
    QWidget,
)

from gp_core.landmarks.features import CODES, Side, feature
from gp_core.study.distance_check import DistanceCheck, PairDistance
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.chips import draw_chip
from gp_labeler.views.fonts import fit, font_of, line_height, pixels, text_width
from gp_labeler.views.formatting import NONE
from gp_labeler.views.signals import follow
from gp_labeler.views.theme import theme_of

__all__ = ["DistanceMatrixModel", "DistanceMatrixView"]

PAIR_ROLE = int(Qt.ItemDataRole.UserRole) + 1
_WIDEST, _PAD, _CHIP, _ROWS_SHOWN = "00.0 ± 0.00", 8, 10, 6

Index = QModelIndex | QPersistentModelIndex


class DistanceMatrixModel(QAbstractTableModel):
    """Lower triangle: rows from the second feature on, columns up to the last but one."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pairs: dict[tuple[str, str], PairDistance] = {}
        self.side = Side.LEFT

    def show_check(self, check: DistanceCheck) -> None:
        """Show these distances."""
        self.side = check.side
        self._pairs = {(pair.feature_a, pair.feature_b): pair for pair in check.pairs}
        self.dataChanged.emit(self.index(0, 0), self.index(self.rowCount() - 1, self.columnCount() - 1))

    def index_of_pair(self, pair: PairDistance) -> QModelIndex:
        """Return the cell of a pair."""
        return self.index(CODES.index(pair.feature_a) - 1, CODES.index(pair.feature_b))

    def pair(self, index: Index) -> PairDistance | None:
        """Return what a cell shows; None above the diagonal."""
        return self._pairs.get((CODES[index.row() + 1], CODES[index.column()]))

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's
        return 0 if parent.isValid() else len(CODES) - 1

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, D102, N802 - Qt's
        return 0 if parent.isValid() else len(CODES) - 1

    def headerData(  # noqa: D102, N802 - Qt's name
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        code = CODES[section + (orientation is Qt.Orientation.Vertical)]
        if role == Qt.ItemDataRole.DisplayRole:
            return code
        return f"{code}, {feature(code).name}" if role == Qt.ItemDataRole.ToolTipRole else None

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:  # noqa: D102
        pair = self.pair(index)
        if pair is None:
            return None
        if role == Qt.ItemDataRole.DisplayRole:
            return NONE if pair.measured_mm is None else f"{pair.measured_mm:.2f}"
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            away = "" if pair.deviation_sd is None else f" ({pair.deviation_sd:+.1f} SD)"
            return f"{pair.text}{away}"
        return pair if role == PAIR_ROLE else None


class DistanceMatrixView(QTableView):
    """The table; a click on a distance shows it in the views.

    Parameters
    ----------
    workspace : Workspace
        Says which pair is shown in the views.
    """

    pair_chosen = Signal(object)
    """The `PairDistance` that was clicked."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.rows = DistanceMatrixModel(self)
        self.setModel(self.rows)
        self.setItemDelegate(_Cells(self))
        self.setAccessibleName("Distances between landmarks, and the published ones")
        self.setMouseTracking(True)
        self.setTabKeyNavigation(False)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        for header in (self.horizontalHeader(), self.verticalHeader()):
            header.setHighlightSections(False)
            header.setSectionsClickable(False)
            header.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        self.clicked.connect(self._choose)
        self.activated.connect(self._choose)
        follow(self, workspace.measure.changed, self._repaint)
        fit(self, self._fit)

    def show_check(self, check: DistanceCheck) -> None:
        """Show these distances, with the one in sight that disagrees most."""
        self.rows.show_check(check)
        if check.disagreeing:
            hint = QAbstractItemView.ScrollHint.PositionAtTop
            self.scrollTo(self.rows.index_of_pair(check.disagreeing[0]), hint)

    def is_shown(self, pair: PairDistance) -> bool:
        """Whether a distance is drawn in the views."""
        return self._workspace.measure.pair == (self.rows.side, pair.feature_a, pair.feature_b)

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return self.minimumSizeHint()

    def minimumSizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Return the room that some rows and columns take; the others scroll."""
        height = self.horizontalHeader().height() + _ROWS_SHOWN * self.verticalHeader().defaultSectionSize()
        return QSize(4 * self.horizontalHeader().defaultSectionSize(), height)

    def _repaint(self, *_: object) -> None:
        self.viewport().update()

    def _fit(self) -> None:
        self.horizontalHeader().setFixedHeight(line_height(self) + 10)
        self.verticalHeader().setFixedWidth(text_width(self, *CODES, bold=True) + 2 * _PAD)
        self.verticalHeader().setDefaultSectionSize(2 * line_height(self) + 6)
        self.horizontalHeader().setDefaultSectionSize(text_width(self, _WIDEST) + 2 * _PAD)
        self.updateGeometry()

    def _choose(self, index: QModelIndex) -> None:
        pair = self.rows.pair(index)
        if pair is not None and pair.measured_mm is not None:
            self.pair_chosen.emit(pair)


class _Cells(QStyledItemDelegate):
    """Paints the distance above the published one, and a triangle before a distance that disagrees."""

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        view, pair = self.parent(), index.data(PAIR_ROLE)
        assert isinstance(view, DistanceMatrixView)
        if pair is None:
            return
        theme, box = theme_of(view), QRectF(option.rect)
        painter.save()
        if option.state & QStyle.StateFlag.State_MouseOver and pair.measured_mm is not None:
            painter.fillRect(box, QColor(theme.hover))
        if view.is_shown(pair):
            painter.setPen(QPen(QColor(theme.accent), 2))
            painter.drawRect(box.adjusted(1, 1, -1, -1))
        if view.hasFocus() and view.currentIndex() == index:
            painter.setPen(QPen(QColor(theme.focus), 2))
            painter.drawRect(box.adjusted(3, 3, -3, -3))
        self._write(painter, view, box.adjusted(_PAD, 3, -_PAD, -3), pair, str(index.data()))
        painter.restore()

    def _write(
        self, painter: QPainter, view: QTableView, box: QRectF, pair: PairDistance, words: str
    ) -> None:
        theme, right = theme_of(view), Qt.AlignmentFlag.AlignRight
        painter.setFont(font_of(view, bold=pair.disagrees))
        colour = theme.state("doubtful") if pair.disagrees else QColor(theme.text)
        painter.setPen(QColor(theme.faint) if pair.measured_mm is None else colour)
        painter.drawText(box, right | Qt.AlignmentFlag.AlignTop, words)
        if pair.disagrees:
            side, line = pixels(view, _CHIP), line_height(view)
            top = box.top() + (line - side) / 2
            draw_chip(painter, "doubtful", QRectF(box.left(), top, side, side), theme)
        painter.setFont(font_of(view))
        painter.setPen(QColor(theme.muted))
        published = f"{pair.mean_mm:.1f} ± {pair.sd_mm:.2f}"
        painter.drawText(box, right | Qt.AlignmentFlag.AlignBottom, published)
