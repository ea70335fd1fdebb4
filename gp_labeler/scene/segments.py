"""Straight lines in the 3D view: the crosshair, and axes such as the modiolar one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.vtkFiltersSources import vtkLineSource
from vtkmodules.vtkRenderingCore import vtkActor

from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import triple
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.stage import Stage, release, solid_actor

__all__ = ["CrosshairActor", "Segment", "SegmentActor"]

_THROUGH_BONE = 0.35


@dataclass(frozen=True, eq=False)
class Segment:
    """A straight line between two scan positions.

    Parameters
    ----------
    start, end : (3,) float array
        Scan frame, mm.
    colour : str
        ``#RRGGBB``.
    width : float
        Logical pixels.
    """

    start: FloatArray
    end: FloatArray
    colour: str
    width: float = 2.5


class SegmentActor:
    """Draws lines: full where they are seen, faint where bone hides them.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._near: list[vtkActor] = []
        self._through: list[vtkActor] = []

    def show(self, segments: Sequence[Segment]) -> None:
        """Draw these lines in place of those before."""
        self.close()
        for segment in segments:
            for renderer, actors, opacity in (
                (self._stage.base, self._near, 1.0),
                (self._stage.overlay, self._through, _THROUGH_BONE),
            ):
                actor = self._line(segment, opacity)
                renderer.AddActor(actor)
                actors.append(actor)

    def close(self) -> None:
        """Let go of the lines."""
        for actor in self._near:
            release(self._stage.base, actor)
        for actor in self._through:
            release(self._stage.overlay, actor)
        self._near, self._through = [], []

    def _line(self, segment: Segment, opacity: float) -> vtkActor:
        line = vtkLineSource()
        line.SetPoint1(triple(segment.start))
        line.SetPoint2(triple(segment.end))
        line.Update()
        actor = solid_actor(line.GetOutput(), segment.colour, opacity)
        actor.GetProperty().SetLineWidth(segment.width * self._stage.scale)
        actor.GetProperty().LightingOff()
        return actor


class CrosshairActor:
    """Draws the position that all views share as a cross with an open centre.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._lines = SegmentActor(stage)

    def show(self, point: ArrayLike | None, *, arm_mm: float = 4.0, gap_mm: float = 0.8) -> None:
        """Draw the cross at a (3,) scan position, or none, each arm in the colour of the plane across it."""
        if point is None or not np.isfinite(point).all():
            self._lines.close()
            return
        middle = np.asarray(point, dtype=np.float64)
        self._lines.show(
            [
                Segment(
                    middle + sign * gap_mm * plane.normal,
                    middle + sign * arm_mm * plane.normal,
                    plane.colour,
                    1.5,
                )
                for plane in Plane
                for sign in (-1.0, 1.0)
            ]
        )

    def close(self) -> None:
        """Let go of the cross."""
        self._lines.close()
