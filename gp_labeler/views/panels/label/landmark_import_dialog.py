"""The dialog that imports landmarks: what files contain, whether it fits the specimen, what was imported."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from qtpy.QtCore import Qt
from qtpy.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDialog,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from gp_core.errors import GpError
from gp_core.io import landmarks_of, read_lab_names, read_points, sides_of, unknown_labels
from gp_core.landmarks.features import Side
from gp_core.landmarks.labels import LabelNames
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.document.lab_names import LabNamesMemory
from gp_labeler.document.landmark_import import OffBoneError, Predicate, import_landmarks
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.formatting import sentence
from gp_labeler.views.layouts import STRETCH, in_column, in_row, placed, wide
from gp_labeler.views.panels.label.lab_names_table import LabNamesTable
from gp_labeler.views.panels.parts import ElidedLabel, Notice, emptied, open_at, scrolled, text_label
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.screen_reader import name_choice

__all__ = ["LandmarkImportDialog"]

_TABLES = "Tables of names (*.csv *.tsv *.txt *.json);;All files (*)"


class LandmarkImportDialog(QDialog):
    """Shows what landmark files hold, imports them, and reports.

    Parameters
    ----------
    workspace : Workspace
        Whose document takes the points.
    files : sequence of path
        The files.
    near_bone : callable, optional
        Tells which points are near bone; see `import_landmarks`.
    prompts : Prompts, optional
        Asks for a table of names.
    """

    def __init__(
        self,
        workspace: Workspace,
        files: Sequence[str | Path],
        near_bone: Predicate | None = None,
        prompts: Prompts | None = None,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._workspace, self._near_bone = workspace, near_bone
        self._prompts = prompts or Prompts(self)
        self._table: dict[str, str] = {}
        self._files = [Path(file) for file in files]
        self._objection = ""
        self._memory = LabNamesMemory(workspace.directory)
        self.setWindowTitle("Import landmarks")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setModal(True)
        self._make_widgets()
        self._lay_out()
        self._look()
        open_at(self, 560, 380)

    def _make_widgets(self) -> None:
        self.side = QComboBox()
        name_choice(self.side, "Side of the head")
        self.side.addItem("As the files say", None)
        for side in Side:
            self.side.addItem(side.word, side)
        self.side.currentIndexChanged.connect(self._look)
        self.keep = QCheckBox("Keep placed points; import only features that are not placed")
        self.anyway = QCheckBox("Import anyway")
        self.anyway.toggled.connect(self._refresh)
        self.show_only = QPushButton("Show as grey reference points instead")
        self.show_only.setAutoDefault(False)
        self.show_only.clicked.connect(self._show_references)
        self.cancel = QPushButton("Cancel")
        self.cancel.clicked.connect(self.reject)
        self.take = QPushButton("Import")
        self.take.setProperty("role", "primary")
        self.take.setDefault(True)
        self.take.clicked.connect(self._import)
        self.names = LabNamesTable()
        self.names.changed.connect(self._look)
        self.names.load_asked.connect(self._ask_table)
        self._findings = QVBoxLayout()
        self._findings.setSpacing(8)
        self._title = ElidedLabel("", "title")

    def _lay_out(self) -> None:
        content = QWidget()
        content.setProperty("role", "panel")
        column = in_column(
            self._title,
            self._findings,
            placed(self.show_only, Qt.AlignmentFlag.AlignLeft),
            self.names,
            self.anyway,
            margins=(20, 16, 20, 12),
            spacing=10,
            of=content,
        )
        self._choices = QWidget()
        choices = QVBoxLayout(self._choices)
        choices.setContentsMargins(0, 4, 0, 0)
        choices.addLayout(in_row(text_label("Side", "hint"), self.side, STRETCH))
        choices.addWidget(self.keep)
        column.addWidget(self._choices)
        column.addStretch(1)
        in_column(
            wide(scrolled(content)),
            in_row(STRETCH, self.cancel, self.take, margins=(20, 10, 20, 14)),
            margins=0,
            of=self,
        )

    def _look(self, *_: object) -> None:
        """Read the files, and say what is in them."""
        self._objection = ""
        self.anyway.setChecked(False)
        unknown = self._unknown()
        self.names.show_names(unknown)
        self.show_only.setVisible(bool(unknown))
        findings = [finding for file in self._files for finding in self._read(file)]
        self._n_wrong = sum(level == "error" for level, _ in findings)
        n = len(self._files)
        self._title.set_words(self._files[0].name if n == 1 else f"{n} landmark files")
        self._show(findings)

    def _read(self, file: Path) -> list[tuple[str, str]]:
        """Return what a file holds, or why it cannot be taken over, and what to know about its sides."""
        try:
            points = read_points(file, names=LabelNames(self._codes()))
            if unknown := unknown_labels(points):
                n = len(unknown)
                what = (
                    "1 name is unknown. Choose what it"
                    if n == 1
                    else f"{n} names are unknown. Choose what they"
                )
                return [("error", f"{file.name}: {what} {'stands' if n == 1 else 'stand'} for.")]
            side = self.side.currentData()
            sets = sides_of(points) if side is None else (landmarks_of(points, side=side),)
        except GpError as error:
            return [("error", str(error))]
        found = [("info", f"{file.name}: {' and '.join(_words(landmarks) for landmarks in sets)}")]
        wrong = [text for landmarks in sets for text in self._workspace.head.wrong_sides_in(landmarks)]
        if wrong:
            rest = f", and {len(wrong) - 1} more on the wrong side too" if len(wrong) > 1 else ""
            left = self._workspace.head.left_text
            found.append(("warning", f"{wrong[0]}{rest}. Are left and right exchanged? {left}"))
        return found

    def _ask_table(self) -> None:
        """Ask for a file that says what the names stand for, and choose what it says."""
        for file in self._prompts.open_files("Open a table of names", _TABLES, start=self._files[0].parent):
            try:
                names = read_lab_names(file)
            except GpError as error:
                self._show([("error", str(error))])
                return
            self._table |= names.codes
            self.names.choose(names)

    def _codes(self) -> dict[str, str]:
        """Return what names stand for: as remembered, as a table said, and as chosen here."""
        given = LabelNames(self.names.codes).codes
        return {**self._memory.recall().codes, **self._table, **given}

    def _unknown(self) -> list[str]:
        """Return the names that neither the feature table nor the memory knows."""
        found: dict[str, None] = {}
        for file in self._files:
            with contextlib.suppress(GpError):
                points = read_points(file, names=self._memory.recall())
                found |= dict.fromkeys(unknown_labels(points))
        return list(found)

    def _show(self, findings: Sequence[tuple[str, str]]) -> None:
        emptied(self._findings)
        for level, words in findings:
            self._findings.addWidget(Notice(level, words))
        self._refresh()

    def _refresh(self, *_: object) -> None:
        self.anyway.setVisible(bool(self._objection))
        self.take.setEnabled(not self._n_wrong and (not self._objection or self.anyway.isChecked()))

    def _show_references(self) -> None:
        """Leave the specimen as it is, and only show where their points are."""
        try:
            self._workspace.references.show(*self._files)
        except GpError as error:
            self._show([("error", str(error))])
        else:
            self.accept()

    def _import(self) -> None:
        document = self._workspace.document
        try:
            notes = import_landmarks(
                document,
                self._files,
                side=self.side.currentData(),
                names=self._codes(),
                near_bone=self._near_bone,
                accept_off_bone=self.anyway.isChecked(),
                replace_placed=not self.keep.isChecked(),
            )
        except OffBoneError as error:
            self._objection = error.problem
            self._show([("warning", sentence(error.problem) + " " + (error.remedy or ""))])
        except GpError as error:
            self._show([("error", str(error))])
        else:
            self._memory.remember({**self._table, **LabelNames(self.names.codes).codes})
            self._report(notes)

    def _report(self, notes: Sequence[str]) -> None:
        """Close where all is well; else say what should be known first."""
        done = " and ".join(f"{side.word} {self._workspace.labels.progress(side).text}" for side in Side)
        if not notes:
            self._workspace.say(f"Imported landmarks: {done}")
            self.accept()
            return
        self._objection = ""
        self._title.set_words("Imported, with warnings")
        self._choices.hide()
        self.show_only.hide()
        self._show([("good", f"Now placed: {done}"), *(("warning", sentence(note)) for note in notes)])
        self.take.hide()
        self.cancel.setText("Close")


def _words(landmarks: LandmarkSet) -> str:
    unseen = f", {len(landmarks.unseen)} not seen" if landmarks.unseen else ""
    suggested = f", {len(landmarks.suggested)} only suggested" if landmarks.suggested else ""
    return f"{len(landmarks.placed)} points of the {landmarks.side.word} side{suggested}{unseen}"
