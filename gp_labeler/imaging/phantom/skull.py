"""The skull of a phantom: skin, braincase, snout, orbits, palate, teeth and cheek arches."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gp_core.checks import FloatArray
from gp_labeler.imaging.phantom import grey
from gp_labeler.imaging.phantom.canvas import Canvas
from gp_labeler.imaging.phantom.layout import Ear, HeadLayout, unit
from gp_labeler.imaging.phantom.solids import (
    Grid,
    Solid,
    Values,
    blend,
    cone,
    cut,
    cut_smoothly,
    ellipsoid,
    implicit,
    inset,
    sheet,
    tip_centre,
    tube,
    union,
)

__all__ = ["paint_arches", "paint_skin", "paint_skull", "paint_upper_teeth", "skin"]

# Cross-sections: anterior position, half width, top, bottom (mm of the mean head, see HeadLayout)
_SKIN = (
    (-17.6, 3.0, 4.0, -4.0),
    (-17.0, 15.0, 14.5, -18.0),
    (-14.0, 17.5, 17.0, -20.5),
    (-6.0, 19.3, 18.2, -21.5),
    (4.0, 20.0, 18.6, -21.8),
    (14.0, 19.8, 18.0, -21.5),
    (22.0, 18.0, 16.6, -20.8),
    (30.0, 14.5, 14.8, -19.5),
    (38.0, 11.2, 12.6, -17.8),
    (45.0, 8.8, 10.2, -14.8),
    (49.5, 7.2, 8.6, -11.8),
    (52.5, 5.6, 7.0, -7.5),
    (54.4, 3.4, 4.6, -2.5),
    (55.0, 0.5, 2.0, 0.4),
)
_SKULL = (
    (-12.4, 1.5, 6.8, 3.8),
    (-12.1, 5.8, 10.0, 0.6),
    (-10.5, 9.0, 12.0, -0.5),
    (-6.0, 10.3, 13.1, -0.6),
    (0.0, 10.5, 13.8, -0.6),
    (6.0, 10.4, 13.9, -0.9),
    (12.0, 10.0, 13.6, -1.4),
    (17.0, 9.2, 13.0, -1.8),
    (22.0, 8.6, 12.3, -2.4),
    (28.0, 8.2, 11.3, -3.4),
    (34.0, 7.2, 9.9, -4.3),
    (40.0, 6.1, 8.4, -4.8),
    (45.0, 5.5, 7.3, -4.8),
    (48.0, 5.2, 6.7, -4.3),
    (50.5, 4.8, 6.1, -3.0),
    (51.8, 4.2, 5.6, -1.8),
    (52.1, 0.6, 3.0, 0.0),
)
_SKULL_WALL = 0.8
_CRIBRIFORM = 24.0
"""Anterior position of the plate between brain and nose."""

_SNOUT = (16.0, 46.0)
_FINE = 8192


def _loft(head: HeadLayout, sections: ArrayLike, power: float) -> Solid:
    """Return the body with superelliptic cross-sections along the midline of the head."""
    from scipy.interpolate import PchipInterpolator

    table = _with_own_snout(head, np.array(sections, dtype=np.float64))
    profile = PchipInterpolator(table[:, 0], table[:, 1:])
    first, last = table[0, 0], table[-1, 0]
    lateral, back, up = head.rotation.T / head.scale
    half, low, high = table[:, 1].max(), table[:, 3].min(), table[:, 2].max()
    corners = head.roughly(
        np.array([(x, -a, z) for x in (-half, half) for a in (first, last) for z in (low, high)])
    )
    fine = np.linspace(first, last, _FINE)
    widths, tops, bottoms = profile(fine).astype(np.float32).T

    def place(grid: Grid, axis: FloatArray) -> Values:
        return sum(np.float32(a) * (g - np.float32(s)) for a, g, s in zip(axis, grid, head.shift, strict=True))

    def value(grid: Grid) -> Values:
        along = -place(grid, back)
        index = ((along - np.float32(first)) * np.float32((_FINE - 1) / (last - first))).clip(0, _FINE - 1).astype(np.int16)
        top, bottom = tops[index], bottoms[index]
        a = np.abs(place(grid, lateral)) / widths[index]
        b = np.abs(place(grid, up) - (top + bottom) / 2) / ((top - bottom) / 2)
        across = np.float32(head.scale) * ((a**power + b**power) ** np.float32(1 / power) - 1) * widths[index]
        ends = np.float32(head.scale) * np.maximum(np.float32(first) - along, along - np.float32(last))
        return np.maximum(across, ends)

    return implicit(value, corners.min(axis=0), corners.max(axis=0))


def _with_own_snout(head: HeadLayout, table: FloatArray) -> FloatArray:
    """Return cross-sections drawn out so that the snout comes to this animal's IN."""
    tip = head.snout_shift
    share = np.clip((table[:, 0] - _SNOUT[0]) / (_SNOUT[1] - _SNOUT[0]), 0, 1)
    share = (share * share * (3 - 2 * share))[:, None]
    return table + share * (tip[1], 0.0, tip[2], tip[2])


