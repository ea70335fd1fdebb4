"""Where a click would land."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gp_core.validation import FloatArray
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.lines2d import PixelLines
from gp_labeler.scene.stage import Stage

__all__ = ["HoverActor"]

_RADIUS_PIXELS = 6.0


class HoverActor:
    """Draws a small ring on the bone under the pointer.

    A display that keeps the last frame may paint this ring itself instead of drawing the scene again.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._point: FloatArray | None = None
        self._ring = PixelLines(stage.overlay)

    def show(self, point: ArrayLike | None) -> None:
        """Draw the ring at a (3,) scan position, or none."""
        self._point = None if point is None else np.asarray(point, dtype=np.float64)

    def refresh(self, view: Viewpoint) -> None:
        """Bring the ring up to date with the camera."""
        if self._point is None:
            self._ring.draw([], [], [])
            return
        scale, turn = self._stage.scale, np.linspace(0, 2 * np.pi, 33)
        circle = _RADIUS_PIXELS * scale * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        ring = view.display(self._point[None])[0, :2] + circle
        colours = self._stage.colours
        self._ring.draw([ring, ring], [colours.halo, colours.states["active"]], [4.0 * scale, 2.0 * scale])

    def close(self) -> None:
        """Let go of the ring."""
        self._ring.close()
