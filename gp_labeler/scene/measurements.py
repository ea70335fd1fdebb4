"""Rulers and angles as they are drawn, in the scan's frame, before a view makes pixels of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gp_core.validation import FloatArray

__all__ = ["DrawnMeasurement"]

_ARC_SHARE, _ARC_STEPS = 0.3, 12
"""Radius of the arc of an angle, as a share of its shorter arm, and how many pieces it is drawn in."""


@dataclass(frozen=True, eq=False)
class DrawnMeasurement:
    """A ruler (two points), an angle (three, the vertex in the middle), or one that is being placed.

    Parameters
    ----------
    points : (N, 3) float array
        Scan frame, mm.
    label : str
        What is written beside it.
    selected : bool
        Whether it is drawn stronger.
    broken : bool
        Whether its lines are dashed: it is being placed, or no part of the specimen.
    """

    points: FloatArray
    label: str = ""
    selected: bool = False
    broken: bool = False

    @property
    def anchor(self) -> FloatArray:
        """(3,) scan position beside which the label is written: the vertex, or the middle of a ruler."""
        anchor: FloatArray = self.points[1] if len(self.points) == 3 else self.points.mean(axis=0)
        return anchor

    def lines(self) -> Iterator[FloatArray]:
        """Yield (M, 3) polylines: its arms, and the arc between the arms of an angle."""
        yield self.points
        if len(self.points) == 3:
            yield from self._arc()

    def _arc(self) -> Iterator[FloatArray]:
        vertex = self.points[1]
        arms = self.points[[0, 2]] - vertex
        lengths = np.linalg.norm(arms, axis=1, keepdims=True)
        if lengths.min() < 1e-9:
            return
        one, other = arms / lengths
        across = other - (other @ one) * one
        width = float(np.linalg.norm(across))
        if width < 1e-9:
            return
        turns = np.linspace(0.0, np.arctan2(width, float(one @ other)), _ARC_STEPS + 1)[:, None]
        radius = _ARC_SHARE * float(lengths.min())
        yield vertex + radius * (np.cos(turns) * one + np.sin(turns) * across / width)
