"""Estimated cochleae in the 3D view, with all that they are judged by; outlines are painted over it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.pose_bodies import PoseBodies
from gp_labeler.scene.pose_data import DrawnPose, DrawnTip, PoseScene
from gp_labeler.scene.pose_glyphs import SolidActor
from gp_labeler.scene.pose_rows import PoseSolid, axes_of, marks_of, sizes_of
from gp_labeler.scene.render_layers import RenderLayers

__all__ = ["PoseActor"]


class PoseActor:
    """Draws estimates: what bone hides shows through it.

    Parameters
    ----------
    layers : RenderLayers
        Where to draw.
    """

    def __init__(self, layers: RenderLayers) -> None:
        self._layers = layers
        self._scene, self._colours = PoseScene(), layers.colours
        self._axis_solids: list[PoseSolid] = []
        self._mark_solids: list[PoseSolid] = []
        self._bodies: list[PoseBodies] = []
        self._axes, self._marks = SolidActor(layers, 1.0), SolidActor(layers)

    @property
    def scene(self) -> PoseScene:
        """What is drawn."""
        return self._scene

    @property
    def poses(self) -> tuple[DrawnPose, ...]:
        """The estimates that are drawn."""
        return self._scene.poses

    def show(self, scene: PoseScene) -> None:
        """Draw this in place of what was before."""
        self._scene, self._colours = scene, self._layers.colours
        self._axis_solids, self._mark_solids = axes_of(scene), marks_of(scene)
        while len(self._bodies) < len(scene.poses):
            self._bodies.append(PoseBodies(self._layers))
        for n, body in enumerate(self._bodies):
            body.show(scene.poses[n] if n < len(scene.poses) else None, scene)

    def show_tip(self, tip: DrawnTip | None) -> None:
        """Move the probe, and leave all else."""
        self._scene = replace(self._scene, tip=tip)
        self._mark_solids = marks_of(self._scene)

    def refresh(self, view: Viewpoint) -> None:
        """Bring sizes up to date with the camera."""
        if self._colours is not self._layers.colours:
            self.show(self._scene)
        for actor, solids in ((self._axes, self._axis_solids), (self._marks, self._mark_solids)):
            self._place(actor, solids, view)

    def close(self) -> None:
        """Let go of everything drawn."""
        self.show(PoseScene())
        for body in self._bodies:
            body.close()
        self._bodies = []
        self._axes.close()
        self._marks.close()

    def _place(self, actor: SolidActor, solids: list[PoseSolid], view: Viewpoint) -> None:
        states = self._layers.colours.states
        places, along = (np.array([getattr(s, n) for s in solids]).reshape(-1, 3) for n in ("place", "along"))
        pixel_mm = self._layers.scale * view.pixel_sizes(places) if solids else np.empty(0)
        colours = {role: np.rint(np.array(rgb(states[role])) * 255) for role in {s.role for s in solids}}
        actor.set(
            places,
            along,
            sizes_of(solids, pixel_mm),
            np.array([colours[s.role] for s in solids], dtype=np.uint8).reshape(-1, 3),
            np.array([s.shape for s in solids], dtype=int),
            self._scene.opacity,
        )
