"""Words as they stand on bone, with an edge that keeps them legible; drawn once each, and kept."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from qtpy.QtCore import QPointF, QRectF, Qt
from qtpy.QtGui import QColor, QFontMetricsF, QImage, QPainter

from gp_labeler.scene.colours import DARK
from gp_labeler.views.fonts import base_font, family

__all__ = ["WordPicture", "word_picture"]

_EDGE = 3.0
_SIDES = 12
_KEPT = 512


class WordPicture(NamedTuple):
    """A picture of a word: where in it the base line begins, and the letters' box from there, pixels."""

    image: QImage
    left: float
    base: float
    box: QRectF

    def draw(self, painter: QPainter, x: float, y: float) -> None:
        """Draw it with its base line beginning there, on whole pixels: so letters stay crisp."""
        painter.drawImage(QPointF(round(x - self.left), round(y - self.base)), self.image)

    def draw_about(self, painter: QPainter, x: float, y: float) -> None:
        """Draw it with the middle of its letters there."""
        self.draw(painter, x - self.box.center().x(), y - self.box.center().y())


def word_picture(
    text: str, size: float, colour: str, ratio: float, *, bold: bool = True, halo: str = DARK.halo
) -> WordPicture:
    """Return the picture of a word.

    Parameters
    ----------
    text : str
    size : float
        Of the letters, logical pixels.
    colour : str
    ratio : float
        Device pixels for each logical one.
    bold : bool
    halo : str
        Colour of the edge.
    """
    return _word_picture(text, size, colour, ratio, bold, halo, family())


@lru_cache(_KEPT)
def _word_picture(
    text: str, size: float, colour: str, ratio: float, bold: bool, halo: str, family_name: str
) -> WordPicture:
    font = base_font()
    font.setPixelSize(round(size * ratio))
    font.setBold(bold)
    edge = _EDGE * ratio
    letters = QFontMetricsF(font).tightBoundingRect(text)
    box = letters.adjusted(-edge, -edge, edge, edge).toAlignedRect()
    image = QImage(box.size(), QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    painter.setFont(font)
    painter.translate(-box.topLeft())
    painter.setPen(QColor(halo))
    for x, y in _around(edge / 2):
        painter.drawText(QPointF(x, y), text)
    painter.setPen(QColor(colour))
    painter.drawText(QPointF(0, 0), text)
    painter.end()
    return WordPicture(image, -float(box.left()), -float(box.top()), letters)


def _around(radius: float) -> list[tuple[float, float]]:
    """Return where a word is written to surround it: much quicker than a stroke along its letters."""
    turns = (2 * math.pi * n / _SIDES for n in range(_SIDES))
    return [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
