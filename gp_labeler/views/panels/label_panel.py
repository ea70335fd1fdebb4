"""The panel of the step Label: the feature card over the table of landmarks."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QVBoxLayout, QWidget

from gp_labeler.views.panels.feature_card import FeatureCard
from gp_labeler.views.panels.landmark_table import LandmarkTable
from gp_labeler.workbench import Workbench

__all__ = ["PANEL_WIDTH", "LabelPanel"]

PANEL_WIDTH = 372
"""Logical pixels; all names and states of the table fit into it."""

_TALLEST_CARD = 540
"""Logical pixels; a picture that is much taller than wide shows nothing more."""


class LabelPanel(QWidget):
    """Card and table; the card gets what the table leaves.

    Parameters
    ----------
    workbench : Workbench
        Whose session they show and edit.
    actions : object, optional
        Handed on.
    """

    def __init__(self, workbench: Workbench, actions: object = None, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("role", "panel")
        self.setFixedWidth(PANEL_WIDTH)
        self.card = FeatureCard(workbench, actions)
        self.table = LandmarkTable(workbench, actions)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(4, 8, 8, 8)
        layout.setSpacing(6)
        self.card.setMaximumHeight(_TALLEST_CARD)
        layout.addWidget(self.card, 1)
        layout.addWidget(self.table, 2)
        layout.addStretch(0)

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(PANEL_WIDTH, super().sizeHint().height())
