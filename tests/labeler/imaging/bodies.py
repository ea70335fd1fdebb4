"""A body without symmetry whose surface is known, as voxels on any grid; how far a file's surface is off."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator

from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.surface import Surface, extract_isosurface
from gp_labeler.imaging.volume import Volume

SIZE = (46, 40, 34)
SPACING = np.array([0.25, 0.25, 0.3])
ORIGIN = np.array([-4.1, 3.3, 12.7])
LEVEL = 1000
AIR = 100
_SPHERES = [((0, 0, 0), 2.9), ((2.6, 0.9, 1.2), 1.5), ((-1.2, 2.2, -1.8), 1.2), ((0.3, -2.1, 2.3), 1.1)]
_BLEND = 0.4
_PER_MM = 900


def affine(direction: np.ndarray | None = None) -> np.ndarray:
    """From (i, j, k) to LPS mm."""
    made = np.eye(4)
    made[:3, :3] = (np.eye(3) if direction is None else direction) * SPACING
    made[:3, 3] = ORIGIN
    return made


def voxels(grid: np.ndarray | None = None, dtype: str = "uint16") -> np.ndarray:
    """(z, y, x) grey values of the body in the middle of the grid."""
    grid = affine() if grid is None else grid
    k, j, i = np.meshgrid(*(np.arange(n) for n in SIZE[::-1]), indexing="ij")
    points = np.stack([i, j, k], axis=-1) @ grid[:3, :3].T + grid[:3, 3]
    values = LEVEL - _PER_MM * outside(points, middle(grid))
    top = 250 if np.dtype(dtype).itemsize == 1 else 1900
    scale = top / 1900
    return np.rint(np.clip(values, AIR, 1900) * scale).astype(dtype)


def middle(grid: np.ndarray) -> np.ndarray:
    return grid[:3, :3] @ ((np.array(SIZE) - 1) / 2) + grid[:3, 3]


def outside(points: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Distance from the body's surface, mm, smooth where its spheres meet."""
    total = np.zeros(points.shape[:-1])
    for place, radius in _SPHERES:
        total += np.exp(-(np.linalg.norm(points - centre - place, axis=-1) - radius) / _BLEND)
    return -_BLEND * np.log(total)


def surface_of(volume: Volume, level: float = LEVEL) -> Surface:
    return extract_isosurface(volume, level, smallest_mm=0)


def off_by(path: Path, grid: np.ndarray | None = None, level: float = LEVEL, **options: Any) -> float:
    """Return how far the surface read from a file is from that of the voxels, in voxels, at worst."""
    grid = affine() if grid is None else grid
    found = surface_of(read_volume(path, **options), level)
    expected = surface_of(Volume(voxels(grid), grid))
    return max(_distance(found, expected), _distance(expected, found)) / SPACING.min()


def _distance(one: Surface, other: Surface) -> float:
    """Return how far a vertex of one surface lies from the other, mm, at worst."""
    locator = vtkStaticCellLocator()
    locator.SetDataSet(other.mesh)
    locator.BuildLocator()
    nearest, cell, part, squared = [0.0] * 3, reference(0), reference(0), reference(0.0)
    apart = 0.0
    for point in one.points.tolist():
        locator.FindClosestPoint(point, nearest, cell, part, squared)
        apart = max(apart, float(squared))
    return apart**0.5
