"""The card of what is drawn of the estimate over bone and slices."""

from __future__ import annotations

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QCheckBox, QGridLayout, QSlider, QWidget

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit, text_width
from gp_labeler.views.layouts import in_row, wide
from gp_labeler.views.panels.action_button import Actions, do_action
from gp_labeler.views.panels.card_parts import link
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.parts import Card, text_label
from gp_labeler.views.signals import blocked, follow

__all__ = ["OverlayCard"]

_PARTS = {
    "estimate": ("Origin and axis", "The estimated CO, and the modiolar axis as an arrow"),
    "region": ("95 % region", "Ellipsoid and cone that contain CO and the axis with 95 % probability"),
    "cochlea": ("Cochlea", "The outline of a cochlea in the estimated pose"),
    "truth": ("Labelled", "The labelled CO and axis, and the errors of the estimate"),
    "features": ("Atlas features", "Features of the atlas in the estimated pose"),
    "vectors": ("Error vectors", "From the atlas features to the labels"),
    "touches": ("Touches", "The touched points in the scan"),
    "tip": ("Probe", "The tracked probe"),
    "path": ("Insertion path", "Insertion path of an electrode, if one is loaded"),
    "names": ("Names and errors", "Labels beside the drawn objects"),
}


class OverlayCard(Card):
    """Check boxes for the parts, opacity, and two cameras.

    Parameters
    ----------
    workspace : Workspace
        Whose overlay it sets.
    actions : mapping of str to QAction
        Of the cameras: ``pose.along_axis`` and ``pose.through_window``, where they are.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__("Overlay", parent)
        self._workspace = workspace
        self.visible = self._box("visible", "Show", "Draw the estimate over bone and slices")
        self.parts = {name: self._box(name, *words) for name, words in _PARTS.items()}
        self.opacity = QSlider(Qt.Orientation.Horizontal)
        self.opacity.setRange(5, 100)
        self.opacity.setAccessibleName("Opacity of the overlay, percent")
        self.percent = text_label("", "hint")
        self.cameras = {name: link(word) for name, word in _CAMERAS.items()}
        self._lay_out(actions)
        self.opacity.valueChanged.connect(lambda percent: self._workspace.pose.draw(opacity=percent / 100))
        follow(self, workspace.pose.overlay_changed, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show what is drawn."""
        options = self._workspace.pose.overlay
        for name, box in {"visible": self.visible, **self.parts}.items():
            with blocked(box):
                box.setChecked(getattr(options, name))
            box.setEnabled(options.visible or name == "visible")
        with blocked(self.opacity):
            self.opacity.setValue(round(100 * options.opacity))
        self.percent.setText(f"{100 * options.opacity:.0f} %")

    def _box(self, name: str, word: str, hint: str) -> QCheckBox:
        box = QCheckBox(word)
        box.setToolTip(hint)
        box.toggled.connect(lambda on: self._workspace.pose.draw(**{name: on}))
        return box

    def _lay_out(self, actions: Actions) -> None:
        self.add_to_heading(self.visible)
        grid = QGridLayout()
        grid.setHorizontalSpacing(8)
        grid.setVerticalSpacing(1)
        for n, box in enumerate(self.parts.values()):
            grid.addWidget(box, n // 2, n % 2)
        self.add(grid)
        row = in_row(text_label("Opacity", "hint"), wide(self.opacity), self.percent, spacing=8)
        fit(self.percent, lambda: self.percent.setFixedWidth(text_width(self.percent, "100 %")))
        self.add(row)
        looks = FlowLayout(spacing=2)
        for name, button in self.cameras.items():
            do_action(button, actions[name])
            looks.addWidget(button)
        self.add(looks)


_CAMERAS = {"pose.along_axis": "Look along the axis", "pose.through_window": "Through the round window"}
