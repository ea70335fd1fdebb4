"""The list of specimens: how far each is, the next unfinished one, and work on all that are shown."""

from __future__ import annotations

from qtpy.QtCore import QModelIndex, Qt, Signal
from qtpy.QtWidgets import (
    QAbstractItemView,
    QCheckBox,
    QComboBox,
    QDialog,
    QHeaderView,
    QLineEdit,
    QPushButton,
    QTableView,
    QWidget,
)

from gp_labeler.document.specimen_list import ListedSpecimen
from gp_labeler.imaging.thumbnail import THUMBNAIL_SIZE
from gp_labeler.models.specimen_list import FILTERS
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit, pixels
from gp_labeler.views.layouts import in_column, in_row, wide
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.parts import open_at, text_label
from gp_labeler.views.panels.scan.specimen_table_model import COLUMNS, SpecimenTableModel
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.screen_reader import name_choice
from gp_labeler.views.signals import attempt, blocked, follow

__all__ = ["SpecimenListDialog"]

_SHEETS = "Contact sheet (*.pdf)"
_SHORT_NAMES, _LONG_NAMES = 80, 220
"""What the column of names takes at least, and at most: the rest is left for notes; logical pixels."""


class SpecimenListDialog(QDialog):
    """Shows the specimens of some folders.

    Parameters
    ----------
    workspace : Workspace
        Whose list it is.
    prompts : Prompts
        Who asks for folders.
    """

    open_asked = Signal(object)
    """The `Path` of a specimen to open."""

    def __init__(self, workspace: Workspace, prompts: Prompts, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace, self._prompts = workspace, prompts
        self.setWindowTitle("Specimens")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.model = SpecimenTableModel(workspace, self)
        self._make_table()
        self._make_filter()
        self._make_buttons()
        self._lay_out()
        list_model = workspace.specimens
        follow(self, list_model.changed, self.refresh)
        for signal in (workspace.jobs.started, workspace.jobs.done, workspace.jobs.failed):
            follow(self, signal, self.refresh)
        if list_model.folders:
            list_model.refresh()
        self.refresh()
        open_at(self, 980, 620)

    def refresh(self, *_: object) -> None:
        """Say how many there are, and what can be done."""
        model = self._workspace.specimens
        self.words.setText("Reading…" if model.is_listing and not model.every else model.text)
        with blocked(self.kind, self.search):
            self.kind.setCurrentIndex(FILTERS.index(model.kind))
            if self.search.text().split() != model.words.split():
                self.search.setText(model.words)
        self.table.setVisible(bool(model.every) or bool(model.folders))
        has_rows = any(row.is_begun and not row.problem for row in model.rows)
        for button in (self.export, self.fit_atlas, self.sheets, self.check):
            button.setEnabled(has_rows)
        self.every.setEnabled(has_rows and any(len(row.labellings) > 1 for row in model.rows))
        self.next.setEnabled(any(not (row.is_finished or row.problem) for row in model.every))
        self.forget.setEnabled(bool(model.folders))

    def _make_table(self) -> None:
        self.table = QTableView()
        self.table.setModel(self.model)
        self.table.setAccessibleName("Specimens")
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setWordWrap(False)
        self.table.setShowGrid(False)
        self.table.verticalHeader().hide()
        self.table.verticalHeader().setDefaultSectionSize(THUMBNAIL_SIZE[1] // 2 + 4)
        header = self.table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        header.setResizeContentsPrecision(50)  # hundreds of rows are not all measured
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.Interactive)
        header.setSectionResizeMode(len(COLUMNS) - 1, QHeaderView.ResizeMode.Stretch)
        header.setSortIndicator(-1, Qt.SortOrder.AscendingOrder)  # in the order of the files, until asked
        self.table.setSortingEnabled(True)
        self.model.modelReset.connect(self._fit_names)
        fit(self, self._fit_names)
        self.table.activated.connect(self._open_row)

    def _fit_names(self) -> None:
        """Give the names the room that they take, but leave some for what is wrong."""
        names = self.table.sizeHintForColumn(1)
        self.table.setColumnWidth(1, min(max(names, pixels(self, _SHORT_NAMES)), pixels(self, _LONG_NAMES)))

    def _make_filter(self) -> None:
        self.words = text_label("", "hint")
        self.search = QLineEdit()
        self.search.setPlaceholderText("Find…")
        self.search.setToolTip("Words in the name, the observers, the notes, or the names of the files")
        self.search.setAccessibleName("Find specimens")
        self.search.setClearButtonEnabled(True)
        self.search.textChanged.connect(lambda text: self._workspace.specimens.show(words=text))
        self.kind = QComboBox()
        name_choice(self.kind, "Which specimens")
        self.kind.addItems([kind.capitalize() for kind in FILTERS])
        self.kind.currentIndexChanged.connect(lambda n: self._workspace.specimens.show(kind=FILTERS[n]))

    def _make_buttons(self) -> None:
        def button(words: str, hint: str, run: object) -> QPushButton:
            made = QPushButton(words)
            made.setToolTip(hint)
            made.clicked.connect(run)
            return made

        self.add_folder = button("Add folder…", "Subfolders are searched too", self._add)
        self.forget = button("Clear folders", "The files are not deleted", self._clear)
        self.export = button("Export…", "Export landmarks of the shown or selected specimens", self._export)
        hint = "Fit the atlas to the shown or selected specimens"
        self.fit_atlas = button("Fit atlas", hint, self._fit)
        self.sheets = button(
            "Contact sheets…", "PDF with every label on its best slice and on bone", self._sheets
        )
        hint = "Compare each specimen with what the others predict, and draw the labels that contradict them"
        self.check = button("Check labels…", hint, self._check)
        self.every = QCheckBox("Of all labellings")
        self.every.setToolTip("Contact sheets have pages for each labelling, not only for the one in work")
        self.next = button("Next unfinished", "Open the next unfinished specimen", self._next)
        self.next.setProperty("role", "primary")

    def _lay_out(self) -> None:
        top = in_row(wide(self.search), self.kind, self.add_folder, self.forget)
        foot = FlowLayout()
        for widget in (self.next, self.export, self.fit_atlas, self.check, self.sheets, self.every):
            foot.addWidget(widget)
        layout = in_column(top, self.words, wide(self.table), margins=(16, 14, 16, 12), spacing=8, of=self)
        layout.addStretch(0)
        layout.addLayout(foot)

    @property
    def chosen(self) -> tuple[ListedSpecimen, ...] | None:
        """The selected rows; None where fewer than two are, so that all that are shown are meant."""
        rows = self.table.selectionModel().selectedRows()
        return tuple(self.model.rows[index.row()] for index in rows) if len(rows) > 1 else None

    def _open_row(self, index: QModelIndex) -> None:
        row = self.model.rows[index.row()]
        if not row.problem:
            self.open_asked.emit(row.path)

    def _add(self) -> None:
        folder = self._prompts.folder("A folder of specimens")
        if folder is not None:
            attempt(self._workspace, lambda: self._workspace.specimens.add(folder))

    def _clear(self) -> None:
        for folder in self._workspace.specimens.folders:
            self._workspace.specimens.remove(folder)

    def _next(self) -> None:
        attempt(
            self._workspace, lambda: self.open_asked.emit(self._workspace.specimens.next_unfinished().path)
        )

    def _export(self) -> None:
        folder = self._prompts.folder("Export landmarks into this folder")
        if folder is not None:
            attempt(self._workspace, lambda: self._workspace.specimens.export(folder, self.chosen))

    def _fit(self) -> None:
        attempt(self._workspace, lambda: self._workspace.specimens.fit(self.chosen))

    def _check(self) -> None:
        path = self._prompts.save_file("Labels that contradict the others", "labels.pdf", _SHEETS)
        if path is not None:
            model = self._workspace.specimens
            attempt(self._workspace, lambda: model.check_library(path, self.chosen))

    def _sheets(self) -> None:
        path = self._prompts.save_file("Contact sheets", "contact.pdf", _SHEETS)
        if path is not None:
            every = self.every.isEnabled() and self.every.isChecked()
            model = self._workspace.specimens
            attempt(
                self._workspace,
                lambda: model.make_contact_sheets(path, self.chosen, all_labellings=every),
            )
