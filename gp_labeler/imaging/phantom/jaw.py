"""The lower jaw of a phantom: body, ramus, angular process, teeth, and the condyle that ends in MN."""

from __future__ import annotations

import numpy as np

from gp_labeler.imaging.phantom import grey
from gp_labeler.imaging.phantom.canvas import Canvas
from gp_labeler.imaging.phantom.layout import Ear, HeadLayout
from gp_labeler.imaging.phantom.solids import Solid, sheet, tube, union

__all__ = ["paint_jaw"]

_TIP_RADIUS = 0.5


def paint_jaw(canvas: Canvas, head: HeadLayout) -> None:
    """Paint both halves of the lower jaw with their teeth."""
    for ear in head.ears:
        canvas.paint(_half_jaw(ear), grey.BONE)
        for a in (14.6, 18.2, 21.8, 25.2):
            tooth = ear.at((6.0 + 0.1 * (20 - a), a, -14.0), (5.4 + 0.1 * (20 - a), a, -9.3))
            canvas.paint(tube(tooth, 1.4 * head.scale), grey.ENAMEL)
            canvas.paint(tube(tooth - (0, 0, 0.2), 0.9 * head.scale), grey.BONE)
        canvas.paint(_incisor(ear, 0.0), grey.ENAMEL)
        canvas.paint(_incisor(ear, 0.35), grey.DENTINE)


def _half_jaw(ear: Ear) -> Solid:
    upper = ear.at(
        (1.5, 40.0, -11.8), (2.2, 36.0, -12.4), (3.4, 30.0, -12.4), (5.0, 26.5, -11.0), (6.6, 17.0, -10.6),
        (8.2, 13.4, -8.8),
    )  # fmt: skip
    lower = ear.at(
        (1.3, 39.0, -13.6), (1.9, 35.0, -15.4), (3.8, 29.0, -16.4), (6.0, 23.0, -17.0), (8.2, 16.0, -17.2),
        (9.6, 10.0, -17.0),
    )  # fmt: skip
    back = ear.at((8.2, 13.4, -8.8), (9.6, 10.6, -7.4), (10.6, 8.6, -6.0), (11.6, 7.4, -3.6))
    angle = ear.at((9.6, 10.0, -17.0), (10.6, 4.0, -16.2), (11.2, 3.0, -12.6), (11.2, 5.6, -7.6))
    spur = ear.at((10.6, 4.0, -16.2), (11.3, -1.0, -15.4), (11.4, -4.4, -14.4))
    tooth_row = ear.at((5.0, 26.5, -12.4), (6.0, 20.0, -12.6), (6.8, 13.6, -12.2))
    return union(
        [
            sheet(upper, lower, (0.9, 1.1, 1.0, 0.9, 0.75, 0.6)),
            sheet(back, angle, (0.6, 0.5, 0.5, 0.6)),
            tube(lower, (0.8, 1.1, 1.2, 1.2, 1.1, 0.8)),
            tube(spur, (0.8, 0.7, 0.5)),
            tube(tooth_row, 1.9),
            tube(ear.at((8.2, 13.4, -8.8), (9.3, 12.0, -5.6)), (0.7, 0.45)),
            _condyle(ear),
        ]
    )


def _condyle(ear: Ear) -> Solid:
    """Return the condylar process; the farthest point of it towards the back and up is MN."""
    tip = ear["MN"] - _TIP_RADIUS * ear.towards(0, -1, 1)
    forward, up = ear.towards(0, 1, 0), ear.towards(0, 0, 1)
    head = np.stack([tip, tip + 1.3 * forward - 0.35 * up, tip + 2.6 * forward - 1.3 * up])
    neck = np.stack([tip, tip + 0.9 * forward - 1.3 * up, ear.at((11.6, 7.4, -3.6)), ear.at((10.6, 8.6, -6.0))])
    return union([tube(head, (_TIP_RADIUS, 0.75, 0.6)), tube(neck, (_TIP_RADIUS, 0.75, 0.7, 0.6))])


def _incisor(ear: Ear, depth: float) -> Solid:
    line = ear.at(
        (4.6, 22.0, -15.4), (3.2, 28.0, -15.4), (2.0, 34.0, -14.4), (1.3, 39.0, -12.4), (1.05, 42.6, -9.6),
        (1.0, 44.2, -7.4),
    )  # fmt: skip
    return tube(line, np.array([0.7, 0.9, 0.9, 0.88, 0.85, 0.5]) - depth)
