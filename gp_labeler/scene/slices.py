"""Slices of a scan in any plane: grey values, where pixels lie, and the edge of bone on them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonCore import VTK_IMAGE_SLAB_MAX, VTK_IMAGE_SLAB_MEAN, VTK_IMAGE_SLAB_MIN
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonTransforms import vtkMatrixToLinearTransform
from vtkmodules.vtkImagingCore import vtkImageReslice

from gp_core.validation import FloatArray
from gp_labeler.imaging.slab import Slab, reduced
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.imaging.threshold import surface_level
from gp_labeler.imaging.volume import Volume
from gp_labeler.imaging.vtk_arrays import matrix_of, to_numpy, to_vtk, vtk_ready
from gp_labeler.scene.level_lines import level_segments
from gp_labeler.scene.oblique_slab import MOST_BYTES, ObliqueSlab, PixelGrid, pixel_grid
from gp_labeler.scene.window_level import WindowLevel

__all__ = ["SliceImage", "VolumeSlicer"]

_STRAIGHT = 1e-4
"""Off-axis part of a direction below which voxel rows run along a plane: 0.1 voxel in a thousand."""

_SLABS_KEPT = 3
"""One for each slice view."""

_EDGES = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1])
"""The 12 edges of a box, as pairs of its 8 corners."""


@dataclass(frozen=True, eq=False)
class SliceImage:
    """The grey values of one slice, rows downwards on the screen.

    Parameters
    ----------
    values : (h, w) array
        Values as the volume has them (a view of it where the volume lies straight).
    plane : SlicePlane
        Which way it is cut.
    position : float
        Where along the plane's normal it really lies, mm.
    origin : (2,) float array
        Coordinates right and down, mm, of the centre of pixel [0, 0].
    step : (2,) float array
        Size of a pixel, right and down, mm.
    unread : int, optional
        Of a coarse picture that was made at once: the x to give to `Voxels.read_ahead` for a whole one.
    """

    values: NDArray[Any]
    plane: SlicePlane
    position: float
    origin: FloatArray
    step: FloatArray
    unread: int | None = None

    @property
    def edges(self) -> FloatArray:
        """(2, 2) coordinates right and down, mm, of the image's outer corners, top left and bottom right."""
        height, width = self.values.shape
        corners: FloatArray = self.origin + self.step * np.array([[-0.5, -0.5], [width - 0.5, height - 0.5]])
        return corners

    def grey(self, window: WindowLevel) -> NDArray[np.uint8]:
        """Return the slice as 8-bit grey values, (h, w)."""
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


class _Grid(NamedTuple):
    """How slices of a plane lie in the voxels; worked out once, for it is asked for at every movement."""

    axes: tuple[int, int, int] | None
    """Which voxel axes run across, right and down; None where none runs along the plane."""
    step: float
    limits: tuple[float, float]


_VTK_SLABS = {"mean": VTK_IMAGE_SLAB_MEAN, "maximum": VTK_IMAGE_SLAB_MAX, "minimum": VTK_IMAGE_SLAB_MIN}


