"""Two middle slices of a coarse volume, laid out as they appear on a screen, to check which side is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gp_labeler.imaging.volume import Volume

__all__ = ["PreviewPlane", "preview_planes"]


@dataclass(frozen=True, eq=False)
class PreviewPlane:
    """A slice through the middle.

    Parameters
    ----------
    name : str
        ``axial`` or ``coronal``.
    grey : (rows, columns) uint8 array
        From the top of the picture down.
    aspect : float
        Height of a pixel over its width.
    letters : str
        Directions at the left, right, bottom and top of the picture.
    """

    name: str
    grey: NDArray[np.uint8]
    aspect: float
    letters: str


def preview_planes(volume: Volume) -> tuple[PreviewPlane, PreviewPlane]:
    """Return the middle axial and coronal slice, the patient's right at the left as slices are shown."""
    array, (dx, dy, dz) = _along_lps(volume)
    low, high = volume.intensity_range
    above = np.subtract(array, low, dtype=np.float64)
    grey = (above * (255 / max(high - low, 1e-6))).clip(0, 255).astype(np.uint8)
    nz, ny, _ = grey.shape
    axial = PreviewPlane("axial", np.ascontiguousarray(grey[nz // 2]), dy / dx, "RLPA")
    coronal = PreviewPlane("coronal", np.ascontiguousarray(grey[::-1, ny // 2]), dz / dx, "RLIS")
    return axial, coronal


def _along_lps(volume: Volume) -> tuple[NDArray[np.generic], tuple[float, float, float]]:
    """Return the voxels with z, y, x along the scan's axes as nearly as their grid goes, and their sizes."""
    direction = volume.direction
    axis_of = [int(np.argmax(np.abs(direction[row]))) for row in range(3)]
    if len(set(axis_of)) < 3:  # turned by 45 degrees: as good as any
        axis_of = [0, 1, 2]
    array = volume.array.transpose([2 - axis_of[2], 2 - axis_of[1], 2 - axis_of[0]])
    flips = tuple(
        slice(None, None, -1 if direction[row, axis_of[row]] < 0 else 1) for row in reversed(range(3))
    )
    sx, sy, sz = (volume.spacing[axis] for axis in axis_of)
    return array[flips], (sx, sy, sz)
