"""Where bone is cut open in the 3D view, and the buttons that cut it."""

from __future__ import annotations

from functools import partial

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QHBoxLayout, QPushButton, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from gp_labeler.commands.actions import action
from gp_labeler.models.view import CUTS
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.bind import follow
from gp_labeler.views.panels.parts import text_label
from gp_labeler.views.scene_overlay import cut_text

__all__ = ["CutRow"]


class CutRow(QWidget):
    """Buttons for each plane, and for the cut there is.

    Parameters
    ----------
    workspace : Workspace
        Whose bone is cut.
    """

    action_asked = Signal(str)
    """Id of the action to be done."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        planes = QHBoxLayout()
        planes.setSpacing(4)
        planes.addWidget(text_label("Cut open", "hint"))
        self.planes = {plane: self._plane_button(plane) for plane in CUTS}
        for button in self.planes.values():
            planes.addWidget(button)
        self.where = text_label()
        self.flip, self.here = (
            self._button(title, id)
            for title, id in (("Other side", "view.cut_flip"), ("To the crosshair", "view.cut_here"))
        )
        changes = QHBoxLayout()
        changes.setSpacing(6)
        changes.addWidget(self.flip)
        changes.addWidget(self.here)
        self._more = QWidget()
        more = QVBoxLayout(self._more)
        more.setContentsMargins(0, 0, 0, 0)
        more.setSpacing(4)
        more.addWidget(self.where)
        more.addWidget(text_label("Alt+wheel over the 3D view moves the cut.", "hint"))
        more.addLayout(changes)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addLayout(planes)
        whole.addWidget(self._more)
        for signal in (workspace.view.changed, workspace.bone.surfaces_changed, workspace.document.reset):
            follow(self, signal, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show the cut as it is."""
        cut = self._workspace.view.state.cut
        for plane, button in self.planes.items():
            button.setChecked(cut is not None and cut.plane == plane)
            button.setEnabled(bool(self._workspace.bone.surfaces))
        self._more.setVisible(cut is not None)
        if cut is not None:
            self.where.setText(cut_text(cut))

    def _plane_button(self, plane: str) -> QToolButton:
        button = QToolButton()
        button.setText("View" if plane == "view" else plane.capitalize())
        button.setCheckable(True)
        button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        row = action(f"view.cut_{plane}")
        button.setToolTip(f"{row.hint}  ({row.shortcuts[0]})")
        button.setAccessibleName(row.title)
        button.clicked.connect(partial(self._ask, row.id))
        return button

    def _button(self, title: str, id: str) -> QPushButton:
        row, button = action(id), QPushButton(title)
        button.setToolTip(f"{row.hint or row.title}  ({row.shortcuts[0]})")
        button.clicked.connect(partial(self._ask, id))
        return button

    def _ask(self, id: str, *_: object) -> None:
        self.action_asked.emit(id)
        self.refresh()
