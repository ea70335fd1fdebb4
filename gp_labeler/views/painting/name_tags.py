"""Names beside what they belong to, placed together so that none lies on another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from qtpy.QtGui import QFontMetricsF, QPainter

from gp_core.validation import FloatArray
from gp_labeler.scene.colours import SceneColours
from gp_labeler.scene.pose_names import Written
from gp_labeler.views.fonts import base_font
from gp_labeler.views.painting.label_layout import lines_within, place_labels
from gp_labeler.views.painting.word_pictures import WordPicture, word_picture

__all__ = ["NameTag", "PlacedWord", "paint_words", "place_names", "pose_tags"]

_FAINT = 0.45
"""Opacity of the name of something that bone hides."""


@dataclass(frozen=True, eq=False)
class NameTag:
    """A text beside a point of a view.

    Parameters
    ----------
    text : str
        What it says; empty to keep the pixels free of other names.
    pixel : (2,) float array
        Painter's coordinates, device pixels.
    colour : str
        ``#RRGGBB``.
    gap : float
        How far from the pixel it begins, logical pixels.
    rank : float
        As in `place_labels`.
    faint : bool
        Whether what it names is hidden.
    """

    text: str
    pixel: FloatArray
    colour: str
    gap: float = 8.0
    rank: float = 0.0
    faint: bool = False


class PlacedWord(NamedTuple):
    """A word with its picture, the device pixel at which its base line begins, and its opacity."""

    text: str
    picture: WordPicture
    x: float
    y: float
    opacity: float


def place_names(
    tags: Sequence[NameTag], size: tuple[int, int], *, ratio: float, text: float, halo: str
) -> list[PlacedWord]:
    """Find a place for each name that has room in a view.

    Parameters
    ----------
    tags : sequence of NameTag
    size : (width, height)
        Of the view, device pixels.
    ratio : float
        Device pixels for each logical one.
    text : float
        Size of the letters, logical pixels.
    halo : str
        Colour of the edge of the letters, ``#RRGGBB``.
    """
    if not any(tag.text for tag in tags):  # what has no text only keeps its place free
        return []
    font = base_font()
    font.setPixelSize(round(text * ratio))
    font.setBold(True)
    metrics = QFontMetricsF(font)
    edge = 2 * ratio  # of the halo
    high, step = metrics.capHeight() + 2 * edge, metrics.lineSpacing()
    lines = [lines_within(tag.text, size[0] - 8 * ratio, metrics.horizontalAdvance) for tag in tags]

    def size_of(words: list[str]) -> tuple[float, float]:
        wide = max(map(metrics.horizontalAdvance, words))
        return (wide + 2 * edge, high + step * (len(words) - 1)) if wide else (0.0, 0.0)

    corners, shown = place_labels(
        [tag.pixel for tag in tags],
        [size_of(words) for words in lines],
        size,
        gaps=[tag.gap * ratio for tag in tags],
        ranks=[tag.rank for tag in tags],
    )
    base = metrics.capHeight() + edge
    return [
        PlacedWord(
            line,
            word_picture(line, text, tags[n].colour, ratio, halo=halo),
            corners[n][0] + edge,
            corners[n][1] + base + row * step,
            _FAINT if tags[n].faint else 1.0,
        )
        for n in np.flatnonzero(shown).tolist()
        for row, line in enumerate(lines[n])
    ]


def paint_words(painter: QPainter, words: Sequence[PlacedWord]) -> None:
    """Paint words where they were placed, in device pixels."""
    for word in words:
        painter.setOpacity(word.opacity)
        word.picture.draw(painter, word.x, word.y)
    painter.setOpacity(1.0)


def pose_tags(
    written: Written, pixels: FloatArray, colours: SceneColours, off: FloatArray | None = None
) -> list[NameTag]:
    """Return what is written at estimates, and what other names leave free.

    Parameters
    ----------
    written : Written
        From `written_in`.
    pixels : (N, 2) float array
        Of its places, painter's coordinates, device pixels.
    colours : SceneColours
    off : (N,) float array, optional
        How far its places are off the slice, mm; names farther than their reach are left out.
    """
    n = len(written.names)
    named = [
        NameTag(name.text, pixel, colours.word(name.role), name.gap, name.rank)
        for k, (name, pixel) in enumerate(zip(written.names, pixels[:n], strict=True))
        if off is None or off[k] <= name.reach_mm
    ]
    free = [
        NameTag("", pixel, colours.text, gap, -2.0)
        for gap, pixel in zip(written.gaps, pixels[n:], strict=True)
    ]
    return named + free
