"""Close-up pictures of a place in a scan, slice and bone, from the voxels around it alone.

No mesh and no graphics are needed, so a sheet of forty of them is made in the background, and without a
display.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import map_coordinates

from gp_core.validation import FloatArray
from gp_labeler.imaging.volume import Volume

__all__ = ["PICTURE_AXES", "CloseUp", "PictureAxes"]

_MOST_VOXELS = 40_000_000
"""Larger boxes are read at every second, third ... voxel."""

_SLAB = 16
_DEPTH_MM = 0.12
"""Steps into the depth; where bone begins is interpolated between two of them."""

_HIDDEN_MM = 0.8
"""Bone that lies so far before a point hides it: it is cut away."""

_CUT_MM = 0.3
_BEFORE_MM = 9.0
_BEHIND_MM = 7.0
_DARKEST = 0.22


@dataclass(frozen=True)
class PictureAxes:
    """A way of looking, in the scan frame (LPS).

    Parameters
    ----------
    name : str
        Such as ``axial`` or ``from the left``.
    right, down : (3,) tuple of float
        Unit vectors of the picture; what is behind it lies along their cross product.
    """

    name: str
    right: tuple[float, float, float]
    down: tuple[float, float, float]

    def turned(self, rotation: FloatArray) -> PictureAxes:
        """Return the same look in another frame; `rotation` (3, 3) leads from that frame into the scan's."""
        right, down = (tuple((rotation @ np.asarray(v)).tolist()) for v in (self.right, self.down))
        return PictureAxes(self.name, right, down)

    @property
    def away(self) -> FloatArray:
        """(3,) unit vector away from the viewer."""
        return np.cross(self.right, self.down)


