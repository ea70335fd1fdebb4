"""How each thing that an estimate is drawn with lies on one slice."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from qtpy.QtGui import QPainter

from gp_core.validation import FloatArray
from gp_labeler.imaging.mean_cochlea import cochlea_tubes
from gp_labeler.scene.coil import section
from gp_labeler.scene.ghosts import RADIUS_95, ellipse
from gp_labeler.scene.pose_data import (
    DrawnFeature,
    DrawnPose,
    DrawnTip,
    DrawnTouch,
    DrawnTruth,
    DrawnVector,
    PoseScene,
)
from gp_labeler.scene.pose_names import REACH_MM
from gp_labeler.scene.slice_viewport import SliceViewport
from gp_labeler.views.painting.pose_strokes import area, arrow, colour_of, hull, line, marker

__all__ = ["SlicePen", "region_section"]

_FADE_MM = 4.0
"""An axis whose origin lies farther off the slice is drawn faintly: it says where to scroll."""

_NEAR_MM = 0.5
_FAINT = 0.35
_MARKERS = {"pose": "ball", "pose_2": "diamond"}
_TRAIL_AT_MOST = 48


def region_section(pose: DrawnPose, shown: SliceViewport) -> FloatArray | None:
    """Return the (N, 2) pixels of the outline in which a slice cuts the 95 % ellipsoid of CO, or None."""
    across = shown.plane.normal
    flat = np.stack([shown.plane.right, shown.plane.down])
    covariance = pose.covariance[:3, :3]
    off = -float(shown.off_slice(pose.origin[None])[0])
    variance = max(float(across @ covariance @ across), 1e-12)
    left = RADIUS_95**2 - off**2 / variance
    if left <= 0:
        return None
    lean = flat @ covariance @ across / variance
    within = flat @ covariance @ flat.T - variance * np.outer(lean, lean)
    middle = shown.flat_to_pixel(flat @ pose.origin + lean * off) + 0.5
    return ellipse(middle, within / shown.mm_per_pixel**2, float(np.sqrt(left)))


class _Near(NamedTuple):
    """Which of some places lies near the slice, its (2,) painter's coordinates, and whether it lies on it."""

    number: int
    pixel: FloatArray
    on_slice: bool


