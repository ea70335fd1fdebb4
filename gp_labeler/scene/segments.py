"""Straight lines in the 3D view, such as the modiolar axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vtkmodules.vtkFiltersSources import vtkLineSource
from vtkmodules.vtkRenderingCore import vtkActor

from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import triple
from gp_labeler.scene.render_layers import RenderLayers, release, solid_actor

__all__ = ["Segment", "SegmentActor"]

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
    """Draws lines: opaque where they are visible, faint where bone hides them.

    Parameters
    ----------
    layers : RenderLayers
        Where to draw.
    """

    def __init__(self, layers: RenderLayers) -> None:
        self._layers = layers
        self._near: list[vtkActor] = []
        self._through: list[vtkActor] = []

    def show(self, segments: Sequence[Segment]) -> None:
        """Draw these lines in place of those before."""
        self.close()
        for segment in segments:
            for renderer, actors, opacity in (
                (self._layers.base, self._near, 1.0),
                (self._layers.overlay, self._through, _THROUGH_BONE),
            ):
                actor = self._line(segment, opacity)
                renderer.AddActor(actor)
                actors.append(actor)

    def close(self) -> None:
        """Let go of the lines."""
        for actor in self._near:
            release(self._layers.base, actor)
        for actor in self._through:
            release(self._layers.overlay, actor)
        self._near, self._through = [], []

    def _line(self, segment: Segment, opacity: float) -> vtkActor:
        line = vtkLineSource()
        line.SetPoint1(triple(segment.start))
        line.SetPoint2(triple(segment.end))
        line.Update()
        actor = solid_actor(line.GetOutput(), segment.colour, opacity)
        actor.GetProperty().SetLineWidth(segment.width * self._layers.scale)
        actor.GetProperty().LightingOff()
        return actor
