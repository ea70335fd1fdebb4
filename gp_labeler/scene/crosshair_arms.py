"""The arms of the crosshair on a slice: where the other planes meet it, and which is under a pixel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gp_core.validation import FloatArray
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.scene.slice_viewport import SliceViewport

__all__ = ["HANDLE_PIXELS", "CrosshairArms"]

HANDLE_PIXELS = 5.0
"""Radius of the handle near the end of an arm, logical pixels."""

_HANDLE_SHARE = 0.4
"""How far from the crosshair handles are, in parts of the shorter side of the view."""

_NEAR_PIXELS, _FREE_PIXELS = 4.0, 30.0
"""An arm is meant within so many logical pixels of it, and so far from the crosshair."""


@dataclass(frozen=True, eq=False)
class CrosshairArms:
    """The two lines of the crosshair in one view; by dragging them, the other planes are turned.

    Parameters
    ----------
    middle : (2,) float array
        Pixel of the crosshair.
    directions : mapping of str to (2,) float array
        Unit vector, right and down, along the line of each other view.
    size : (2,) tuple of int
        Of the view, pixels.
    ratio : float
        Device pixels per logical one.
    """

    middle: FloatArray
    directions: Mapping[str, FloatArray]
    size: tuple[int, int]
    ratio: float = 1.0

    @classmethod
    def of(
        cls,
        shown: SliceViewport,
        crosshair: ArrayLike,
        planes: Mapping[str, SlicePlane],
        name: str,
        ratio: float = 1.0,
    ) -> CrosshairArms:
        """Make the arms of the view `name`, through a (3,) crosshair."""
        middle = shown.scan_to_pixel(np.reshape(crosshair, (1, 3)))[0]
        lines = {other: shown.line_of(plane) for other, plane in planes.items() if other != name}
        return cls(middle, lines, shown.size, ratio)

    @property
    def handles(self) -> list[tuple[str, FloatArray]]:
        """The arms' names and the (2,) pixels of their handles, as far as they are in the view."""
        reach = _HANDLE_SHARE * min(self.size)
        every = [(n, self.middle + s * reach * d) for n, d in self.directions.items() for s in (-1, 1)]
        return [(name, pixel) for name, pixel in every if (pixel >= 0).all() and (pixel < self.size).all()]

    def handle_at(self, x: float, y: float) -> str | None:
        """Return the arm whose handle is under a pixel."""
        within = (HANDLE_PIXELS + _NEAR_PIXELS) * self.ratio
        near = [name for name, pixel in self.handles if np.linalg.norm(pixel - [x, y]) <= within]
        return near[0] if near else None

    def arm_at(self, x: float, y: float) -> str | None:
        """Return the arm that is under a pixel, by its handle or anywhere off the crosshair."""
        from_middle = np.array([x, y]) - self.middle
        if np.linalg.norm(from_middle) < _FREE_PIXELS * self.ratio:
            return None
        off = {
            n: abs(float(d[0] * from_middle[1] - d[1] * from_middle[0])) for n, d in self.directions.items()
        }
        nearest = min(off, key=lambda name: off[name])
        return nearest if off[nearest] <= _NEAR_PIXELS * self.ratio else self.handle_at(x, y)

    def angle_of(self, x: float, y: float) -> float:
        """Return the direction from the crosshair to a pixel, rad, from right towards down."""
        across, along = np.array([x, y]) - self.middle
        return float(np.arctan2(along, across))
