"""The import dialog of scans: what the files state, what they leave open, and the user's answers."""

from __future__ import annotations

from functools import partial
from typing import Any

from qtpy.QtCore import Qt
from qtpy.QtGui import QCloseEvent, QShowEvent
from qtpy.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDialog,
    QGridLayout,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from gp_labeler.imaging.preview import PreviewPlane
from gp_labeler.imaging.readers import ImportPlan, Problem
from gp_labeler.jobs.head import StraightPreview
from gp_labeler.jobs.runner import Task
from gp_labeler.jobs.scan import InspectScan
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit
from gp_labeler.views.formatting import bytes_text, sentence
from gp_labeler.views.layouts import in_column, in_row, wide
from gp_labeler.views.panels.parts import (
    ElidedLabel,
    Facts,
    Notice,
    breakable,
    column_of_captions,
    emptied,
    open_at,
    scrolled,
    text_label,
)
from gp_labeler.views.panels.scan.import_wording import (
    PreviewScan,
    bare,
    facts_of,
    remedy,
    why_not,
)
from gp_labeler.views.panels.scan.preview_picture import PreviewPicture
from gp_labeler.views.panels.scan.spacing_fields import SpacingFields
from gp_labeler.views.screen_reader import name_choice
from gp_labeler.views.signals import blocked, follow

__all__ = ["ImportDialog"]

_STRIDES = {1: "Every voxel", 2: "Every second voxel", 4: "Every fourth voxel"}