class VolumeSlicer:
    """Cuts slices out of one volume: its voxels where a plane lies along its grid, resampled where not.

    Parameters
    ----------
    volume : Volume
        The scan.
    """

    def __init__(self, volume: Volume) -> None:
        self.volume = volume
        nx, ny, nz = volume.size
        box = np.array([(i, j, k) for i in (0, nx) for j in (0, ny) for k in (0, nz)], dtype=np.float64) - 0.5
        self.corners = volume.voxel_to_scan(box)
        self._reslice: vtkImageReslice | None = None
        self._grids: WeakKeyDictionary[SlicePlane, _Grid] = WeakKeyDictionary()
        self._slabs: dict[object, ObliqueSlab] = {}

    def close(self) -> None:
        """Let go of the voxels."""
        self._reslice = None
        self.forget_slabs()

    def is_oblique(self, plane: SlicePlane) -> bool:
        """Whether slices of a plane are resampled, because it does not lie along the grid of voxels."""
        return self._grid(plane).axes is None

    def step(self, plane: SlicePlane) -> float:
        """Return the distance from one slice to the next, mm."""
        return self._grid(plane).step

    def step_along(self, direction: ArrayLike) -> float:
        """Return how long a step of one voxel is in a (3,) unit direction, mm."""
        return self.volume.step_along(direction)

    def limits(self, plane: SlicePlane) -> tuple[float, float]:
        """Return the first and last position of slices, mm."""
        return self._grid(plane).limits

    def snap(self, plane: SlicePlane, position: float) -> float:
        """Return the position of the slice that is shown for `position`, mm.

        It is the nearest layer of voxels; an oblique plane is cut exactly where it is asked for.
        """
        low, high = self.limits(plane)
        if not self.is_oblique(plane):
            step = self.step(plane)
            position = low + round((position - low) / step) * step
        return float(np.clip(position, low, high))

    def thickness(self, plane: SlicePlane, slab: Slab, step: float | None = None) -> float:
        """Return how thick a slab is in a plane, mm: whole layers of voxels, or of samples if oblique."""
        layer = self._layer(plane, step)
        return slab.n_layers(layer) * layer

    def image(
        self,
        plane: SlicePlane,
        position: float,
        step: float | None = None,
        slab: Slab | None = None,
        *,
        at_once: bool = False,
    ) -> SliceImage:
        """Return the slice nearest to a position along the plane's normal, mm.

        Parameters
        ----------
        plane : SlicePlane
        position : float
            Along the normal, mm.
        step : float, optional
            How fine an oblique slice is sampled, mm; by default as fine as the voxels. See `sampling_step`.
        slab : Slab, optional
            What to take of a slab around the slice, in place of the slice; display only.
        at_once : bool
            Do not keep a window waiting: where much of a file must be read first, the picture is coarse, and
            its `unread` says what to read.
        """
        there, grid_axes = self.snap(plane, position), self._grid(plane).axes
        if grid_axes is None:
            return self._resampled(plane, there, step or min(self.volume.spacing), slab)
        return self._voxels(plane, there, grid_axes, slab, at_once)

    def forget_slabs(self) -> None:
        """Let go of the layers of slabs that were shown."""
        self._slabs.clear()

    def _layer(self, plane: SlicePlane, step: float | None) -> float:
        """Return the distance of the layers of a slab, mm."""
        return self.step(plane) * (self._n_between(plane, step) if self.is_oblique(plane) else 1)

    def _n_between(self, plane: SlicePlane, step: float | None) -> int:
        """Return how many slices apart the layers of an oblique slab are: not much finer than its pixels."""
        return max(1, math.floor((step or 0.0) / self.step(plane) + 1e-9))

    def sampling_step(self, plane: SlicePlane, mm_per_pixel: float) -> float:
        """Return how fine an oblique slice needs to be sampled for a screen, mm.

        It is the voxel, or a step between 0.7 and 1 pixel where that is coarser: more would be sampled, and
        never seen.
        """
        voxel = min(self.volume.spacing)
        if mm_per_pixel <= voxel or not self.is_oblique(plane):
            return voxel
        return float(voxel * 2.0 ** (0.5 * math.floor(2 * math.log2(mm_per_pixel / voxel))))

    def _grid(self, plane: SlicePlane) -> _Grid:
        if plane not in self._grids:
            along = np.abs(self.volume.direction.T @ plane.axes)
            right, down, across = (int(n) for n in along.argmax(axis=0))
            along[[right, down, across], [0, 1, 2]] = 0.0
            step, depths = self.step_along(plane.normal), plane.depth(self.corners)
            limits = float(depths.min() + step / 2), float(depths.max() - step / 2)
            straight = along.max() <= _STRAIGHT
            self._grids[plane] = _Grid((across, right, down) if straight else None, step, limits)
        return self._grids[plane]

    def _voxels(
        self,
        plane: SlicePlane,
        position: float,
        grid_axes: tuple[int, int, int],
        slab: Slab | None,
        at_once: bool,
    ) -> SliceImage:
        """Take the voxels as they are, turned and flipped for the screen."""
        volume, (across, right, down) = self.volume, grid_axes
        index = volume.scan_to_voxel(plane.moved_to(self.corners.mean(axis=0), position)[None])
        index[0, across] = np.rint(index[0, across])
        layer, voxels = int(index[0, across]), volume.voxels
        is_glance = at_once and across == 0 and voxels.is_unread(layer)
        apart = voxels.rows_apart(layer, at_once=at_once) if across == 0 else 1
        flips = []
        for axis, direction in ((down, plane.down), (right, plane.right)):
            forward = volume.direction[:, axis] @ direction > 0
            flips.append(1 if forward else -1)
            index[0, axis] = 0 if forward else (volume.size[axis] - 1) // apart * apart
        cut = self._cut(plane, across, layer, None if is_glance else slab, apart)
        values = (cut if down > right else cut.T)[:: flips[0], :: flips[1]]  # its axes are z, y, x
        if cut.strides[-1] > cut.itemsize:  # single voxels all over the scan
            values = np.ascontiguousarray(values)  # read once, and not again for each use
        corner = volume.voxel_to_scan(index)
        step = apart * np.array([volume.spacing[right], volume.spacing[down]])
        unread = layer if is_glance else None
        return SliceImage(values, plane, plane.position_of(corner), plane.flat(corner)[0], step, unread)

    def _cut(self, plane: SlicePlane, across: int, index: int, slab: Slab | None, apart: int) -> NDArray[Any]:
        """Return one layer of voxels, or what a slab shows of those around it."""
        half = 0 if slab is None else slab.n_layers(self.step(plane)) // 2
        kji = [slice(None, None, apart)] * 3
        kji[2 - across] = slice(max(index - half, 0), index + half + 1)
        layers = self.volume.voxels.read(*kji)
        return reduced(layers, 2 - across, slab.mode) if slab and half else layers.squeeze(2 - across)

    def _resampled(
        self, plane: SlicePlane, position: float, step: float, slab: Slab | None = None
    ) -> SliceImage:
        """Interpolate on a square grid over the part of the plane that lies in the volume."""
        grid = pixel_grid(self.section(plane, position), step)
        if slab is None or slab.n_layers(self._layer(plane, step)) == 1:
            values = self._sampled(plane, position, grid, step)
        else:
            values = self._slab_values(plane, position, grid, step, slab)
        return SliceImage(values, plane, position, step * np.array(grid[:2]), np.array([step, step]))

    def _slab_values(
        self, plane: SlicePlane, position: float, grid: PixelGrid, step: float, slab: Slab
    ) -> NDArray[Any]:
        """Return what an oblique slab shows; from the second slice of a plane on, its layers are kept."""
        key = (plane.axes.tobytes(), plane.origin.tobytes(), step, slab)
        before = self._slabs.pop(key, None)
        kept = before or self._slab(plane, slab, step, pixel_grid(plane.flat(self.corners), step))
        self._slabs[key] = kept
        while len(self._slabs) > _SLABS_KEPT:
            del self._slabs[next(iter(self._slabs))]
        if before is not None and kept.n_bytes <= MOST_BYTES:
            return kept.values(position, grid)
        return self._slab_at_once(plane, position, grid, step, slab)

    def _slab(self, plane: SlicePlane, slab: Slab, step: float, grid: PixelGrid) -> ObliqueSlab:
        return ObliqueSlab(
            self.volume,
            plane,
            slab,
            step=step,
            scroll=self.step(plane),
            n_between=self._n_between(plane, step),
            grid=grid,
            sample=lambda at, of, beyond: self._sampled(plane, at, of, step, beyond),
        )

    def _sampled(
        self, plane: SlicePlane, position: float, grid: PixelGrid, step: float, beyond: float | None = None
    ) -> NDArray[Any]:
        """Return the (rows, columns) grey values of one layer, `beyond` the scan by default its least one."""
        left, top, width, height = grid
        outside = self.volume.intensity_range[0] if beyond is None else beyond
        origin = plane.scan(step * np.array([[left, top]]), position)[0]
        array = self.volume.voxels.uncopied()
        if array is None:
            return _interpolated(self.volume, origin, plane, step, (height, width), outside)
        return self._by_vtk(array, plane, origin, (width, height), (step, step, step), outside)

    def _slab_at_once(
        self, plane: SlicePlane, position: float, grid: PixelGrid, step: float, slab: Slab
    ) -> NDArray[Any]:
        """Return what an oblique slab shows, and keep no layers: it turns, or is too large."""
        if (array := self.volume.voxels.uncopied()) is None:
            return self._slab(plane, slab, step, grid).values(position, grid)
        layer = self._layer(plane, step)
        low, origin = self.volume.intensity_range[0], plane.scan(step * np.array([grid[:2]]), position)[0]
        return self._by_vtk(
            array, plane, origin, grid[2:], (step, step, layer), low, slab.n_layers(layer), slab.mode
        )

    def _by_vtk(
        self,
        array: NDArray[Any],
        plane: SlicePlane,
        origin: FloatArray,
        size: tuple[int, int],
        spacing: tuple[float, float, float],
        beyond: float,
        n_layers: int = 1,
        mode: str = "mean",
    ) -> NDArray[Any]:
        """Let `vtkImageReslice` interpolate, columns by rows from an origin (3,), one or several layers."""
        if self._reslice is None:
            self._reslice = _reslice(self.volume, array)
        T_scan_screen = np.eye(4)
        T_scan_screen[:3, :3], T_scan_screen[:3, 3] = plane.axes, origin
        to_voxel = vtkMatrixToLinearTransform()
        to_voxel.SetInput(matrix_of(self.volume.T_voxel_scan @ T_scan_screen))
        self._reslice.SetResliceTransform(to_voxel)
        self._reslice.SetOutputSpacing(*spacing)
        self._reslice.SetSlabNumberOfSlices(n_layers)
        self._reslice.SetSlabMode(_VTK_SLABS[mode])
        self._reslice.SetOutputExtent(0, size[0] - 1, 0, size[1] - 1, 0, 0)
        self._reslice.SetBackgroundLevel(beyond)
        self._reslice.Update()
        scalars = self._reslice.GetOutput().GetPointData().GetScalars()
        return np.asarray(to_numpy(scalars).reshape(size[1], size[0]).copy())

    def section(self, plane: SlicePlane, position: float) -> FloatArray:
        """Return the (N, 2) coordinates right and down of where a plane meets the edges of the volume, mm."""
        start, end = self.corners[_EDGES[:, 0]], self.corners[_EDGES[:, 1]]
        before, after = plane.depth(start) - position, plane.depth(end) - position
        crossed = (before <= 0) != (after <= 0)
        share = (before[crossed] / (before[crossed] - after[crossed]))[:, None]
        met = start[crossed] + share * (end[crossed] - start[crossed])
        return plane.flat(met if len(met) else self.corners.mean(axis=0)[None])


def _interpolated(
    volume: Volume,
    origin: FloatArray,
    plane: SlicePlane,
    step: float,
    shape: tuple[int, int],
    beyond: float,
) -> NDArray[Any]:
    """Interpolate linearly between voxels that must be converted, as `vtkImageReslice` does others."""
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
    values = np.full(shape[0] * shape[1], beyond, volume.dtype)
    values[inside] = np.rint(total) if volume.dtype.kind in "iu" else total
    return values.reshape(shape)


def _reslice(volume: Volume, array: NDArray[Any]) -> vtkImageReslice:
    image = vtkImageData()
    image.SetDimensions(volume.size)
    image.GetPointData().SetScalars(to_vtk(vtk_ready(array).reshape(-1), share=True))
    reslice = vtkImageReslice()
    reslice.SetInputData(image)
    reslice.SetInterpolationModeToLinear()
    reslice.SetOutputDimensionality(2)
    reslice.SetOutputOrigin(0.0, 0.0, 0.0)
    return reslice