def skin(head: HeadLayout) -> Solid:
    """Return the soft outline of the head without the outer ears."""
    return _loft(head, _SKIN, 2.3)


def paint_skin(canvas: Canvas, head: HeadLayout) -> None:
    """Paint the soft outline of the head, with eyes and nostrils."""
    canvas.paint(skin(head), grey.SOFT)
    for ear in head.ears:
        eye = ear.at((11.8, 21.5, 5.8))
        canvas.paint(ellipsoid(eye, head.semi_axes(4.2, 4.2, 4.2)), grey.SOFT)
        canvas.paint(ellipsoid(eye, head.semi_axes(3.7, 3.7, 3.7)), grey.FLUID)
        canvas.paint(ellipsoid(ear.at((13.0, 21.5, 5.8)), head.semi_axes(1.7, 2.1, 2.1)), grey.LENS)


def paint_skull(canvas: Canvas, head: HeadLayout) -> None:
    """Paint braincase and snout as one shell, the brain, the nose, and the openings."""
    outer = _skull(head)
    inner = inset(outer, _SKULL_WALL * head.scale)
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
    body = _loft(head, _SKULL, 2.5)
    hollows = []
    for ear in head.ears:
        hollows.append(ellipsoid(ear.at((12.8, 20.6, 3.6)), head.semi_axes(7.4, 6.6, 5.4)))
        hollows.append(ellipsoid(ear.at((11.6, 27.4, 0.4)), head.semi_axes(4.6, 4.2, 3.6)))
        hollows.append(ellipsoid(ear.at((11.2, 11.0, 1.2)), head.semi_axes(2.4, 4.6, 3.2)))
    return cut_smoothly(body, blend(hollows, 1.5), 1.6)


def _half_space(point: FloatArray, normal: FloatArray) -> Solid:
    """Return all that lies ahead of a plane; it has no box of its own, so it only cuts."""

    def distance(grid: Grid) -> Values:
        return sum(np.float32(-n) * (g - np.float32(p)) for n, g, p in zip(normal, grid, point, strict=True))

    return Solid(distance, np.full(3, -np.inf), np.full(3, np.inf))


def _paint_nose(canvas: Canvas, head: HeadLayout, inner: Solid) -> None:
    """Paint the septum, scrolled turbinates on both sides, and the solid roots of the incisors."""
    lines = [head.at([(0, a, z) for a in (25, 32, 40, 48)]) for z in (11.0, -4.0)]
    parts = [sheet(lines[0], lines[1], 0.22)]
    for ear in head.ears:
        for up, wide, turn in ((6.2, 2.2, 0.4), (2.4, 2.6, 2.2), (-1.0, 2.0, 3.8)):
            rows = [_scroll(ear, a, up - 0.06 * (a - 25), wide * (1 - 0.02 * (a - 25)), turn) for a in (25, 33, 42)]
            for first, second in zip(rows[:-1], rows[1:], strict=True):
                parts.append(sheet(first, second, 0.17))
    nose = union(parts)
    inside = Solid(lambda grid: np.maximum(nose.distance(grid), inner.distance(grid)), nose.low, nose.high)
    canvas.paint(inside, grey.CANCELLOUS)


