"""Slices of a scan in its physical axes: grey values, where pixels lie, and the edge of bone on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from contourpy import LineType, contour_generator
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonTransforms import vtkMatrixToLinearTransform
from vtkmodules.vtkImagingCore import vtkImageReslice

from gp_core.validation import FloatArray
from gp_labeler.imaging.threshold import surface_level
from gp_labeler.imaging.volume import Volume
from gp_labeler.imaging.voxels import ArrayVoxels
from gp_labeler.imaging.vtk_arrays import matrix_of, to_numpy, to_vtk, vtk_ready
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.window_level import WindowLevel

__all__ = ["SliceImage", "VolumeSlicer", "level_segments"]

_STRAIGHT = 1e-4
"""Off-axis part of a direction below which voxel rows run along the scan's axes: 0.1 voxel in a thousand."""


@dataclass(frozen=True, eq=False)
class SliceImage:
    """The grey values of one slice, rows downwards on the screen.

    Parameters
    ----------
    values : (h, w) array
        Values as the volume has them (a view of it where the volume lies straight).
    plane : Plane
        Which way it is cut.
    position : float
        Where along the plane's axis it really lies, mm.
    origin : (2,) float array
        Coordinates right and down, mm, of the centre of pixel [0, 0].
    step : (2,) float array
        Size of a pixel, right and down, mm.
    """

    values: NDArray[Any]
    plane: Plane
    position: float
    origin: FloatArray
    step: FloatArray

    @property
    def edges(self) -> FloatArray:
        """(2, 2) coordinates right and down, mm, of the image's outer corners, top left and bottom right."""
        height, width = self.values.shape
        corners: FloatArray = self.origin + self.step * np.array([[-0.5, -0.5], [width - 0.5, height - 0.5]])
        return corners

    def grey(self, window: WindowLevel) -> NDArray[np.uint8]:
        """Return the slice as 8-bit greys, (h, w)."""
        return np.ascontiguousarray(window.grey(self.values))

    def rgb(
        self,
        window: WindowLevel,
        *,
        threshold: float | None = None,
        tint: tuple[float, float, float] = (0.98, 0.75, 0.35),
    ) -> NDArray[np.uint8]:
        """Return the slice as (h, w, 3), voxels of `threshold` and above tinted to preview it."""
        image = np.repeat(self.grey(window)[:, :, None], 3, axis=2)
        if threshold is not None:
            bone = self.values >= threshold
            image[bone] = (0.45 * image[bone] + 0.55 * 255 * np.array(tint)).astype(np.uint8)
        return image

    def outline(self, threshold: float) -> FloatArray:
        """Return the edge of bone: (M, 2, 2) line segments in coordinates right and down, mm.

        It is where the isosurface of the same threshold cuts this slice.
        """
        pixels = level_segments(self.values, surface_level(threshold, self.values[None]))
        segments: FloatArray = self.origin + self.step * pixels
        return segments


def level_segments(values: NDArray[Any], level: float) -> FloatArray:
    """Return the (M, 2, 2) line segments, columns and rows, along which (h, w) values pass a level.

    Not VTK's flying edges: they share their threads with the meshing in the background, and make the window
    wait for it.
    """
    found: Any = contour_generator(z=values, line_type=LineType.ChunkCombinedOffset).lines(level)
    (points,), (offsets,) = found
    if points is None:
        return np.empty((0, 2, 2))
    is_end = np.zeros(len(points), dtype=bool)
    is_end[offsets[1:] - 1] = True
    begins = np.flatnonzero(~is_end)
    return np.stack([points[begins], points[begins + 1]], axis=1)


