"""The skull of a phantom: skin, braincase, snout, orbits, palate, teeth and cheek arches."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.phantom import grey
from gp_labeler.phantom.canvas import VoxelCanvas
from gp_labeler.phantom.layout import Ear, HeadLayout, unit
from gp_labeler.phantom.loft import roof_heights, skin, skull_body
from gp_labeler.phantom.solids import (
    Grid,
    Solid,
    Values,
    blend,
    component,
    cone,
    cut,
    cut_smoothly,
    ellipsoid,
    inset,
    moved,
    sheet,
    tip_centre,
    tube,
    union,
)

__all__ = ["paint_arches", "paint_skin", "paint_skull", "paint_upper_teeth"]

_SKULL_WALL = 0.8
_CRIBRIFORM = 24.0
"""Anterior position of the plate between brain and nose."""


def paint_skin(canvas: VoxelCanvas, head: HeadLayout) -> None:
    """Paint the soft outline of the head, with eyes and nostrils."""
    canvas.paint(skin(head), grey.SOFT)
    for ear in head.ears:
        eye = ear.at((11.8, 21.5, 5.8))
        canvas.paint(ellipsoid(eye, head.semi_axes(4.2, 4.2, 4.2)), grey.SOFT)
        canvas.paint(ellipsoid(eye, head.semi_axes(3.7, 3.7, 3.7)), grey.FLUID)
        canvas.paint(ellipsoid(ear.at((13.0, 21.5, 5.8)), head.semi_axes(1.7, 2.1, 2.1)), grey.LENS)


def paint_skull(canvas: VoxelCanvas, head: HeadLayout, thickness: float = 1.0) -> None:
    """Paint braincase and snout as one shell, the brain, the nose, and the openings.

    The wall grows inwards by the factor `thickness`: its outer surface stays.
    """
    outer = _skull(head)
    inner = inset(outer, _SKULL_WALL * thickness * head.scale)
    front, back = head.at((0, _CRIBRIFORM, 4)), head.at((0, _CRIBRIFORM - 1, 4))
    forward = unit(front - back)
    canvas.paint(outer, grey.BONE)
    canvas.paint(cut(inner, _half_space(back, forward)), grey.BRAIN)
    canvas.paint(cut(inner, _half_space(front, -forward)), grey.AIR)
    _paint_nose(canvas, head, inner)
    _paint_openings(canvas, head)
    _paint_crests(canvas, head)
    _paint_sutures(canvas, head)


def _skull(head: HeadLayout) -> Solid:
    """Return the outside of the skull: a body along the midline with a hollow for each eye."""
    hollows = []
    for ear in head.ears:
        hollows.append(ellipsoid(ear.at((12.8, 20.6, 3.6)), head.semi_axes(7.4, 6.6, 5.4)))
        hollows.append(ellipsoid(ear.at((11.6, 27.4, 0.4)), head.semi_axes(4.6, 4.2, 3.6)))
        hollows.append(ellipsoid(ear.at((11.2, 11.0, 1.2)), head.semi_axes(2.4, 4.6, 3.2)))
    return cut_smoothly(skull_body(head), blend(hollows, 1.5), 1.6)


def _half_space(point: FloatArray, normal: FloatArray) -> Solid:
    """Return all that lies ahead of a plane; it has no box of its own, so it only cuts."""

    def distance(grid: Grid) -> Values:
        return -component(moved(grid, point), normal)

    return Solid(distance, np.full(3, -np.inf), np.full(3, np.inf))


def _paint_nose(canvas: VoxelCanvas, head: HeadLayout, inner: Solid) -> None:
    """Paint the septum, scrolled turbinates on both sides, and the solid roots of the incisors."""
    lines = [head.at([(0, a, z) for a in (25, 32, 40, 48)]) for z in (11.0, -4.0)]
    parts = [sheet(lines[0], lines[1], 0.22)]
    for ear in head.ears:
        for up, wide, turn in ((6.2, 2.2, 0.4), (2.4, 2.6, 2.2), (-1.0, 2.0, 3.8)):
            rows = [
                _scroll(ear, a, up - 0.06 * (a - 25), wide * (1 - 0.02 * (a - 25)), turn)
                for a in (25, 33, 42)
            ]
            for first, second in pairwise(rows):
                parts.append(sheet(first, second, 0.17))
    nose = union(parts)
    inside = Solid(lambda grid: np.maximum(nose.distance(grid), inner.distance(grid)), nose.low, nose.high)
    canvas.paint(inside, grey.CANCELLOUS)


def _scroll(ear: Ear, anterior: float, up: float, wide: float, turn: float) -> FloatArray:
    angle = turn + np.linspace(0, 1.5 * np.pi, 9)
    radius = wide * np.linspace(0.7, 0.3, 9)
    return ear.at(
        *((3.0 + r * np.cos(t), anterior, up + r * np.sin(t)) for r, t in zip(radius, angle, strict=True))
    )


def _paint_openings(canvas: VoxelCanvas, head: HeadLayout) -> None:
    """Open nose and foramen magnum, and the optic and incisive foramen of each side."""
    nose = ellipsoid(head.at((0, 53.2, -0.2)), head.semi_axes(3.4, 5.2, 3.6))
    canvas.paint(nose, grey.SOFT)
    canvas.paint(ellipsoid(head.at((0, 50.2, 0.6)), head.semi_axes(2.8, 3.4, 2.4)), grey.AIR)
    hole = head.at([(0, -10.5, 2.6), (0, -15.0, 2.0)])
    canvas.paint(cone(hole[0], hole[1], 3.1 * head.scale), grey.BRAIN)
    for ear in head.ears:
        optic = ear.at((9.0, 17.2, 3.0), (4.0, 15.5, 3.0))
        canvas.paint(cone(optic[0], optic[1], 0.9), grey.SOFT)
        palate = ear.at((0.9, 35.0, -4.6), (0.9, 39.0, -5.0))
        canvas.paint(cone(palate[0], palate[1], 0.55), grey.SOFT)


def _paint_crests(canvas: VoxelCanvas, head: HeadLayout) -> None:
    """Paint what stands out behind: occipital crest and condyles, the processes beside the bullae."""
    crest = head.at([(x, -11.0 + 0.012 * x * x, 11.2 - 0.035 * x * x) for x in np.linspace(-7.5, 7.5, 13)])
    parts = [tube(crest, 0.6)]
    for ear in head.ears:
        parts.append(
            tube(ear.at((2.2, -12.4, -0.4), (3.3, -12.5, 0.9), (3.4, -11.9, 2.6)), (0.8, 1.0, 0.6), steps=4)
        )
        process = ear.at((7.4, -9.0, 0.5), (7.9, -8.4, -3.0), (7.9, -7.2, -6.2))
        parts.append(tube(process, (1.3, 0.9, 0.5), steps=4))
    canvas.paint(union(parts), grey.BONE)


def _paint_sutures(canvas: VoxelCanvas, head: HeadLayout) -> None:
    """Paint the seams of the roof: sagittal, coronal, lambdoid, and between nose and forehead."""
    wiggle = 0.25 * (-1.0) ** np.arange(60)
    along = np.linspace(-8.5, 50.0, 60)
    aside = np.linspace(-1.0, 1.0, 24)
    seams = [np.column_stack([wiggle, along])]
    for anterior, half, bow in ((8.0, 8.6, 2.0), (-7.5, 7.5, -2.2), (30.5, 4.6, -1.5)):
        seams.append(np.column_stack([half * aside, anterior - bow * aside**2 + wiggle[:24]]))
    for seam in seams:
        roof = roof_heights(seam[:, 0], seam[:, 1])
        edge = [head.roughly(np.column_stack([seam[:, 0], -seam[:, 1], roof + h])) for h in (0.5, -0.45)]
        canvas.paint(sheet(edge[0], edge[1], 0.09), grey.SUTURE)


def paint_arches(canvas: VoxelCanvas, head: HeadLayout) -> None:
    """Paint the cheek arch of each side, whose lateralmost point is ZL."""
    for ear in head.ears:
        canvas.paint(_arch(ear), grey.BONE)


def _arch(ear: Ear) -> Solid:
    """Return the strap from the maxilla to the temporal bone, forked in front by the infraorbital foramen."""
    half = 0.6
    upper = ear.at(
        (11.4, 26.4, -2.0), (13.6, 23.0, -1.2), (14.8, 18.4, -0.3), (15.0, 13.4, 0.0), (14.2, 10.0, 1.0),
        (12.7, 7.9, 2.9), (9.8, 5.0, 5.4),
    )  # fmt: skip
    lower = ear.at(
        (11.3, 25.4, -6.0), (13.5, 22.0, -6.4), (14.8, 17.8, -5.2), (15.1, 13.4, -3.8), (14.4, 10.4, -2.2),
        (12.9, 8.8, 0.6), (9.8, 7.6, 1.6),
    )  # fmt: skip
    middle = (upper + lower) / 2
    middle[3] = tip_centre(ear["ZL"], ear.towards(1, 0, 0), half)
    middle[[2, 4]] += (0.4, 0.0, 0.0) * np.array(ear.sign)
    fork = ear.at((6.6, 31.0, 2.6), (8.6, 29.6, 0.6), (11.4, 26.4, -2.0))
    flange = ear.at((6.6, 29.4, 5.0), (8.6, 28.4, 2.6), (11.4, 26.0, -1.4))
    root = ear.at((5.4, 28.0, -4.6), (8.4, 27.2, -5.8), (11.3, 25.4, -6.0))
    return union(
        [
            sheet(upper, middle, half, steps=4),
            sheet(middle, lower, half, steps=4),
            sheet(fork, flange, (0.7, 0.6, 0.5), steps=3),
            tube(root, (1.3, 1.1, 0.6), steps=4),
            tube(lower[:5], (0.6, 0.75, 0.75, 0.6, 0.6), steps=4),
        ]
    )


def paint_upper_teeth(canvas: VoxelCanvas, head: HeadLayout) -> None:
    """Paint palate, cheek teeth and incisors; IN is the lowest point of the bone between the incisors."""
    tip = head.ears[0]["IN"]
    up = np.array([0.0, 0.0, 1.0])
    parts = [cone(head.at((0, 46.0, -3.4)), tip_centre(tip, -up, 0.4), 1.1, 0.4)]
    for ear in head.ears:
        parts.append(
            tube(
                ear.at((5.0, 13.0, -2.6), (5.1, 16.0, -4.3), (4.9, 23.0, -4.8), (4.2, 29.5, -4.4)),
                (1.2, 2.0, 2.1, 1.2),
                steps=4,
            )
        )
        hook = ear.at((3.2, 14.0, -2.4), (2.9, 11.0, -1.8)), ear.at((3.4, 13.0, -6.0), (3.6, 10.5, -5.0))
        parts.append(sheet(hook[0], hook[1], 0.4))
    canvas.paint(union(parts), grey.BONE)
    for ear in head.ears:
        for a in (15.0, 18.4, 21.8, 25.0):
            lean = 0.1 * (20 - a)
            ends = ear.at((5.3 + lean, a, -3.0), (4.7 + lean, a + 0.4, -8.0))
            canvas.paint(cone(ends[0], ends[1], 1.45 * head.scale), grey.ENAMEL)
            canvas.paint(cone(ends[0], ends[1] - 0.2 * up, 0.95 * head.scale), grey.BONE)
        canvas.paint(upper_incisor(ear), grey.ENAMEL)
        canvas.paint(inset(upper_incisor(ear), 0.35), grey.DENTINE)


def upper_incisor(ear: Ear) -> Solid:
    """Return an upper incisor: an arc from its root in the snout down past IN."""
    line = ear.at(
        (1.7, 36.0, -0.6), (1.6, 39.5, 1.1), (1.4, 43.0, 0.9), (1.3, 45.8, -1.2), (1.17, 47.2, -4.6),
        (1.1, 47.5, -8.0), (1.05, 46.9, -11.2),
    )  # fmt: skip
    return tube(line, (0.7, 0.9, 0.95, 0.92, 0.9, 0.85, 0.55), steps=4)
