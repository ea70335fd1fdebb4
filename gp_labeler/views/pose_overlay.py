"""Estimated cochleae over a slice, with all that they are judged by."""

from __future__ import annotations

import numpy as np
from qtpy.QtCore import QObject
from qtpy.QtGui import QPainter

from gp_labeler.scene.colours import DARK
from gp_labeler.scene.pose_data import PoseScene
from gp_labeler.scene.pose_names import written_in
from gp_labeler.scene.slice_view import SliceView as Shown
from gp_labeler.views.pose_slices import SlicePen
from gp_labeler.views.slice_layers import SliceName
from gp_labeler.views.slice_view import SliceView

__all__ = ["PoseOverlay"]


class PoseOverlay(QObject):
    """A layer of a slice view, between its picture and its points.

    Parameters
    ----------
    view : SliceView
        The view, which owns it.
    """

    def __init__(self, view: SliceView) -> None:
        super().__init__(view)
        self._view, self._scene = view, PoseScene()
        view.layers.append(self)

    @property
    def scene(self) -> PoseScene:
        """What is drawn."""
        return self._scene

    def show(self, scene: PoseScene) -> None:
        """Draw this in place of what was before."""
        self._scene = scene
        self._view.update()

    def paint(self, painter: QPainter, shown: Shown, ratio: float) -> None:
        """Paint it, in device pixels; `ratio` of them are a logical one."""
        painter.save()
        SlicePen(painter, shown, ratio, self._scene).draw()
        painter.restore()

    def names(self, shown: Shown, ratio: float) -> list[SliceName]:
        """Return what is written beside it, and what names leave free."""
        names, places, gaps = written_in(self._scene)
        pixels, off = shown.scan_to_pixel(places) + 0.5, np.abs(shown.off_slice(places))
        written = [
            SliceName(name.text, pixel, DARK.word(name.role), name.gap, name.rank)
            for name, pixel, away in zip(names, pixels[: len(names)], off[: len(names)], strict=True)
            if away <= name.reach_mm
        ]
        free = [
            SliceName("", pixel, DARK.text, gap, -2.0)
            for gap, pixel in zip(gaps, pixels[len(names) :], strict=True)
        ]
        return written + free
