"""The edge of an opening in bone, through given points: round window, oval window, ear canal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.phantom.layout import unit
from gp_labeler.phantom.solids import Grid, Solid, Values, component, moved, tube

__all__ = ["Rim"]

_STEPS = 720


@dataclass(frozen=True)
class Rim:
    """A closed curve around an opening, as a radius and a height for each angle about its centre.

    At each of its given points the curve runs across the line to the centre, so that the point is the
    extreme of the opening in its direction.

    Parameters
    ----------
    centre : (3,) array, mm
    axes : (3, 3) array
        Rows: two unit directions in the plane of the opening, and its normal, outward.
    angles, radii, heights : (n,) arrays
        The given points, by rising angle (radians); mm.
    """

    centre: FloatArray
    axes: FloatArray
    angles: FloatArray
    radii: FloatArray
    heights: FloatArray

    @classmethod
    def through(cls, points: Sequence[FloatArray], *, along: FloatArray, outward: FloatArray) -> Rim:
        """Make the rim through points (3,), with a first axis and (about) its outward normal."""
        centre = np.mean(points, axis=0)
        first = unit(along)
        normal = unit(outward - (outward @ first) * first)
        axes = np.stack([first, np.cross(normal, first), normal])
        u, v, w = axes @ (np.array(points) - centre).T
        angles = np.arctan2(v, u)
        order = np.argsort(angles)
        return cls(centre, axes, angles[order], np.hypot(u, v)[order], w[order])

    @property
    def normal(self) -> FloatArray:
        """(3,) unit vector out of the opening."""
        normal: FloatArray = self.axes[2]
        return normal

    def shape(self, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return radius and height at angles (n,): smooth steps from each point to the next."""
        turn = 2 * np.pi
        knots = np.concatenate([self.angles, self.angles[:1] + turn])
        at = (angles - knots[0]) % turn + knots[0]
        i = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(self.angles) - 1)
        j = (i + 1) % len(self.angles)
        t = (at - knots[i]) / (knots[i + 1] - knots[i])
        t = t * t * (3 - 2 * t)
        return (
            self.radii[i] + t * (self.radii[j] - self.radii[i]),
            self.heights[i] + t * (self.heights[j] - self.heights[i]),
        )

    def curve(self, outwards: float = 0.0, steps: int = 48) -> FloatArray:
        """Return the closed curve (n, 3) so far outside the rim, in its plane, mm."""
        angles = np.sort(np.concatenate([np.linspace(-np.pi, np.pi, steps, endpoint=False), self.angles]))
        angles = np.append(angles, angles[0])
        radius, height = self.shape(angles)
        local = np.stack([(radius + outwards) * np.cos(angles), (radius + outwards) * np.sin(angles), height])
        return self.centre + local.T @ self.axes

    def ring(self, thickness: float) -> Solid:
        """Return the rounded lip of bone whose inner edge is the rim; `thickness` is its radius."""
        return tube(self.curve(thickness), thickness)

    def plug(self, inner: float, outer: float, *, grow: float = 0.0, flare: float = 0.0) -> Solid:
        """Return what fills the opening from height `inner` to `outer` above the rim.

        Parameters
        ----------
        inner, outer : float
            mm along the normal.
        grow : float
            mm wider than the rim all round.
        flare : float
            mm wider for each mm along the normal.
        """
        ends = np.array([inner, outer])
        reach = float(self.radii.max() + grow + np.max(flare * ends)) + float(np.abs(self.heights).max())
        corners = self.centre + ends[:, None] * self.normal
        table = np.stack(self.shape(np.linspace(-np.pi, np.pi, _STEPS))).astype(np.float32)
        middle, half = np.float32((inner + outer) / 2), np.float32((outer - inner) / 2)

        def distance(grid: Grid) -> Values:
            here = moved(grid, self.centre)
            u, v, w = (component(here, axis) for axis in self.axes)
            turned = (np.arctan2(v, u) + np.float32(np.pi)) * np.float32((_STEPS - 1) / (2 * np.pi))
            step = turned.astype(np.int16)
            radius, height = table[:, step]
            w = w - height
            side = np.sqrt(u * u + v * v) - radius - np.float32(grow) - np.float32(flare) * w
            gone: Values = np.maximum(side, np.abs(w - middle) - half)
            return gone

        return Solid(distance, corners.min(axis=0) - reach, corners.max(axis=0) + reach)
