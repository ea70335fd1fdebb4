"""Landmarks as they are painted in every view: shape and colour say the state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from qtpy.QtCore import QPointF, Qt
from qtpy.QtGui import QColor, QPainter, QPen

from gp_core.validation import FloatArray
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.colours import SceneColours
from gp_labeler.scene.marks import LOOKED_AT, REFERENCE, Mark, MarkSet
from gp_labeler.views.painting.marker_pictures import marker_picture
from gp_labeler.views.painting.name_tags import NameTag

__all__ = ["PlacedMark", "paint_mark", "place_marks", "shape_of", "tags_of"]

_SHAPES = {"computed": "rhomb", "doubtful": "triangle", "suggested": "square", REFERENCE: "inverted"}
"""A state shows by shape as well as by colour; others are balls."""

_HOLLOW = LOOKED_AT | {"suggested"}
"""Never filled: what lies beneath is to be judged."""

_LINE, _HALO, _RING, _RING_LINE = 1.6, 3.2, 4.0, 1.8
"""Widths of the outline, of its edge, of the gap to the ring round the active one, and of that; logical
pixels."""

_FAINT = 0.30
"""Opacity behind opaque bone."""


class PlacedMark(NamedTuple):
    """A mark in the 3D view, about a (2,) pixel in painter's coordinates."""

    mark: Mark
    pixel: FloatArray
    radius: float
    opacity: float
    hidden: bool


def paint_mark(
    painter: QPainter,
    mark: Mark,
    pixel: FloatArray,
    radius: float,
    colours: SceneColours,
    *,
    ratio: float,
    opacity: float = 1.0,
    full: bool = True,
    lit: bool = False,
) -> None:
    """Paint a landmark about a (2,) pixel.

    Parameters
    ----------
    painter : QPainter
        In device pixels.
    mark : Mark
    pixel : (2,) float array
        Painter's coordinates.
    radius : float
        Of its outline, device pixels.
    colours : SceneColours
    ratio : float
        Device pixels for each logical one.
    opacity : float
    full : bool
        Whether it is filled, unless its state never is.
    lit : bool
        Whether it is shaded like a solid.
    """
    painter.setOpacity(opacity)
    marker_picture(
        shape_of(mark.state),
        round(2 * radius) / 2,
        colours.states.get(mark.state, colours.text),
        full=full and mark.state not in _HOLLOW,
        line=_LINE * ratio,
        halo=_HALO * ratio,
        halo_colour=colours.halo,
        lit=lit,
    ).draw(painter, pixel)
    painter.setOpacity(1.0)
    if mark.active:
        painter.setPen(QPen(QColor(colours.states["active"]), _RING_LINE * ratio))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawEllipse(QPointF(*pixel), radius + _RING * ratio, radius + _RING * ratio)


def shape_of(state: str) -> str:
    """Return the shape of a mark in some state, one of those of `marker_picture`."""
    return _SHAPES.get(state, "ball")


def place_marks(
    marks: MarkSet, view: Viewpoint, hidden: NDArray[np.bool_], *, ratio: float, bone_opacity: float
) -> list[PlacedMark]:
    """Return the marks of the 3D view that are seen, the farthest first.

    Parameters
    ----------
    marks : MarkSet
    view : Viewpoint
        The projection of the frame.
    hidden : (N,) bool array
        Which marks lie behind bone.
    ratio : float
        Device pixels for each logical one.
    bone_opacity : float
        From 0 to 1; the fainter bone is, the clearer is what lies behind it.
    """
    display = view.display(marks.positions)
    radii = np.maximum(marks.radii(view, ratio) - 0.5 * _HALO * ratio, ratio)  # the edge is part of the mark
    through = 1.0 - (1.0 - _FAINT) * bone_opacity
    clear = np.where(hidden, through * marks.show_hidden, 1.0)
    return [
        PlacedMark(marks.marks[n], display[n, :2] + 0.5, float(radii[n]), float(clear[n]), bool(hidden[n]))
        for n in np.argsort(-display[:, 2]).tolist()
        if clear[n] > 0 or marks.marks[n].active
    ]


def tags_of(placed: list[PlacedMark], colours: SceneColours, ratio: float) -> list[NameTag]:
    """Return the names of marks in the 3D view."""
    return [_tag(one, colours, ratio) for one in placed if one.mark.label]


def _tag(placed: PlacedMark, colours: SceneColours, ratio: float) -> NameTag:
    mark, active = placed.mark, placed.mark.active
    gap = max(placed.radius / ratio, 3.0) + 4.0 + (_RING if active else 0.0)
    rank = 2.0 if active else -float(placed.hidden) - 2.0 * (mark.state == REFERENCE)
    faint = placed.hidden and not active
    return NameTag(mark.label, placed.pixel, colours.word(mark.state), gap, rank, faint)
