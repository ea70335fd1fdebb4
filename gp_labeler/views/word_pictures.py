"""Words as they stand on a slice, with an edge that keeps them legible on bone; drawn once each, and kept."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPainterPath, QPen

from gp_labeler.scene.colours import DARK
from gp_labeler.views.theme import base_font

__all__ = ["WordPicture", "word_picture"]

_EDGE = 3.0
_KEPT = 512


class WordPicture(NamedTuple):
    """A picture of a word, and where in it the word's base line begins, pixels."""

    image: QImage
    left: float
    base: float

    def draw(self, painter: QPainter, x: float, y: float) -> None:
        """Draw it with its base line beginning there, on whole pixels: so letters stay crisp."""
        painter.drawImage(QPointF(round(x - self.left), round(y - self.base)), self.image)


@lru_cache(_KEPT)
def word_picture(text: str, size: int, colour: str, ratio: float) -> WordPicture:
    """Return the picture of a word.

    Parameters
    ----------
    text : str
    size : int
        Of the bold letters, device pixels.
    colour : str
    ratio : float
        Device pixels for each logical one; the edge grows with it.
    """
    font = base_font()
    font.setPixelSize(size)
    font.setBold(True)
    letters = QPainterPath()
    letters.addText(QPointF(0, 0), font, text)
    edge = _EDGE * ratio
    box = letters.boundingRect().adjusted(-edge, -edge, edge, edge).toAlignedRect()
    image = QImage(box.size(), QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.translate(-box.topLeft())
    painter.strokePath(letters, QPen(QColor(DARK.halo), edge))
    painter.fillPath(letters, QColor(colour))
    painter.end()
    return WordPicture(image, -float(box.left()), -float(box.top()))
