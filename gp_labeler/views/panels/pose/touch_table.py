"""The table of touches: where each point was touched, how well it fits, and whether it counts."""

from __future__ import annotations

from qtpy.QtCore import (
    QEvent,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QPoint,
    QRectF,
    QSize,
    Qt,
    Signal,
)
from qtpy.QtGui import (
    QColor,
    QFocusEvent,
    QKeyEvent,
    QKeySequence,
    QMouseEvent,
    QPainter,
    QPen,
    QResizeEvent,
)
from qtpy.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QLineEdit,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
    QWidget,
)

from gp_labeler.views.focus_ring import BY_KEYBOARD
from gp_labeler.views.fonts import field_width, fit, font_of, line_height, pixels
from gp_labeler.views.panels.parts import fix_headers
from gp_labeler.views.panels.pose.touch_cells import column_widths, names_width, paint_cell, paint_ground
from gp_labeler.views.panels.pose.touch_table_model import CLEAR, NAME, USE, XYZ, TouchTableModel
from gp_labeler.views.theme import theme_of

__all__ = ["TouchTable"]

_ROW, _ROOMY_ROW = 20, 24
"""Height of a row, logical pixels at the normal text size."""

_BEGINS_NUMBER = "0123456789-+."
Index = QModelIndex | QPersistentModelIndex


