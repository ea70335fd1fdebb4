"""The bone mesh in the 3D view."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkRenderingCore import vtkActor, vtkProperty

from gp_core.validation import FloatArray
from gp_labeler.imaging.surface import Surface, SurfaceHit
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.cut import CutPlane
from gp_labeler.scene.mesh_chunks import MeshChunk, chunks_of
from gp_labeler.scene.render_layers import RenderLayers

__all__ = ["BoneActor"]

_BARELY_THERE = 0.05
"""Below this opacity the mesh is not seen, so a click must not land on it."""

_INSIDE = (0.66, 0.50, 0.42)
"""The colour of the inner side of the surface, as parts of the outer's. All in one tone, it looks like bone
that is cut through: behind a cut it is seen just where that lies in bone."""


class BoneActor:
    """Draws surfaces, and answers what lies under a ray.

    What is drawn when is for the `BoneFrameCache`: it asks for actors, and draws them one after the other.

    Parameters
    ----------
    layers : RenderLayers
        Where to draw.
    """

    def __init__(self, layers: RenderLayers) -> None:
        self._layers = layers
        self._surfaces: tuple[Surface, ...] = ()
        self._fine: list[MeshChunk] = []
        self._quick: list[MeshChunk] = []
        self._look, self._inside = vtkProperty(), vtkProperty()
        self._opacity = 1.0
        self._visible = True
        self._cut: CutPlane | None = None
        self._plane: vtkPlane | None = None
        self.version = 0
        """Number of the meshes shown last."""
        self._apply()

    def show(self, surfaces: Sequence[Surface], quick: Sequence[Surface] = ()) -> None:
        """Draw surfaces in place of those before.

        Parameters
        ----------
        surfaces : sequence of Surface
            Parts that do not overlap, such as an overview with a hole (`Surface.outside`) and what fills it.
        quick : sequence of Surface
            A coarser preview mesh, drawn while the camera is dragged; picking always uses `surfaces`.
        """
        self._drop()
        self._surfaces = tuple(surfaces)
        self._fine = [chunk for surface in surfaces for chunk in chunks_of(surface)]
        self._quick = [MeshChunk(surface, 0, surface.n_triangles) for surface in quick if surface.n_triangles]
        self.version += 1

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """What is drawn."""
        return self._surfaces

    @property
    def has_quick(self) -> bool:
        """Whether there is a coarser preview mesh."""
        return bool(self._quick)

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

    @property
    def cut(self) -> CutPlane | None:
        """The plane that cuts it open, if any."""
        return self._cut

    @cut.setter
    def cut(self, value: CutPlane | None) -> None:
        if value != self._cut:
            self._cut, self._plane = value, None if value is None else value.to_vtk()

    @property
    def look(self) -> tuple[object, ...]:
        """Everything but the meshes on which it depends how the bone looks."""
        return self._layers.colours, self._opacity, self._visible, self._cut

    def recolour(self) -> None:
        """Take the colours of the theme."""
        self._apply()

    def groups(
        self, direction: FloatArray, *, quick: bool = False, at_once: bool = False
    ) -> list[list[MeshChunk]]:
        """Return what is drawn one after the other to make a frame.

        Parameters
        ----------
        direction : (3,) float array
            Into the scene. Nearer chunks of solid bone come first, as they hide others; of transparent bone,
            they come last, as they lie over others.
        quick : bool
            The preview mesh, where there is one.
        at_once : bool
            All chunks in one group.
        """
        if not self._visible or self._opacity == 0:
            return []
        chunks = self._quick if quick and self._quick else self._fine
        order = 1.0 if self._opacity == 1 else -1.0
        chunks = sorted(chunks, key=lambda chunk: order * float(chunk.middle @ direction))
        return [chunks] if at_once or quick else [[chunk] for chunk in chunks]

    def actors(self, chunks: Sequence[MeshChunk]) -> list[vtkActor]:
        """Return what draws chunks, invisible yet."""
        made = [chunk.actor(self._layers.bone, self._look, self._plane) for chunk in chunks]
        solid = self._cut is not None and self._opacity == 1
        for actor in made:
            actor.SetBackfaceProperty(cast(Any, self._inside if solid else None))
        return made

    def pick(self, origin: ArrayLike, direction: ArrayLike) -> SurfaceHit | None:
        """Return the first point of the drawn surfaces along a ray, or None.

        What is cut away is not there; and a ray that meets the cut within bone ends there, on no surface.
        """
        if not self._seen:
            return None
        start, along = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        if self._cut is not None and not self._cut.keeps(start):
            there = self._cut.crossing(start, along)
            if not there >= 0:
                return None
            start = start + there * along
        hits = [hit for surface in self._surfaces if (hit := surface.pick(start, along)) is not None]
        nearest = min(hits, key=lambda hit: float(np.linalg.norm(hit.point - start)), default=None)
        if nearest is None or self._cut is None:
            return nearest
        from_within = float(nearest.normal @ along) > 0
        return None if from_within or self._cut.depth(nearest.point) < -_ON_PLANE_MM else nearest

    def blocks(self, start: ArrayLike, end: ArrayLike) -> bool:
        """Whether drawn bone lies between two scan positions."""
        if not self._seen:
            return False
        part = (start, end) if self._cut is None else self._cut.kept_part(start, end)
        return part is not None and any(surface.blocks(*part) for surface in self._surfaces)

    def close(self) -> None:
        """Let go of the meshes."""
        self._drop()
        self._surfaces = ()

    @property
    def _seen(self) -> bool:
        return self._visible and self._opacity > _BARELY_THERE

    def _apply(self) -> None:
        colour = rgb(self._layers.colours.bone)
        self._look.SetColor(*colour)
        self._look.SetOpacity(self._opacity)
        self._look.SetAmbient(0.10)
        self._look.SetDiffuse(0.90)
        self._look.SetSpecular(0.18)
        self._look.SetSpecularPower(18.0)
        self._inside.SetColor(*(np.array(colour) * _INSIDE).tolist())
        self._inside.SetAmbient(1.0)
        self._inside.SetDiffuse(0.0)
        self._inside.SetSpecular(0.0)

    def _drop(self) -> None:
        for chunk in (*self._fine, *self._quick):
            chunk.close(self._layers.bone)
        self._fine, self._quick = [], []


_ON_PLANE_MM = 1e-6
