"""The three anatomical planes, and how each lies on the screen.

Radiological convention: the patient's right is on the left of the screen in axial and coronal views; the nose
points to the left in sagittal ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from gp_core.validation import FloatArray, as_points

__all__ = ["LETTERS", "Plane", "letter_of", "position_text"]

LETTERS = (("R", "L"), ("A", "P"), ("I", "S"))
"""What lies at the negative and the positive end of x, y and z (LPS)."""

_L, _P, _I = np.eye(3) * [1, 1, -1]


@dataclass(frozen=True, eq=False)
class _Layout:
    """The scan axis across a plane, what is right and down on the screen, and the colour."""

    axis: int
    right: FloatArray
    down: FloatArray
    colour: str


class Plane(Enum):
    """An anatomical plane."""

    AXIAL = "axial"
    SAGITTAL = "sagittal"
    CORONAL = "coronal"

    @property
    def axis(self) -> int:
        """Number of the scan axis across the plane."""
        return _LAYOUTS[self.value].axis

    @property
    def right(self) -> FloatArray:
        """(3,) scan direction that points right on the screen."""
        return _LAYOUTS[self.value].right

    @property
    def down(self) -> FloatArray:
        """(3,) scan direction that points down on the screen."""
        return _LAYOUTS[self.value].down

    @property
    def colour(self) -> str:
        """Colour of the plane in all views, as 3D Slicer has it."""
        return _LAYOUTS[self.value].colour

    @property
    def letters(self) -> tuple[str, str, str, str]:
        """Letters at the left, right, top and bottom of the view."""
        right, down = letter_of(self.right), letter_of(self.down)
        return letter_of(-self.right), right, letter_of(-self.down), down

    @property
    def normal(self) -> FloatArray:
        """(3,) the scan axis across the plane, in which its position is counted."""
        axis: FloatArray = np.eye(3)[self.axis]
        return axis

    def flat(self, points: ArrayLike) -> FloatArray:
        """Return the (N, 2) coordinates right and down, mm, of (N, 3) scan positions."""
        scan = as_points(points, "points", missing_allowed=True)
        return np.stack([scan @ self.right, scan @ self.down], axis=1)

    def depth(self, points: ArrayLike) -> FloatArray:
        """Return the (N,) coordinates across the plane, mm, of (N, 3) scan positions."""
        return as_points(points, "points", missing_allowed=True)[:, self.axis]

    def scan(self, flat: ArrayLike, position: float) -> FloatArray:
        """Return the (N, 3) scan positions of (N, 2) coordinates right and down at `position`, mm."""
        right, down = np.asarray(flat, dtype=np.float64).T
        points: FloatArray = right[:, None] * self.right + down[:, None] * self.down + position * self.normal
        return points


_LAYOUTS: Mapping[str, _Layout] = MappingProxyType(
    {
        "axial": _Layout(2, _L, _P, "#F34A33"),
        "sagittal": _Layout(0, _P, _I, "#EDD54C"),
        "coronal": _Layout(1, _L, _I, "#6EB04B"),
    }
)


def letter_of(direction: ArrayLike) -> str:
    """Return the anatomical letter of the scan axis nearest to a direction."""
    vector = np.asarray(direction, dtype=np.float64)
    axis = int(np.abs(vector).argmax())
    return LETTERS[axis][int(vector[axis] > 0)]


def position_text(plane: Plane, position: float) -> str:
    """Say where a slice is, such as ``"S 12.4 mm"``."""
    return f"{LETTERS[plane.axis][int(position >= 0)]} {abs(position):.1f} mm"
