"""Two middle slices of a coarse volume, laid out as they appear on a screen, to check which side is left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.frames import RigidTransform
from gp_labeler.imaging.anatomical_frame import AnatomicalFrame
from gp_labeler.imaging.volume import Volume

__all__ = ["PreviewPlane", "preview_planes", "straight_preview_planes"]


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
    grey = _grey(array, volume)
    nz, ny, _ = grey.shape
    axial = PreviewPlane("axial", np.ascontiguousarray(grey[nz // 2]), dy / dx, "RLPA")
    coronal = PreviewPlane("coronal", np.ascontiguousarray(grey[::-1, ny // 2]), dz / dx, "RLIS")
    return axial, coronal


def straight_preview_planes(volume: Volume, T_head_scan: RigidTransform) -> tuple[PreviewPlane, PreviewPlane]:
    """Return the axial and the coronal slice of a head that lies tilted, through its own zero."""
    frame = AnatomicalFrame("head", T_head_scan)
    axial, coronal = (_turned(volume, frame, name) for name in ("axial", "coronal"))
    return PreviewPlane("axial", axial, 1.0, "RLPA"), PreviewPlane("coronal", coronal, 1.0, "RLIS")


def _turned(volume: Volume, frame: AnatomicalFrame, name: str) -> NDArray[np.uint8]:
    """Return a slice in a plane of the head's frame, as it appears on a screen."""
    from scipy.ndimage import map_coordinates

    plane, step = frame.plane(name), min(volume.spacing)
    corners = np.array(list(np.ndindex(2, 2, 2))) * (np.array(volume.size) - 1)
    reach = np.ceil(np.abs(plane.flat(volume.voxel_to_scan(corners))).max(axis=0) / step)
    right, down = np.meshgrid(*(step * np.arange(-n, n + 1) for n in reach))
    index = volume.scan_to_voxel(plane.scan(np.stack([right.ravel(), down.ravel()], axis=1), 0.0))
    low = volume.intensity_range[0]
    values = map_coordinates(volume.array, index[:, ::-1].T, order=1, cval=low, output=np.float64)
    grey = _grey(values.reshape(right.shape), volume)
    rows, columns = (np.flatnonzero((grey > 0).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return grey
    part: NDArray[np.uint8] = grey[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return np.ascontiguousarray(part)


def _grey(values: NDArray[Any], volume: Volume) -> NDArray[np.uint8]:
    low, high = volume.intensity_range
    above = np.subtract(values, low, dtype=np.float64)
    grey: NDArray[np.uint8] = (above * (255 / max(high - low, 1e-6))).clip(0, 255).astype(np.uint8)
    return grey


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
