"""What small solids an estimate is drawn with: rods, heads, balls, before a camera gives them their size."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.scene.pose_data import (
    AXIS_MM,
    BEHIND_MM,
    DrawnFeature,
    DrawnPose,
    DrawnTip,
    DrawnTouch,
    DrawnTruth,
    DrawnVector,
    PoseScene,
)
from gp_labeler.scene.pose_solids import BALL, CUBE, DIAMOND, HEAD, ROD

__all__ = [
    "BALL",
    "CUBE",
    "DASHES",
    "DIAMOND",
    "HEAD",
    "ROD",
    "PoseSolid",
    "axes_of",
    "dashes",
    "marks_of",
    "sizes_of",
]

DASHES = {"solid": (np.inf, 0.0), "dashed": (0.7, 0.3), "dotted": (0.18, 0.22)}
"""Length of a dash and of the gap after it, mm, by style."""

_UP = np.array([0.0, 0.0, 1.0])
_MARKERS = {"pose": BALL, "pose_2": DIAMOND}
_HEAD_MM = 0.9
_NEEDLE_MM, _HANDLE_MM = 2.5, 9.0
_TRAIL_AT_MOST = 48


@dataclass(frozen=True, eq=False)
class PoseSolid:
    """A small solid; along its direction it is so long, across so thick, each the larger of mm and pixels.

    Parameters
    ----------
    shape : int
        ``ROD`` from its place on, ``HEAD`` of an arrow that ends at its place, else about its place.
    place, along : (3,) float array
        Scan frame, mm, and a unit vector.
    role : str
        Colour: a state of the theme.
    long, thick : (2,) tuple of float
        In mm, and in logical pixels at least.
    """

    shape: int
    place: FloatArray
    along: FloatArray
    role: str
    long: tuple[float, float]
    thick: tuple[float, float]


def axes_of(scene: PoseScene) -> list[PoseSolid]:
    """Return the solids of estimated and labelled axes, as far as they are shown."""
    seen = scene.seen
    poses = seen.poses if scene.shows("estimate") else ()
    return _flat([*map(_pose, poses), *map(_truth, seen.truths)])


def marks_of(scene: PoseScene) -> list[PoseSolid]:
    """Return the solids of points, error vectors and the probe, as far as they are shown."""
    seen = scene.seen
    found = _flat(map(_vector, seen.vectors))
    found += [*map(_feature, seen.features), *map(_touch, seen.touches)]
    return found if seen.tip is None else found + _tip(seen.tip)


def dashes(length: float, style: str) -> list[tuple[float, float]]:
    """Return where the dashes of a line begin and end, mm from its start; the last one ends with it."""
    dash, gap = DASHES[style]
    if dash >= length:
        return [(0.0, length)]
    starts = np.arange(0.0, length, dash + gap)
    return [(float(s), float(min(s + dash, length))) for s in starts]


def _flat(many: Iterable[Iterable[PoseSolid]]) -> list[PoseSolid]:
    return [solid for some in many for solid in some]


def _pose(pose: DrawnPose) -> Iterator[PoseSolid]:
    for start, end in dashes(AXIS_MM + BEHIND_MM - 0.8 * _HEAD_MM, pose.style):
        place = pose.tail + start * pose.axis
        yield PoseSolid(ROD, place, pose.axis, pose.role, (end - start, 0.0), (0.15, 2.6))
    yield PoseSolid(HEAD, pose.tip, pose.axis, pose.role, (_HEAD_MM, 9.0), (0.55, 8.0))
    shape = _MARKERS.get(pose.role, BALL)
    size = (0.5, 8.0) if shape == BALL else (0.62, 10.0)
    yield PoseSolid(shape, pose.origin, pose.axis, pose.role, size, size)


def _truth(truth: DrawnTruth) -> Iterator[PoseSolid]:
    length = float(np.linalg.norm(truth.tip - truth.tail))
    yield PoseSolid(ROD, truth.tail, truth.axis, "truth", (length, 0.0), (0.09, 2.0))
    yield PoseSolid(CUBE, truth.origin, truth.axis, "truth", (0.42, 7.0), (0.42, 7.0))
    for end in (truth.tip, truth.tail):
        yield PoseSolid(ROD, end, truth.axis, "truth", (0.05, 1.5), (0.26, 6.0))


def _vector(vector: DrawnVector) -> Iterator[PoseSolid]:
    if vector.length < 1e-6:
        return
    along, bold = (vector.end - vector.start) / vector.length, 1.8 if vector.is_long else 1.0
    yield PoseSolid(ROD, vector.start, along, vector.role, (vector.length, 0.0), (0.03, 1.6 * bold))
    head = (min(0.3 * bold, 0.6 * vector.length), 0.0)
    yield PoseSolid(HEAD, vector.end, along, vector.role, head, (0.12 * bold, 5.0 * bold))


def _feature(feature: DrawnFeature) -> PoseSolid:
    return PoseSolid(DIAMOND, feature.position, _UP, feature.role, (0.12, 6.0), (0.12, 6.0))


def _touch(touch: DrawnTouch) -> PoseSolid:
    role = "doubtful" if touch.suspect else "touch" if touch.used else "unseen"
    grown = 1.25 if touch.suspect else 1.0
    return PoseSolid(DIAMOND, touch.position, _UP, role, (0.3, 15.0 * grown), (0.18, 9.0 * grown))


def _tip(tip: DrawnTip) -> list[PoseSolid]:
    role = "touch" if tip.visible else "unseen"
    trail = tip.trail[-_TRAIL_AT_MOST:]
    sizes = np.linspace(3.5, 7.0, len(trail))
    found = [
        PoseSolid(DIAMOND, place, _UP, role, (0.0, float(size)), (0.0, float(size)))
        for place, size in zip(trail, sizes, strict=True)
    ]
    if tip.handle is None:
        return [*found, PoseSolid(BALL, tip.position, _UP, role, (0.3, 8.0), (0.3, 8.0))]
    up = tip.handle / max(float(np.linalg.norm(tip.handle)), 1e-9)
    return [
        *found,
        PoseSolid(HEAD, tip.position, -up, role, (_NEEDLE_MM, 0.0), (0.4, 5.0)),
        PoseSolid(ROD, tip.position + _NEEDLE_MM * up, up, role, (_HANDLE_MM, 0.0), (0.4, 5.0)),
    ]


def sizes_of(solids: Sequence[PoseSolid], pixel_mm: FloatArray) -> FloatArray:
    """Return the (N, 3) length and thickness (twice) of solids, mm, where a pixel is so large."""
    long, thick = (np.array([getattr(s, name) for s in solids]).reshape(-1, 2) for name in ("long", "thick"))
    grown = [np.maximum(size[:, 0], size[:, 1] * pixel_mm) for size in (long, thick)]
    return np.stack([grown[0], grown[1], grown[1]], axis=1)