class TouchTable(QTableView):
    """Rows of `TouchTableModel`.

    Parameters
    ----------
    model : TouchTableModel
        What it shows.
    """

    use_asked = Signal(str)
    """Leave this one out, or take it in again."""
    clear_asked = Signal(str)
    chosen = Signal(str)
    """A row was clicked, or reached by keys."""
    looked_at = Signal(str)
    """Name under the pointer, else the current one; empty for none."""
    menu_asked = Signal(str, QPoint)
    typed = Signal(str)
    """A position was typed for this one and confirmed with Enter."""
    pasted = Signal(str, str)
    """Text that was pasted on a row."""

    def __init__(self, model: TouchTableModel, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._model = model
        self.setModel(model)
        self.setItemDelegate(_TouchDelegate(self))
        self.setAccessibleName("Touches")
        self._roomy = False
        self._set_up()
        fit(self, self._fit)
        model.modelReset.connect(self._fit)
        self.entered.connect(lambda index: self.looked_at.emit(self.name_at(index)))
        self.selectionModel().currentChanged.connect(self._on_current)
        self.customContextMenuRequested.connect(self._on_menu)

    def name_at(self, index: Index) -> str:
        """Return the point that a cell is about."""
        return self._model.rows[index.row()].name if index.isValid() else ""

    def set_roomy(self, roomy: bool) -> None:
        """Make the rows higher, where there is room."""
        if roomy != self._roomy:
            self._roomy = roomy
            self._fit()

    def edit_position(self, name: str) -> None:
        """Let a position be typed."""
        index = self._model.index(self._model.row_of(name), XYZ)
        if index.isValid():
            self.setCurrentIndex(index)
            self.scrollTo(index)
            self.edit(index)

    def _set_up(self) -> None:
        self.setShowGrid(False)
        self.setMouseTracking(True)
        self.setTabKeyNavigation(False)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        trigger = QAbstractItemView.EditTrigger
        self.setEditTriggers(trigger.DoubleClicked | trigger.EditKeyPressed | trigger.AnyKeyPressed)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.horizontalHeader().setMinimumSectionSize(16)
        fix_headers(self, stretched=NAME)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802 - Qt's name
        self._share_width()
        super().resizeEvent(event)

    def _share_width(self) -> None:
        for column, width in column_widths(self, self._headings, self.viewport().width()).items():
            if column != NAME:
                self.setColumnWidth(column, width)

    def _fit(self) -> None:
        """Give columns and rows the room that their words take."""
        row = max(pixels(self, _ROOMY_ROW if self._roomy else _ROW), line_height(self))
        head = line_height(self) + 8
        self.verticalHeader().setMinimumSectionSize(row)
        self.verticalHeader().setDefaultSectionSize(row)
        self.horizontalHeader().setFixedHeight(head)
        self.setFixedHeight(head + row * self._model.rowCount() + 4)
        self._share_width()
        self.updateGeometry()

    @property
    def _headings(self) -> dict[int, str]:
        model = self._model
        return {
            column: str(model.headerData(column, Qt.Orientation.Horizontal))
            for column in range(model.columnCount())
        }

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        width = sum(column_widths(self, self._headings).values()) + 4
        return QSize(width + (names_width(self) if self._roomy else 0), self.height())

    def minimumSizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(sum(column_widths(self, self._headings).values()) + 4, self.height())

    def _on_current(self, current: QModelIndex, _: QModelIndex) -> None:
        self.viewport().update()
        self.looked_at.emit(self.name_at(current))

    def _on_menu(self, where: QPoint) -> None:
        index = self.indexAt(where)
        if index.isValid():
            self.menu_asked.emit(self.name_at(index), self.viewport().mapToGlobal(where))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().mouseReleaseEvent(event)
        index = self.indexAt(event.position().toPoint())
        if event.button() is not Qt.MouseButton.LeftButton or not index.isValid():
            return
        row = self._model.rows[index.row()]
        if index.column() in (USE, CLEAR) and row.touch is not None:
            (self.use_asked if index.column() == USE else self.clear_asked).emit(row.name)
        else:
            self.chosen.emit(row.name)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802 - Qt's name
        index = self.indexAt(event.position().toPoint())
        if index.isValid() and index.column() not in (USE, CLEAR):
            self.edit_position(self.name_at(index))

    def event(self, event: QEvent) -> bool:  # noqa: D102
        if (
            event.type() is QEvent.Type.ShortcutOverride
            and isinstance(event, QKeyEvent)
            and _begins_number(event)
            and self.currentIndex().isValid()
        ):
            event.accept()  # else the first digit of a position would be a command of the window
            return True
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102, N802 - Qt's name
        name = self.name_at(self.currentIndex())
        if event.matches(QKeySequence.StandardKey.Paste):
            self.pasted.emit(name, QApplication.clipboard().text())
        elif not name:
            super().keyPressEvent(event)
        elif event.key() in (Qt.Key.Key_Delete, Qt.Key.Key_Backspace):
            self.clear_asked.emit(name)
        elif event.key() == Qt.Key.Key_Space:
            self.use_asked.emit(name)
        elif event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_F2):
            self.edit_position(name)
        elif event.key() == Qt.Key.Key_Menu:
            self._on_menu(self.visualRect(self.currentIndex()).center())
        elif _begins_number(event):
            self.setCurrentIndex(self._model.index(self.currentIndex().row(), XYZ))
            super().keyPressEvent(event)
        elif event.text() and event.text().isprintable():
            event.ignore()  # letters are the window's shortcuts
        else:
            super().keyPressEvent(event)

    def focusInEvent(self, event: QFocusEvent) -> None:  # noqa: N802 - Qt's name
        """Begin at the feature to touch next, where the keyboard came here and no cell is the current one."""
        super().focusInEvent(event)
        if event.reason() in BY_KEYBOARD and not self.currentIndex().isValid() and self._model.rows:
            row = next((n for n, each in enumerate(self._model.rows) if each.target), 0)
            self.setCurrentIndex(self._model.index(row, XYZ))

    def leaveEvent(self, event: QEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().leaveEvent(event)
        self.viewport().update()
        self.looked_at.emit(self.name_at(self.currentIndex()))


class _TouchDelegate(QStyledItemDelegate):
    """Paints the cells, and lets positions be typed."""

    def __init__(self, table: TouchTable) -> None:
        super().__init__(table)
        self._table = table

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        table, box = self._table, QRectF(option.rect)
        theme, row = theme_of(table), table._model.rows[index.row()]
        is_current = table.currentIndex().row() == index.row()
        is_over = table.underMouse() and table.indexAt(_pointer(table)).row() == index.row()
        painter.save()
        paint_ground(painter, box, row, theme, current=is_current, over=is_over)
        if table.hasFocus() and table.currentIndex() == index:
            painter.setPen(QPen(QColor(theme.focus), 2))
            painter.drawRect(box.adjusted(1, 1, -1, -1))
        painter.setClipRect(box)
        painter.setFont(font_of(table))
        paint_cell(
            painter, table, index.column(), box, row, theme, longest=table._model.largest, over=is_over
        )
        painter.restore()

    def createEditor(self, parent: QWidget, option: QStyleOptionViewItem, index: Index) -> QWidget:  # noqa: N802
        editor = QLineEdit(parent)
        editor.setPlaceholderText("x y z in mm")
        editor.setStyleSheet("padding: 0 4px; border-radius: 0")
        editor.setAccessibleName(f"Position of {self._table.name_at(index)}, x y z in mm")
        return editor

    def setEditorData(self, editor: QWidget, index: Index) -> None:  # noqa: N802
        """Fill the field in, but leave alone what somebody is typing while other touches come in."""
        if not (isinstance(editor, QLineEdit) and editor.isModified()):
            super().setEditorData(editor, index)

    def updateEditorGeometry(self, editor: QWidget, option: QStyleOptionViewItem, index: Index) -> None:  # noqa: N802
        box = option.rect
        wide = field_width(editor, "-1000.000 -1000.000 -1000.000")
        editor.setGeometry(box.x() - 4, box.y(), max(box.width(), wide) + 4, box.height())

    def eventFilter(self, editor: QObject, event: QEvent) -> bool:  # noqa: N802 - Qt's name
        if (
            isinstance(editor, QLineEdit)
            and isinstance(event, QKeyEvent)
            and event.type() is QEvent.Type.KeyPress
        ) and event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Tab):
            self._confirm(editor)
            return True
        return super().eventFilter(editor, event)

    def _confirm(self, editor: QLineEdit) -> None:
        """Take what was typed; where it is no position, leave it there to be mended."""
        index = self._table.currentIndex()
        name, unchanged = self._table.name_at(index), not editor.text().strip()
        if unchanged or editor.text() == index.data(Qt.ItemDataRole.EditRole):
            self.closeEditor.emit(editor)
        elif self._table._model.record(name, editor.text()):
            self.closeEditor.emit(editor)
            self._table.typed.emit(name)
        else:
            editor.setProperty("wrong", "true")
            editor.style().unpolish(editor)
            editor.style().polish(editor)


def _begins_number(event: QKeyEvent) -> bool:
    """Whether a key begins a position; with Ctrl or Alt it is a command."""
    held = event.modifiers() & ~(Qt.KeyboardModifier.KeypadModifier | Qt.KeyboardModifier.ShiftModifier)
    return not held and bool(event.text()) and event.text() in _BEGINS_NUMBER


def _pointer(table: QTableView) -> QPoint:
    return table.viewport().mapFromGlobal(table.cursor().pos())
