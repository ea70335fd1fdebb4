"""Estimated cochleae over a slice, with all that they are judged by."""

from __future__ import annotations

import numpy as np
from qtpy.QtCore import QObject
from qtpy.QtGui import QPainter

from gp_labeler.scene.colours import DARK
from gp_labeler.scene.pose_data import PoseScene
from gp_labeler.scene.pose_names import written_in
from gp_labeler.scene.slice_viewport import SliceViewport
from gp_labeler.views.painting.name_tags import NameTag, pose_tags
from gp_labeler.views.painting.pose_slices import SlicePen
from gp_labeler.views.slice_view import SliceView

__all__ = ["PoseLayer"]


class PoseLayer(QObject):
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

    def paint(self, painter: QPainter, shown: SliceViewport, ratio: float) -> None:
        """Paint it, in device pixels; `ratio` of them are a logical one."""
        painter.save()
        SlicePen(painter, shown, ratio, self._scene).draw()
        painter.restore()

    def names(self, shown: SliceViewport, ratio: float) -> list[NameTag]:
        """Return what is written beside it, and what names leave free."""
        written = written_in(self._scene)
        pixels, off = shown.scan_to_pixel(written.places) + 0.5, np.abs(shown.off_slice(written.places))
        return pose_tags(written, pixels, DARK, off)
