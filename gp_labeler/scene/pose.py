"""Estimated cochleae in the 3D view, with all that they are judged by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.labels import Label
from gp_labeler.scene.lines2d import PixelLines
from gp_labeler.scene.pose_bodies import PoseBodies
from gp_labeler.scene.pose_data import DrawnPose, DrawnTip, PoseScene
from gp_labeler.scene.pose_glyphs import SolidActor
from gp_labeler.scene.pose_names import names_of
from gp_labeler.scene.pose_rings import coil_edges, outline_of, ring
from gp_labeler.scene.pose_rows import Solid, axes_of, marks_of, sizes_of
from gp_labeler.scene.stage import Stage

__all__ = ["PoseActor"]

_HALO_GROWS = 2.4


class PoseActor:
    """Draws estimates: what bone hides shows through it.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._scene, self._colours = PoseScene(), stage.colours
        self._axis_solids: list[Solid] = []
        self._mark_solids: list[Solid] = []
        self._bodies: list[PoseBodies] = []
        self._axes, self._marks = SolidActor(stage, 1.0), SolidActor(stage)
        self._lines = PixelLines(stage.overlay)

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
        self._scene, self._colours = scene, self._stage.colours
        self._axis_solids, self._mark_solids = axes_of(scene), marks_of(scene)
        while len(self._bodies) < len(scene.poses):
            self._bodies.append(PoseBodies(self._stage))
        for n, body in enumerate(self._bodies):
            body.show(scene.poses[n] if n < len(scene.poses) else None, scene)

    def show_tip(self, tip: DrawnTip | None) -> None:
        """Move the probe, and leave all else."""
        self._scene = replace(self._scene, tip=tip)
        self._mark_solids = marks_of(self._scene)

    def refresh(self, view: Viewpoint) -> list[Label]:
        """Bring sizes and outlines up to date with the camera, and return the labels to draw."""
        if self._colours is not self._stage.colours:
            self.show(self._scene)
        for actor, solids in ((self._axes, self._axis_solids), (self._marks, self._mark_solids)):
            self._place(actor, solids, view)
        self._draw_lines(view)
        return names_of(self._scene, view, self._stage)

    def close(self) -> None:
        """Let go of everything drawn."""
        self.show(PoseScene())
        for body in self._bodies:
            body.close()
        self._bodies = []
        self._axes.close()
        self._marks.close()
        self._lines.close()

    def _place(self, actor: SolidActor, solids: list[Solid], view: Viewpoint) -> None:
        states = self._stage.colours.states
        places, along = (np.array([getattr(s, n) for s in solids]).reshape(-1, 3) for n in ("place", "along"))
        pixel_mm = self._stage.scale * view.pixel_sizes(places) if solids else np.empty(0)
        colours = {role: np.rint(np.array(rgb(states[role])) * 255) for role in {s.role for s in solids}}
        actor.set(
            places,
            along,
            sizes_of(solids, pixel_mm),
            np.array([colours[s.role] for s in solids], dtype=np.uint8).reshape(-1, 3),
            np.array([s.shape for s in solids], dtype=int),
            self._scene.opacity,
        )

    def _draw_lines(self, view: Viewpoint) -> None:
        scene, states, scale = self._scene.seen, self._stage.colours.states, self._stage.scale
        lines: list[tuple[FloatArray, str, float]] = []
        if scene.shows("region"):
            lines += [(outline_of(pose, view), states[pose.role], 1.6) for pose in scene.poses]
        if scene.shows("cochlea"):
            lines += [
                (edge, states[pose.role], 1.3) for pose in scene.poses for edge in coil_edges(pose, view)
            ]
        for touch in scene.touches:
            if touch.suspect:
                lines.append((ring(touch.position, view, 12.0 * scale), states["doubtful"], 2.0))
        for path in scene.paths:
            pixels = view.display(path)[:, :2]
            lines.append((pixels, self._stage.colours.halo, 2.5 * _HALO_GROWS))
            lines.append((pixels, states["path"], 2.5))
        self._lines.draw(
            [line for line, _, _ in lines],
            [colour for _, colour, _ in lines],
            [width * scale for _, _, width in lines],
            scene.opacity,
        )
