"""The window of rulers and angles, and of distances between landmarks beside the published ones."""

from __future__ import annotations

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QComboBox, QDialog, QPushButton, QWidget

from gp_core.landmarks.features import Side
from gp_core.study.distance_check import DISAGREES_SD, PairDistance
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import STRETCH, in_column, in_row, wide
from gp_labeler.views.panels.action_button import Actions, action_button
from gp_labeler.views.panels.finding_list import FindingList, FindingRow
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.measure.distance_table import DistanceMatrixView
from gp_labeler.views.panels.measure.measurement_table import MeasurementTable
from gp_labeler.views.panels.parts import Card, open_at, scrolled, text_label
from gp_labeler.views.screen_reader import name_choice
from gp_labeler.views.signals import attempt, follow

__all__ = ["MeasureDialog"]

_BUTTONS = (
    ("tool.ruler", "Ruler"),
    ("tool.angle", "Angle"),
    ("measure.remove", "Remove"),
    ("measure.import", "Import…"),
    ("measure.export", "Export…"),
)


class MeasureDialog(QDialog):
    """Stays open beside the main window while one measures in it.

    Parameters
    ----------
    workspace : Workspace
        Whose measurements and landmarks.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.setWindowTitle("Measurements and distances")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.measurements, self.distances = MeasurementTable(workspace), DistanceMatrixView(workspace)
        self.hint = text_label(role="hint", wrap=True)
        self.summary, self.findings = text_label(wrap=True), FindingList()
        self.side = QComboBox()
        name_choice(self.side, "Side whose distances are shown")
        for side in Side:
            self.side.addItem(side.word.capitalize(), side)
        self.side.setCurrentIndex(list(Side).index(workspace.labels.active.side))
        self.side.currentIndexChanged.connect(self.refresh)
        self.findings.chosen.connect(self._open)
        self._lay_out(actions)
        for signal in (workspace.document.landmarks_changed, workspace.document.reset):
            follow(self, signal, self.refresh)
        follow(self, workspace.measure.changed, self._show_hint)
        self.refresh()
        self._show_hint()
        open_at(self, 760, 700)

    def refresh(self, *_: object) -> None:
        """Show the distances of the chosen side as the landmarks stand."""
        check = self._workspace.measure.distances(self.side.currentData())
        self.distances.show_check(check)
        wrong = check.disagreeing
        measured = sum(pair.measured_mm is not None for pair in check.pairs)
        words = f"{measured} of {len(check.pairs)} distances measured"
        if measured:
            verb = "differs" if len(wrong) == 1 else "differ"
            words += (
                f"; {len(wrong) or 'none'} {verb} by more than {DISAGREES_SD:g} SD from the published ones"
            )
        self.summary.setText(f"{words}.")
        self.findings.show_rows([FindingRow(pair.text, target=pair) for pair in wrong])

    def _show_hint(self) -> None:
        there = self._workspace.document.state.measurements
        words = "Edit a name in place. Click a row to show the measurement in the views."
        self.hint.setText(words if there else "No measurements yet: choose Ruler or Angle, then click.")

    def _open(self, pair: PairDistance) -> None:
        side = self.side.currentData()
        attempt(
            self._workspace,
            lambda: self._workspace.measure.show_pair(side, pair.feature_a, pair.feature_b),
        )

    def _lay_out(self, actions: Actions) -> None:
        rulers, distances = Card("Rulers and angles"), Card("Distances between landmarks")
        buttons = FlowLayout(spacing=6)
        for id, words in _BUTTONS:
            button = action_button(actions[id], words)
            button.setAutoDefault(False)
            buttons.addWidget(button)
        rulers.add(self.hint)
        rulers.add(self.measurements)
        rulers.add(buttons)
        distances.add_to_heading(self.side)
        distances.add(text_label(_EXPLAINED, "hint", wrap=True))
        distances.add(self.summary)
        distances.add(self.distances)
        distances.add(self.findings)
        self.distances.pair_chosen.connect(self._open)
        content = QWidget()
        content.setProperty("role", "panel")
        in_column(rulers, wide(distances), margins=(12, 12, 12, 12), spacing=8, of=content)
        close = QPushButton("Close")
        close.setAutoDefault(False)
        close.clicked.connect(self.accept)
        in_column(
            wide(scrolled(content)), in_row(STRETCH, close, margins=(12, 4, 12, 10)), margins=0, of=self
        )

    def done(self, code: int) -> None:
        """Close, and draw no distance between landmarks any more."""
        self._workspace.measure.clear_pair()
        super().done(code)


_EXPLAINED = (
    "In each cell: the distance of the placed landmarks, mm, above the published mean ± SD of 22 sides "
    "(Figure 2 of the paper). A triangle marks a distance that disagrees; a click shows it in the views."
)
