"""What is painted over the 3D view's last frame: the crosshair, the cut, and where a click would land."""

from __future__ import annotations

import numpy as np
from qtpy.QtCore import QRectF, Qt
from qtpy.QtGui import QColor, QFontMetricsF, QPainter, QPen
from qtpy.QtWidgets import QWidget

from gp_core.validation import FloatArray
from gp_labeler.models.view import Cut
from gp_labeler.scene.planes import Plane, letter_of, position_text
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.views.fonts import font_of
from gp_labeler.views.mouse import painted
from gp_labeler.views.theme import theme_of

__all__ = ["cut_text", "paint_crosshair", "paint_cut", "paint_pointer"]

_GAP_MM, _ARM_MM = 0.8, 4.0
_CHIP_ROOM = 26
"""Beside words on a card: a chip before them, and some air, logical pixels."""

_WORDS = {"R": "right", "L": "left", "A": "anterior", "P": "posterior", "S": "superior", "I": "inferior"}


def paint_crosshair(painter: QPainter, view: QWidget, scene: Scene3D, middle: FloatArray) -> None:
    """Paint a cross with an open centre, each arm in the colour of the plane that it stands upon."""
    ends = [middle + sign * r * p.normal for p in Plane for sign in (-1, 1) for r in (_GAP_MM, _ARM_MM)]
    pixels, colours = scene.display_of(np.array(ends)), theme_of(view).views
    for n, plane in enumerate(plane for plane in Plane for _ in range(2)):
        painter.setPen(QPen(QColor(colours[plane.value]), 1.4))
        near, far = (painted(view, *pixels[2 * n + k]) for k in range(2))
        painter.drawLine(near, far)


def cut_text(cut: Cut) -> str:
    """Say where bone is cut open, such as ``Cut axial at S 12.4 mm, inferior side stays``."""
    if cut.plane == "view":
        return "Cut across the view"
    plane = Plane(cut.plane)
    kept = letter_of(cut.normal)
    return f"Cut {cut.plane} at {position_text(plane, cut.origin[plane.axis])}, {_WORDS[kept]} side stays"


def paint_cut(painter: QPainter, view: QWidget, cut: Cut | None) -> None:
    """Say in the upper left corner that bone is cut open, and where."""
    if cut is None:
        return
    theme, font = theme_of(view), font_of(view)
    painter.setFont(font)
    text = cut_text(cut)
    room = QRectF(0, 0, max(view.width() - 20 - _CHIP_ROOM, 1), view.height())
    words = QFontMetricsF(font).boundingRect(room, Qt.TextFlag.TextWordWrap, text)
    box = QRectF(10, 10, words.width() + _CHIP_ROOM, words.height() + 8)
    painter.setPen(Qt.PenStyle.NoPen)
    ground = QColor(theme.card)
    ground.setAlpha(225)
    painter.setBrush(ground)
    painter.drawRoundedRect(box, 5, 5)
    painter.setBrush(QColor(theme.views["3d" if cut.plane == "view" else cut.plane]))
    painter.drawRoundedRect(QRectF(box.left() + 6, box.center().y() - 4, 8, 8), 2, 2)
    painter.setPen(QColor(theme.text))
    wrapped = Qt.AlignmentFlag.AlignVCenter | Qt.TextFlag.TextWordWrap
    painter.drawText(box.adjusted(20, 0, -2, 0), wrapped, text)


def paint_pointer(
    painter: QPainter, view: QWidget, scene: Scene3D, point: FloatArray | None, holds: bool
) -> None:
    """Paint a ring at a (3,) scan position, filled while a point is held there."""
    if point is None:
        return
    colours = theme_of(view).scene
    centre = painted(view, *scene.display_of(point[None])[0])
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for colour, width in ((colours.halo, 4.0), (colours.states["active"], 1.8)):
        painter.setPen(QPen(QColor(colour), width))
        painter.drawEllipse(centre, 6.0, 6.0)
    if holds:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(colours.states["placed"]))
        painter.drawEllipse(centre, 4.0, 4.0)
