"""The lower jaw of a phantom: body, ramus, angular process, teeth, and the condyle that ends in MN."""

from __future__ import annotations

import numpy as np

from gp_labeler.phantom import grey
from gp_labeler.phantom.canvas import VoxelCanvas
from gp_labeler.phantom.layout import Ear, HeadLayout
from gp_labeler.phantom.solids import Solid, sheet, tip_centre, tube, union

__all__ = ["paint_jaw"]

_TIP_RADIUS = 0.5


def paint_jaw(canvas: VoxelCanvas, head: HeadLayout) -> None:
    """Paint both halves of the lower jaw with their teeth."""
    for ear in head.ears:
        canvas.paint(_half_jaw(ear), grey.BONE)
        for a in (14.8, 18.2, 21.6, 25.0):
            tooth = ear.at((5.6 + 0.1 * (20 - a), a, -13.0), (5.4 + 0.1 * (20 - a), a, -8.7))
            canvas.paint(tube(tooth, 1.35 * head.scale), grey.ENAMEL)
            canvas.paint(tube(tooth - (0, 0, 0.2), 0.9 * head.scale), grey.BONE)
        canvas.paint(_incisor(ear, 0.0), grey.ENAMEL)
        canvas.paint(_incisor(ear, 0.35), grey.DENTINE)


def _half_jaw(ear: Ear) -> Solid:
    upper = ear.at(
        (1.6, 40.4, -10.6), (2.4, 36.0, -12.2), (3.6, 31.0, -12.6), (5.2, 26.5, -11.4), (6.9, 17.0, -10.8),
        (8.4, 13.6, -8.6),
    )  # fmt: skip
    lower = ear.at(
        (1.4, 38.6, -13.8), (2.2, 34.4, -16.0), (4.0, 29.0, -17.2), (6.2, 23.0, -17.6), (8.4, 16.0, -17.4),
        (9.6, 10.0, -17.2),
    )  # fmt: skip
    back = ear.at((8.4, 13.6, -8.6), (9.6, 11.0, -7.2), (10.6, 8.8, -5.8), (11.6, 7.4, -3.6))
    angle = ear.at((9.6, 10.0, -17.2), (10.5, 3.0, -16.6), (11.0, 3.4, -12.0), (11.4, 5.8, -6.4))
    spur = ear.at((9.6, 10.0, -17.2), (10.5, 3.0, -16.6), (11.2, -2.0, -16.0), (11.4, -6.0, -14.6))
    blade = ear.at((10.6, 7.0, -14.0), (10.9, 3.8, -13.4), (11.2, -1.0, -14.6), (11.4, -5.0, -14.4))
    ridge = ear.at((6.2, 24.0, -13.6), (8.4, 18.0, -14.2), (9.9, 12.0, -14.8), (10.7, 6.0, -14.4))
    tooth_row = ear.at((4.6, 27.6, -13.0), (5.6, 22.0, -13.0), (6.4, 13.4, -12.6))
    return union(
        [
            sheet(upper, lower, (0.9, 1.2, 1.1, 1.0, 0.7, 0.55), steps=4),
            sheet(back, angle, (0.55, 0.45, 0.45, 0.6), steps=8),
            sheet(spur, blade, (0.6, 0.6, 0.5, 0.4), steps=4),
            tube(lower, (0.9, 1.2, 1.4, 1.3, 1.0, 0.7), steps=4),
            tube(spur, (0.7, 0.75, 0.65, 0.4), steps=4),
            tube(ridge, (0.4, 0.8, 0.7, 0.4), steps=4),
            tube(tooth_row, (1.5, 2.0, 1.7), steps=4),
            tube(ear.at((8.4, 13.6, -8.6), (9.2, 12.6, -6.6), (9.5, 11.6, -4.8)), (0.7, 0.55, 0.35), steps=3),
            _condyle(ear),
        ]
    )


def _condyle(ear: Ear) -> Solid:
    """Return the condylar process; the farthest point of it towards the back and up is MN."""
    tip = tip_centre(ear["MN"], ear.towards(0, -1, 1), _TIP_RADIUS)
    forward, up = ear.towards(0, 1, 0), ear.towards(0, 0, 1)
    head = np.stack([tip, tip + 1.3 * forward - 0.35 * up, tip + 2.6 * forward - 1.3 * up])
    bend = tip + 0.9 * forward - 1.3 * up
    neck = np.stack([tip, bend, *ear.at((11.6, 7.6, -3.6), (10.6, 9.0, -6.2))])
    return union(
        [
            tube(head, (_TIP_RADIUS, 0.75, 0.6), steps=3),
            tube(neck, (_TIP_RADIUS, 0.75, 0.7, 0.6), steps=3),
        ]
    )


def _incisor(ear: Ear, depth: float) -> Solid:
    line = ear.at(
        (4.6, 22.0, -15.4), (3.2, 28.0, -15.4), (2.0, 34.0, -14.4), (1.3, 39.0, -12.4), (1.05, 42.6, -9.6),
        (1.0, 44.2, -7.4),
    )  # fmt: skip
    return tube(line, np.array([0.7, 0.9, 0.9, 0.88, 0.85, 0.5]) - depth, steps=4)
