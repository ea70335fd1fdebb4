"""The cochlea of the mean guinea pig as bodies in the cochlea frame: its duct and its modiolus."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray
from gp_labeler.imaging.coil import Coil

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["BASE_MM", "COIL", "cochlea_tubes", "duct_curve"]

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
def cochlea_tubes(side: Side) -> tuple[pv.PolyData, pv.PolyData]:
    """Return the duct and the modiolus, closed, with outward triangles and normals, cochlea frame, mm."""
    shares, radii = np.array(_MODIOLUS).T
    core = np.zeros((len(shares), 3))
    core[:, 0] = BASE_MM + shares * COIL.length
    return _tube(*duct_curve(side)), _tube(core, radii)


def _tube(line: FloatArray, radii: FloatArray) -> pv.PolyData:
    """Make the closed tube about a line of points, with rounded ends."""
    import pyvista as pv  # takes 0.6 s: not before the window shows

    line, radii = _rounded(line, radii)
    middle = pv.MultipleLines(points=line)
    middle["radius"] = radii
    tube = middle.tube(scalars="radius", absolute=True, n_sides=_AROUND)
    tube.clear_data()
    closed: pv.PolyData = tube.triangulate().clean()
    smooth: pv.PolyData = closed.compute_normals(
        cell_normals=False, split_vertices=False, auto_orient_normals=True
    )
    return smooth


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
