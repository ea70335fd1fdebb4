"""The bone mesh in the 3D view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.vtkRenderingCore import vtkActor

from gp_core.checks import FloatArray
from gp_labeler.imaging.surface import Surface, SurfaceHit
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.stage import Stage, release, solid_actor

__all__ = ["BoneActor"]

_BARELY_THERE = 0.05
"""Below this opacity the mesh is not seen, so a click must not land on it."""


class BoneActor:
    """Draws surfaces, and answers what lies under a ray.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._surfaces: tuple[Surface, ...] = ()
        self._fine: list[vtkActor] = []
        self._quick: list[vtkActor] = []
        self._opacity = 1.0
        self._visible = True
        self._hurried = False

    def show(self, surfaces: Sequence[Surface], quick: Sequence[Surface] = ()) -> None:
        """Draw surfaces in place of those before.

        Parameters
        ----------
        surfaces : sequence of Surface
            Parts that do not overlap, such as an overview with a hole (`Surface.outside`) and what fills it.
        quick : sequence of Surface
            A coarser stand-in, drawn while the camera is dragged; picking always uses `surfaces`.
        """
        self._drop()
        self._surfaces = tuple(surfaces)
        self._fine = [self._actor(surface) for surface in surfaces]
        self._quick = [self._actor(surface) for surface in quick]
        self._apply()

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """What is drawn."""
        return self._surfaces

    @property
    def bounds(self) -> FloatArray | None:
        """(2, 3) lowest and highest coordinates, mm; None where nothing is shown."""
        if not self._surfaces:
            return None
        boxes = np.stack([surface.bounds for surface in self._surfaces])
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    @property
    def opacity(self) -> float:
        """From 0 to 1."""
        return self._opacity

    @opacity.setter
    def opacity(self, value: float) -> None:
        self._opacity = float(np.clip(value, 0.0, 1.0))
        self._apply()

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return self._visible

    @visible.setter
    def visible(self, value: bool) -> None:
        self._visible = bool(value)
        self._apply()

    def hurry(self, on: bool) -> None:
        """Draw the coarser stand-in, where there is one, while the camera moves."""
        if on != self._hurried:
            self._hurried = on
            self._apply()

    def recolour(self) -> None:
        """Take the colours of the stage's theme."""
        self._apply()

    def pick(self, origin: ArrayLike, direction: ArrayLike) -> SurfaceHit | None:
        """Return the first point of the drawn surfaces along a ray, or None."""
        if not self._seen:
            return None
        start = np.asarray(origin, dtype=np.float64)
        hits = [hit for surface in self._surfaces if (hit := surface.pick(start, direction)) is not None]
        return min(hits, key=lambda hit: float(np.linalg.norm(hit.point - start)), default=None)

    def blocks(self, start: ArrayLike, end: ArrayLike) -> bool:
        """Whether drawn bone lies between two scan positions."""
        return self._seen and any(surface.blocks(start, end) for surface in self._surfaces)

    def close(self) -> None:
        """Let go of the meshes."""
        self._drop()
        self._surfaces = ()

    @property
    def _seen(self) -> bool:
        return self._visible and self._opacity > _BARELY_THERE

    def _actor(self, surface: Surface) -> vtkActor:
        actor = solid_actor(surface.mesh, self._stage.colours.bone)
        actor.GetMapper().SetStatic(True)  # the mesh never changes: spare a walk over it every frame
        self._stage.base.AddActor(actor)
        return actor

    def _apply(self) -> None:
        hurried = self._hurried and bool(self._quick)
        for actors, shown in ((self._fine, not hurried), (self._quick, hurried)):
            for actor in actors:
                actor.SetVisibility(self._visible and shown and self._opacity > 0)
                look = actor.GetProperty()
                look.SetColor(*rgb(self._stage.colours.bone))
                look.SetOpacity(self._opacity)
                look.SetAmbient(0.10)
                look.SetDiffuse(0.90)
                look.SetSpecular(0.18)
                look.SetSpecularPower(18.0)

    def _drop(self) -> None:
        for actor in (*self._fine, *self._quick):
            release(self._stage.base, actor)
        self._fine, self._quick = [], []
