"""Points over a slice that are no landmarks: reference points, and those a head is straightened by."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from qtpy.QtCore import QObject
from qtpy.QtGui import QPainter

from gp_core.validation import FloatArray
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.colours import DARK
from gp_labeler.scene.marks import Mark
from gp_labeler.scene.slice_viewport import SliceViewport
from gp_labeler.views.drawn import drawn_free_points, drawn_references
from gp_labeler.views.painting.marks import paint_mark
from gp_labeler.views.painting.name_tags import NameTag
from gp_labeler.views.painting.slice_painter import reach_of
from gp_labeler.views.signals import follow

if TYPE_CHECKING:
    from gp_labeler.views.slice_view import SliceView

__all__ = ["ReferenceLayer"]

_RADIUS = 3.5
_FADE = 0.65


class ReferenceLayer(QObject):
    """A layer of a slice view, beneath the landmarks.

    Parameters
    ----------
    workspace : Workspace
        Whose reference points and free points.
    view : SliceView
        The view, which owns it.
    """

    def __init__(self, workspace: Workspace, view: SliceView) -> None:
        super().__init__(view)
        self._workspace, self._view = workspace, view
        view.layers.append(self)
        for signal in (workspace.references.changed, workspace.head.changed):
            follow(self, signal, self._repaint)

    def _repaint(self) -> None:
        self._view.update()

    def paint(self, painter: QPainter, shown: SliceViewport, ratio: float) -> None:
        """Paint those near the slice, in device pixels; `ratio` of them are a logical one."""
        for mark, pixel, share in self._near(shown):
            opacity = 1.0 - _FADE * share
            paint_mark(painter, mark, pixel, _RADIUS * ratio, DARK, ratio=ratio, opacity=opacity)

    def names(self, shown: SliceViewport, ratio: float) -> list[NameTag]:
        """Return their names, which give way to those of landmarks."""
        return [
            NameTag(mark.label, pixel, DARK.word(mark.state), 7.0, -1.0)
            for mark, pixel, _ in self._near(shown)
        ]

    def _near(self, shown: SliceViewport) -> list[tuple[Mark, FloatArray, float]]:
        """Return the points near the slice, their pixels, and how far off it they are: 0 on it, 1 at most."""
        marks = drawn_references(self._workspace) + drawn_free_points(self._workspace)
        if not marks or self._view.source is None:
            return []
        positions = np.array([mark.position for mark in marks])
        pixels = shown.scan_to_pixel(positions) + 0.5
        shares = np.abs(shown.off_slice(positions)) / reach_of(self._view.source, shown.plane)
        return [(marks[n], pixels[n], float(shares[n])) for n in np.flatnonzero(shares <= 1.0)]
