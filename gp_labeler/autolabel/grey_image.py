"""Grey values on a grid of equal steps, so that tissue is near 0 and bone near 1: what is registered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.head_pose.bone import CoarseScan

__all__ = ["Affine", "GreyImage", "SampleGrid", "normalised", "sampled", "smoothed_for"]

_Values = NDArray[np.float32]

_LOWEST, _HIGHEST = -0.2, 1.5
_BONE_PERCENT = 75
_SMOOTHING = 0.45
"""Of a voxel: the standard deviation that a voxel itself amounts to."""

_FEWEST_SAMPLES = 16
"""Along each axis: registration begins at a quarter of them, and needs four there."""


@dataclass(frozen=True, eq=False)
class Affine:
    """An affine map of points: ``p = matrix @ q + shift``."""

    matrix: FloatArray
    shift: FloatArray

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return points (N, 3) moved."""
        moved: FloatArray = points @ self.matrix.T + self.shift
        return moved

    @classmethod
    def fitted(cls, points: FloatArray, moved: FloatArray) -> Affine:
        """Return the affine map that takes points (N, 3) to where they were moved, as nearly as it can."""
        design = np.column_stack([points, np.ones(len(points))])
        found = np.linalg.lstsq(design, moved, rcond=None)[0]
        return cls(np.asarray(found[:3].T, dtype=np.float64), np.asarray(found[3], dtype=np.float64))


@dataclass(frozen=True, eq=False)
class SampleGrid:
    """A grid of equal steps along x, y, z.

    Parameters
    ----------
    origin : (3,) array, LPS mm
        Centre of the first voxel.
    step : float
        mm.
    size : (int, int, int)
        Along x, y, z.
    """

    origin: FloatArray
    step: float
    size: tuple[int, int, int]

    @classmethod
    def around(cls, low: FloatArray, high: FloatArray, step: float) -> SampleGrid:
        """Return the grid that holds a box, which is in its middle where it is thinner than a grid may be."""
        size = np.ceil((high - low) / step).astype(int) + 1
        missing = np.maximum(_FEWEST_SAMPLES - size, 0)
        nx, ny, nz = (int(n) for n in size + missing)
        origin = np.asarray(low, dtype=np.float64) - step * (missing // 2)
        return cls(origin, step, (nx, ny, nz))

    @property
    def high(self) -> FloatArray:
        """(3,) centre of the last voxel, LPS mm."""
        return self.origin + self.step * (np.array(self.size) - 1)

    def lattice(self, n: int) -> FloatArray:
        """Return n x n x n points (n^3, 3) from corner to corner, LPS mm."""
        shares = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        points: FloatArray = self.origin + shares * (self.high - self.origin)
        return points

    def displaced(self, field: NDArray[np.float32], points: FloatArray) -> FloatArray:
        """Return points (N, 3) moved by a field of displacements (nz, ny, nx, 3), mm."""
        from scipy.ndimage import map_coordinates

        index = ((points - self.origin) / self.step)[:, ::-1].T
        moves = [map_coordinates(field[..., c], index, order=1, mode="nearest") for c in range(3)]
        return points + np.stack(moves, axis=1)


@dataclass(frozen=True, eq=False)
class GreyImage:
    """Normalised grey values on a grid.

    Parameters
    ----------
    grid : SampleGrid
    values : (nz, ny, nx) float32 array
        Tissue near 0, bone near 1.
    """

    grid: SampleGrid
    values: _Values

    def packed(self) -> NDArray[np.uint8]:
        """Return the values in 256 steps."""
        share = (self.values - _LOWEST) / (_HIGHEST - _LOWEST)
        return np.asarray(np.rint(255 * np.clip(share, 0.0, 1.0)), dtype=np.uint8)

    @classmethod
    def unpacked(cls, grid: SampleGrid, packed: NDArray[np.uint8]) -> GreyImage:
        """Return the image that was packed."""
        values = packed.astype(np.float32) * np.float32((_HIGHEST - _LOWEST) / 255) + np.float32(_LOWEST)
        return cls(grid, values)


def smoothed_for(scan: CoarseScan, step: float) -> CoarseScan:
    """Return a scan smoothed as much as is needed before it is sampled at a step, mm."""
    from scipy.ndimage import gaussian_filter

    spacing = scan.spacing
    sigma = _SMOOTHING * np.sqrt(np.maximum(step**2 - spacing**2, 0.0)) / spacing
    values = np.asarray(scan.grid, dtype=np.float32)
    if scan.measured is not None and not scan.measured.all():
        lowest = values[scan.measured].min() if scan.measured.any() else 0.0
        values = np.where(scan.measured, values, np.float32(lowest))
    if sigma.max() > 0.1:
        values = gaussian_filter(values, sigma[::-1], truncate=3.0)
    return CoarseScan(values, scan.T_scan_index, scan.measured)


def sampled(scan: CoarseScan, grid: SampleGrid, where: Affine, threshold: float) -> GreyImage:
    """Return a scan's grey values, normalised, at the places to which a grid's points are moved.

    Parameters
    ----------
    scan : CoarseScan
        Smoothed for the grid's step.
    grid : SampleGrid
    where : Affine
        From the grid's frame to the scan, LPS mm.
    threshold : float
        Grey value at which bone begins in the scan.
    """
    from scipy.ndimage import affine_transform

    to_index = scan.T_index_scan[:3, :3] @ where.matrix
    first = scan.T_index_scan[:3, :3] @ where(grid.origin[None])[0] + scan.T_index_scan[:3, 3]
    matrix = (grid.step * to_index)[::-1, ::-1]
    values = affine_transform(
        scan.grid,
        matrix,
        offset=first[::-1],
        output_shape=grid.size[::-1],
        order=1,
        mode="constant",
        cval=float(scan.grid.min()),
        output=np.float32,
    )
    return GreyImage(grid, normalised(values, threshold))


def normalised(values: _Values, threshold: float) -> _Values:
    """Return grey values so that the median of what is not bone is 0, and dense bone 1."""
    is_bone = values > threshold
    low = float(np.median(values[~is_bone])) if not is_bone.all() else float(values.min())
    high = float(np.percentile(values[is_bone], _BONE_PERCENT)) if is_bone.any() else threshold + 1.0
    scaled = (values - np.float32(low)) / np.float32(max(high - low, 1e-6))
    return np.asarray(np.clip(scaled, _LOWEST, _HIGHEST), dtype=np.float32)
