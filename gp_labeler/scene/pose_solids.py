"""Small solids of length and thickness 1 along x: rod, arrow head, ball, diamond, cube."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["BALL", "CUBE", "DIAMOND", "HEAD", "ROD", "SolidMesh", "solid_mesh"]

ROD, HEAD, BALL, DIAMOND, CUBE = range(5)
"""A rod begins at its place and a head ends there; the others lie about theirs."""

_SHARP_DEG = 45.0
"""Edges sharper than this are drawn as edges, others smoothly."""


class SolidMesh(NamedTuple):
    """Points (N, 3) and outward normals (N, 3), and the (T, 3) corners of triangles."""

    points: FloatArray
    normals: FloatArray
    triangles: NDArray[np.int64]


@cache
def solid_mesh(shape: int) -> SolidMesh:
    """Return triangles with outward normals, a corner repeated for each flat face that meets there.

    Parameters
    ----------
    shape : int
        ``ROD``, ``HEAD``, ``BALL``, ``DIAMOND`` or ``CUBE``.
    """
    import pyvista as pv  # takes 0.6 s: not before the window shows

    x, middle, back = (1.0, 0.0, 0.0), (0.5, 0.0, 0.0), (-0.5, 0.0, 0.0)
    make: dict[int, Callable[[], pv.PolyData]] = {
        ROD: lambda: pv.Cylinder(center=middle, direction=x, radius=0.5, height=1.0, resolution=12),
        HEAD: lambda: pv.Cone(center=back, direction=x, radius=0.5, height=1.0, resolution=20),
        BALL: lambda: pv.Sphere(radius=0.5, theta_resolution=16, phi_resolution=12, direction=x),
        DIAMOND: lambda: pv.Octahedron(radius=0.5).rotate_z(45.0),
        CUBE: lambda: pv.Cube(),
    }
    mesh: pv.PolyData = make[shape]().triangulate()
    smooth: pv.PolyData = mesh.compute_normals(
        cell_normals=False, split_vertices=True, feature_angle=_SHARP_DEG, auto_orient_normals=True
    )
    points, normals = (np.array(values, dtype=np.float64) for values in (smooth.points, smooth.point_normals))
    return SolidMesh(points, normals, np.array(smooth.regular_faces))
