"""The landmarks of the 3D view: which are shown, and how large. They are painted over the frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.scene.camera import Viewpoint

__all__ = [
    "ACTIVE_GROWTH",
    "FREE_POINT",
    "LOOKED_AT",
    "OTHER",
    "REFERENCE",
    "GlyphSize",
    "Mark",
    "MarkSet",
    "growth_of",
]

REFERENCE = "reference"
"""The state of a mark that is only looked at: smaller, hollow, and never picked."""

OTHER = "other"
"""The state of a point of the side that is not worked on: smaller, and of another colour."""

FREE_POINT = "free point"
"""The state of one of the three points that a head is straightened by: no landmark, and never picked."""

LOOKED_AT = frozenset({REFERENCE, FREE_POINT})
"""States of marks that are hollow, and never picked."""

ACTIVE_GROWTH = 1.25
"""How much larger the landmark being worked on is drawn."""

_SMALLER = MappingProxyType({REFERENCE: 0.8, OTHER: 0.7})
"""States that are told from a placed point by their size, and not by their colour alone."""


@dataclass(frozen=True)
class GlyphSize:
    """How large marks are drawn.

    Parameters
    ----------
    diameter : float
        In mm, or in logical pixels.
    unit : str
        ``mm`` or ``px``.
    """

    diameter: float = 11.0
    unit: str = "px"


@dataclass(frozen=True, eq=False)
class Mark:
    """A landmark to draw.

    Parameters
    ----------
    key : str
        Its name among all marks, such as ``"L:CA"``.
    position : (3,) float array
        Scan frame, mm.
    label : str
        What stands beside it; empty for none.
    state : str
        ``placed``, ``suggested``, ``computed``, ``doubtful``, `OTHER`, one of
        `LOOKED_AT` or any other state of the theme.
    active : bool
        Whether it is the one being worked on: larger, and its label is never left out.
    """

    key: str
    position: FloatArray
    label: str = ""
    state: str = "placed"
    active: bool = False


class MarkSet:
    """The landmarks of a 3D view.

    Attributes
    ----------
    size : GlyphSize
        How large they are drawn.
    show_hidden : bool
        Whether those behind bone are drawn.
    """

    def __init__(self) -> None:
        self._marks: tuple[Mark, ...] = ()
        self.size = GlyphSize()
        self.show_hidden = True

    def show(self, marks: Sequence[Mark]) -> None:
        """Show these marks in place of those before."""
        self._marks = tuple(mark for mark in marks if np.isfinite(mark.position).all())

    @property
    def marks(self) -> tuple[Mark, ...]:
        """What is shown."""
        return self._marks

    @property
    def positions(self) -> FloatArray:
        """(N, 3) scan positions of the marks, mm."""
        return np.array([mark.position for mark in self._marks], dtype=np.float64).reshape(-1, 3)

    def radii(self, view: Viewpoint, ratio: float) -> FloatArray:
        """Return how large the marks are drawn, (N,) device pixels, `ratio` of which are a logical one."""
        radius = np.full(len(self._marks), 0.5 * self.size.diameter)
        scaled = radius / view.pixel_sizes(self.positions) if self.size.unit == "mm" else radius * ratio
        grown: FloatArray = scaled * [growth_of(mark) for mark in self._marks]
        return grown


def growth_of(mark: Mark) -> float:
    """Return how much larger than others a mark is drawn, in every view."""
    return _SMALLER.get(mark.state, ACTIVE_GROWTH if mark.active else 1.0)