PICTURE_AXES = {
    "axial": PictureAxes("axial", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "coronal": PictureAxes("coronal", (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    "sagittal": PictureAxes("sagittal", (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),
    "L": PictureAxes("from the left", (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),
    "R": PictureAxes("from the right", (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)),
}
"""As in the window: slices are seen from below, from the front and from the left."""


class CloseUp:
    """The voxels around a place.

    Parameters
    ----------
    volume : Volume
        The scan.
    centre : (3,) array_like, mm, scan frame
        The place, in the middle of all pictures.
    across_mm : float
        Width of the pictures.
    pixels : int
        Along each side of them.
    only : PictureAxes, optional
        Look of the one slice that is wanted: then, no voxels beside it are read, and `slice` is quick.
    """

    def __init__(
        self,
        volume: Volume,
        centre: ArrayLike,
        across_mm: float,
        pixels: int,
        *,
        only: PictureAxes | None = None,
    ) -> None:
        self._volume, self._pixels = volume, pixels
        self._centre = np.asarray(centre, dtype=np.float64)
        self._step = across_mm / pixels
        half = np.full(3, max(across_mm / 2, _BEFORE_MM, _BEHIND_MM))
        if only is not None:
            half = across_mm / 2 * (np.abs(only.right) + np.abs(only.down))
        self._box, self._first, self._stride = _box(volume, self._centre, half)

    def slice(self, axes: PictureAxes) -> NDArray[np.float32]:
        """Return the grey values of the plane through the place, (pixels, pixels); NaN outside the scan."""
        values = self._values(self._grid(axes, self._pixels, self._step))
        return values.reshape(self._pixels, self._pixels)

    def bone(self, axes: PictureAxes, threshold: float) -> NDArray[np.float32]:
        """Return bone as seen by someone who looks that way, (pixels, pixels) from 0 (none) to 1 (bright).

        Bone that hides the place is cut away just before it. It is drawn at two thirds of the resolution.
        """
        return self.shaded(self.bone_depths(axes, threshold))

    def shaded(self, depths: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the picture, as `bone` does, of what `bone_depths` found."""
        return _enlarged(_shaded(depths, self._step * self._pixels / len(depths)), self._pixels)

    def bone_depths(self, axes: PictureAxes, threshold: float) -> NDArray[np.float32]:
        """Return how far behind the place the bone lies that `bone` shows, (n, n), mm; NaN where it has none.

        The n pixels along each side are two thirds of those of a slice.
        """
        n = self._pixels * 2 // 3
        step = self._step * self._pixels / n
        rays = self._grid(axes, n, step)
        depths = np.arange(self._start(axes, threshold), _BEHIND_MM, _DEPTH_MM)
        found = np.full(n * n, np.nan, np.float32)
        before = self._values(rays + (depths[0] - _DEPTH_MM) * axes.away)
        for first in range(0, len(depths), _SLAB):
            part = depths[first : first + _SLAB]
            open_rays = np.flatnonzero(np.isnan(found))
            values = self._values((rays[open_rays] + part[:, None, None] * axes.away).reshape(-1, 3))
            layers = np.concatenate([before[open_rays][None], values.reshape(len(part), -1)])
            found[open_rays] = _first_crossings(layers, part, threshold)
            before[open_rays] = layers[-1]
        return found.reshape(n, n)

    def _start(self, axes: PictureAxes, threshold: float) -> float:
        """Return where to begin, mm along the axes: far off, or just before a place that is hidden."""
        depths = np.arange(-_BEFORE_MM, -_HIDDEN_MM, _DEPTH_MM / 2)
        line = self._centre + depths[:, None] * axes.away
        hidden = (self._values(line) >= threshold).any()
        return -_CUT_MM if hidden else -_BEFORE_MM

    def _grid(self, axes: PictureAxes, n: int, step: float) -> FloatArray:
        """Return the (n * n, 3) scan positions of the pixels of a picture through the place."""
        offsets = (np.arange(n) - (n - 1) / 2) * step
        right, down = np.asarray(axes.right), np.asarray(axes.down)
        grid: FloatArray = self._centre + offsets[:, None, None] * down + offsets[None, :, None] * right
        return grid.reshape(-1, 3)

    def _values(self, points: FloatArray) -> NDArray[np.float32]:
        index = (self._volume.scan_to_voxel(points) - self._first) / self._stride
        values: NDArray[np.float32] = map_coordinates(
            self._box, index[:, ::-1].T, output=np.float32, order=1, mode="constant", cval=np.nan
        )
        return values


def _box(volume: Volume, centre: FloatArray, half: FloatArray) -> tuple[NDArray[np.float32], FloatArray, int]:
    """Return the voxels within some mm of a place, the (i, j, k) of the first, and the stride."""
    corners = centre + half * np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    index = volume.scan_to_voxel(corners)
    low = np.clip(np.floor(index.min(axis=0)).astype(int) - 1, 0, np.array(volume.size) - 1)
    high = np.clip(np.ceil(index.max(axis=0)).astype(int) + 2, low + 1, volume.size)
    stride = int(np.ceil(max(1.0, float(np.prod(high - low)) / _MOST_VOXELS) ** (1 / 3)))
    i, j, k = (slice(int(a), int(b), stride) for a, b in zip(low, high, strict=True))
    return volume.voxels.read(k, j, i).astype(np.float32), low.astype(np.float64), stride


def _first_crossings(
    layers: NDArray[np.float32], depths: FloatArray, threshold: float
) -> NDArray[np.float32]:
    """Return where rays first cross the threshold, mm; NaN where they do not.

    `layers` (1 + depths, rays): the grey values one step before the first depth, and at each.
    """
    is_bone = layers[1:] >= threshold
    first = is_bone.argmax(axis=0)
    rays = np.arange(layers.shape[1])
    at, before = layers[first + 1, rays], layers[first, rays]
    rise = at - before
    with np.errstate(divide="ignore", invalid="ignore"):
        back = np.where(rise > 0, (at - threshold) / rise, 0.0).clip(0.0, 1.0)
    where = depths[first] - _DEPTH_MM * np.nan_to_num(back)
    crossings: NDArray[np.float32] = np.where(is_bone.any(axis=0), where, np.nan).astype(np.float32)
    return crossings


def _enlarged(picture: NDArray[np.float32], pixels: int) -> NDArray[np.float32]:
    place = np.linspace(0, len(picture) - 1, pixels)
    grid = np.stack(np.meshgrid(place, place, indexing="ij"))
    larger: NDArray[np.float32] = map_coordinates(picture, grid, order=1)
    return larger


def _shaded(depth: NDArray[np.float32], step: float) -> NDArray[np.float32]:
    """Return how bright a surface is: where it faces the viewer, and where it is near."""
    seen = np.isfinite(depth)
    if not seen.any():
        return np.zeros_like(depth)
    filled = np.where(seen, depth, np.nanmax(depth))
    down, right = np.gradient(filled / step)
    facing = 1 / np.sqrt(1 + down**2 + right**2)
    near = 1 - 0.35 * (filled - filled.min()) / (_BEFORE_MM + _BEHIND_MM)
    bright = _DARKEST + (1 - _DARKEST) * facing * near
    shaded: NDArray[np.float32] = np.where(seen, bright, 0.0).astype(np.float32)
    return shaded
