"""A thick slab in an oblique plane: its layers are kept while it is scrolled, so that a step costs one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.imaging.slab import Slab
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.imaging.volume import Volume

__all__ = ["MOST_BYTES", "ObliqueSlab", "PixelGrid", "pixel_grid"]

MOST_BYTES = 128 * 2**20
"""Of the layers of one slab that are kept."""

_BETWEEN = 1e-3
"""Share of a step by which a slice may lie off those before, and still share their layers."""

PixelGrid = tuple[int, int, int, int]
"""First column and row of a picture in steps from the plane's origin, and how many there are."""

Sample = Callable[[float, PixelGrid, float], NDArray[Any]]
"""Returns the (rows, columns) grey values at a position, of a grid, with a value beyond the scan."""


def pixel_grid(flat: FloatArray, step: float) -> PixelGrid:
    """Return the grid that holds (N, 2) coordinates right and down, mm; its lines are those of all slices."""
    first = np.floor(flat.min(axis=0) / step + 0.5)
    size = np.maximum(np.ceil(flat.max(axis=0) / step - 0.5) - first + 1, 1)
    return int(first[0]), int(first[1]), int(size[0]), int(size[1])


class ObliqueSlab:
    """What a slab shows in one plane: `values` at a position are those of the layers around it.

    Beyond the scan there are no layers: they count neither in a mean nor in a maximum or minimum.

    Parameters
    ----------
    volume : Volume
    plane : SlicePlane
    slab : Slab
    step : float
        How fine its layers are sampled, mm.
    scroll : float
        By how much slices are scrolled, mm.
    n_between : int
        How many times `scroll` its layers are apart.
    grid : (4,) tuple of int
        That of its layers: it holds every slice of the plane.
    sample : callable
        Makes a layer.
    """

    def __init__(
        self,
        volume: Volume,
        plane: SlicePlane,
        slab: Slab,
        *,
        step: float,
        scroll: float,
        n_between: int,
        grid: PixelGrid,
        sample: Sample,
    ) -> None:
        self._volume, self._plane, self._slab = volume, plane, slab
        self._step, self._scroll, self._between = step, scroll, n_between
        self._grid, self._sample = grid, sample
        self._n = slab.n_layers(scroll * n_between)
        self._start = 0.0
        self._layers: dict[int, NDArray[Any]] = {}
        self._sums: dict[int, tuple[set[int], NDArray[Any]]] = {}
        low, high = volume.intensity_range
        self._low = low
        self._beyond = {"mean": 0.0, "maximum": low, "minimum": high}[slab.mode]

    @property
    def n_bytes(self) -> int:
        """How much its layers take, once they are all there."""
        return self._n * self._grid[2] * self._grid[3] * self._volume.dtype.itemsize

    def values(self, position: float, grid: PixelGrid) -> NDArray[Any]:
        """Return the grey values of a grid that lies in its own, at a position along the normal, mm."""
        index = self._index(position)
        reach = self._between * (self._n // 2)
        wanted = range(index - reach, index + reach + 1, self._between)
        for n in wanted:
            if n not in self._layers:
                self._layers[n] = self._sample(self._position(n), self._grid, self._beyond)
        left, top = grid[0] - self._grid[0], grid[1] - self._grid[1]
        part = (slice(top, top + grid[3]), slice(left, left + grid[2]))
        values = self._mean(wanted, grid, part) if self._slab.mode == "mean" else self._extreme(wanted, part)
        if self._slab.mode == "minimum":
            values[self._counts(wanted, grid) == 0] = self._low
        for n in [n for n in self._layers if abs(n - index) > reach + self._between]:
            del self._layers[n]
        return values

    def _index(self, position: float) -> int:
        """Return which slice from the first one it is; one that lies between them begins again."""
        away = (position - self._start) / self._scroll
        if not self._layers or abs(away - round(away)) > _BETWEEN:
            self._start, away = position, 0.0
            self._layers.clear()
            self._sums.clear()
        return round(away)

    def _position(self, index: int) -> float:
        return self._start + index * self._scroll

    def _extreme(self, wanted: range, part: tuple[slice, slice]) -> NDArray[Any]:
        take: Any = np.maximum if self._slab.mode == "maximum" else np.minimum
        values = self._layers[wanted[0]][part].copy()
        for n in wanted[1:]:
            take(values, self._layers[n][part], out=values)
        return values

    def _mean(self, wanted: range, grid: PixelGrid, part: tuple[slice, slice]) -> NDArray[Any]:
        dtype = self._volume.dtype
        count = self._counts(wanted, grid)
        mean = self._sum(wanted)[part] / np.maximum(count, 1)
        values: NDArray[Any] = (np.rint(mean) if dtype.kind in "iu" else mean).astype(dtype)
        values[count == 0] = self._low
        return values

    def _sum(self, wanted: range) -> NDArray[Any]:
        """Return the sum of layers: that of the slice before, with the new ones and without the old."""
        phase = wanted.start % self._between
        known, total = self._sums.get(phase, (set(), None))
        new, old = set(wanted) - known, known - set(wanted)
        if total is None or len(new) + len(old) >= len(wanted) or not old <= self._layers.keys():
            new, old = set(wanted), set()
            total = np.zeros(self._grid[:1:-1], np.int64 if self._volume.dtype.kind in "iu" else np.float64)
        for n in new:
            total += self._layers[n]
        for n in old:
            total -= self._layers[n]
        self._sums[phase] = (set(wanted), total)
        return total

    def _counts(self, wanted: range, grid: PixelGrid) -> NDArray[np.int64]:
        """Return in how many of the layers each pixel of a grid lies in the scan."""
        left, top, width, height = grid
        volume, plane = self._volume, self._plane
        positions = np.array([self._position(n) for n in wanted])
        to_voxel = volume.T_voxel_scan
        right, down, across = (to_voxel[:3, :3] @ plane.axes).T
        corner = plane.origin + self._step * (left * plane.right + top * plane.down)
        first = to_voxel[:3, :3] @ corner + to_voxel[:3, 3]
        starts = first + positions[:, None] * across  # (layers, 3)
        rows = np.arange(height)[:, None] * self._step * down  # (rows, 3)
        at = starts[:, None] + rows[None]
        begin, end = _columns_inside(at, self._step * right, np.array(volume.size), width)
        first_of_row = np.arange(height) * (width + 1)
        n = height * (width + 1)
        steps = np.bincount((first_of_row + begin).ravel(), minlength=n)
        steps -= np.bincount((first_of_row + end).ravel(), minlength=n)
        return np.cumsum(steps.reshape(height, width + 1), axis=1)[:, :width]


def _columns_inside(
    at: FloatArray, along: FloatArray, size: NDArray[Any], width: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first column of each row that lies in the scan, and the one after the last.

    Parameters
    ----------
    at : (..., 3) array
        Voxel indices of the first column.
    along : (3,) array
        From one column to the next, voxels.
    size : (3,) array
        Of the scan.
    width : int
        How many columns there are.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        bounds = np.stack([(-0.5 - at) / along, (size - 0.5 - at) / along])
    low, high = np.sort(bounds, axis=0)
    runs_beside = np.abs(along) < 1e-12
    beside = runs_beside & ((at < -0.5) | (at > size - 0.5))
    low, high = np.where(runs_beside, -np.inf, low), np.where(runs_beside, np.inf, high)
    begin = np.clip(np.ceil(low.max(axis=-1)), 0, width)
    end = np.clip(np.floor(high.min(axis=-1)) + 1, 0, width)
    end = np.where(beside.any(axis=-1), begin, np.maximum(begin, end))
    return begin.astype(np.intp), end.astype(np.intp)
