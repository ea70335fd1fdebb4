"""The table of landmarks: 20 features, both sides, each with the shape and colour of its state."""

from __future__ import annotations

from qtpy.QtCore import QEvent, QModelIndex, QPersistentModelIndex, QPoint, QRectF, QSize, Qt
from qtpy.QtGui import QColor, QKeyEvent, QPainter, QPen, QResizeEvent
from qtpy.QtWidgets import (
    QAbstractItemView,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
    QWidget,
)

from gp_core.landmarks.features import CODES, FEATURES, Side, feature, index_of
from gp_labeler.document.edits import ClearPoint
from gp_labeler.models.workflow import PointState
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.chips import draw_chip
from gp_labeler.views.fonts import fit, font_of, heading_width, line_height, pixels, text_width
from gp_labeler.views.layouts import in_column
from gp_labeler.views.panels.label.landmark_menu import landmark_menu
from gp_labeler.views.panels.label.landmark_table_model import (
    ACTIVE_ROLE,
    CODE_ROLE,
    LOCKED_ROLE,
    SIDES,
    STATE_ROLE,
    LandmarkTableModel,
)
from gp_labeler.views.panels.parts import fix_headers
from gp_labeler.views.signals import attempt, blocked, follow
from gp_labeler.views.theme import Theme, theme_of

__all__ = ["LandmarkTable"]

_ROOMY_ROW = 24
"""Height of a row where there is room, logical pixels at the normal text size."""

_FEWEST_ROWS = 6
"""Rows that are shown in a low window, which scrolls the table."""

_WIDEST_STATES = (*(state.value for state in PointState), "automatic", "99.9 mm")
_CHIP, _PAD = 12, 8


class LandmarkTable(QWidget):
    """The table; a click or the arrow keys go to a point, a right click opens the menu of the point.

    Parameters
    ----------
    workspace : Workspace
        What it shows and edits.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.model = LandmarkTableModel(workspace, self)
        self.view = _TableView(self.model, self)
        in_column(self.view, margins=0, of=self)
        fit(self, lambda: self.setMaximumHeight(self.view.height_of(len(CODES), roomy=True)))
        self.view.selectionModel().currentChanged.connect(self._on_current)
        self.view.clicked.connect(self._on_clicked)
        self.view.customContextMenuRequested.connect(self._open_menu)
        follow(self, workspace.labels.active_changed, self._show_active)
        follow(self, workspace.document.reset, self._show_active)
        self._show_active()

    def target_of(self, index: QModelIndex) -> tuple[Side, str]:
        """Return which point a cell is about; a feature's name means the side being worked on."""
        side = self._workspace.labels.active.side if index.column() == 0 else SIDES[index.column() - 1]
        return side, FEATURES[index.row()].code

    def _on_current(self, current: QModelIndex, previous: QModelIndex) -> None:
        if current.isValid():
            self._go_to(current)

    def _on_clicked(self, index: QModelIndex) -> None:
        self._go_to(index)

    def _go_to(self, index: QModelIndex) -> None:
        side, code = self.target_of(index)
        attempt(self._workspace, lambda: self._workspace.labels.go_to(side, code))

    def _show_active(self, *_: object) -> None:
        """Bring the cursor of the table to the active point."""
        active = self._workspace.labels.active
        index = QModelIndex() if active.code is None else self._index(active.side, active.code)
        before = self.view.currentIndex()
        if before == index:
            return
        with blocked(self.view.selectionModel()):
            self.view.setCurrentIndex(index)
        if index.isValid():
            self.view.scrollTo(index)
        for changed in (before, index):
            self.view.repaint_row(changed.row())

    def _index(self, side: Side, code: str) -> QModelIndex:
        return self.model.index(index_of(code), 1 + SIDES.index(side))

    def _open_menu(self, position: QPoint) -> None:
        index = self.view.indexAt(position)
        if index.isValid():
            menu = landmark_menu(self._workspace, *self.target_of(index), self)
            menu.popup(self.view.viewport().mapToGlobal(position))

    def clear_current(self) -> None:
        """Clear the point of the current cell."""
        side, code = self.target_of(self.view.currentIndex())
        if self.view.currentIndex().isValid() and not feature(code).computed:
            attempt(self._workspace, lambda: self._workspace.document.do(ClearPoint(side, code)))


