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
    ellipsoid,
    implicit,
    inset,
    sheet,
    tube,
    union,
)

__all__ = ["head_box", "paint_arches", "paint_skin", "paint_skull", "paint_upper_teeth"]

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
    (50.0, 7.0, 7.4, -11.5),
    (54.0, 5.0, 4.6, -7.0),
    (56.3, 2.5, 1.8, -2.5),
    (56.8, 0.5, 0.4, -0.5),
)
_SKULL = (
    (-12.4, 1.5, 6.8, 3.8),
    (-12.0, 5.6, 9.6, 0.6),
    (-10.0, 8.8, 11.6, -0.4),
    (-6.0, 10.2, 12.9, -0.6),
    (0.0, 10.5, 13.6, -0.6),
    (6.0, 10.3, 13.6, -0.9),
    (12.0, 9.3, 13.2, -1.4),
    (17.0, 7.9, 12.6, -1.8),
    (22.0, 7.0, 11.9, -2.4),
    (28.0, 7.2, 10.9, -3.4),
    (34.0, 6.8, 9.6, -4.2),
    (40.0, 5.9, 8.0, -4.6),
    (46.0, 5.0, 6.0, -4.6),
    (50.0, 4.2, 4.4, -3.4),
    (53.0, 3.4, 3.0, -1.6),
    (54.0, 0.6, 1.2, 0.0),
)
_SKULL_WALL = 0.8
_CRIBRIFORM = 24.0
"""Anterior position of the plate between brain and nose."""

_NOSTRIL = 50.5
_FINE = 8192


def head_box(head: HeadLayout) -> FloatArray:
    """Return the (2, 3) corners of a box in the scan around the whole head, with some air, mm."""
    skin = _loft(head, _SKIN, 2.3)
    margin = 2.0
    return np.stack([skin.low - margin, skin.high + margin])


def _loft(head: HeadLayout, sections: ArrayLike, power: float) -> Solid:
    """Return the body with superelliptic cross-sections along the midline of the head."""
    from scipy.interpolate import PchipInterpolator

    table = np.asarray(sections, dtype=np.float64)
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


def paint_skin(canvas: Canvas, head: HeadLayout) -> None:
    """Paint the soft outline of the head, with eyes and nostrils."""
    canvas.paint(_loft(head, _SKIN, 2.3), grey.SOFT)
    for ear in head.ears:
        eye = ear.at((11.8, 21.5, 5.8))
        canvas.paint(ellipsoid(eye, ear.semi_axes(4.2, 4.2, 4.2)), grey.SOFT)
        canvas.paint(ellipsoid(eye, ear.semi_axes(3.7, 3.7, 3.7)), grey.FLUID)
        canvas.paint(ellipsoid(ear.at((13.0, 21.5, 5.8)), ear.semi_axes(1.7, 2.1, 2.1)), grey.LENS)


def paint_skull(canvas: Canvas, head: HeadLayout) -> None:
    """Paint braincase and snout as one shell, the brain, the nose, and the openings."""
    outer = _loft(head, _SKULL, 2.5)
    inner = inset(outer, _SKULL_WALL * head.scale)
    front, back = head.at((0, _CRIBRIFORM, 4)), head.at((0, _CRIBRIFORM - 1, 4))
    forward = unit(front - back)
    canvas.paint(outer, grey.BONE)
    canvas.paint(cut(inner, _half_space(back, forward)), grey.BRAIN)
    canvas.paint(cut(inner, _half_space(front, -forward)), grey.AIR)
    _paint_nose(canvas, head, inner, front, forward)
    mouth = head.at([(0, _NOSTRIL, 2), (0, _NOSTRIL + 6, 2)])
    canvas.paint(cone(mouth[0], mouth[1], 3.4 * head.scale), grey.SOFT)
    _paint_openings(canvas, head)
    _paint_crests(canvas, head)


def _half_space(point: FloatArray, normal: FloatArray) -> Solid:
    """Return all that lies ahead of a plane; it has no box of its own, so it only cuts."""

    def distance(grid: Grid) -> Values:
        return sum(np.float32(-n) * (g - np.float32(p)) for n, g, p in zip(normal, grid, point, strict=True))

    return Solid(distance, np.full(3, -np.inf), np.full(3, np.inf))


def _paint_nose(
    canvas: Canvas, head: HeadLayout, inner: Solid, front: FloatArray, forward: FloatArray
) -> None:
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
    """Open the foramen magnum, and the optic foramen and incisive foramen of each side."""
    hole = head.at([(0, -10.5, 2.6), (0, -15.0, 2.0)])
    canvas.paint(cone(hole[0], hole[1], 3.1 * head.scale), grey.BRAIN)
    for ear in head.ears:
        optic = ear.at((9.5, 18.0, 2.6), (5.0, 16.5, 2.6))
        canvas.paint(cone(optic[0], optic[1], 0.9), grey.SOFT)
        palate = ear.at((0.9, 35.0, -4.6), (0.9, 39.0, -5.0))
        canvas.paint(cone(palate[0], palate[1], 0.55), grey.SOFT)


