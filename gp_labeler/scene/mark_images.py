"""What a landmark looks like: a small lit solid with a dark rim and soft edges, crisp on any bone."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.scene.colours import rgb

__all__ = ["mark_image"]

_LARGEST = 400.0
_RIM_PIXELS = 1.1
_RIM_TONE = 0.42
_AMBIENT = 0.34
_LIGHT = np.array([-0.42, -0.55, 0.72])
"""Towards the light: right, down, and towards the eye."""

_SHINE, _POWER = 0.45, 18.0
_TRIANGLE = np.array([[0.0, -1.0], [0.87, 0.5], [-0.87, 0.5]])
"""Unit vectors across the sides of a triangle that stands on its base are the opposite of these."""


@lru_cache(maxsize=256)
def mark_image(shape: str, colour: str, diameter: float, opacity: float = 1.0) -> NDArray[np.float32]:
    """Draw a landmark; return (n, n, 4) red, green, blue, opacity from 0 to 1, n odd, itself in the middle.

    Parameters
    ----------
    shape : str
        ``ball``, ``diamond``, ``triangle``, ``frame`` or ``inverted``: a hollow triangle on its tip.
    colour : str
        ``#RRGGBB``.
    diameter : float
        Pixels.
    opacity : float
        From 0 to 1.
    """
    radius = max(1.0, min(diameter, _LARGEST) / 2)
    half = int(np.ceil(1.5 * radius)) + 1
    y, x = np.mgrid[-half : half + 1, -half : half + 1] / radius
    inside, normals = _SOLIDS[shape](x, y)
    depth = inside * radius
    tone = _lit(normals)
    rim = np.clip(_RIM_PIXELS + 0.5 - depth, 0, 1) if radius > 2 else np.zeros_like(depth)
    tone = tone * (1 - rim) + _RIM_TONE * rim
    image = np.empty((*depth.shape, 4), dtype=np.float32)
    shine = np.clip(tone - 1, 0, 1)[..., None]
    image[..., :3] = np.clip(tone, 0, 1)[..., None] * np.array(rgb(colour)) * (1 - shine) + shine
    image[..., 3] = np.clip(depth + 0.5, 0, 1) * opacity
    image.setflags(write=False)
    return image


def _lit(normals: FloatArray) -> FloatArray:
    """Return how bright surfaces of (..., 3) normals are; above 1 they shine white."""
    light = _LIGHT / np.linalg.norm(_LIGHT)
    facing = np.clip(normals @ light, 0, 1)
    mirrored = 2 * facing * normals[..., 2] - light[2]
    tone: FloatArray = _AMBIENT + 0.72 * facing + _SHINE * np.clip(mirrored, 0, 1) ** _POWER
    return tone


def _ball(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far (in radii) positions lie inside, and the normals there."""
    away = np.hypot(x, y)
    nearer = np.sqrt(np.clip(1 - away**2, 0, 1))
    return 1 - away, np.stack([x, y, nearer], axis=-1) / np.maximum(away, 1.0)[..., None]


def _diamond(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    corner = 1.25
    inside = (corner - np.abs(x) - np.abs(y)) / np.sqrt(2)
    normals = np.stack([np.sign(x), np.sign(y), np.ones_like(x)], axis=-1)
    return inside, normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def _triangle(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the same of an upright pyramid seen from above its tip."""
    across = -_TRIANGLE[:, 0] * x[..., None] - _TRIANGLE[:, 1] * (y[..., None] - 0.1)
    side = across.argmax(axis=-1)
    normals = np.concatenate([-_TRIANGLE[side], np.full((*side.shape, 1), 0.9)], axis=-1)
    inside: FloatArray = 0.68 - across.max(axis=-1)
    return inside, normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def _frame(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the same of a square with a hole: nothing hides what lies beneath it, which is to be judged."""
    out = np.maximum(np.abs(x), np.abs(y))
    inside = np.minimum(1.1 - out, out - 0.55)
    return inside, np.broadcast_to([0.0, 0.0, 1.0], (*x.shape, 3))


def _inverted(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the same of a triangle on its tip, with a hole."""
    within, _ = _triangle(x, -y)
    inside = np.minimum(within, 0.42 - within)
    return inside, np.broadcast_to([0.0, 0.0, 1.0], (*x.shape, 3))


_SOLIDS = {
    "ball": _ball,
    "diamond": _diamond,
    "triangle": _triangle,
    "frame": _frame,
    "inverted": _inverted,
}
