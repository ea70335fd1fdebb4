"""How far places of a scan are from the surface of bone: looked up, coarsely, for many trials of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray

if TYPE_CHECKING:
    from gp_labeler.head_pose.bone import Bone

__all__ = ["CLIP", "DistanceField"]

CLIP, _OUTSIDE = 6.0, -0.3
"""Distances are clipped at radius / 6; a point beyond the scan scores neither well nor badly."""

_CELLS = 2.5
"""Cells of the field to the clipping distance, at least."""


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Clipped distances to the surface of a bone, on a padded grid of cells.

    Parameters
    ----------
    values : (n,) float32 array
        Distance less the clipping distance, mm, at most 0; cells in the order z, y, x.
    size : (3,) array
        Cells along x, y, z.
    T_index_scan : (4, 4) array
        From LPS mm to the index (i, j, k) of a cell.
    """

    values: NDArray[np.float32]
    size: NDArray[np.intp]
    T_index_scan: FloatArray

    @classmethod
    def of(cls, bone: Bone) -> DistanceField:
        """Make the field of a bone; its cells are blocks of voxels where those are small."""
        from scipy.ndimage import distance_transform_edt

        scan, clip = bone.scan, bone.radius / CLIP
        factors = np.maximum(1, clip / (_CELLS * scan.spacing)).astype(int)
        away = ~np.asarray(_blocks(bone.surface, factors).any(axis=(1, 3, 5)))
        distance = distance_transform_edt(away, sampling=(factors * scan.spacing)[::-1])
        below = np.minimum(distance - clip, 0.0).astype(np.float32)
        if scan.measured is not None:
            below[_blocks(scan.measured, factors).mean(axis=(1, 3, 5)) <= 0.5] = _OUTSIDE * clip
        padded = np.pad(below, 1, constant_values=_OUTSIDE * clip)
        T_cell_voxel = np.eye(4)
        T_cell_voxel[:3, :3] /= factors[:, None]
        T_cell_voxel[:3, 3] = 1 - (factors - 1) / (2 * factors)
        return cls(padded.ravel(), np.array(padded.shape[::-1]), T_cell_voxel @ scan.T_index_scan)

    def indices(self, points: FloatArray) -> FloatArray:
        """Return the indices (N, 3), fractions, of points (N, 3), LPS mm."""
        found: FloatArray = points @ self.T_index_scan[:3, :3].T + self.T_index_scan[:3, 3]
        return found

    def means(self, indices: FloatArray) -> NDArray[np.float32]:
        """Return the mean value (M,) of each of M sets of indices (M, N, 3)."""
        at = np.rint(indices).astype(np.intp)
        i, j, k = np.moveaxis(np.clip(at, 0, self.size - 1), -1, 0)
        found: NDArray[np.float32] = self.values[(k * self.size[1] + j) * self.size[0] + i].mean(axis=1)
        return found


def _blocks(mask: NDArray[np.bool_], factors: NDArray[np.int_]) -> NDArray[np.bool_]:
    """Return a (z, y, x) mask as blocks (nz, fz, ny, fy, nx, fx); a rest is one more block."""
    fx, fy, fz = (int(f) for f in factors)
    missing = [(0, -n % f) for n, f in zip(mask.shape, (fz, fy, fx), strict=True)]
    padded = np.pad(mask, missing)
    nz, ny, nx = (n // f for n, f in zip(padded.shape, (fz, fy, fx), strict=True))
    return padded.reshape(nz, fz, ny, fy, nx, fx)
