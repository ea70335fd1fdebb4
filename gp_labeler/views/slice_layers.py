"""What others draw over a slice: beneath its points, with names that are placed together with theirs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from qtpy.QtGui import QPainter

from gp_core.validation import FloatArray
from gp_labeler.scene.slice_view import SliceView as Shown

__all__ = ["SliceLayer", "SliceName"]


@dataclass(frozen=True, eq=False)
class SliceName:
    """A text beside a point of a slice.

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
    """

    text: str
    pixel: FloatArray
    colour: str
    gap: float = 8.0
    rank: float = 0.0


class SliceLayer(Protocol):
    """Something drawn over slices."""

    def paint(self, painter: QPainter, shown: Shown, ratio: float) -> None:
        """Paint it, in device pixels; `ratio` of them are a logical one."""

    def names(self, shown: Shown, ratio: float) -> list[SliceName]:
        """Return what is written beside it."""