class ImportDialog(QDialog):
    """Asks what the files of a scan do not say; `Load` reads it as a new specimen.

    Parameters
    ----------
    workspace : Workspace
        Reads the scan.
    plan : ImportPlan
        What was found.
    """

    def __init__(
        self, workspace: Workspace, plan: ImportPlan, actions: object = None, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self._plan = plan
        self.accepts: dict[str, QCheckBox] = {}
        self.setWindowTitle("Open scan")
        self.setModal(True)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._make_widgets()
        self._lay_out()
        self._show_plan(plan)
        self._start_preview()
        follow(self, workspace.jobs.failed, self._on_failed)
        open_at(self, 720, 480 if plan.sides_known else 700)

    @property
    def plan(self) -> ImportPlan:
        """The plan under the answers given so far."""
        return self._plan

    def _make_widgets(self) -> None:
        self.facts = Facts()
        self.series = QComboBox()
        self.series.setPlaceholderText("Choose one of the scans")
        name_choice(self.series, "Which scan of the folder")
        self.series.activated.connect(self._on_series)
        self.spacing = SpacingFields()
        self.spacing.changed.connect(self._update)
        self.stride = QComboBox()
        name_choice(self.stride, "Voxels to load")
        self.stride.currentIndexChanged.connect(self._update)
        self.reverse = QCheckBox("Reverse the order of the slices: exchanges left and right")
        self.reverse.toggled.connect(self._on_reverse)
        self.pictures = (PreviewPicture(), PreviewPicture())
        self.why = text_label("", "danger", wrap=True)
        self.cancel = QPushButton("Cancel")
        self.cancel.clicked.connect(self.reject)
        self.load = QPushButton("Load")
        self.load.setProperty("role", "primary")
        self.load.setDefault(True)
        self.load.clicked.connect(self.accept)
        self._findings = QVBoxLayout()
        self._findings.setSpacing(8)

    def _lay_out(self) -> None:
        content = QWidget()
        content.setProperty("role", "panel")
        column = QVBoxLayout(content)
        column.setContentsMargins(20, 16, 20, 12)
        column.setSpacing(10)
        self._title = ElidedLabel("", "title")
        column.addWidget(self._title)
        column.addWidget(self.facts)
        column.addLayout(self._findings)
        column.addLayout(self._form())
        column.addWidget(self._sides_box())
        column.addStretch(1)
        foot = in_row(wide(self.why), self.cancel, self.load, margins=(20, 10, 20, 14), spacing=8)
        in_column(wide(scrolled(content)), foot, margins=0, spacing=0, of=self)

    def _form(self) -> QGridLayout:
        form = QGridLayout()
        form.setHorizontalSpacing(8)
        form.setVerticalSpacing(8)
        form.setColumnStretch(1, 1)
        self._captions = {}
        rows = (("Which scan", self.series), ("Voxel size", self.spacing), ("Load", self.stride))
        for row, (name, widget) in enumerate(rows):
            caption = self._captions[name] = text_label(name, "hint")
            column_of_captions(caption)
            form.addWidget(caption, row, 0, Qt.AlignmentFlag.AlignTop)
            form.addWidget(widget, row, 1)
            fit(caption, partial(self._level, caption))
        return form

    def _level(self, caption: QWidget) -> None:
        """Have a caption level with the first line of what it stands beside."""
        caption.setMinimumHeight(self.stride.sizeHint().height())

    def _sides_box(self) -> QWidget:
        """Return pictures with R and L, and the choice to reverse."""
        self.sides = QWidget()
        column = in_column(
            text_label("Which side is left?", "heading"), margins=(0, 4, 0, 0), spacing=6, of=self.sides
        )
        words = (
            "The file does not determine it. Find a structure whose side you know, and reverse the slices "
            "if it is on the wrong side. The choice is stored with the specimen."
        )
        column.addWidget(text_label(words, "hint", wrap=True))
        column.addLayout(in_row(*map(wide, self.pictures), spacing=8))
        self.straight = text_label("", "hint", wrap=True)
        column.addWidget(self.straight)
        column.addWidget(self.reverse)
        return self.sides

    def _show_plan(self, plan: ImportPlan) -> None:
        """Fill everything in from a plan that was just made."""
        self._plan = plan
        self._title.set_words(plan.name)
        self._captions["Which scan"].setVisible(len(plan.choices) > 1)
        self.series.setVisible(len(plan.choices) > 1)
        with blocked(self.series, self.stride, self.reverse):
            self.series.clear()
            for choice in plan.choices:
                self.series.addItem(choice.text, choice.id)
            self.series.setCurrentIndex(self.series.findData(plan.choice))
            self.stride.clear()
            for stride, words in _STRIDES.items():
                bytes_ = plan.with_options(stride=stride).n_bytes
                self.stride.addItem(f"{words}  ({bytes_text(bytes_)} of memory)", stride)
            self.stride.setCurrentIndex(max(0, self.stride.findData(plan.options.stride)))
            self.reverse.setChecked(plan.options.reverse)
        self.accepts = {}
        implausible = any("spacing" in p.resolved_by for p in bare(plan).errors)
        self.spacing.offer(
            plan.suggested_spacing if not implausible else plan.geometry.suggested, from_file=not implausible
        )
        self.sides.setVisible(not plan.sides_known)
        self._update()

    def _update(self) -> None:
        """Take the answers into the plan, and say what still stands against it."""
        wrong = self.spacing.error()
        self._plan = self._plan.with_options(
            spacing=None if wrong else self.spacing.spacing(),
            stride=self.stride.currentData() or 1,
            reverse=self.reverse.isChecked(),
            accept=[code for code, box in self.accepts.items() if box.isChecked()],
        )
        self.facts.show_facts(facts_of(self._plan))
        self._show_findings()
        self.spacing.show_wrong(bool(wrong))
        self.load.setEnabled(not wrong and not self._plan.errors)
        self.why.setText(sentence(wrong) if wrong else why_not(self._plan.errors))

    def _show_findings(self) -> None:
        accepted = {code for code, box in self.accepts.items() if box.isChecked()}
        emptied(self._findings)
        self.accepts = {}
        original = {p.code: p for p in bare(self._plan).problems}
        for problem in self._plan.problems:
            if problem.code == "sides-unknown":
                continue  # it has a place of its own
            advice = remedy(original.get(problem.code, problem))
            self._findings.addWidget(Notice(problem.severity, sentence(problem.text), advice))
            if "accept" in problem.resolved_by:
                self._findings.addWidget(self._accept_box(problem, problem.code in accepted))

    def _accept_box(self, problem: Problem, checked: bool) -> QCheckBox:
        box = QCheckBox("Accept this and continue")
        box.setChecked(checked)
        box.toggled.connect(self._update_later)
        self.accepts[problem.code] = box
        return box

    def _update_later(self) -> None:
        self._update()
        for box in self.accepts.values():
            box.setFocus()

    def _on_series(self, _: int) -> None:
        """Look into another scan of the folder."""
        chosen = self.series.currentData()
        if chosen == self._plan.choice:
            return
        self.load.setEnabled(False)
        self.why.setText("Reading the header…")
        options: dict[str, Any] = self._plan.options.as_json() | {"series": chosen}
        options.pop("spacing", None)
        options.pop("accept", None)
        self._workspace.jobs.submit(InspectScan(self._plan.path, options), self._take_plan, key="import look")

    def _take_plan(self, plan: ImportPlan) -> None:
        self._show_plan(plan)
        self._start_preview()

    def _on_reverse(self, _: bool) -> None:
        self._update()
        self._start_preview()

    def _start_preview(self) -> None:
        if self._plan.sides_known:
            return
        for picture in self.pictures:
            picture.show_plane(None)
        self.straight.setText("")
        self._workspace.jobs.submit(PreviewScan(self._plan), self._show_preview, key="import preview")

    def _show_preview(self, planes: tuple[PreviewPlane, PreviewPlane]) -> None:
        self._show_planes(planes)
        self.straight.setText("As stored. The head is being straightened…")
        job = StraightPreview(self._plan)
        self._workspace.jobs.submit(job, self._show_straight, key="import straight preview")

    def _show_straight(self, planes: tuple[PreviewPlane, PreviewPlane] | None) -> None:
        if planes is None:
            self.straight.setText("As stored: the bone does not show how the head lies.")
            return
        self._show_planes(planes)
        self.straight.setText(
            "The head is shown straightened. L and R are assumed from the order of the slices: a head and "
            "its mirror image look alike, so nothing in the scan can prove them."
        )

    def _show_planes(self, planes: tuple[PreviewPlane, PreviewPlane]) -> None:
        for picture, plane in zip(self.pictures, planes, strict=True):
            picture.show_plane(plane)

    def _on_failed(self, task: Task[Any]) -> None:
        if task.key == "import preview":
            for picture in self.pictures:
                picture.show_plane(None, "No preview: the file cannot be read")
        elif task.key == "import straight preview":
            self.straight.setText("As stored.")
        elif task.key == "import look":
            self.why.setText(breakable(task.message))

    def accept(self) -> None:
        """Read the scan as answered."""
        if self.load.isEnabled():
            self._stop()
            self._workspace.scan.read(self._plan)
            super().accept()

    def reject(self) -> None:
        """Read nothing."""
        self._stop()
        super().reject()

    def showEvent(self, event: QShowEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().showEvent(event)
        for caption in self._captions.values():  # only now do the fields have their style
            self._level(caption)

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: D102, N802 - Qt's name
        self._stop()
        super().closeEvent(event)

    def _stop(self) -> None:
        self._workspace.jobs.cancel("import preview", "import straight preview", "import look")
