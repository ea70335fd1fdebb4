"""The bone threshold over the histogram: shown on the slices while it is dragged, then applied."""

from __future__ import annotations

from qtpy.QtGui import QShowEvent
from qtpy.QtWidgets import QPushButton, QWidget

from gp_labeler.imaging.histogram import histogram_of
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.scan import ProposeThreshold
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import STRETCH, in_row, wide
from gp_labeler.views.panels.number_field import NumberField
from gp_labeler.views.panels.parts import Card, text_label
from gp_labeler.views.panels.scan.histogram_slider import HistogramSlider
from gp_labeler.views.signals import attempt, follow

__all__ = ["BoneCard"]


class BoneCard(Card):
    """The bone threshold.

    Parameters
    ----------
    workspace : Workspace
        Whose threshold it sets.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__("Bone threshold", parent)
        self._workspace = workspace
        self._counted: Volume | None = None
        """The scan whose grey values are shown."""
        self.slider = HistogramSlider()
        self.slider.previewed.connect(self._on_previewed)
        self.slider.chosen.connect(self._choose)
        self.box = NumberField("Bone threshold, grey value")
        self.box.value_chosen.connect(self._choose)
        self.propose = QPushButton("Propose")
        self.propose.setToolTip("Propose a threshold from the histogram")
        self.propose.clicked.connect(self._propose)
        self.add(self.slider)
        self.add(in_row(wide(self.box), self.propose, spacing=8))
        self.smallest = NumberField("Smallest bone part to keep, mm", widest="100.00")
        self.smallest.step = 0.1
        self.smallest.setToolTip("Removes noise. Ossicles are more than 1 mm across")
        self.smallest.value_chosen.connect(self._choose_smallest)
        self.add(
            in_row(
                text_label("Remove parts below", "hint"),
                self.smallest,
                text_label("mm", "hint"),
                STRETCH,
                spacing=8,
            )
        )
        self.add(
            text_label(
                "Lower the threshold until holes in thin bone just close. The slices follow while you drag.",
                "hint",
                wrap=True,
            )
        )
        follow(self, workspace.scan.opened, self._on_volume)
        follow(self, workspace.document.reset, self._on_volume)
        follow(self, workspace.scan.threshold_changed, self.refresh)
        self._on_volume()

    def refresh(self, *_: object) -> None:
        """Show the threshold in effect."""
        threshold = self._workspace.scan.threshold
        for widget in (self.box, self.propose, self.smallest):
            widget.setEnabled(self._workspace.scan.volume is not None)
        self.slider.set_value(threshold)
        self.box.set_value(threshold)
        self.smallest.set_value(self._workspace.bone.smallest_part_mm)

    def _choose_smallest(self, mm: float) -> None:
        attempt(self._workspace, lambda: self._workspace.bone.set_smallest_part(mm))
        self.refresh()

    def _on_volume(self, *_: object) -> None:
        volume = self._workspace.scan.volume
        if volume is None or self.isVisible():
            self._count(volume)
        self.refresh()

    def _count(self, volume: Volume | None) -> None:
        """Count the grey values, not before somebody looks: it takes some 10 ms."""
        histogram = None if volume is None else histogram_of(volume)
        self._counted = volume
        self.slider.set_histogram(histogram)
        if histogram is not None:
            self.box.step = histogram.step

    def showEvent(self, event: QShowEvent) -> None:  # noqa: D102, N802 - Qt's name
        volume = self._workspace.scan.volume
        if self._counted is not volume:
            self._count(volume)
        super().showEvent(event)

    def _on_previewed(self, value: float) -> None:
        self.box.set_value(value)
        self._workspace.scan.preview_threshold(value)

    def _choose(self, value: float) -> None:
        if self._workspace.scan.volume is not None:
            attempt(self._workspace, lambda: self._workspace.scan.set_threshold(value))

    def _propose(self) -> None:
        volume = self._workspace.scan.volume
        if volume is not None:
            self._workspace.jobs.submit(ProposeThreshold(volume), self._choose, key="propose threshold")