class SlicePen:
    """Draws on one slice.

    Parameters
    ----------
    painter : QPainter
        In device pixels.
    shown : SliceView
        Which slice.
    ratio : float
        Device pixels per logical one.
    scene : PoseScene
        What there is, and which parts of it are shown.
    """

    def __init__(self, painter: QPainter, shown: SliceViewport, ratio: float, scene: PoseScene) -> None:
        self._painter, self._shown, self._ratio = painter, shown, ratio
        self._scene = scene

    def draw(self) -> None:
        """Draw all, what matters most last."""
        seen, scene = self._scene.seen, self._scene
        for pose in seen.poses:
            self._cochlea(pose)
        for pose in seen.poses if scene.shows("region") else ():
            self._region(pose)
        for path in seen.paths:
            self._path(path)
        for truth in seen.truths:
            self._truth(truth)
        for pose in seen.poses if scene.shows("estimate") else ():
            self._axis(pose)
        self._vectors([vector for vector in seen.vectors if vector.length >= 1e-6])
        self._features(seen.features)
        self._touches(seen.touches)
        if seen.tip is not None:
            self._tip(seen.tip)

    def _pixels(self, *points: FloatArray) -> FloatArray:
        return self._shown.scan_to_pixel(np.array(points)) + 0.5

    def _off(self, point: FloatArray) -> float:
        return abs(float(self._shown.off_slice(point[None])[0]))

    def _fade(self, strength: float) -> None:
        self._painter.setOpacity(self._scene.opacity * strength)

    def _cochlea(self, pose: DrawnPose) -> None:
        if not self._scene.shows("cochlea"):
            return
        self._fade(1.0)
        for tube, alpha, width in zip(cochlea_tubes(pose.side), (60, 40), (1.0, 0.0), strict=True):
            loops = section(tube, pose, self._shown.plane, self._shown.position)
            outlines = [self._shown.scan_to_pixel(loop) + 0.5 for loop in loops]
            area(self._painter, outlines, colour_of(pose.role), alpha, width * self._ratio)

    def _region(self, pose: DrawnPose) -> None:
        colour = colour_of(pose.role)
        self._fade(1.0)
        cut = region_section(pose, self._shown)
        if cut is not None:
            area(self._painter, [cut], colour, 50, 1.5 * self._ratio)
        else:
            self._fade(_FAINT)
            axes = np.stack([self._shown.plane.right, self._shown.plane.down])
            spread = axes @ pose.covariance[:3, :3] @ axes.T / self._shown.mm_per_pixel**2
            area(self._painter, [ellipse(self._pixels(pose.origin)[0], spread)], colour, 0, self._ratio)
        self._fade(1.0 if self._off(pose.origin) < _FADE_MM else _FAINT)
        rim = self._pixels(pose.origin, *pose.rim)
        area(self._painter, [hull(rim)], colour, 26, 0.0)

    def _axis(self, pose: DrawnPose) -> None:
        colour, off = colour_of(pose.role), self._off(pose.origin)
        self._fade(1.0 if off < _FADE_MM else _FAINT)
        tail, tip, origin = self._pixels(pose.tail, pose.tip, pose.origin)
        head = min(11 * self._ratio, 0.5 * float(np.linalg.norm(tip - tail)))
        along = (tip - tail) / max(float(np.linalg.norm(tip - tail)), 1e-9)
        shaft = np.stack([tail, tip - 0.8 * head * along])
        line(self._painter, shaft, colour, 2.2 * self._ratio, style=pose.style)
        arrow(self._painter, tail, tip, head, colour)
        shape = _MARKERS.get(pose.role, "ball")
        marker(self._painter, origin, shape, 4.2 * self._ratio, colour, full=off < _NEAR_MM)

    def _truth(self, truth: DrawnTruth) -> None:
        colour, off = colour_of("truth"), self._off(truth.origin)
        self._fade(1.0 if off < _FADE_MM else _FAINT)
        tail, tip, origin = self._pixels(truth.tail, truth.tip, truth.origin)
        line(self._painter, np.stack([tail, tip]), colour, 1.7 * self._ratio)
        marker(self._painter, origin, "square", 4.2 * self._ratio, colour, full=off < _NEAR_MM)

    def _near(self, places: Sequence[FloatArray] | FloatArray, reach: float = REACH_MM) -> Iterator[_Near]:
        """Yield those of the (3,) places that are drawn, the painter's opacity set for each."""
        if not len(places):
            return
        scan = np.asarray(places, dtype=np.float64).reshape(-1, 3)
        offs = np.abs(self._shown.off_slice(scan))
        near = np.flatnonzero(offs <= reach)
        for n, pixel, off in zip(
            near.tolist(), self._shown.scan_to_pixel(scan[near]) + 0.5, offs[near].tolist(), strict=True
        ):
            self._fade(1.0 if off < _NEAR_MM else 1.0 - 0.6 * off / reach)
            yield _Near(n, pixel, off < _NEAR_MM)

    def _vectors(self, vectors: Sequence[DrawnVector]) -> None:
        for n, _, _ in self._near([(vector.start + vector.end) / 2 for vector in vectors]):
            vector, colour = vectors[n], colour_of(vectors[n].role)
            start, end = self._pixels(vector.start, vector.end)
            width = (2.4 if vector.is_long else 1.4) * self._ratio
            line(self._painter, np.stack([start, end]), colour, width)
            head = min(4.0 * width, 0.7 * float(np.linalg.norm(end - start)))
            arrow(self._painter, start, end, head, colour)

    def _features(self, features: Sequence[DrawnFeature]) -> None:
        for n, pixel, _ in self._near([feature.position for feature in features]):
            marker(self._painter, pixel, "diamond", 2.8 * self._ratio, colour_of(features[n].role))

    def _touches(self, touches: Sequence[DrawnTouch]) -> None:
        for n, pixel, on_slice in self._near([touch.position for touch in touches]):
            self._touch(touches[n], pixel, full=on_slice)

    def _touch(self, touch: DrawnTouch, pixel: FloatArray, *, full: bool) -> None:
        role = "doubtful" if touch.suspect else "touch" if touch.used else "unseen"
        marker(self._painter, pixel, "tall", 4.6 * self._ratio, colour_of(role), full=full)
        if touch.suspect:
            about = ellipse(pixel, (11 * self._ratio) ** 2 * np.eye(2), 1.0)
            area(self._painter, [about], colour_of(role), 0, 1.6 * self._ratio)

    def _path(self, path: FloatArray) -> None:
        self._fade(1.0)
        pixels, off = self._shown.scan_to_pixel(path) + 0.5, np.abs(self._shown.off_slice(path))
        self._fade(_FAINT)
        line(self._painter, pixels, colour_of("path"), 1.6 * self._ratio)
        self._fade(1.0)
        near = np.flatnonzero(off < _NEAR_MM)
        for run in np.split(near, np.flatnonzero(np.diff(near) > 1) + 1):
            if len(run) > 1:
                line(self._painter, pixels[run], colour_of("path"), 2.6 * self._ratio)

    def _tip(self, tip: DrawnTip) -> None:
        colour = colour_of("touch" if tip.visible else "unseen")
        for n, pixel, _ in self._near(tip.trail[-_TRAIL_AT_MOST:], 2 * REACH_MM):
            size = 0.8 + 1.4 * n / _TRAIL_AT_MOST
            marker(self._painter, pixel, "ball", size * self._ratio, colour)
        off = self._off(tip.position)
        self._fade(1.0 if off < _FADE_MM else _FAINT)
        if tip.handle is not None:
            up = tip.handle / max(float(np.linalg.norm(tip.handle)), 1e-9)
            start, end = self._pixels(tip.position, tip.position + 12.0 * up)
            line(self._painter, np.stack([start, end]), colour, 3.0 * self._ratio)
        marker(
            self._painter, self._pixels(tip.position)[0], "ball", 5 * self._ratio, colour, full=off < _NEAR_MM
        )
