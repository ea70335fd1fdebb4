"""The voxels of a phantom: solids are painted one over the other, then a scanner blurs and adds noise."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.validation import FloatArray
from gp_labeler.imaging.progress import Report
from gp_labeler.phantom.solids import Grid, Solid, Values

__all__ = ["VoxelCanvas"]

_SILENT = Report()
_WORKERS = 2
_FIRST_ARE_SLOW = 0.4
"""Power that makes time of the share of solids: the first ones, skin and skull, are by far the largest."""

_EDGE = 1.7
"""Voxels over which the edge of a solid rises; narrower ones leave terraces on slopes."""

_BLOCK = 1_500_000
"""Voxels worked on at a time in one thread: bounds the memory of the temporary arrays."""


class VoxelCanvas:
    """Grey values on a grid along the axes of the scan frame.

    Parameters
    ----------
    low, high : (3,) array_like, mm
        Corners of the box to cover, LPS.
    spacing : float
        Voxel size, mm.
    background : float
        Grey value of what nothing is painted on.
    report : Report
        Told how many of `n_solids` are painted, and asked whether to stop.
    n_solids : int
        About how many solids will be painted.
    """

    def __init__(
        self,
        low: ArrayLike,
        high: ArrayLike,
        spacing: float,
        background: float,
        *,
        report: Report = _SILENT,
        n_solids: int = 1,
    ) -> None:
        self.spacing = spacing
        self._report, self._n_solids, self._painted = report, n_solids, 0
        self.origin = np.asarray(low, dtype=np.float64)
        size = np.ceil((np.asarray(high) - self.origin) / spacing).astype(int) + 1
        self.axes = [self.origin[a] + spacing * np.arange(size[a]) for a in range(3)]
        self.grey: Values = np.full(size[::-1], background, np.float32)

    def paint(self, solid: Solid, grey: float) -> None:
        """Paint a solid over what is there; its edge voxels are mixed by the share of each."""
        self._report((self._painted / self._n_solids) ** _FIRST_ARE_SLOW)
        self._painted += 1
        with ThreadPoolExecutor(_WORKERS) as pool:
            list(pool.map(lambda block: self._paint_block(block, solid, grey), self._blocks(solid)))

    def _blocks(self, solid: Solid) -> Iterator[tuple[slice, slice, slice]]:
        """Yield the layers (z, y, x) that the solid touches."""
        spans = [
            np.clip(np.searchsorted(axis, (low - 2 * self.spacing, high + 2 * self.spacing)), 0, len(axis))
            for axis, low, high in zip(self.axes, solid.low, solid.high, strict=True)
        ]
        (x0, x1), (y0, y1), (z0, z1) = (tuple(int(i) for i in span) for span in spans)
        if x0 >= x1 or y0 >= y1:
            return
        layers = max(4, _BLOCK // ((x1 - x0) * (y1 - y0)))
        for z in range(z0, z1, layers):
            yield slice(z, min(z + layers, z1)), slice(y0, y1), slice(x0, x1)

    def _paint_block(self, block: tuple[slice, slice, slice], solid: Solid, grey: float) -> None:
        self._report.check()
        z, y, x = block
        around = slice(
            max(z.start - 1, 0), min(z.stop + 1, len(self.axes[2]))
        )  # for slopes at the layer's ends
        distance = solid.distance(self._grid(around, y, x))
        distance = distance[z.start - around.start : z.stop - around.start]
        share = np.clip(np.float32(0.5) - distance / np.float32(_EDGE * self.spacing), 0, 1)
        part = self.grey[block]
        part += share * (np.float32(grey) - part)

    def _grid(self, z: slice, y: slice, x: slice) -> Grid:
        xs, ys, zs = (axis[part].astype(np.float32) for axis, part in zip(self.axes, (x, y, z), strict=True))
        return xs[None, None, :], ys[None, :, None], zs[:, None, None]

    def scanned(
        self, rng: np.random.Generator, *, blur: float, noise: float, report: Report = _SILENT
    ) -> NDArray[np.uint16]:
        """Return the voxels as a scanner would.

        Parameters
        ----------
        rng : numpy Generator
        blur : float
            Standard deviation of the point spread, mm.
        noise : float
            Standard deviation of the noise, grey values.
        report : Report
            Told the fraction done, and asked whether to stop.
        """
        from scipy.ndimage import gaussian_filter

        grey: Values = gaussian_filter(self.grey, blur / self.spacing, mode="nearest", truncate=3.0)
        out = np.empty(grey.shape, np.uint16)
        for k, layer in enumerate(grey):
            report((k + 1) / len(grey))
            noisy = layer + np.float32(noise) * rng.standard_normal(layer.shape, dtype=np.float32)
            out[k] = np.clip(np.rint(noisy), 0, 65535)
        return out

    def part(self, axis: int, kept: slice) -> VoxelCanvas:
        """Return the part of the canvas at some voxels along x (0), y (1) or z (2)."""
        axes = [a[kept] if n == axis else a for n, a in enumerate(self.axes)]
        index: list[slice] = [slice(None)] * 3
        index[2 - axis] = kept
        part = VoxelCanvas([a[0] for a in axes], [a[0] for a in axes], self.spacing, 0.0)
        part.origin, part.axes = np.array([a[0] for a in axes]), axes
        part.grey = np.ascontiguousarray(self.grey[tuple(index)])
        return part

    @property
    def extent(self) -> FloatArray:
        """(2, 3) LPS mm: centres of the first and the last voxel."""
        return np.array([[axis[0] for axis in self.axes], [axis[-1] for axis in self.axes]])
