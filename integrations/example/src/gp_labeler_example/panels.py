"""A panel beside the views: how far each placed feature is from the one that is chosen."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from qtpy.QtCore import Qt
from qtpy.QtGui import QAction
from qtpy.QtWidgets import QLabel, QTableWidget, QTableWidgetItem, QVBoxLayout, QWidget

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.parts import Card
from gp_labeler.views.signals import follow

_EMPTY = "Place two or more features, and select one of them in the step Label."


class DistancesPanel(QWidget):
    """Lists distances in mm, and goes to a feature that is clicked.

    Parameters
    ----------
    workspace : Workspace
        What is open in the window: the panel reads its models, and listens to their signals.
    actions : mapping of str to QAction
        The commands of the window, for buttons.
    """

    def __init__(self, workspace: Workspace, actions: Mapping[str, QAction]) -> None:
        super().__init__()
        self._workspace = workspace
        self.card = Card("Distances")
        self.table = QTableWidget(0, 2)
        self.table.setHorizontalHeaderLabels(["Feature", "mm"])
        self.table.cellClicked.connect(self._go)
        self.table.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        self.table.verticalHeader().hide()
        header = self.table.horizontalHeader()
        header.setStretchLastSection(True)
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.hint = QLabel()
        self.hint.setWordWrap(True)
        self.card.add(self.hint)
        self.card.add(self.table)
        QVBoxLayout(self).addWidget(self.card)
        for signal in (
            workspace.document.reset,
            workspace.document.landmarks_changed,
            workspace.labels.active_changed,
        ):
            follow(self, signal, self.refresh)  # let go with the panel
        self.refresh()

    def refresh(self, *_: object) -> None:
        """List the distances again."""
        active = self._workspace.labels.active
        landmarks = self._workspace.document.landmarks(active.side)
        codes = [code for code in landmarks.placed if code != active.code] if active.code in landmarks else []
        self.hint.setText(f"From {active.code} on the {active.side.word} to:" if codes else _EMPTY)
        self.table.setRowCount(len(codes))
        for row, code in enumerate(codes):
            mm = float(np.linalg.norm(landmarks[code] - landmarks[active.code]))
            for column, text in enumerate((code, f"{mm:.2f}")):
                self.table.setItem(row, column, QTableWidgetItem(text))

    def _go(self, row: int, column: int) -> None:
        code = self.table.item(row, 0)
        if code is not None:
            self._workspace.labels.go_to(self._workspace.labels.active.side, code.text())
