"""Words as they stand on a slice, with an edge that keeps them legible on bone; drawn once each, and kept."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPainterPath, QPen

from gp_labeler.scene.colours import DARK
from gp_labeler.views.theme import base_font

__all__ = ["WordPicture", "word_picture"]

_EDGE = 3.0
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


@lru_cache(_KEPT)
def word_picture(text: str, size: float, colour: str, ratio: float, *, bold: bool = True) -> WordPicture:
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
    """
    font = base_font()
    font.setPixelSize(round(size * ratio))
    font.setBold(bold)
    letters = QPainterPath()
    letters.addText(QPointF(0, 0), font, text)
    edge = _EDGE * ratio
    letters_box = letters.boundingRect()
    box = letters_box.adjusted(-edge, -edge, edge, edge).toAlignedRect()
    image = QImage(box.size(), QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.translate(-box.topLeft())
    painter.strokePath(letters, QPen(QColor(DARK.halo), edge))
    painter.fillPath(letters, QColor(colour))
    painter.end()
    return WordPicture(image, -float(box.left()), -float(box.top()), letters_box)