class _TableView(QTableView):
    """Twenty rows that share the height there is."""

    def __init__(self, model: LandmarkTableModel, parent: LandmarkTable) -> None:
        super().__init__(parent)
        self._table = parent
        self.setModel(model)
        self.setItemDelegate(_ChipDelegate(self))
        self.setAccessibleName("Landmarks")
        self.setShowGrid(False)
        self.setMouseTracking(True)
        self.setTabKeyNavigation(False)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerItem)
        fix_headers(self)
        model.headings_changed.connect(self._on_headings)
        fit(self, self._fit)

    def height_of(self, rows: int, *, roomy: bool = False) -> int:
        """Return how high it is with so many rows, logical pixels."""
        row = pixels(self, _ROOMY_ROW) if roomy else self._lowest_row
        return self.horizontalHeader().height() + max(row, self._lowest_row) * rows + 4

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        return self.minimumSizeHint()

    def minimumSizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        names = _PAD + _code_width(self) + text_width(self, *(row.name for row in FEATURES)) + _PAD
        bar = self.verticalScrollBar().sizeHint().width()
        return QSize(names + sum(self._state_widths()) + bar + 4, self.height_of(_FEWEST_ROWS))

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802 - Qt's name
        self._share_height()
        super().resizeEvent(event)

    @property
    def _lowest_row(self) -> int:
        return line_height(self)

    def _on_headings(self) -> None:
        """Show other counts; only where one takes more room than its column has are columns fitted again."""
        widths = [self.columnWidth(column) for column in (1, 2)]
        if widths != self._state_widths():
            self._fit()
        self.horizontalHeader().viewport().update()

    def _fit(self) -> None:
        """Give columns and rows the room that their words take."""
        self.horizontalHeader().setFixedHeight(line_height(self) + 10)
        self.verticalHeader().setMinimumSectionSize(self._lowest_row)
        for column, width in enumerate(self._state_widths(), 1):
            self.setColumnWidth(column, width)
        self._share_height()
        self.updateGeometry()

    def _state_widths(self) -> list[int]:
        way, model = Qt.Orientation.Horizontal, self.model()
        return [_state_width(self, str(model.headerData(column, way))) for column in (1, 2)]

    def _share_height(self) -> None:
        height = (self.viewport().height() - 2) // len(CODES)
        highest = max(pixels(self, _ROOMY_ROW), self._lowest_row)
        self.verticalHeader().setDefaultSectionSize(min(max(height, self._lowest_row), highest))

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802 - Qt's name
        if event.key() in (Qt.Key.Key_Delete, Qt.Key.Key_Backspace):
            self._table.clear_current()
        elif event.key() == Qt.Key.Key_Menu:
            where = self.visualRect(self.currentIndex()).center()
            self.customContextMenuRequested.emit(where)
        elif event.text().isprintable() and event.text():
            event.ignore()  # letters are the window's shortcuts, not a search
        else:
            super().keyPressEvent(event)

    def repaint_row(self, row: int) -> None:
        """Draw one row again, where there is such a row."""
        for column in range(self.model().columnCount()):
            self.update(self.model().index(row, column))

    def leaveEvent(self, event: QEvent) -> None:  # noqa: N802 - Qt's name
        super().leaveEvent(event)
        self.viewport().update()


def _code_width(view: QWidget) -> int:
    """Return how much the codes take, with the gap behind them."""
    return text_width(view, *CODES, bold=True) + pixels(view, 6)


def _state_width(view: QWidget, heading: str) -> int:
    """Return how much a column of states takes: chip, word and lock, or what stands above them."""
    chip = _PAD + pixels(view, _CHIP) + 4
    words = chip + text_width(view, *_WIDEST_STATES) + pixels(view, _CHIP) + 4
    return max(words, heading_width(view, heading))


class _ChipDelegate(QStyledItemDelegate):
    """Paints a feature's code and name, or the state of a point as a chip and a word."""

    def paint(
        self, painter: QPainter, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> None:
        view = self.parent()
        assert isinstance(view, QTableView)
        theme, box = theme_of(view), QRectF(option.rect)
        painter.save()
        self._ground(painter, option, index, theme, view)
        painter.setClipRect(box)
        if index.column() == 0:
            self._name(painter, view, box, index, theme)
        else:
            self._state(painter, view, box, index, theme)
        painter.restore()

    def _ground(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
        theme: Theme,
        view: QTableView,
    ) -> None:
        box = QRectF(option.rect)
        is_row = view.currentIndex().row() == index.row()
        is_over = bool(option.state & QStyle.StateFlag.State_MouseOver)
        if bool(index.data(ACTIVE_ROLE)) or (is_row and index.column() == 0):
            painter.fillRect(box, QColor(theme.selected))
        elif is_over:
            painter.fillRect(box, QColor(theme.hover))
        if view.hasFocus() and view.currentIndex() == index:
            painter.setPen(QPen(QColor(theme.focus), 2))
            painter.drawRect(box.adjusted(1, 1, -1, -1))

    def _name(
        self,
        painter: QPainter,
        view: QTableView,
        box: QRectF,
        index: QModelIndex | QPersistentModelIndex,
        theme: Theme,
    ) -> None:
        painter.setFont(font_of(view, bold=True))
        painter.setPen(QColor(theme.text))
        middle = Qt.AlignmentFlag.AlignVCenter
        painter.drawText(box.adjusted(_PAD, 0, 0, 0), middle, str(index.data(CODE_ROLE)))
        painter.setFont(font_of(view))
        painter.setPen(QColor(theme.muted))
        painter.drawText(box.adjusted(_PAD + _code_width(view), 0, 0, 0), middle, str(index.data()))

    def _state(
        self,
        painter: QPainter,
        view: QTableView,
        box: QRectF,
        index: QModelIndex | QPersistentModelIndex,
        theme: Theme,
    ) -> None:
        state, active = str(index.data(STATE_ROLE)), bool(index.data(ACTIVE_ROLE))
        waiting = state in ("to do", "ghost")
        shape = "active" if active and waiting else state
        side = pixels(view, _CHIP)
        chip = QRectF(box.left() + _PAD - 2, box.center().y() - side / 2, side, side)
        draw_chip(painter, shape, chip, theme)
        painter.setFont(font_of(view))
        painter.setPen(theme.state(shape))
        words, said = box.adjusted(_PAD + side + 4, 0, 0, 0), str(index.data())
        painter.drawText(words, Qt.AlignmentFlag.AlignVCenter, said)
        if index.data(LOCKED_ROLE):
            end = words.left() + text_width(view, said) + 4
            draw_chip(painter, "locked", chip.translated(end - chip.left(), 0), theme)
