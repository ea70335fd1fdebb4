"""Where bone is cut open in the 3D view, and the buttons that cut it."""

from __future__ import annotations

from qtpy.QtGui import QAction
from qtpy.QtWidgets import QSizePolicy, QToolButton, QWidget

from gp_labeler.models.view import CUTS
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import in_column, in_row
from gp_labeler.views.painting.scene_overlay import cut_text
from gp_labeler.views.panels.action_button import Actions, action_button, do_action
from gp_labeler.views.panels.parts import text_label
from gp_labeler.views.signals import follow

__all__ = ["CutRow"]


class CutRow(QWidget):
    """Buttons for each plane, and for the cut there is.

    Parameters
    ----------
    workspace : Workspace
        Whose bone is cut.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        planes = in_row(text_label("Cut open", "hint"), spacing=4)
        self.planes = {plane: _plane_button(plane, actions[f"view.cut_{plane}"]) for plane in CUTS}
        for button in self.planes.values():
            planes.addWidget(button)
        self.where = text_label()
        self.flip, self.here = (
            action_button(actions[id], title)
            for title, id in (("Other side", "view.cut_flip"), ("To the crosshair", "view.cut_here"))
        )
        changes = in_row(self.flip, self.here, spacing=6)
        self._more = QWidget()
        in_column(
            self.where,
            text_label("Alt+wheel in the 3D view moves the cut.", "hint"),
            changes,
            margins=0,
            spacing=4,
            of=self._more,
        )
        in_column(planes, self._more, margins=0, of=self)
        for signal in (workspace.view.changed, workspace.document.reset):
            follow(self, signal, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show the cut as it is."""
        cut = self._workspace.view.state.cut
        self._more.setVisible(cut is not None)
        if cut is not None:
            self.where.setText(cut_text(cut, self._workspace.view.frame))


def _plane_button(plane: str, action: QAction) -> QToolButton:
    button = QToolButton()
    button.setText("View" if plane == "view" else plane.capitalize())
    button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
    button.setAccessibleName(action.text())
    do_action(button, action)
    return button
