"""What others draw over a slice: beneath its points, with names that are placed together with theirs."""

from __future__ import annotations

from typing import Protocol

from qtpy.QtGui import QPainter

from gp_labeler.scene.slice_viewport import SliceViewport
from gp_labeler.views.painting.name_tags import NameTag

__all__ = ["SliceLayer"]


class SliceLayer(Protocol):
    """Something drawn over slices."""

    def paint(self, painter: QPainter, shown: SliceViewport, ratio: float) -> None:
        """Paint it, in device pixels; `ratio` of them are a logical one."""

    def names(self, shown: SliceViewport, ratio: float) -> list[NameTag]:
        """Return what is written beside it."""
