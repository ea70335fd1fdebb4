"""The scale bar at the lower right of a view."""

from __future__ import annotations

from qtpy.QtCore import QPointF
from qtpy.QtGui import QColor, QPainter, QPen

from gp_labeler.scene.colours import SceneColours
from gp_labeler.scene.slice_viewport import scale_bar_length
from gp_labeler.views.painting.word_pictures import word_picture

__all__ = ["paint_scale_bar"]

_MARGIN = 14.0
_ABOVE_EDGE = 12.0


def paint_scale_bar(
    painter: QPainter,
    mm_per_pixel: float,
    size: tuple[int, int],
    colours: SceneColours,
    *,
    ratio: float,
    text: float,
    longest: float,
    share: float,
) -> None:
    """Paint a bar of a round number of millimetres.

    Parameters
    ----------
    painter : QPainter
        In device pixels.
    mm_per_pixel : float
        Zoom, in device pixels.
    size : (width, height)
        Of the view, device pixels.
    colours : SceneColours
    ratio : float
        Device pixels for each logical one.
    text : float
        Size of the letters, logical pixels.
    longest : float
        How long the bar may be, logical pixels.
    share : float
        How much of the width of a small view it may take.
    """
    width, height = size
    length, pixels = scale_bar_length(mm_per_pixel, min(longest * ratio, share * width))
    right, y = width - min(_MARGIN * ratio, 0.05 * width), height - _ABOVE_EDGE * ratio
    for colour, thick in ((colours.halo, 4.5), (colours.text, 2.5)):
        painter.setPen(QPen(QColor(colour), thick * ratio))
        painter.drawLine(QPointF(right - pixels, y), QPointF(right, y))
    word = word_picture(f"{length:g} mm", text, colours.text, ratio, bold=False, halo=colours.halo)
    x = min(right - pixels / 2, width - word.box.width() / 2 - 4 * ratio) - word.box.center().x()
    word.draw(painter, x, y - 6 * ratio - word.box.bottom())