class VolumeSlicer:
    """Cuts slices out of one volume: its voxels where they lie along the scan's axes, resampled where not.

    Parameters
    ----------
    volume : Volume
        The scan.
    """

    def __init__(self, volume: Volume) -> None:
        self.volume = volume
        self._axis_of = np.abs(volume.direction).argmax(axis=1)
        off_axis = np.abs(volume.direction).copy()
        off_axis[np.arange(3), self._axis_of] = 0.0
        self.oblique = bool(off_axis.max() > _STRAIGHT)
        in_memory = isinstance(volume.voxels, ArrayVoxels)
        self._reslice = _reslice(volume) if self.oblique and in_memory else None

    def close(self) -> None:
        """Let go of the voxels."""
        self._reslice = None

    def step(self, plane: Plane) -> float:
        """Return the distance from one slice to the next, mm."""
        if self.oblique:
            return min(self.volume.spacing)
        return self.volume.spacing[self._axis_of[plane.axis]]

    def limits(self, plane: Plane) -> tuple[float, float]:
        """Return the first and last position of slices, mm."""
        low, high = self.volume.extent[:, plane.axis]
        half = 0.5 * self.step(plane)
        return float(low + half), float(high - half)

    def snap(self, plane: Plane, position: float) -> float:
        """Return the position of the slice that is shown for `position`: the nearest that there is, mm."""
        low, high = self.limits(plane)
        step = self.step(plane)
        return float(np.clip(low + round((position - low) / step) * step, low, high))

    def image(self, plane: Plane, position: float) -> SliceImage:
        """Return the slice nearest to a position along the plane's axis, mm."""
        snapped = self.snap(plane, position)
        return self._resampled(plane, snapped) if self.oblique else self._voxels(plane, snapped)

    def _voxels(self, plane: Plane, position: float) -> SliceImage:
        """Take the voxels as they are, turned and flipped for the screen."""
        volume = self.volume
        across, right, down = (
            int(self._axis_of[np.abs(d).argmax()]) for d in (plane.normal, plane.right, plane.down)
        )
        index = volume.scan_to_voxel(plane.scan(np.zeros((1, 2)), position))
        index[0, across] = np.rint(index[0, across])
        flips = []
        for axis, direction in ((down, plane.down), (right, plane.right)):
            forward = volume.direction[:, axis] @ direction > 0
            flips.append(1 if forward else -1)
            index[0, axis] = 0 if forward else volume.size[axis] - 1
        cut = volume.voxels.plane(across, int(index[0, across]))
        values = (cut if down > right else cut.T)[:: flips[0], :: flips[1]]  # its axes are z, y, x
        corner = volume.voxel_to_scan(index)
        step = np.array([volume.spacing[right], volume.spacing[down]])
        return SliceImage(values, plane, float(corner[0, plane.axis]), plane.flat(corner)[0], step)

    def _resampled(self, plane: Plane, position: float) -> SliceImage:
        """Interpolate on a straight grid that covers the whole volume."""
        step = self.step(plane)
        corners = plane.flat(self.volume.extent)
        low, high = corners.min(axis=0) + step / 2, corners.max(axis=0) - step / 2
        width, height = (int(n) for n in np.maximum(np.ceil((high - low) / step - 1e-6), 0) + 1)
        origin = plane.scan(low[None], position)[0]
        if self._reslice is None:
            values = _interpolated(self.volume, origin, plane, step, (height, width))
            return SliceImage(values, plane, position, low, np.array([step, step]))
        T_scan_screen = np.eye(4)
        T_scan_screen[:3, 0], T_scan_screen[:3, 1], T_scan_screen[:3, 2] = (
            plane.right,
            plane.down,
            plane.normal,
        )
        T_scan_screen[:3, 3] = origin
        to_voxel = vtkMatrixToLinearTransform()
        to_voxel.SetInput(matrix_of(self.volume.T_voxel_scan @ T_scan_screen))
        self._reslice.SetResliceTransform(to_voxel)
        self._reslice.SetOutputSpacing(step, step, 1.0)
        self._reslice.SetOutputExtent(0, width - 1, 0, height - 1, 0, 0)
        self._reslice.Update()
        scalars = self._reslice.GetOutput().GetPointData().GetScalars()
        values = to_numpy(scalars).reshape(height, width).copy()
        return SliceImage(values, plane, position, low, np.array([step, step]))


def _interpolated(
    volume: Volume, origin: FloatArray, plane: Plane, step: float, shape: tuple[int, int]
) -> NDArray[Any]:
    """Interpolate linearly between voxels that stay in their file, as `vtkImageReslice` does in memory."""
    down, right = np.indices(shape).reshape(2, -1)
    index = volume.scan_to_voxel(origin + step * (right[:, None] * plane.right + down[:, None] * plane.down))
    last = np.array(volume.size) - 1
    inside = np.all((index >= -0.5) & (index <= last + 0.5), axis=1)
    index = index[inside].clip(0, last)
    first = np.minimum(index.astype(np.intp), np.maximum(last - 1, 0))
    total = np.zeros(len(index))
    for corner in np.ndindex(2, 2, 2):
        weight = np.where(corner, index - first, 1 - (index - first)).prod(axis=1)
        i, j, k = np.minimum(first + corner, last).T
        total += weight * volume.voxels.at(k, j, i)
    values = np.full(shape[0] * shape[1], volume.intensity_range[0], volume.dtype)
    values[inside] = np.rint(total) if volume.dtype.kind in "iu" else total
    return values.reshape(shape)


def _reslice(volume: Volume) -> vtkImageReslice:
    image = vtkImageData()
    image.SetDimensions(volume.size)
    image.GetPointData().SetScalars(to_vtk(vtk_ready(volume.array).reshape(-1), share=True))
    reslice = vtkImageReslice()
    reslice.SetInputData(image)
    reslice.SetInterpolationModeToLinear()
    reslice.SetOutputDimensionality(2)
    reslice.SetOutputOrigin(0.0, 0.0, 0.0)
    reslice.SetBackgroundLevel(volume.intensity_range[0])
    return reslice
