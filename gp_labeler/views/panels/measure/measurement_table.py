"""The list of rulers and angles: a name is typed over, a click shows the measurement."""

from __future__ import annotations

from qtpy.QtCore import QSize, Qt
from qtpy.QtGui import QKeyEvent
from qtpy.QtWidgets import QAbstractItemView, QHeaderView, QTableWidget, QTableWidgetItem, QWidget

from gp_core.landmarks.measurements import LINE
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit, line_height, pixels, text_width
from gp_labeler.views.signals import attempt, blocked, follow

__all__ = ["MeasurementTable"]

_HEADINGS = ("Name", "Kind", "Value")
_MOST_ROWS, _PAD = 6, 12


class MeasurementTable(QTableWidget):
    """One row a measurement.

    Parameters
    ----------
    workspace : Workspace
        Whose measurements.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(0, len(_HEADINGS), parent)
        self._workspace = workspace
        self.setAccessibleName("Rulers and angles")
        self.setHorizontalHeaderLabels(list(_HEADINGS))
        self.setShowGrid(False)
        self.setTabKeyNavigation(False)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.verticalHeader().hide()
        header = self.horizontalHeader()
        header.setHighlightSections(False)
        header.setSectionsClickable(False)
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        header.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.cellClicked.connect(self._go_to)
        self.cellActivated.connect(self._go_to)
        self.itemChanged.connect(self._rename)
        for signal in (workspace.measure.changed, workspace.document.reset):
            follow(self, signal, self.refresh)
        fit(self, self._fit)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show the measurements as they are."""
        there, selected = self._workspace.document.state.measurements, self._workspace.measure.selected
        with blocked(self):
            self.setRowCount(len(there))
            for row, each in enumerate(there):
                kind = "ruler" if each.kind == LINE else "angle"
                for column, words in enumerate((each.name, kind, each.value_text)):
                    item = QTableWidgetItem(words)
                    item.setData(Qt.ItemDataRole.UserRole, each.name)
                    if column:
                        item.setFlags(Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable)
                    self.setItem(row, column, item)
                if each.name == selected:
                    self.selectRow(row)
            if selected is None:
                self.clearSelection()
        self.updateGeometry()

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return self.minimumSizeHint()

    def minimumSizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Return the room that a few rows take; more scroll."""
        rows = min(max(self.rowCount(), 1), _MOST_ROWS)
        height = self.horizontalHeader().height() + rows * self.verticalHeader().defaultSectionSize() + 4
        return QSize(pixels(self, 240), height)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102, N802 - Qt's name
        if event.key() in (Qt.Key.Key_Delete, Qt.Key.Key_Backspace) and self._workspace.measure.selected:
            attempt(self._workspace, self._workspace.measure.remove)
        else:
            super().keyPressEvent(event)

    def _fit(self) -> None:
        self.horizontalHeader().setFixedHeight(line_height(self) + 10)
        self.verticalHeader().setDefaultSectionSize(max(pixels(self, 24), line_height(self) + 4))
        for column, longest in ((1, "angle"), (2, "000.00 mm")):
            self.setColumnWidth(column, text_width(self, longest, _HEADINGS[column], bold=True) + 2 * _PAD)
        self.updateGeometry()

    def _go_to(self, row: int, _: int) -> None:
        name = self._workspace.document.state.measurements[row].name
        attempt(self._workspace, lambda: self._workspace.measure.go_to(name))

    def _rename(self, item: QTableWidgetItem) -> None:
        name = item.data(Qt.ItemDataRole.UserRole)
        if item.column() == 0 and item.text() != name:
            attempt(self._workspace, lambda: self._workspace.measure.rename(name, item.text()))
            self.refresh()  # as it was, where the name is taken
