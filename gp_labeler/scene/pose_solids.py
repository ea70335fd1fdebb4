"""Small solids of length and thickness 1 along x: rod, arrow head, ball, diamond, cube."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gp_core.checks import FloatArray

__all__ = ["BALL", "CUBE", "DIAMOND", "HEAD", "ROD", "SHAPES", "Shape"]

ROD, HEAD, BALL, DIAMOND, CUBE = range(5)
"""Numbers of `SHAPES`: a rod begins at its place and a head ends there; the others lie about theirs."""

_SIDES = 12


@dataclass(frozen=True, eq=False)
class Shape:
    """A solid.

    Parameters
    ----------
    points, normals : (N, 3) float array
        Corners, once for each face that is flat.
    triangles : (T, 3) int array
        Numbers of corners.
    """

    points: FloatArray
    normals: FloatArray
    triangles: NDArray[np.int64]


def _lathe(profile: FloatArray, sides: int = _SIDES) -> Shape:
    """Turn the outline (P, 2), along and across, about x; a point that comes twice makes an edge."""
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    round_x = np.stack([np.zeros(sides + 1), np.cos(turn), np.sin(turn)], axis=1)
    points = profile[:, None, :1] * np.eye(3)[0] + profile[:, None, 1:] * round_x
    steps = np.diff(profile, axis=0)
    out = np.stack([-steps[:, 1], steps[:, 0]], axis=1)
    flat = np.linalg.norm(steps, axis=1) < 1e-9
    before = np.concatenate([out[:1], out])
    after = np.concatenate([out, out[-1:]])
    start, end = np.append(flat, False), np.insert(flat, 0, False)
    slope = np.where(start[:, None], before, np.where(end[:, None], after, before + after))
    slope /= np.linalg.norm(slope, axis=1, keepdims=True)
    normals = slope[:, None, :1] * np.eye(3)[0] + slope[:, None, 1:] * round_x
    rows = (sides + 1) * np.flatnonzero(~flat)[:, None] + np.arange(sides)
    a, b, c, d = rows, rows + 1, rows + sides + 2, rows + sides + 1
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    return _outward(points.reshape(-1, 3), normals.reshape(-1, 3), triangles.astype(np.int64))


def _faceted(corners: FloatArray, faces: NDArray[np.int64]) -> Shape:
    points = corners[faces]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals *= np.sign((normals * points.mean(axis=1)).sum(axis=1))[:, None]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    numbers = np.arange(points.size // 3, dtype=np.int64).reshape(-1, 3)
    return _outward(points.reshape(-1, 3), np.repeat(normals, 3, axis=0), numbers)


def _outward(points: FloatArray, normals: FloatArray, triangles: NDArray[np.int64]) -> Shape:
    """Turn every triangle so that it faces outward, and drop those without area."""
    a, b, c = points[triangles.T]
    facing = np.cross(b - a, c - a)
    whole = np.linalg.norm(facing, axis=1) > 1e-9
    inward = (facing * normals[triangles].sum(axis=1)).sum(axis=1) < 0
    turned = np.where(inward[:, None], triangles[:, ::-1], triangles)[whole]
    return Shape(points, normals, turned)


def _ball() -> Shape:
    turn = np.linspace(np.pi, 0, 11)
    return _lathe(0.5 * np.stack([np.cos(turn), np.sin(turn)], axis=1), 16)


def _diamond() -> Shape:
    corners = 0.5 * np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array([[x, y, z] for x in (0, 3) for y in (1, 4) for z in (2, 5)], dtype=np.int64)
    return _faceted(corners, faces)


def _cube() -> Shape:
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    squares = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = np.array([[a, b, c] for a, b, c, d in squares] + [[a, c, d] for a, b, c, d in squares])
    return _faceted(corners, faces.astype(np.int64))


SHAPES = (
    _lathe(np.array([[0, 0], [0, 0.5], [0, 0.5], [1, 0.5], [1, 0.5], [1, 0]])),
    _lathe(np.array([[-1, 0], [-1, 0.5], [-1, 0.5], [0, 0]]), 20),
    _ball(),
    _diamond(),
    _cube(),
)