def _paint_crests(canvas: Canvas, head: HeadLayout) -> None:
    """Paint what stands out from the braincase: occipital crest and condyles, the rim of the orbit."""
    crest = head.at([(x, -11.0 + 0.012 * x * x, 11.2 - 0.035 * x * x) for x in np.linspace(-9.5, 9.5, 13)])
    parts = [tube(crest, 0.75)]
    for ear in head.ears:
        parts.append(tube(ear.at((2.2, -12.6, -0.6), (3.4, -12.6, 1.0), (3.5, -12.0, 2.8)), (1.0, 1.15, 0.7)))
        brow = ear.at((6.6, 27.5, 8.2), (7.7, 24.5, 9.3), (8.4, 21.0, 9.6), (8.5, 17.0, 9.2), (8.4, 14.0, 8.6))
        parts.append(tube(brow, (0.6, 0.8, 0.9, 0.8, 0.5)))
        process = ear.at((7.6, -8.6, -0.5), (7.9, -8.2, -4.0), (7.6, -7.0, -7.4))
        parts.append(tube(process, (1.2, 0.9, 0.5)))
    canvas.paint(union(parts), grey.BONE)


def paint_arches(canvas: Canvas, head: HeadLayout) -> None:
    """Paint the cheek arch of each side, whose lateralmost point is ZL."""
    for ear in head.ears:
        canvas.paint(_arch(ear), grey.BONE)


def _arch(ear: Ear) -> Solid:
    """Return the strap from the maxilla to the temporal bone, forked in front by the infraorbital foramen."""
    half = 0.62
    crown = ear["ZL"] - half * ear.towards(1, 0, 0)
    upper = ear.at(
        (11.9, 25.6, -2.6), (14.0, 22.0, -1.9), (15.0, 18.0, -1.0), (15.1, 13.4, -0.7), (14.2, 10.0, 0.5),
        (12.7, 7.9, 2.2), (10.2, 6.0, 3.9),
    )  # fmt: skip
    lower = ear.at(
        (11.7, 25.2, -5.6), (13.8, 21.6, -5.6), (15.0, 17.8, -4.3), (15.1, 13.4, -3.2), (14.4, 10.2, -1.8),
        (12.9, 8.4, 0.9), (10.2, 6.4, 2.4),
    )  # fmt: skip
    middle = (upper + lower) / 2
    middle[3] = crown
    middle[2], middle[4] = ((outer + 0.25 * (crown - outer)) for outer in (middle[2], middle[4]))
    fork = ear.at((6.4, 30.0, 1.6), (9.0, 28.2, -0.6), (11.9, 25.6, -2.6))
    root = ear.at((5.6, 29.0, -4.6), (8.6, 27.6, -5.6), (11.7, 25.2, -5.6))
    edges = [tube(upper, 0.6), tube(lower, 0.6), tube(fork, (1.0, 0.7, 0.6)), tube(root, (1.5, 1.0, 0.6))]
    return union([sheet(upper, middle, half), sheet(middle, lower, half), *edges])


def paint_upper_teeth(canvas: Canvas, head: HeadLayout) -> None:
    """Paint palate, cheek teeth and incisors; IN is the lowest point of the bone between the incisors."""
    tip = head.ears[0]["IN"]
    up = np.array([0.0, 0.0, 1.0])
    parts = [cone(head.at((0, 46.0, -2.6)), tip + 0.4 * up, 1.1, 0.4)]
    for ear in head.ears:
        parts.append(tube(ear.at((5.0, 13.5, -3.0), (5.0, 20.0, -3.8), (4.4, 27.0, -4.6)), (1.4, 2.0, 1.5)))
        hook = ear.at((3.2, 14.0, -2.4), (2.9, 11.0, -1.8)), ear.at((3.4, 13.0, -6.0), (3.6, 10.5, -5.0))
        parts.append(sheet(hook[0], hook[1], 0.4))
    canvas.paint(union(parts), grey.BONE)
    for ear in head.ears:
        for a in (15.0, 18.4, 21.8, 25.0):
            lean = 0.1 * (20 - a)
            ends = ear.at((5.3 + lean, a, -3.0), (4.7 + lean, a + 0.4, -8.3))
            canvas.paint(cone(ends[0], ends[1], 1.45 * head.scale), grey.ENAMEL)
            canvas.paint(cone(ends[0], ends[1] - 0.2 * up, 0.95 * head.scale), grey.BONE)
        canvas.paint(upper_incisor(ear), grey.ENAMEL)
        canvas.paint(inset(upper_incisor(ear), 0.35), grey.DENTINE)


def upper_incisor(ear: Ear) -> Solid:
    """Return an upper incisor: an arc from its root in the snout down past IN."""
    line = ear.at(
        (1.7, 36.0, -0.6), (1.6, 39.5, 1.1), (1.4, 43.0, 0.9), (1.25, 45.8, -1.2), (1.1, 47.2, -4.6),
        (1.05, 47.5, -8.0), (1.02, 46.9, -11.2),
    )  # fmt: skip
    return tube(line, (0.7, 0.9, 0.95, 0.92, 0.9, 0.85, 0.55))
