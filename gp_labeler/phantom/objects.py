"""What lies in a scan beside the healthy head: a broken bulla, an electrode, a clip, a holder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray
from gp_labeler.phantom import grey
from gp_labeler.phantom.canvas import VoxelCanvas
from gp_labeler.phantom.layout import Ear, HeadLayout, unit
from gp_labeler.phantom.solids import (
    Grid,
    Solid,
    Values,
    component,
    cone,
    ellipsoid,
    moved,
    sheet,
    squared_length,
    tube,
)
from gp_labeler.phantom.variation import HeadVariation, generator_of

__all__ = ["METAL", "holder_of", "paint_objects"]

METAL = 65_000.0
_TUBE_MM, _TUBE_WALL_MM, _ROD_MM = 28.0, 1.2, 1.6
_WIRE_MM, _CLIP_MM = 0.15, 0.35


def paint_objects(canvas: VoxelCanvas, head: HeadLayout, variation: HeadVariation, seed: int) -> None:
    """Paint over a head what a variation adds to it."""
    if variation.broken_bulla:
        _break_bulla(canvas, _ear(head, variation.broken_bulla), generator_of(seed, "broken_bulla"))
    if variation.electrode:
        canvas.paint(_wire(_ear(head, variation.electrode)), METAL)
    if variation.clip:
        canvas.paint(_clip(head, generator_of(seed, "clip")), METAL)
    holder = holder_of(head, variation, seed)
    if holder is not None:
        canvas.paint(holder, grey.BONE)


def _ear(head: HeadLayout, side: str) -> Ear:
    return head.ears[0 if Side(side) is Side.LEFT else 1]


def _break_bulla(canvas: VoxelCanvas, ear: Ear, rng: np.random.Generator) -> None:
    """Knock a hole into the floor of the bulla, with blood in the hole and a chip inside."""
    aside, ahead = rng.uniform(-0.8, 0.8, 2)
    hole = np.array([7.2 + aside, 0.6 + ahead, -7.8])
    canvas.paint(ellipsoid(ear.at(hole), ear.head.semi_axes(1.9, 2.6, 1.3)), grey.FLUID)
    chip = [[(-1.4, -0.9, 1.6), (1.1, -1.2, 1.2)], [(-1.2, 1.0, 1.5), (1.2, 0.8, 2.0)]]
    first, second = (ear.at(*(np.add(hole, corner) for corner in edge)) for edge in chip)
    canvas.paint(sheet(first, second, 0.2), grey.BONE)


def _wire(ear: Ear) -> Solid:
    """Return an electrode: from outside through the ear canal to just before the round window."""
    window = (ear["RWA"] + ear["RWP"]) / 2
    canal = (ear["OS"] + ear["OI"]) / 2
    inner = unit(canal - window)
    line = np.stack(
        [
            *ear.at((24.0, -4.0, 4.0), (17.0, -2.4, 2.4)),
            canal,
            window + 0.6 * inner,
        ]
    )
    return tube(line, _WIRE_MM, steps=6)


def _clip(head: HeadLayout, rng: np.random.Generator) -> Solid:
    """Return a U-shaped clip in the skin of the neck, aside of the middle."""
    aside, ahead = rng.uniform(-9, 9), rng.uniform(-12, -4)
    places = [(-2.2, 0, -3.0), (-2.2, 0, 1.2), (2.2, 0.6, 1.2), (2.2, 0.6, -3.0)]
    return tube(head.at(np.array([aside, ahead, 17.0]) + places), _CLIP_MM, steps=1)


def holder_of(head: HeadLayout, variation: HeadVariation, seed: int) -> Solid | None:
    """Return what holds the head, askew; None where nothing does."""
    rng = generator_of(seed, "holder")
    lean, rise = rng.uniform(-0.12, 0.12, 2)
    aside, lower = rng.uniform(-1.2, 1.2), rng.uniform(-1.0, 0.0)
    if variation.holder == "rod":
        ends = head.at(
            [(-24.0, 36.0 + 24 * lean, -9.0 - 24 * rise), (24.0, 36.0 - 24 * lean, -9.0 + 24 * rise)]
        )
        return cone(ends[0], ends[1], _ROD_MM)
    if not variation.holder:
        return None
    start, end = head.roughly(np.array([(aside, 18.0, lower - 2.0), (aside, -44.0, lower - 2.0)]))
    along = unit(end - start + float(np.linalg.norm(end - start)) * np.array([lean, 0.0, rise]) / 2)
    up = head.rotation[:, 2]
    shape = _Pipe(start, along, float(np.linalg.norm(end - start)), _TUBE_MM * head.scale, up)
    return shape.solid(half=variation.holder == "cradle")


@dataclass(frozen=True)
class _Pipe:
    """A pipe from `start` along a unit direction; mm."""

    start: FloatArray
    along: FloatArray
    length: float
    radius: float
    up: FloatArray

    def solid(self, *, half: bool) -> Solid:
        """Return its wall; of its lower half only, if asked."""
        ends = np.stack([self.start, self.start + self.length * self.along])
        reach = self.radius + _TUBE_WALL_MM

        def distance(grid: Grid) -> Values:
            here = moved(grid, self.start)
            t = component(here, self.along)
            r = np.sqrt(np.maximum(squared_length(here) - t * t, 0))
            wall = np.abs(r - np.float32(self.radius)) - np.float32(_TUBE_WALL_MM / 2)
            out: Values = np.maximum(wall, np.maximum(-t, t - np.float32(self.length)))
            if half:
                np.maximum(out, component(here, self.up) + np.float32(4.0), out=out)
            return out

        return Solid(distance, ends.min(axis=0) - reach, ends.max(axis=0) + reach)
