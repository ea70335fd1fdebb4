"""Outlines of an estimate on the screen, pixels."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray
from gp_labeler.imaging.mean_cochlea import duct_curve
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.ghosts import outline_in
from gp_labeler.scene.pose_data import DrawnPose, PoseScene

__all__ = ["ScreenLine", "coil_edges", "outlines_of"]

_PER_TURN = 72
"""So many that an edge stays smooth where the duct runs towards the eye."""

_RING = 12.0
"""Radius of the ring round a suspect touch, logical pixels."""


class ScreenLine(NamedTuple):
    """An open line to paint over the frame (its first point again at the end closes it).

    Parameters
    ----------
    pixels : (N, 2) float array
        Whole numbers are the centres of pixels.
    role : str
        Colour: a state of the theme, or ``halo``.
    width : float
        Logical pixels.
    """

    pixels: FloatArray
    role: str
    width: float


def outlines_of(scene: PoseScene, view: Viewpoint, ratio: float) -> list[ScreenLine]:
    """Return the outlines of all estimates, of suspect touches and of paths, as they are seen.

    Parameters
    ----------
    scene : PoseScene
    view : Viewpoint
        The projection of the frame.
    ratio : float
        Device pixels for each logical one.
    """
    seen, lines = scene.seen, []
    if seen.shows("region"):
        for pose in seen.poses:
            outline = outline_in(view, pose.origin, pose.covariance[:3, :3])
            lines.append(ScreenLine(outline, pose.role, 1.6))
    if seen.shows("cochlea"):
        lines += [ScreenLine(edge, pose.role, 1.3) for pose in seen.poses for edge in coil_edges(pose, view)]
    for touch in seen.touches:
        if touch.suspect:
            lines.append(ScreenLine(_ring(touch.position, view, _RING * ratio), "doubtful", 2.0))
    for path in seen.paths:
        pixels = view.display(path)[:, :2]
        lines += [ScreenLine(pixels, "halo", 6.0), ScreenLine(pixels, "path", 2.5)]
    return lines


def _ring(place: FloatArray, view: Viewpoint, radius: float) -> FloatArray:
    """Return a closed circle, (N, 2), about a (3,) scan position."""
    turn = np.linspace(0, 2 * np.pi, 33)
    circle: FloatArray = view.display(place[None])[0, :2] + radius * np.stack(
        [np.cos(turn), np.sin(turn)], axis=1
    )
    return circle


def coil_edges(pose: DrawnPose, view: Viewpoint) -> list[FloatArray]:
    """Return the edges, (N, 2) each, that the duct of the cochlea shows to the eye, without what it hides."""
    line, along, radii = _curve(pose.side)
    x, y, _ = view.display(pose.origin[None])[0]
    away = view.ray(x, y)[1] @ pose.T_scan_cochlea[:3, :3]
    across = np.cross(along, away)
    across *= (radii / np.maximum(np.linalg.norm(across, axis=1), 1e-6))[:, None]
    edges, both = [], np.stack([line + across, line - across])
    hidden = _is_hidden(both.reshape(-1, 3), line[::3], radii[::3], away).reshape(2, -1)
    for edge, behind in zip(both, hidden, strict=True):
        pixels = view.display(pose.at(edge))[:, :2]
        seen = np.flatnonzero(~behind)
        runs = np.split(seen, np.flatnonzero(np.diff(seen) > 1) + 1)
        edges += [pixels[run] for run in runs if len(run) > 1]
    return edges


def _is_hidden(
    points: FloatArray, line: FloatArray, radii: FloatArray, away: FloatArray
) -> NDArray[np.bool_]:
    """Return which of (N, 3) points on a duct lie behind another part of it, looking along `away`."""
    depth, line_depth = points @ away, line @ away
    flat = points - depth[:, None] * away
    middle = line - line_depth[:, None] * away
    gap = (flat**2).sum(axis=1)[:, None] - 2 * flat @ middle.T  # squared, but for the middles' own squares
    covers = gap < (0.96 * radii) ** 2 - (middle**2).sum(axis=1)
    hidden: NDArray[np.bool_] = (covers & (line_depth < depth[:, None] - 0.25 * radii)).any(axis=1)
    return hidden


@cache
def _curve(side: Side) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the middle of the duct, its direction, and its radius."""
    line, radii = duct_curve(side, _PER_TURN)
    return line, np.gradient(line, axis=0), radii
