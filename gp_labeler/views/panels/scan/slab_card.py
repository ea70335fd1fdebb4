"""Thick slabs and less noise in the slice views: display only."""

from __future__ import annotations

from qtpy.QtWidgets import QComboBox, QGridLayout, QWidget

from gp_labeler.imaging.slab import Slab
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.number_field import NumberField
from gp_labeler.views.panels.parts import Card, keep_room, text_label
from gp_labeler.views.screen_reader import name_choice
from gp_labeler.views.signals import attempt, blocked, follow

__all__ = ["SlabCard"]

_MODES = {"Single slice": "", "Mean": "mean", "Maximum": "maximum", "Minimum": "minimum"}
_KINDS = {"None": "", "Median": "median", "Gaussian": "gaussian", "Bilateral": "bilateral"}
_FIRST_MM = 0.5


class SlabCard(Card):
    """What the slice views show in place of single slices.

    Parameters
    ----------
    workspace : Workspace
        Whose view it sets.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__("Slab and noise", parent)
        self._workspace = workspace
        self.mode, self.denoise = QComboBox(), QComboBox()
        self.mode.addItems(list(_MODES))
        name_choice(self.mode, "Slab projection")
        self.denoise.addItems(list(_KINDS))
        name_choice(self.denoise, "How the slices are denoised")
        self.thickness = NumberField("Thickness of the slab, mm")
        self.thickness.step = 0.1
        grid = QGridLayout()
        grid.setHorizontalSpacing(8)
        self._unit = text_label("mm", "hint")
        keep_room(self.thickness)
        keep_room(self._unit)
        for column, widget in enumerate((text_label("Slab", "hint"), self.mode, self.thickness, self._unit)):
            grid.addWidget(widget, 0, column)
        grid.addWidget(text_label("Denoise", "hint"), 1, 0)
        grid.addWidget(self.denoise, 1, 1)
        grid.setColumnStretch(1, 2)
        grid.setColumnStretch(2, 1)
        self.add(grid)
        self.add(
            text_label("Display only: values, bone edge and clicks use the single slice.", "hint", wrap=True)
        )
        self.mode.activated.connect(self._on_slab)
        self.thickness.value_chosen.connect(self._on_slab)
        self.denoise.activated.connect(self._on_denoise)
        for signal in (workspace.view.changed, workspace.document.reset):
            follow(self, signal, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show what is in effect."""
        state = self._workspace.view.state
        with blocked(self.mode, self.denoise):
            mode = "" if state.slab is None else state.slab.mode
            self.mode.setCurrentIndex(list(_MODES.values()).index(mode))
            self.denoise.setCurrentIndex(list(_KINDS.values()).index(state.denoise or ""))
        self.thickness.setVisible(state.slab is not None)
        self._unit.setVisible(state.slab is not None)
        self.thickness.set_value(None if state.slab is None else state.slab.mm)

    def _on_slab(self, _: object) -> None:
        mode, mm = _MODES[self.mode.currentText()], self.thickness.value or _FIRST_MM
        attempt(self._workspace, lambda: self._workspace.view.update(slab=Slab(mode, mm) if mode else None))
        self.refresh()

    def _on_denoise(self, _: object) -> None:
        self._workspace.view.update(denoise=_KINDS[self.denoise.currentText()] or None)
