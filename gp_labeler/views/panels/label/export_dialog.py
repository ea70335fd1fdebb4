"""The export dialog: which files are written where, and what is missing from them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import (
    QCheckBox,
    QDialog,
    QFileDialog,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import Status
from gp_labeler.document.landmark_export import CO_IS_MISSING, FORMATS, export_landmarks, export_names
from gp_labeler.models.workflow import PointState
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import in_column, in_row, wide
from gp_labeler.views.panels.parts import (
    ElidedLabel,
    Notice,
    breakable,
    emptied,
    open_at,
    scrolled,
    text_label,
)
from gp_labeler.views.signals import follow

__all__ = ["ExportDialog"]

_WORDS: Mapping[str, str] = MappingProxyType(
    {
        ".mrk.json": "Markups JSON: 3D Slicer, SlicerMorph and gp-core; complete",
        ".fcsv": "FCSV: older 3D Slicer",
        ".csv": "CSV: spreadsheets and R",
    }
)


class ExportDialog(QDialog):
    """Writes the landmarks of both sides.

    Parameters
    ----------
    workspace : Workspace
        Whose specimen is written.
    folder : path
        Where to propose.
    """

    exported = Signal(str)
    """The folder that was written into."""

    def __init__(
        self,
        workspace: Workspace,
        folder: str | Path,
        actions: object = None,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.setWindowTitle("Export landmarks")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setModal(True)
        self._make_widgets(str(folder))
        self._lay_out()
        follow(self, workspace.labels.problems_changed, self.refresh)
        self.refresh()
        open_at(self, 560, 660)

    def refresh(self, *_: object) -> None:
        """Say what would be written, and what would be missing."""
        emptied(self._findings)
        for level, words in self._missing():
            self._findings.addWidget(Notice(level, words))
        names, there = self._names(), self._there()
        self.files.setText(
            breakable("   ".join(names)) if names else "No feature is placed, or no format is selected."
        )
        n_suggested = sum(m.suggestion is not None for m in self._workspace.document.state.landmarks.values())
        self.suggested.setVisible(bool(n_suggested))
        self.replace.setVisible(bool(there))
        self.replace.setText(f"Replace {len(there)} file{'s' if len(there) > 1 else ''} of that name")
        self.export.setEnabled(bool(names) and (not there or self.replace.isChecked()))

    def _make_widgets(self, folder: str) -> None:
        self.folder = QLineEdit(folder)
        self.folder.setAccessibleName("Folder to write into")
        self.folder.textChanged.connect(self.refresh)
        self.browse = QPushButton("Browse…")
        self.browse.clicked.connect(self._browse)
        self.formats = {suffix: self._format_box(suffix) for suffix in FORMATS}
        self.suggested = QCheckBox("Also write suggestions, to separate files, marked as not confirmed")
        self.suggested.setToolTip("3D Slicer treats every point of a landmark file as observed")
        self.suggested.toggled.connect(self.refresh)
        self.files = text_label("", "", wrap=True)
        self.replace = QCheckBox()
        self.replace.toggled.connect(self.refresh)
        self._findings = QVBoxLayout()
        self._findings.setSpacing(8)
        self._result = text_label("", "danger", wrap=True)
        self.cancel = QPushButton("Cancel")
        self.cancel.clicked.connect(self.reject)
        self.export = QPushButton("Export")
        self.export.setProperty("role", "primary")
        self.export.setDefault(True)
        self.export.clicked.connect(self._export)

    def _format_box(self, suffix: str) -> QCheckBox:
        box = QCheckBox(_WORDS[suffix])
        box.setChecked(suffix == FORMATS[0])
        box.toggled.connect(self.refresh)
        return box

    def _lay_out(self) -> None:
        content = QWidget()
        content.setProperty("role", "panel")
        self._form = in_column(
            ElidedLabel(f"Landmarks of {self._workspace.document.state.specimen}", "title"),
            self._findings,
            margins=(20, 16, 20, 12),
            spacing=8,
            of=content,
        )
        self._form.addSpacing(4)
        self._form.addWidget(text_label("Folder", "heading"))
        self._form.addLayout(in_row(wide(self.folder), self.browse))
        self._form.addWidget(text_label("Formats", "heading"))
        for box in self.formats.values():
            self._form.addWidget(box)
        self._form.addWidget(self.suggested)
        self._form.addWidget(text_label("Files", "heading"))
        self._form.addWidget(self.files)
        self._form.addWidget(self.replace)
        self._form.addStretch(1)
        in_column(
            wide(scrolled(content)),
            in_row(wide(self._result), self.cancel, self.export, margins=(20, 10, 20, 14)),
            margins=0,
            of=self,
        )

    def _missing(self) -> list[tuple[str, str]]:
        """Return a finding for each side, with its level."""
        found, document, labels = [], self._workspace.document, self._workspace.labels
        for side in Side:
            landmarks = document.landmarks(side)
            if not landmarks.placed:
                writes = bool(landmarks.suggested) and self.suggested.isChecked()
                but = "; only its suggestions will be written" if writes else " and will not be written"
                found.append(("warning", f"The {side.word} side is not labelled{but}."))
                continue
            statuses = {code: landmarks.status(code) for code in labels.point_states(side, wait=False)}
            to_do = [code for code, status in statuses.items() if status is Status.TO_DO and code != "CO"]
            unseen = [code for code, status in statuses.items() if status is Status.UNSEEN]
            suggested = list(landmarks.suggested)
            parts = [
                f"{word} {' '.join(codes)}"
                for word, codes in (
                    ("to do:", to_do),
                    ("suggested, not confirmed, so without a position:", suggested),
                    ("not seen:", unseen),
                )
                if codes
            ]
            lacks_co = statuses.get("CO") is Status.TO_DO
            parts += [CO_IS_MISSING] if lacks_co else []
            words = f"The {side.word} side has {labels.progress(side).text}" + "".join(
                f"; {p}" for p in parts
            )
            found.append(
                ("warning" if to_do or suggested or lacks_co else "info" if unseen else "good", f"{words}.")
            )
            found += self._label_problems(side)
        return found

    def _label_problems(self, side: Side) -> list[tuple[str, str]]:
        """Return the problems of a side: one notice for each kind of mistake."""
        labels = self._workspace.labels
        states = labels.point_states(side, wait=False)
        problems = {
            code: problem
            for code, problem in labels.known_problems(side).items()
            if states[code] is PointState.DOUBTFUL
        }
        far = [code for code, problem in problems.items() if problem.kind == "far"]
        others = dict.fromkeys(problem for problem in problems.values() if problem.kind != "far")
        words = [f"On the {side.word} side {problem.text}. {problem.remedy}" for problem in others]
        if far:
            many = (
                "are far from the positions that the atlas predicts"
                if len(far) > 1
                else "is far from the position that the atlas predicts"
            )
            words.append(f"On the {side.word} side {' '.join(far)} {many}: review, or mark as checked.")
        return [("warning", each) for each in words]

    def _suffixes(self) -> list[str]:
        return [suffix for suffix, box in self.formats.items() if box.isChecked()]

    def _names(self) -> list[str]:
        state = self._workspace.document.state
        return list(export_names(state, self._suffixes(), suggested=self.suggested.isChecked()))

    def _there(self) -> list[Path]:
        folder = Path(self.folder.text())
        return [folder / name for name in self._names() if (folder / name).exists()]

    def _browse(self) -> None:
        chosen = QFileDialog.getExistingDirectory(self, "Export into this folder", self.folder.text())
        if chosen:
            self.folder.setText(chosen)

    def _export(self) -> None:
        """Write the files; on failure say why and stay."""
        state, folder = self._workspace.document.measured_state, self.folder.text()
        try:
            report = export_landmarks(
                state,
                folder,
                formats=self._suffixes(),
                overwrite=self.replace.isChecked(),
                suggested=self.suggested.isChecked(),
            )
        except GpError as error:
            self._result.setText(breakable(str(error)))
            return
        level = "info" if report.is_complete else "warning"
        self._workspace.say(report.text.replace("\n", "  "), level)
        self.exported.emit(folder)
        self._workspace.messages.wrote.emit("landmarks", report)
        self.accept()
