"""How grey values become black and white: presets, level and width."""

from __future__ import annotations

from qtpy.QtWidgets import QGridLayout, QHBoxLayout, QSizePolicy, QToolButton, QWidget

from gp_labeler.imaging.histogram import window_presets
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.number_field import NumberField
from gp_labeler.views.panels.parts import Card, text_label
from gp_labeler.views.signals import attempt, follow

__all__ = ["WindowLevelCard"]

_HINTS = {
    "Auto": "Grey window for the whole scan",
    "Full": "From the darkest to the brightest value",
    "Bone": "Shades within bone",
    "Soft": "Shades below bone",
    "Edge": "Narrow window around the bone threshold",
}


class WindowLevelCard(Card):
    """Grey window of the slices.

    Parameters
    ----------
    workspace : Workspace
        Whose view it sets.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__("Window and level of the slices", parent)
        self._workspace = workspace
        row = QHBoxLayout()
        row.setSpacing(4)
        self.presets = {name: self._button(name, row) for name in _HINTS}
        self.add(row)
        self.level, self.width_box = (
            NumberField(f"{name} of the grey window") for name in ("Level", "Width")
        )
        grid = QGridLayout()
        grid.setHorizontalSpacing(8)
        for column, (name, box) in enumerate((("Level", self.level), ("Width", self.width_box))):
            grid.addWidget(text_label(name, "hint"), 0, 2 * column)
            grid.addWidget(box, 0, 2 * column + 1)
            grid.setColumnStretch(2 * column + 1, 1)
            box.value_chosen.connect(self._on_typed)
        self.add(grid)
        for signal in (workspace.view.changed, workspace.scan.opened, workspace.document.reset):
            follow(self, signal, self.refresh)
        follow(self, workspace.scan.threshold_changed, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show the window in effect."""
        volume, view = self._workspace.scan.volume, self._workspace.view.state
        presets = {} if volume is None else window_presets(volume, self._workspace.scan.threshold)
        auto = view.level is None or view.width is None
        shown = presets.get("Full", (0.0, 1.0)) if auto else (view.level or 0.0, view.width or 1.0)
        for name, button in self.presets.items():
            button.setEnabled(volume is not None and (name == "Auto" or name in presets))
            button.setChecked(auto if name == "Auto" else not auto and presets.get(name) == shown)
        for box, value in zip((self.level, self.width_box), shown, strict=True):
            box.setEnabled(volume is not None)
            box.step = presets["Full"][1] / 100 if presets else 1.0
            box.set_value(value if presets else None)

    def _button(self, name: str, row: QHBoxLayout) -> QToolButton:
        button = QToolButton()
        button.setText(name)
        button.setCheckable(True)
        button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        button.setToolTip(_HINTS[name])
        button.clicked.connect(lambda: self._choose(name))
        row.addWidget(button, 1)
        return button

    def _choose(self, name: str) -> None:
        volume, view = self._workspace.scan.volume, self._workspace.view
        if volume is None:
            return
        level, width = None, None
        if name != "Auto":
            level, width = window_presets(volume, self._workspace.scan.threshold)[name]
        view.update(level=level, width=width)
        self.refresh()

    def _on_typed(self, _: float) -> None:
        view = self._workspace.view
        level, width = self.level.value, self.width_box.value
        attempt(self._workspace, lambda: view.update(level=level, width=width))
        self.refresh()
