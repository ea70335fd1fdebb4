"""The panel of the step Atlas: which atlas is in use, fitting another, how labels fit it, leave-one-out."""

from __future__ import annotations

from typing import Any

from qtpy.QtCore import QSize, Qt, Signal
from qtpy.QtGui import QResizeEvent
from qtpy.QtWidgets import (
    QBoxLayout,
    QCheckBox,
    QGridLayout,
    QHBoxLayout,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from gp_core.atlas.label_check import Finding
from gp_core.constants import METHOD_NAMES
from gp_labeler.document.animals import Animals
from gp_labeler.jobs.atlas import FEWEST_ANIMALS, FitAtlas
from gp_labeler.jobs.runner import Task
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit, pixels
from gp_labeler.views.formatting import sentence
from gp_labeler.views.layouts import STRETCH, in_column, in_row, wide
from gp_labeler.views.panels.action_button import Actions, action_button
from gp_labeler.views.panels.atlas.feature_table import FeatureTable
from gp_labeler.views.panels.atlas.repeatability_card import RepeatabilityCard
from gp_labeler.views.panels.card_parts import Notices
from gp_labeler.views.panels.finding_list import FindingList, FindingRow
from gp_labeler.views.panels.parts import Card, ElidedLabel, Facts, emptied, scrolled, text_label
from gp_labeler.views.signals import blocked, follow

__all__ = ["AtlasPanel"]

_WIDEST = 1020
_TWO_COLUMNS = 640
"""From which width there is room for two columns; logical pixels at the normal text size."""


class AtlasPanel(QWidget):
    """All that concerns the atlas.

    Parameters
    ----------
    workspace : Workspace
        Whose atlas it shows and changes.
    actions : mapping of str to QAction
        What its buttons do.
    """

    animal_asked = Signal(object)
    """A `Finding` whose animal the user wants to see."""

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("role", "panel")
        self.which, self.own = AtlasCard(workspace, actions), AtlasFittingCard(workspace, actions)
        self.trial, self.labels = LeaveOneOutCard(workspace, actions), LabelsCard(workspace)
        self.repeatability = RepeatabilityCard(workspace, actions)
        self.own.animal_asked.connect(self.animal_asked)
        content = QWidget()
        content.setProperty("role", "panel")
        fit(content, lambda: content.setMaximumWidth(pixels(content, _WIDEST)))
        self._columns = QBoxLayout(QBoxLayout.Direction.TopToBottom, content)
        self._columns.setContentsMargins(4, 8, 8, 8)
        self._columns.setSpacing(6)
        self._left, self._right = _column(self.which), _column(self.labels)
        for column in (self._left, self._right):
            self._columns.addLayout(column, 1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        self._area = scrolled(content)
        self._area.setAlignment(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop)
        layout.addWidget(self._area)
        self.setFocusProxy(self.which.open)
        self._is_alone, self._is_wide = False, True
        fit(self, self._share_columns)

    def set_wide(self, wide: bool) -> None:
        """Take all the width there is, where there is no scan beside."""
        self._is_alone = wide
        self._share_columns()

    def _share_columns(self) -> None:
        """Lie in two columns where there is room for them."""
        wide = self._is_alone and self.width() >= pixels(self, _TWO_COLUMNS)
        if wide == self._is_wide:
            return
        self._is_wide = wide
        ways = QBoxLayout.Direction
        self._columns.setDirection(ways.LeftToRight if wide else ways.TopToBottom)
        self._columns.setStretch(0, int(wide))  # below each other, the last column takes what is left
        column = self._left if wide else self._right
        for card in (self.own, self.trial, self.repeatability):
            for other in (self._left, self._right):
                other.removeWidget(card)
            column.insertWidget(column.count() - 1, card)  # before the stretch
        self._area.updateGeometry()  # which no layout asks for while the panel is hidden

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().resizeEvent(event)
        self._share_columns()

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        least, table = self.minimumSizeHint(), self.labels.table
        names = table.sizeHint().width() - table.minimumSizeHint().width()
        return QSize(least.width() + names, super().sizeHint().height())


def _column(*cards: QWidget) -> QVBoxLayout:
    return in_column(*cards, STRETCH, spacing=6)


class AtlasCard(Card):
    """Which atlas is in use."""

    def __init__(self, workspace: Workspace, actions: Actions) -> None:
        super().__init__("Atlas in use")
        self._workspace = workspace
        self.name, self.facts = ElidedLabel("", "title"), Facts()
        self.add(self.name)
        self.add(self.facts)
        row = QHBoxLayout()
        row.setSpacing(6)
        self.published, self.open, self.save = (
            action_button(actions[f"atlas.{name}"], *texts) for name, texts in _BUTTONS.items()
        )
        for button in (self.published, self.open, self.save):
            row.addWidget(button, 1)
        self.notices = Notices()
        self.add(self.notices)
        self.add(row)
        for signal in (workspace.atlas.changed, workspace.atlas.details_changed, workspace.document.reset):
            follow(self, signal, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show which it is."""
        workspace, atlas = self._workspace, self._workspace.atlas.current
        self.name.set_words(_title(workspace))
        remedy = "Choose another atlas, or press Published to discard this one."
        self.notices.show_notices(
            [("warning", workspace.atlas.problem, remedy)] if workspace.atlas.problem else []
        )
        if atlas is None:
            self.facts.show_facts({})
            return
        facts = {"Source": _source(workspace)}
        if _made_from(workspace) != atlas.name:
            facts["Made from"] = _made_from(workspace)
        facts["Features"] = f"{len(atlas.codes)} of 19"
        facts["Labels"] = f"Error {workspace.atlas.labelling_error_text}"
        if workspace.atlas.file is not None:
            facts["File"] = workspace.atlas.file.name
        if workspace.atlas.is_held_out:
            facts["Here"] = (
                f"{workspace.document.state.specimen} is one of them, and is compared with the others"
            )
        self.facts.show_facts(facts)


_BUTTONS = {
    "published": ("Published", "Use the atlas rebuilt from the paper's table of distances"),
    "open": ("Open file…", "Use an atlas saved here or made with gp-core fit"),
    "save": ("Save…", "Save the atlas for gp-core or another computer"),
}


def _title(workspace: Workspace) -> str:
    atlas = workspace.atlas.current
    if atlas is None:
        return "Loading…"
    return "The published atlas" if workspace.atlas.is_published else atlas.name


def _source(workspace: Workspace) -> str:
    if workspace.atlas.is_published:
        return "Distances published by Usevitch et al. 2021"
    return "Fitted here" if workspace.atlas.animals is not None else "An atlas file"


def _made_from(workspace: Workspace) -> str:
    atlas = workspace.atlas.current
    assert atlas is not None
    sides = f"{atlas.n_samples} side{'' if atlas.n_samples == 1 else 's'}"
    if workspace.atlas.is_published:
        return f"11 animals, {sides}"
    n = len(atlas.specimens)
    return f"{n} animal{'' if n == 1 else 's'}, {sides}" if n else sides


class AtlasFittingCard(Card):
    """Fitting an atlas to labelled animals, and what was read for it."""

    animal_asked = Signal(object)
    """A `Finding` whose animal the user wants to see."""

    def __init__(self, workspace: Workspace, actions: Actions) -> None:
        super().__init__("Fit to labelled animals")
        self._workspace = workspace
        hint = "Specimens saved here, or landmarks exported from here or from 3D Slicer."
        self.add(text_label(hint, "hint", wrap=True))
        row = QHBoxLayout()
        row.setSpacing(6)
        self.files = action_button(actions["atlas.fit_files"], "From files…", "Choose all of them at once")
        self.folder = action_button(
            actions["atlas.fit_folder"], "From a folder…", "Subfolders are searched too"
        )
        for button in (self.files, self.folder):
            row.addWidget(button, 1)
        self.add(row)
        self.keep_doubtful = QCheckBox("Use doubtful labels too")
        self.keep_doubtful.setToolTip(
            "By default, exchanged names and labels beyond 5 SD are left out, and their animals get little "
            "weight"
        )
        self.keep_doubtful.toggled.connect(self._keep_doubtful)
        self.add(self.keep_doubtful)
        self.weigh_certainty = QCheckBox("Weight labels by certainty")
        self.weigh_certainty.setToolTip("Weights: fair 1/2, guess 1/5, all others 1")
        self.weigh_certainty.toggled.connect(workspace.atlas.set_weigh_certainty)
        self.add(self.weigh_certainty)
        self._add_progress()
        self.findings = FindingList()
        self.findings.chosen.connect(self.animal_asked)
        self.add(self.findings)
        for signal in (workspace.atlas.changed, workspace.atlas.details_changed):
            follow(self, signal, self.refresh)
        for signal in (workspace.jobs.started, workspace.jobs.progressed):
            follow(self, signal, self._on_progress)
        for signal in (workspace.jobs.done, workspace.jobs.failed, workspace.jobs.cancelled):
            follow(self, signal, self._on_end)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show what was read."""
        animals = self._workspace.atlas.animals
        with blocked(self.keep_doubtful, self.weigh_certainty):
            self.keep_doubtful.setChecked(self._workspace.atlas.keep_doubtful)
            self.weigh_certainty.setChecked(self._workspace.atlas.weigh_certainty)
        self.findings.show_rows(
            [] if animals is None else _findings(animals, self._workspace.atlas.keeps_doubtful)
        )

    def _add_progress(self) -> None:
        self.progress, self.stop = QProgressBar(), QPushButton("Stop")
        self.progress.setRange(0, 100)
        self.progress.setTextVisible(False)
        fit(self.progress, lambda: self.progress.setFixedHeight(pixels(self, 8)))
        self.stop.clicked.connect(self._stop)
        self._work = QWidget()
        in_row(
            text_label("Reading and checking", "hint"),
            wide(self.progress),
            self.stop,
            margins=0,
            of=self._work,
        )
        self._work.hide()
        self.add(self._work)

    def _on_progress(self, task: Task[Any]) -> None:
        if isinstance(task.job, FitAtlas):
            self._work.show()
            self.progress.setValue(round(100 * task.fraction))

    def _on_end(self, _: Task[Any]) -> None:
        self._work.setVisible(any(isinstance(task.job, FitAtlas) for task in self._workspace.jobs.running))

    def _keep_doubtful(self, keep: bool) -> None:
        self._workspace.atlas.set_keep_doubtful(keep)

    def _stop(self) -> None:
        for task in self._workspace.jobs.running:
            if isinstance(task.job, FitAtlas):
                task.cancel()


def _words(finding: Finding) -> str:
    """Return what was found, and where; a text about several landmarks names them itself."""
    named = f" {finding.landmarks[0]}" if len(finding.landmarks) == 1 else ""
    return f"{finding.specimen} {finding.side.word}{named}: {finding.text}"


def _findings(animals: Animals, kept: bool) -> list[FindingRow]:
    """Return what was left out or should be looked at, the worst first, and what was skipped."""
    left_out = () if kept or animals.screened is None else animals.screened.left_out
    rows = [FindingRow(f"{animals.text} were read.", level="good")]
    rows += [
        FindingRow(
            _words(each),
            f"Left out. {each.remedy}" if each in left_out else each.remedy,
            target=each,
        )
        for each in animals.problems
    ]
    rows += [FindingRow(f"Skipped {each.what}", sentence(each.why)) for each in animals.skipped]
    notes = () if animals.screened is None else animals.screened.notes
    return rows + [FindingRow(note, level="info") for note in notes]


class LabelsCard(Card):
    """How much each feature varies, and how well the labels of this specimen fit."""

    def __init__(self, workspace: Workspace) -> None:
        super().__init__("Features")
        self._workspace = workspace
        self.verdict = text_label("", "hint", wrap=True)
        self.table = FeatureTable(workspace)
        self.add(self.verdict)
        self.add(self.table)
        for signal in (
            workspace.atlas.changed,
            workspace.labels.checked,
            workspace.labels.problems_changed,
            workspace.document.landmarks_changed,
            workspace.document.reset,
        ):
            follow(self, signal, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Say in a sentence what the table shows."""
        rows = self.table.rows
        if not rows.n_judged:
            words = "When four features of a side are placed, this shows how well they fit the atlas."
        elif rows.n_doubtful:
            words = f"{rows.n_doubtful} of {rows.n_judged} labels should be reviewed."
        else:
            words = f"All {rows.n_judged} labels that can be checked fit the atlas."
        others = rows.with_other_problems
        if rows.n_judged and others:
            have = "has" if len(others) == 1 else "have"
            words = f"{words.removesuffix('.')}; {len(others)} {have} other problems: {', '.join(others)}."
        self.verdict.setText(words)


class LeaveOneOutCard(Card):
    """Leave-one-out: how well each animal's cochlea is found from the others."""

    def __init__(self, workspace: Workspace, actions: Actions) -> None:
        super().__init__("Leave-one-out")
        self._workspace = workspace
        self.words = text_label("", "hint", wrap=True)
        self.add(self.words)
        self._table = QWidget()
        self._grid = QGridLayout(self._table)
        self._grid.setContentsMargins(0, 2, 0, 2)
        self._grid.setHorizontalSpacing(8)
        self._grid.setVerticalSpacing(3)
        self.add(self._table)
        self.findings = FindingList()
        self.add(self.findings)
        row = QHBoxLayout()
        self.run = action_button(actions["atlas.try"], "Run leave-one-out", "On the animals of the atlas")
        row.addWidget(self.run, 1)
        self.add(row)
        for signal in (workspace.atlas.changed, workspace.atlas.details_changed):
            follow(self, signal, self.refresh)
        for signal in (
            workspace.jobs.started,
            workspace.jobs.done,
            workspace.jobs.failed,
            workspace.jobs.cancelled,
        ):
            follow(self, signal, self._on_jobs)
        self.refresh()

    @property
    def figures(self) -> list[list[str]]:
        """What the table shows, a list for each method."""
        trial = self._workspace.atlas.trial
        if trial is None:
            return []
        return [
            [METHOD_NAMES[method], f"{co:.2f}", f"{co_max:.2f}", f"{axis:.1f}", f"{axis_max:.1f}"]
            for method, (co, co_max, axis, axis_max) in trial.figures.items()
        ]

    def refresh(self, *_: object) -> None:
        """Show the errors, or what it takes to find them."""
        trial = self._workspace.atlas.trial
        emptied(self._grid)
        skipped = () if trial is None else trial.skipped
        self.findings.show_rows([FindingRow(f"Left out: {each.text}") for each in skipped])
        self._table.setVisible(trial is not None)
        self.words.setText(self._sentence())
        self._on_jobs()
        if trial is None:
            return
        for column, words in enumerate(("", "CO, mm", "max", "axis, °", "max")):
            self._grid.addWidget(_figure(words, "hint"), 0, column)
        for row, texts in enumerate(self.figures, 1):
            for column, words in enumerate(texts):
                self._grid.addWidget(_figure(words, "" if column else "heading"), row, column)
        for column in range(5):
            self._grid.setColumnStretch(column, 1)

    def _sentence(self) -> str:
        workspace, trial = self._workspace, self._workspace.atlas.trial
        if not workspace.atlas.can_try:
            least = f"Fit to {FEWEST_ANIMALS} labelled animals or more"
            return f"{least} to see how well each is estimated from the others."
        if trial is None:
            return "Estimates each animal's cochlea from the touchable points and the other animals."
        report = trial.reports[0]
        return (
            f"{trial.n_sides} sides of {trial.n_animals} animals, each estimated from the others; "
            f"{len(report.training)} training and {len(report.probe)} probe features."
        )

    def _on_jobs(self, *_: object) -> None:
        self.run.setText("Running…" if self._workspace.atlas.is_trying else "Run leave-one-out")


def _figure(words: str, role: str) -> QWidget:
    label = text_label(words, role)
    side = Qt.AlignmentFlag.AlignLeft if role == "heading" else Qt.AlignmentFlag.AlignRight
    label.setAlignment(side | Qt.AlignmentFlag.AlignVCenter)
    return label
