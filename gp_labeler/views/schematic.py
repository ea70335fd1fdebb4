"""A flat schematic of ear and head, made from the atlas: what the pictures of features are drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.landmarks.features import CODES, Side, feature
from gp_core.validation import FloatArray

__all__ = [
    "AXIS",
    "EDGE",
    "FAR",
    "GROUNDS",
    "HEAD",
    "ORBITAL",
    "OUTLINE",
    "SKULL",
    "WINDOW",
    "Schematic",
    "ground_of",
    "ground_schematic",
]

FAR = ("IN", "ZL")
"""Features so far from the ear that the picture must show the head."""

_LEVEL_RAD = np.deg2rad(-19.0)
"""Turns the CO frame about the ear-to-ear axis until the head is level, as in a side view of a skull."""

_TURNS, _BASE_RADIUS, _TOP_RADIUS, _FIRST, _LAST = 3.6, 1.75, 0.35, 0.55, 3.95
"""The cochlear tube around the axis CB-CA: turns, and mm; drawn, not measured."""

HEAD = "head"
GROUNDS = ("coronal", "axial", "sagittal", "3D", HEAD)
"""What pictures of features show: the ear from a direction, or the head from the side."""

WINDOW, AXIS, EDGE, SKULL, OUTLINE, ORBITAL = "#56b4e9", "#e69f00", "#50472f", "#d9cfb9", "#8a7f68", "#101010"
"""Colours in the files that a theme replaces: of round window, modiolar axis, the coil's edge, skull, its
outline and orbit. Other bone is ``currentColor``."""

_PLANES: Mapping[str, tuple[tuple[float, ...], tuple[float, ...], str]] = {
    "coronal": ((0, 1, 0), (0, 0, 1), "RLIS"),
    "axial": ((0, 1, 0), (1, 0, 0), "RLPA"),
    "sagittal": ((-1, 0, 0), (0, 0, 1), "APIS"),
    "3D": ((-0.93, -0.36, 0.0), (0.10, -0.27, 0.96), "APIS"),
}
"""Of the left side: what points right and up on the picture, and the letters left, right, below, above."""

_HEAD = tuple(
    np.array(outline, dtype=np.float64).reshape(-1, 2)
    for outline in (
        [-14, -3, -15.5, 5, -11, 12, -2, 15, 10, 15, 21, 12.6, 33, 8.6, 42, 5, 48.5, 1.5, 48.5, -2,
         46.2, -4.6, 47.4, -10.5, 46.8, -12.6, 45.4, -11, 44.2, -6.5, 36, -5, 28, -6, 20, -5.5,
         12, -4.5, 6, -3, 3, -5.5, -3, -6, -8, -5],
        [45.6, -10.5, 45.4, -12.6, 42, -14.2, 35, -12.6, 30, -16.2, 20, -18, 9, -18.6, -2, -17,
         1, -13, 4, -10, 6.4, -1, 9, -4, 13, -7.5, 24, -8.2, 33, -8.6, 40, -11.6],
        [19, 3.5, 22, 8, 27.5, 8.2, 30.5, 4, 28.5, -0.5, 22.5, -1.2],
        [5.5, 2.2, 13, 0.8, 20, -1, 27, -2.2, 27, -4, 19, -3.2, 12, -1, 5.5, 0.6],
    )
)  # fmt: skip
"""A guinea pig's skull, mandible, orbit and zygoma from the left: mm forwards and upwards of the ear, in
turns; drawn by hand, not measured."""


@dataclass(frozen=True, eq=False)
class Schematic:
    """Ear and head as one direction of view shows them, in mm of the picture: x to the right, y upwards.

    Parameters
    ----------
    ground : str
        One of `GROUNDS`: the file in ``resources/pictures`` that shows the ear (and the head) alone.
    axes : (3, 3) array
        What points right, up and at the beholder, in the frame of the atlas.
    points : mapping of str to (2,) array
        The features.
    depths : mapping of str to float
        How near the beholder each of them is, mm.
    coil : (n, 2) array
        The cochlear tube, from the round window to the apex.
    head : tuple of (n, 2) arrays
        Outlines of the skull and what is on it; empty where the picture is of the ear alone.
    letters : str
        Left, right, below and above on the picture, as on slices.
    """

    ground: str
    axes: FloatArray
    points: Mapping[str, FloatArray]
    depths: Mapping[str, float]
    coil: FloatArray
    head: tuple[FloatArray, ...]
    letters: str

    def box_around(self, code: str) -> FloatArray:
        """Return the lower left and upper right corner of what the picture of a feature shows, (2, 2)."""
        far = self.ground == HEAD
        codes = [c for c in CODES if far or c == code or c not in (*FAR, "MN")]
        corners = np.vstack([np.array([self.points[c] for c in codes]), self.coil, *self.head])
        return np.stack([corners.min(axis=0), corners.max(axis=0)])


def ground_of(code: str) -> str:
    """Return which of the `GROUNDS` the picture of a feature has."""
    return HEAD if code in FAR else feature(code).view


@cache
def ground_schematic(ground: str, side: Side) -> Schematic:
    """Return one of the `GROUNDS`, of the left or the right ear."""
    far, atlas = ground == HEAD, Atlas.published()
    view = "sagittal" if far else ground
    right, up, letters = _PLANES[view]
    axes = np.array([right, up, np.cross(right, up)], dtype=np.float64)
    if far:
        axes[:2, [0, 2]] = _turned(axes[:2, [0, 2]])
    if side is Side.RIGHT:
        axes, letters = _mirrored(axes, view, letters)
    shown = {c: axes @ atlas[c] for c in CODES}
    forwards = np.array([1.0 if side is Side.RIGHT else -1.0, 1.0])
    return Schematic(
        ground,
        axes,
        {c: xyz[:2] for c, xyz in shown.items()},
        {c: float(xyz[2]) for c, xyz in shown.items()},
        (_coil() @ axes.T)[:, :2],
        tuple(outline * forwards for outline in _HEAD) if far else (),
        letters,
    )


def _turned(directions: FloatArray) -> FloatArray:
    """Turn (n, 2) directions (x, z) so that what they show is turned level."""
    c, s = np.cos(_LEVEL_RAD), np.sin(_LEVEL_RAD)
    turned: FloatArray = directions @ np.array([[c, -s], [s, c]])
    return turned


def _mirrored(axes: FloatArray, view: str, letters: str) -> tuple[FloatArray, str]:
    """Return axes and letters for the right ear, whose outward direction is the other way.

    The atlas is a left ear; mirrored between left and right, outwards becomes left on coronal and axial
    pictures, and from the side the nose points to the right.
    """
    flipped = axes.copy()
    flipped[0] *= -1
    if view in ("coronal", "axial"):
        return flipped, letters
    return flipped, letters[1] + letters[0] + letters[2:]


def _coil() -> FloatArray:
    """Return the (n, 3) middle line of the cochlear tube in the atlas frame of a left ear."""
    t = np.linspace(0.0, 1.0, 120)
    angle = 2 * np.pi * _TURNS * t
    radius = _BASE_RADIUS + (_TOP_RADIUS - _BASE_RADIUS) * t
    along = _FIRST + (_LAST - _FIRST) * t
    line: FloatArray = np.stack([along, radius * np.cos(angle), -radius * np.sin(angle)], axis=1)
    return line
