"""What is painted over the 3D view's last frame: the crosshair, and where a click would land."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPainter, QPen
from PySide6.QtWidgets import QWidget

from gp_core.checks import FloatArray
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.views.mouse import painted
from gp_labeler.views.theme import theme_of

__all__ = ["paint_crosshair", "paint_pointer"]

_GAP_MM, _ARM_MM = 0.8, 4.0


def paint_crosshair(painter: QPainter, view: QWidget, scene: Scene3D, middle: FloatArray) -> None:
    """Paint a cross with an open centre, each arm in the colour of the plane that it stands upon."""
    ends = [middle + sign * r * p.normal for p in Plane for sign in (-1, 1) for r in (_GAP_MM, _ARM_MM)]
    pixels, colours = scene.display_of(np.array(ends)), theme_of(view).views
    for n, plane in enumerate(plane for plane in Plane for _ in range(2)):
        painter.setPen(QPen(QColor(colours[plane.value]), 1.4))
        near, far = (painted(view, *pixels[2 * n + k]) for k in range(2))
        painter.drawLine(near, far)


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
