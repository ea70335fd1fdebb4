"""The first offer of the step Label: suggestions from labelled scans, then checking them in pages."""

from __future__ import annotations

from qtpy.QtWidgets import QWidget

from gp_core.landmarks.features import Side
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import in_row
from gp_labeler.views.panels.action_button import Actions, action_button
from gp_labeler.views.signals import follow

__all__ = ["SuggestRow"]

_OFFER, _STOP = "Suggest…", "Stop"
_FEWEST_FOR_A_PAGE = 2


class SuggestRow(QWidget):
    """Two buttons: to suggest landmarks, while a scan has none; and to check several suggestions at a glance.

    Parameters
    ----------
    workspace : Workspace
        Whose labels it looks at.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.button = action_button(
            actions["point.suggest_like"],
            _OFFER,
            "Suggests first labels from labelled scans; click again to stop",
        )
        self.check = action_button(actions["point.check_page"], "Check pages…")
        in_row(self.button, self.check, margins=(0, 0, 12, 0), of=self)
        document = workspace.document
        for signal in (document.reset, document.landmarks_changed, workspace.first_labels.changed):
            follow(self, signal, self.refresh)
        follow(self, workspace.scan.opened, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show the offers, or hide them."""
        running = self._workspace.first_labels.is_running
        sides = [self._workspace.document.landmarks(side) for side in Side]
        is_new = not any(landmarks.placed or landmarks.suggested for landmarks in sides)
        has_scan = self._workspace.scan.volume is not None
        n_suggested = sum(len(landmarks.suggested) for landmarks in sides)
        self.button.setText(_STOP if running else _OFFER)
        self.button.setVisible(running or (is_new and has_scan))
        self.check.setVisible(has_scan and n_suggested >= _FEWEST_FOR_A_PAGE)
        self.setVisible(not (self.button.isHidden() and self.check.isHidden()))
