"""The bone as it is seen now, kept as a picture with depths, over which points are drawn again and again.

Without a graphics card a large mesh takes a second to draw. So it is drawn when the camera or the bone itself
changes, never for a point; and it is drawn in chunks, between which the window answers.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D, vtkProp3D, vtkRenderer

from gp_core.validation import FloatArray
from gp_labeler.scene.added_meshes import AddedMeshActors
from gp_labeler.scene.bone import BoneActor
from gp_labeler.scene.mesh_chunks import MeshChunk
from gp_labeler.scene.orientation_cube import OrientationCube
from gp_labeler.scene.render_layers import RenderLayers
from gp_labeler.scene.target import RenderTarget

__all__ = ["BoneFrameCache", "RenderKey"]

_STRIP_PIXELS = 100_000
"""Edges of so many pixels are smoothed at a time."""

_QUICK_SECONDS = (0.012, 0.035)
"""A quick frame that took longer than the second is drawn in coarser pixels next time; less than the first,
in finer ones."""

_COARSEST = 3


@dataclass(frozen=True)
class RenderKey:
    """Everything on which the picture of the bone depends.

    Parameters
    ----------
    camera : bytes
        The projection.
    size : (2,) tuple of int
        Of the picture, pixels.
    look : tuple
        How bone and cube look.
    mesh : int
        Which meshes.
    """

    camera: bytes
    size: tuple[int, int]
    look: tuple[object, ...]
    mesh: int


class BoneFrameCache:
    """Draws and keeps the picture of the bone.

    Parameters
    ----------
    layers : RenderLayers
        Its renderer ``bone`` is drawn here alone.
    target : RenderTarget
        Where.
    bone : BoneActor
        What is drawn.
    added : AddedMeshActors
        What others add, drawn with the bone.
    cube : OrientationCube
        Drawn into the picture too: it changes with the camera only, and its letters take their time.
    """

    def __init__(
        self,
        layers: RenderLayers,
        target: RenderTarget,
        bone: BoneActor,
        added: AddedMeshActors,
        cube: OrientationCube,
    ) -> None:
        self._layers, self._target, self._bone, self._added, self._cube = layers, target, bone, added, cube
        self._smoother, self._nothing = _smoother()
        target.add(self._smoother)
        self._kept, self._next = "bone", "bone to be"
        self._shown: RenderKey | None = None
        self._fine = False
        self._is_empty = self._next_is_empty = True
        """Whether no mesh is in the picture that is kept, and in the one under way."""
        self._work: Iterator[None] | None = None
        self._work_for: RenderKey | None = None
        self._coarseness = 1
        self._warm = -1
        self.n_drawn = 0
        """How often bone has been drawn, a frame in chunks once."""

    def is_fine(self, key: RenderKey) -> bool:
        """Whether the picture that is kept shows just that, finely."""
        return self._fine and self._shown == key

    def may_stay(self, key: RenderKey) -> bool:
        """Whether the picture that is kept may stay until the fine one is there.

        It may where only meshes are newer, or where they are the first: the camera has turned to them, but
        there was nothing to see before.
        """
        shown = self._shown
        if shown is None or not self._fine:
            return False
        is_first = self._is_empty and shown.mesh != key.mesh and shown.size == key.size
        return is_first or replace(shown, mesh=key.mesh) == key

    def draw_quickly(self, key: RenderKey, direction: FloatArray) -> None:
        """Draw the coarse preview mesh and keep the picture; without a preview mesh, draw the bone itself."""
        if not self._bone.has_quick:
            self.advance(key, direction)
            return
        (width, height), n = key.size, self._coarseness
        part = (max(1, width // n), max(1, height // n))
        start = time.perf_counter()
        self._draw_preview(part, key.size, direction)
        self._target.keep(self._kept, part=part)
        self._target.restore(self._kept)
        self._add_cube(self._kept)
        self._shown, self._fine, self._is_empty = key, False, False
        self.n_drawn += 1
        self._adapt(time.perf_counter() - start)

    def advance(self, key: RenderKey, direction: FloatArray, seconds: float = np.inf) -> bool:
        """Draw more of the bone, in about so many seconds; return whether the picture is done, and kept.

        Parameters
        ----------
        key : RenderKey
            What is to be seen; another one than last time begins a new picture.
        direction : (3,) float array
            Into the scene.
        seconds : float
            After which to stop, at the end of a chunk.
        """
        if self.is_fine(key):
            return True
        end = time.perf_counter() + seconds
        if self._work is None or self._work_for != key:
            self._work, self._work_for = self._steps(key, direction), key
        else:
            self._target.restore(self._next)
        for _ in self._work:
            if time.perf_counter() >= end:
                self._target.keep(self._next)
                return False
        self._target.keep(self._next)
        self._add_cube(self._next)
        self._kept, self._next = self._next, self._kept
        self._shown, self._fine, self._is_empty = key, True, self._next_is_empty
        self._work = self._work_for = None
        self.n_drawn += 1
        return True

    def restore(self) -> None:
        """Bring the picture back into the target, with its depths."""
        self._target.restore(self._kept)

    def forget(self) -> None:
        """Drop the picture that is kept."""
        self._shown = self._work = self._work_for = None
        self._fine, self._warm = False, -1

    def close(self) -> None:
        """Let go of everything."""
        self._work = None
        self._smoother.RemoveAllViewProps()

    def _steps(self, key: RenderKey, direction: FloatArray) -> Iterator[None]:
        """Draw a fine picture, stopping after each chunk and each strip."""
        if self._bone.has_quick and self._warm != key.mesh:
            self._draw_preview((1, 1), key.size, direction)  # so that the first turn does not wait for it
            self._warm = key.mesh
            yield
        groups = self._bone.groups(direction, at_once=bool(self._layers.bone.GetUseSSAO()))
        self._next_is_empty = not (groups or self._added.names)
        for n, actors in enumerate(self._batches(groups)):
            self._layers.bone.SetErase(n == 0)
            self._draw(actors)
            yield
        n_strips = max(1, round(key.size[0] * key.size[1] / _STRIP_PIXELS)) if not self._next_is_empty else 0
        for n in range(n_strips):
            self._smoother.SetViewport(0.0, n / n_strips, 1.0, (n + 1) / n_strips)
            self._target.draw(self._smoother)
            yield

    def _draw_preview(self, part: tuple[int, int], whole: tuple[int, int], direction: FloatArray) -> None:
        """Draw the preview mesh into the lower left part of the picture."""
        renderer = self._layers.bone
        renderer.SetViewport(0.0, 0.0, part[0] / whole[0], part[1] / whole[1])
        for n, actors in enumerate(self._batches(self._bone.groups(direction, quick=True), quick=True)):
            renderer.SetErase(n == 0)
            self._draw(actors)
        renderer.SetViewport(0.0, 0.0, 1.0, 1.0)

    def _batches(
        self, groups: list[list[MeshChunk]], *, quick: bool = False
    ) -> Iterator[Sequence[vtkProp3D]]:
        """Return what is drawn one after the other: solid first, so that transparent bone lies over it."""
        solid, clear = (self._added.actors(solid=each, quick=quick) for each in (True, False))
        if solid or not groups:
            yield solid
        for group in groups:
            yield self._bone.actors(group)
        if clear:
            yield clear

    def _draw(self, actors: Sequence[vtkProp3D]) -> None:
        for actor in actors:
            actor.VisibilityOn()
        self._target.draw(self._layers.bone)
        for actor in actors:
            actor.VisibilityOff()

    def _add_cube(self, name: str) -> None:
        """Draw the cube into a picture; its depths are its own."""
        if self._cube.visible:
            self._target.draw(self._cube.renderer)
            self._target.keep(name, depth=False)

    def _adapt(self, seconds: float) -> None:
        fast, slow = _QUICK_SECONDS
        step = int(seconds > slow) - int(seconds < fast)
        self._coarseness = min(max(self._coarseness + step, 1), _COARSEST)


def _smoother() -> tuple[vtkRenderer, vtkActor2D]:
    """Return a renderer that smooths edges in what was drawn before, and draws nothing itself."""
    renderer = vtkRenderer()
    renderer.EraseOff()
    renderer.InteractiveOff()
    renderer.AutomaticLightCreationOff()
    renderer.UseFXAAOn()
    nothing, mapper = vtkActor2D(), vtkPolyDataMapper2D()  # a renderer without any prop does nothing at all
    mapper.SetInputData(vtkPolyData())
    nothing.SetMapper(mapper)
    renderer.AddViewProp(nothing)
    return renderer, nothing
