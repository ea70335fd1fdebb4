"""The physical test of a touched and labelled skull: errors of each method, on the paper's Figure 6 C, D."""

from __future__ import annotations

import json
from pathlib import Path

from qtpy.QtCore import Qt
from qtpy.QtGui import QPixmap
from qtpy.QtWidgets import (
    QDialog,
    QGridLayout,
    QLabel,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from gp_core.constants import METHOD_NAMES
from gp_core.disk import write_bytes, write_text
from gp_labeler.jobs.physical import PhysicalResult, PhysicalTest
from gp_labeler.jobs.runner import Task
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import STRETCH, in_column, in_row, wide
from gp_labeler.views.panels.parts import ElidedLabel, Notice, open_at, scrolled, text_label
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.signals import attempt

__all__ = ["PhysicalDialog"]

_WAYS = {"names": "skull features by name", "icp": "skull features by ICP", "surface": "bone surface"}
_FIGURE_WIDTH = 620


class PhysicalDialog(QDialog):
    """Runs the test in the background, and shows what comes of it.

    Parameters
    ----------
    workspace : Workspace
        Whose touches and labels; the side is the one of its Pose panel.
    prompts : Prompts
        Asks where to save.
    """

    def __init__(self, workspace: Workspace, prompts: Prompts, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace, self._prompts = workspace, prompts
        self.result_found: PhysicalResult | None = None
        side = workspace.pose.side
        self.setWindowTitle("Test against the scan")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.title = ElidedLabel(f"{workspace.document.state.specimen}, {side.word} ear", "title")
        self.busy = QProgressBar()
        self.busy.setRange(0, 0)
        self.busy.setTextVisible(False)
        self.rows = QGridLayout()
        self.rows.setHorizontalSpacing(24)
        self.rows.setVerticalSpacing(4)
        self.findings = QVBoxLayout()
        self.figure = QLabel()
        self.figure.setAccessibleName("Errors of this skull compared with simulated animals")
        self._lay_out()
        self._task = self._start()
        open_at(self, _FIGURE_WIDTH + 72, 640)

    def _start(self) -> Task[PhysicalResult] | None:
        workspace = self._workspace
        if workspace.atlas.current is None:
            self._fail("The atlas is not loaded yet. Try again in a moment.")
            return None
        test = PhysicalTest.of(
            workspace.document.state, workspace.pose.side, workspace.atlas.current, workspace.atlas.specimens
        )
        workspace.jobs.failed.connect(self._on_failed)
        return workspace.jobs.submit(test, self._show, key="physical test")

    def _show(self, result: PhysicalResult) -> None:
        self.result_found = result
        self.busy.hide()
        for column, words in enumerate(("Registered by", "FRE", "Method", "CO off by", "Axis off by")):
            self.rows.addWidget(text_label(words, "hint"), 0, column)
        fre = {registration.method: registration.fre_mm for registration in result.report.registrations}
        for n, row in enumerate(result.report.rows, start=1):
            cells = (
                _WAYS.get(row.registration, row.registration),
                f"{fre[row.registration]:.2f} mm",
                METHOD_NAMES.get(row.method, row.method),
                f"{row.e_co_mm:.2f} mm",
                f"{row.e_ma_deg:.1f}°",
            )
            for column, text in enumerate(cells):
                self.rows.addWidget(text_label(text), n, column)
        for text in result.report.warnings:
            method, colon, words = text.partition(": ")
            self.findings.addWidget(Notice("warning", f"{METHOD_NAMES.get(method, method)}{colon}{words}"))
        if len({row.method for row in result.report.rows}) == 1:
            hint = "JRMPC needs an atlas fitted to labelled animals (step Atlas)."
            self.findings.addWidget(Notice("info", hint))
        self._show_figure(result.figure)
        for button in (self.save_figure, self.save_json):
            button.setEnabled(True)

    def _show_figure(self, png: bytes) -> None:
        ratio, picture = self.devicePixelRatioF(), QPixmap()
        picture.loadFromData(png)
        mode = Qt.TransformationMode.SmoothTransformation
        picture = picture.scaledToWidth(round(_FIGURE_WIDTH * ratio), mode)
        picture.setDevicePixelRatio(ratio)
        self.figure.setPixmap(picture)

    def _on_failed(self, task: object) -> None:
        if task is self._task and isinstance(task, Task):
            self._fail(task.message)

    def _fail(self, words: str) -> None:
        self.busy.hide()
        self.findings.addWidget(Notice("error", words))

    def _save_figure(self) -> None:
        path = self._prompts.save_file("Save the figure", "physical.png", "PNG (*.png)")
        if path is not None and self.result_found is not None:
            attempt(self._workspace, lambda: _write(path, self.result_found))

    def _save_json(self) -> None:
        path = self._prompts.save_file("Save the numbers", "physical.json", "JSON (*.json)")
        if path is not None and self.result_found is not None:
            text = json.dumps(self.result_found.report.as_dict(), indent=1) + "\n"
            attempt(self._workspace, lambda: write_text(path, text))

    def done(self, code: int) -> None:
        """Close, and end the work with it."""
        self._workspace.jobs.failed.disconnect(self._on_failed, missing_ok=True)
        if self._task is not None:
            self._task.cancel()
        super().done(code)

    def _lay_out(self) -> None:
        self.save_figure, self.save_json = QPushButton("Save figure…"), QPushButton("Save numbers…")
        for button, call in ((self.save_figure, self._save_figure), (self.save_json, self._save_json)):
            button.setEnabled(False)
            button.clicked.connect(call)
        close = QPushButton("Close")
        close.clicked.connect(self.accept)
        buttons = in_row(self.save_figure, self.save_json, STRETCH, close)
        content = QWidget()
        content.setProperty("role", "panel")
        in_column(
            self.title,
            self.busy,
            self.rows,
            self.findings,
            self.figure,
            STRETCH,
            margins=(20, 16, 20, 8),
            spacing=10,
            of=content,
        )
        buttons.setContentsMargins(20, 4, 20, 14)
        in_column(wide(scrolled(content)), buttons, margins=0, of=self)


def _write(path: Path, result: PhysicalResult | None) -> None:
    assert result is not None
    write_bytes(path, result.figure)
