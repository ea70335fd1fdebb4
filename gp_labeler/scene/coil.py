"""The outline of a guinea pig's cochlea in the cochlea frame, and where a slice cuts it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gp_core.checks import FloatArray
from gp_core.landmarks.features import Side
from gp_labeler.imaging.coil import Coil
from gp_labeler.scene.pose_data import DrawnPose

__all__ = ["BASE_MM", "COIL", "Tube", "cochlea_tubes", "duct_curve", "section"]

COIL = Coil(length=4.64, cc=(2.77, 1.31), cl=(1.5, 2.32))
"""The mean guinea pig's: CB to CA, and CC and CL about that axis, from the published distances."""

BASE_MM = -0.3
"""Where CB lies on the axis of the mean cochlea: a little behind CO."""

_WINDOW = (0.0, 1.85, 0.0)
"""Where the duct begins: inside the round window, whose middle is at y = 2.35 mm."""

_AROUND = 14
_PER_TURN = 24
_MODIOLUS = ((0.0, 0.62), (0.3, 0.45), (0.8, 0.2))
"""Height, as a share of CB-CA, and radius (mm) of the modiolus."""


@dataclass(frozen=True, eq=False)
class Tube:
    """A closed tube.

    Parameters
    ----------
    points : (N, 3) float array
        Cochlea frame, mm.
    triangles : (T, 3) int array
        Corners, counter-clockwise from without.
    """

    points: FloatArray
    triangles: NDArray[np.int64]


def duct_curve(side: Side, per_turn: int = _PER_TURN) -> tuple[FloatArray, FloatArray]:
    """Return the middle (n, 3) of the duct from the round window to the apex, cochlea frame, and its radius.

    From the round window (y) the left duct turns towards -z, below, and winds forward about x; the right one
    is its mirror image in z.
    """
    height, rho, angle, thick = COIL.duct(per_turn)
    turn = -1.0 if side is Side.LEFT else 1.0
    wound = np.stack([BASE_MM + height, rho * np.cos(angle), turn * rho * np.sin(angle)], axis=1)
    top = [BASE_MM + COIL.length - thick[-1], 0.0, 0.0]
    line = np.concatenate([[_WINDOW], wound, [top]])
    return line, np.concatenate([thick[:1], thick, thick[-1:]])


@cache
def cochlea_tubes(side: Side) -> tuple[Tube, Tube]:
    """Return the duct and the modiolus of the mean cochlea."""
    shares, radii = np.array(_MODIOLUS).T
    core = np.zeros((len(shares), 3))
    core[:, 0] = BASE_MM + shares * COIL.length
    return _tube(*duct_curve(side)), _tube(core, radii)


def section(tube: Tube, pose: DrawnPose, axis: int, position: float) -> list[FloatArray]:
    """Cut a tube where it lies in the scan by a plane across a scan axis.

    Parameters
    ----------
    tube : Tube
        In the cochlea frame.
    pose : DrawnPose
        Where it lies.
    axis : int
        Scan axis across the plane: 0, 1 or 2.
    position : float
        Of the plane along it, mm.

    Returns
    -------
    list of (n, 3) float array
        Closed outlines in the scan, mm; none where the plane misses the tube.
    """
    matrix = pose.T_scan_cochlea
    depth = tube.points @ matrix[axis, :3] + (matrix[axis, 3] - position)
    ahead = depth > 0
    corners = tube.triangles
    cut = corners[ahead[corners].any(axis=1) & ~ahead[corners].all(axis=1)]
    if not len(cut):
        return []
    edges = np.sort(np.stack([cut, np.roll(cut, -1, axis=1)], axis=2), axis=2)  # (T, 3 edges, 2 ends)
    crossing = edges[ahead[edges[..., 0]] != ahead[edges[..., 1]]].reshape(-1, 2)
    keys, number = np.unique(crossing @ [len(depth), 1], return_inverse=True)
    ends = np.stack(np.divmod(keys, len(depth)), axis=1)
    first, last = depth[ends[:, 0]], depth[ends[:, 1]]
    share = (first / (first - last))[:, None]
    points = pose.at((1 - share) * tube.points[ends[:, 0]] + share * tube.points[ends[:, 1]])
    return [points[loop] for loop in _loops(number.reshape(-1, 2))]


def _loops(pairs: NDArray[np.int64]) -> list[list[int]]:
    """Join pairs of point numbers, each number in two pairs, into closed loops."""
    beside: dict[int, list[int]] = {}
    for a, b in pairs.tolist():
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    loops = []
    while beside:
        start, neighbours = beside.popitem()
        loop, here = [start], neighbours[0]
        while here != start:
            before, (one, other) = loop[-1], beside.pop(here)
            loop.append(here)
            here = other if one == before else one
        loops.append(loop)
    return loops


def _tube(line: FloatArray, radii: FloatArray) -> Tube:
    """Make the closed tube about a line of points, with rounded ends."""
    line, radii = _rounded(line, radii)
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = _carried(along)
    turn = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)[None, :, None]
    rings = np.cos(turn) * across[:, None] + np.sin(turn) * np.cross(along, across)[:, None]
    points = line[:, None] + radii[:, None, None] * rings
    n = len(line) * _AROUND
    ends = np.stack([line[0], line[-1]])
    return Tube(np.concatenate([points.reshape(-1, 3), ends]), _corners(len(line), n))


def _rounded(line: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Let a tube end in a quarter of a circle at either end rather than in a flat face."""
    turn = np.array([0.05, 0.35, 0.7])
    parts_line, parts_radii = [line], [radii]
    for end, before in ((0, 1), (-1, -2)):
        out = (line[end] - line[before]) / np.linalg.norm(line[end] - line[before])
        bulge = line[end] + radii[end] * np.cos(turn * np.pi / 2)[:, None] * out
        thin = radii[end] * np.sin(turn * np.pi / 2)
        at = 0 if end == 0 else len(parts_line)
        parts_line.insert(at, bulge if end == 0 else bulge[::-1])
        parts_radii.insert(at, thin if end == 0 else thin[::-1])
    return np.concatenate(parts_line), np.concatenate(parts_radii)


def _carried(along: FloatArray) -> FloatArray:
    """Return unit vectors across (n, 3) directions that turn as little as may be from one to the next."""
    across = np.empty_like(along)
    last = np.eye(3)[np.abs(along[0]).argmin()]
    for n, direction in enumerate(along):
        last = last - (last @ direction) * direction
        last = across[n] = last / np.linalg.norm(last)
    return across


def _corners(n_rings: int, n_points: int) -> NDArray[np.int64]:
    ring = np.arange(_AROUND)
    following = np.roll(ring, -1)
    first = _AROUND * np.arange(n_rings - 1)[:, None]
    a, b, c, d = (first + k for k in (ring, following, following + _AROUND, ring + _AROUND))
    sides = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    last = n_points - _AROUND
    start = np.stack([np.full(_AROUND, n_points), following, ring], axis=1)
    end = np.stack([np.full(_AROUND, n_points + 1), last + ring, last + following], axis=1)
    return np.concatenate([sides, start, end]).astype(np.int64)
