"""Rulers and angles over a slice: what of them lies in it, and near it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from qtpy.QtCore import QObject
from qtpy.QtGui import QPainter

from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.colours import DARK
from gp_labeler.scene.slice_viewport import SliceViewport
from gp_labeler.views.drawn_measurements import kept_measurements, moving_measurements
from gp_labeler.views.painting.measurement_strokes import (
    Strokes,
    paint_strokes,
    strokes_on_slice,
    tags_of_strokes,
)
from gp_labeler.views.painting.name_tags import NameTag
from gp_labeler.views.painting.slice_painter import reach_of
from gp_labeler.views.signals import follow

if TYPE_CHECKING:
    from gp_labeler.views.slice_view import SliceView

__all__ = ["MeasureLayer"]


class MeasureLayer(QObject):
    """A layer of a slice view, beneath the landmarks.

    Parameters
    ----------
    workspace : Workspace
        Whose measurements.
    view : SliceView
        The view, which owns it.
    """

    def __init__(self, workspace: Workspace, view: SliceView) -> None:
        super().__init__(view)
        self._workspace, self._view = workspace, view
        view.layers.append(self)
        for signal in (workspace.measure.changed, workspace.measure.pointed):
            follow(self, signal, self._repaint)

    def _repaint(self, *_: object) -> None:
        self._view.update()

    def paint(self, painter: QPainter, shown: SliceViewport, ratio: float) -> None:
        """Paint those near the slice, in device pixels; `ratio` of them are a logical one."""
        paint_strokes(painter, self._near(shown), DARK, ratio)

    def names(self, shown: SliceViewport, ratio: float) -> list[NameTag]:
        """Return what is written beside them."""
        return tags_of_strokes(self._near(shown), DARK)

    def _near(self, shown: SliceViewport) -> list[Strokes]:
        source, measure = self._view.source, self._workspace.measure
        if source is None:
            return []
        reach, in_slice = reach_of(source, shown.plane), 0.75 * source.step(shown.plane)
        drawn = kept_measurements(measure) + moving_measurements(measure)
        return [strokes_on_slice(each, shown, reach=reach, in_slice=in_slice) for each in drawn]
