"""The panel of the step Label: the feature card over the table of landmarks."""

from __future__ import annotations

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QVBoxLayout, QWidget

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit, pixels
from gp_labeler.views.layouts import in_column, in_row, placed, wide
from gp_labeler.views.panels.action_button import Actions
from gp_labeler.views.panels.label.feature_card import FeatureCard
from gp_labeler.views.panels.label.landmark_table import LandmarkTable
from gp_labeler.views.panels.label.left_row import LeftRow
from gp_labeler.views.panels.label.observer_row import ObserverRow
from gp_labeler.views.panels.label.suggest_row import SuggestRow
from gp_labeler.views.panels.label.tilt_row import TiltRow
from gp_labeler.views.panels.parts import Scrolled

__all__ = ["LabelPanel"]

_TALLEST_CARD = 540
"""Logical pixels at the normal text size; a picture that is much taller than wide shows nothing more."""


class LabelPanel(QWidget):
    """Card and table; the card gets what the table leaves. In a low window the table scrolls.

    Parameters
    ----------
    workspace : Workspace
        What they show and edit.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("role", "panel")
        self.observer = ObserverRow(workspace, actions)
        self.suggest = SuggestRow(workspace, actions)
        self.tilt = TiltRow(workspace, actions)
        self.left = LeftRow(workspace, actions)
        self.card = FeatureCard(workspace, actions)
        self.table = LandmarkTable(workspace)
        content = QWidget()
        content.setProperty("role", "panel")
        column = QVBoxLayout(content)
        column.setContentsMargins(4, 8, 8, 8)
        column.setSpacing(6)
        fit(self, lambda: self.card.setMaximumHeight(pixels(self, _TALLEST_CARD)))
        column.addLayout(
            in_row(wide(self.observer), placed(self.suggest, Qt.AlignmentFlag.AlignBottom), spacing=0)
        )
        column.addWidget(self.tilt)
        column.addWidget(self.left)
        column.addWidget(self.card, 1)
        column.addWidget(self.table, 2)
        column.addStretch(0)
        in_column(Scrolled(content), margins=0, of=self)
        self.setFocusProxy(self.table.view)
        self.observer.named.connect(self._leave_text)
        self.card.annotation.note.returnPressed.connect(self._leave_text)

    def _leave_text(self) -> None:
        """Take the keys from a field once something was typed: letters are commands again."""
        self.table.view.setFocus()