def _scroll(ear: Ear, anterior: float, up: float, wide: float, turn: float) -> FloatArray:
    angle = turn + np.linspace(0, 1.5 * np.pi, 9)
    radius = wide * np.linspace(0.7, 0.3, 9)
    return ear.at(*((3.0 + r * np.cos(t), anterior, up + r * np.sin(t)) for r, t in zip(radius, angle, strict=True)))


def _paint_openings(canvas: Canvas, head: HeadLayout) -> None:
    """Open nose and foramen magnum, and the optic and incisive foramen of each side."""
    nose = ellipsoid(head.at((0, 52.4, 1.4)), head.semi_axes(3.7, 4.2, 3.3))
    canvas.paint(nose, grey.SOFT)
    canvas.paint(ellipsoid(head.at((0, 50.5, 1.4)), head.semi_axes(3.2, 4.0, 2.6)), grey.AIR)
    hole = head.at([(0, -10.5, 2.6), (0, -15.0, 2.0)])
    canvas.paint(cone(hole[0], hole[1], 3.1 * head.scale), grey.BRAIN)
    for ear in head.ears:
        optic = ear.at((9.0, 17.2, 3.0), (4.0, 15.5, 3.0))
        canvas.paint(cone(optic[0], optic[1], 0.9), grey.SOFT)
        palate = ear.at((0.9, 35.0, -4.6), (0.9, 39.0, -5.0))
        canvas.paint(cone(palate[0], palate[1], 0.55), grey.SOFT)


def _paint_crests(canvas: Canvas, head: HeadLayout) -> None:
    """Paint what stands out from the braincase: occipital crest and condyles, the processes behind the bullae."""
    crest = head.at([(x, -11.0 + 0.012 * x * x, 11.2 - 0.035 * x * x) for x in np.linspace(-7.5, 7.5, 13)])
    parts = [tube(crest, 0.6)]
    for ear in head.ears:
        parts.append(tube(ear.at((2.2, -12.4, -0.4), (3.3, -12.5, 0.9), (3.4, -11.9, 2.6)), (0.8, 1.0, 0.6), steps=4))
        process = ear.at((7.4, -9.0, 0.5), (7.9, -8.4, -3.0), (7.9, -7.2, -6.2))
        parts.append(tube(process, (1.3, 0.9, 0.5), steps=4))
    canvas.paint(union(parts), grey.BONE)


def _paint_sutures(canvas: Canvas, head: HeadLayout) -> None:
    """Paint the seams between the bones of the roof: sagittal, coronal, lambdoid, between nose and forehead."""
    wiggle = 0.25 * (-1.0) ** np.arange(60)
    along = np.linspace(-8.5, 50.0, 60)
    aside = np.linspace(-1.0, 1.0, 24)
    seams = [np.column_stack([wiggle, along])]
    for anterior, half, bow in ((8.0, 8.6, 2.0), (-7.5, 7.5, -2.2), (30.5, 4.6, -1.5)):
        seams.append(np.column_stack([half * aside, anterior - bow * aside**2 + wiggle[:24]]))
    roof = np.array(_SKULL)
    for seam in seams:
        half, top, low = (np.interp(seam[:, 1], roof[:, 0], roof[:, c]) for c in (1, 2, 3))
        drop = (top - low) / 2 * (1 - (1 - (np.abs(seam[:, 0]) / half) ** 2.5) ** 0.4)
        edge = [head.roughly(np.column_stack([seam[:, 0], -seam[:, 1], top - drop + h])) for h in (0.5, -0.45)]
        canvas.paint(sheet(edge[0], edge[1], 0.09), grey.SUTURE)


def paint_arches(canvas: Canvas, head: HeadLayout) -> None:
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


def paint_upper_teeth(canvas: Canvas, head: HeadLayout) -> None:
    """Paint palate, cheek teeth and incisors; IN is the lowest point of the bone between the incisors."""
    tip = head.ears[0]["IN"]
    up = np.array([0.0, 0.0, 1.0])
    parts = [cone(head.at((0, 46.0, -3.4)), tip_centre(tip, -up, 0.4), 1.1, 0.4)]
    for ear in head.ears:
        parts.append(tube(ear.at((5.0, 13.0, -2.6), (5.1, 16.0, -4.3), (4.9, 23.0, -4.8), (4.2, 29.5, -4.4)), (1.2, 2.0, 2.1, 1.2), steps=4))
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
