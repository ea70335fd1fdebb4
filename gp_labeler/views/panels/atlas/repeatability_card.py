"""The card that says how repeatable labels are: table, picture, the largest disagreements, export."""

from __future__ import annotations

from typing import Any

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import QCheckBox, QHBoxLayout, QHeaderView, QSizePolicy, QTableWidget, QTableWidgetItem

from gp_core.study.limits_of_agreement import agreement_panels
from gp_core.study.reliability import Disagreement, FeatureReliability, ReliabilityReport
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit, line_height, pixels
from gp_labeler.views.formatting import NONE, mm_text
from gp_labeler.views.panels.action_button import Actions, action_button
from gp_labeler.views.panels.atlas.agreement_plot import AgreementPlot
from gp_labeler.views.panels.finding_list import FindingList, FindingRow
from gp_labeler.views.panels.parts import Card, text_label
from gp_labeler.views.signals import attempt, blocked, follow

__all__ = ["RepeatabilityCard"]

_HEADINGS = ("Feature", "Intra, mm", "Inter, mm", "TEM, mm", "ICC(2,1)")
_HINTS = (
    "All: all features together",
    "Intra-observer: mean distance of two labels by one observer, mm",
    "Inter-observer: mean distance of two labels by two observers, mm",
    "Technical error of measurement, mm: between observers, else within one",
    "Intraclass correlation of observers, absolute agreement",
)
_ROWS_SHOWN = 8
_LEGEND = "Differences of two labels against their mean. Solid: two observers; dashed: rounds of one."


class RepeatabilityCard(Card):
    """How far labels of the same points lie apart.

    Parameters
    ----------
    workspace : Workspace
        Whose report it shows.
    actions : mapping of str to QAction
        What its buttons do.
    """

    disagreement_asked = Signal(object)
    """A `Disagreement` that the user wants to see."""

    def __init__(self, workspace: Workspace, actions: Actions) -> None:
        super().__init__("Repeatability")
        self._workspace = workspace
        self.words = text_label("", "hint", wrap=True)
        self.add(self.words)
        row = QHBoxLayout()
        row.setSpacing(6)
        self.files = action_button(actions["atlas.reliability_files"], "From files…")
        self.folder = action_button(actions["atlas.reliability_folder"], "From a folder…")
        for button in (self.files, self.folder):
            row.addWidget(button, 1)
        self.add(row)
        self.table = self._make_table()
        self.add(self.table)
        self.plot = AgreementPlot()
        self.add(self.plot)
        self.legend = text_label(_LEGEND, "hint", wrap=True)
        self.add(self.legend)
        self.findings = FindingList()
        self.findings.chosen.connect(self.disagreement_asked)
        self.add(self.findings)
        self.use = QCheckBox("Use this error in checks and regions")
        self.use.setToolTip("Replaces 0.1 mm in the label check and in the regions of ghosts")
        self.use.toggled.connect(self._use)
        self.add(self.use)
        self.save = action_button(actions["atlas.save_reliability"], "Save…", "As a table, JSON or a plot")
        self.add(self.save)
        follow(self, workspace.reliability.changed, self.refresh)
        for signal in (
            *(workspace.jobs.started, workspace.jobs.done),
            *(workspace.jobs.failed, workspace.jobs.cancelled),
        ):
            follow(self, signal, self._on_jobs)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show the report, or what it takes to have one."""
        report = self._workspace.reliability.report
        for widget in (self.table, self.plot, self.legend, self.use, self.save):
            widget.setVisible(report is not None)
        self._show_words()
        if report is None:
            self.findings.show_rows([])
            return
        self._fill(report)
        self.plot.show_panels(agreement_panels(report.differences))
        self.findings.show_rows([_finding(row) for row in report.disagreements])
        with blocked(self.use):
            self.use.setChecked(self._workspace.reliability.is_used)

    def _make_table(self) -> QTableWidget:
        table = QTableWidget(0, len(_HEADINGS))
        table.setHorizontalHeaderLabels(_HEADINGS)
        table.setAccessibleName("How repeatable the labels of each feature are")
        table.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        table.setSelectionMode(QTableWidget.SelectionMode.NoSelection)
        table.setTabKeyNavigation(False)
        table.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        table.verticalHeader().hide()
        table.setShowGrid(False)
        table.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
        for column, hint in enumerate(_HINTS):
            item = table.horizontalHeaderItem(column)
            if item is not None:
                item.setToolTip(hint)
                item.setTextAlignment(_alignment(column))
        fit(table, lambda: self._fit(table))
        return table

    def _fit(self, table: QTableWidget) -> None:
        height = line_height(table) + pixels(table, 6)
        table.verticalHeader().setDefaultSectionSize(height)
        table.setFixedHeight((_ROWS_SHOWN + 1) * height + pixels(table, 12))

    def _fill(self, report: ReliabilityReport) -> None:
        rows = (report.overall, *report.features)
        self.table.setRowCount(len(rows))
        for n, row in enumerate(rows):
            for column, words in enumerate(_cells(row)):
                item = QTableWidgetItem(words)
                item.setTextAlignment(_alignment(column))
                font = item.font()
                font.setBold(n == 0)
                item.setFont(font)
                self.table.setItem(n, column, item)

    def _show_words(self) -> None:
        model = self._workspace.reliability
        if model.is_measuring:
            words = "Comparing labels…"
        elif model.report is None:
            words = "Compares labels of animals that were labelled more than once."
        else:
            words = _summary(model.report)
        self.words.setText(words)

    def _on_jobs(self, _: Any) -> None:
        self._show_words()

    def _use(self, use: bool) -> None:
        attempt(self._workspace, lambda: self._workspace.reliability.use_error(use))


def _alignment(column: int) -> Qt.AlignmentFlag:
    """Return how a column is aligned, with its heading: numbers stand one below the other."""
    side = Qt.AlignmentFlag.AlignRight if column else Qt.AlignmentFlag.AlignLeft
    return side | Qt.AlignmentFlag.AlignVCenter


def _summary(report: ReliabilityReport) -> str:
    observers = ", ".join(name or "unnamed" for name in report.observers)
    many = "" if report.n_animals == 1 else "s"
    sides = f"{report.n_labellings} labellings of {report.n_sides} sides"
    words = f"{sides} ({report.n_animals} animal{many}) by {observers}."
    for name, pose in (("One observer again", report.pose_intra), ("Two observers", report.pose_inter)):
        if pose is not None:
            words += f" {name}: CO differs by {mm_text(pose.origin_mm['mean'])}, "
            words += f"the axis by {pose.axis_deg['mean']:.1f}° on average."
    certain = [row for row in report.offsets if row.p_corrected < 0.05]
    if certain:
        named = ", ".join(f"{row.code} ({' and '.join(row.observers)})" for row in certain[:3])
        words += f" Systematic offset: {named}."
    return words


def _cells(row: FeatureReliability) -> tuple[str, ...]:
    error = row.inter or row.intra
    icc = NONE if row.icc_inter is None else f"{row.icc_inter.icc2:.2f}"
    within, between = (NONE if each is None else f"{each.mean_mm:.2f}" for each in (row.intra, row.inter))
    tem = NONE if error is None else f"{error.tem_mm:.2f}"
    return ("All" if row.code == "all" else row.code, within, between, tem, icc)


def _finding(row: Disagreement) -> FindingRow:
    words = f"{row.specimen} {row.side.word} {row.code}: {mm_text(row.distance_mm)} apart"
    return FindingRow(words, f"{' and '.join(row.labellings)}; {row.ratio:.1f} times the median.", row)
