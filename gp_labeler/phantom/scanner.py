"""What a scanner does to a phantom: beam hardening, streaks, partial volume, rings, a circle, a mirror."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.phantom import grey
from gp_labeler.phantom.canvas import VoxelCanvas
from gp_labeler.phantom.objects import METAL
from gp_labeler.phantom.solids import Values
from gp_labeler.phantom.variation import HeadVariation, generator_of

__all__ = ["FILL", "distort", "stored", "with_fill"]

FILL = 0
"""Value of voxels outside the scanner's circle; measured ones are at least 1."""

_HARDENING_MM = 5.0
_RING_MM = 0.3
_STREAKS, _STREAK_GREY, _STREAK_MM = 9, 5_000.0, 5.0


def distort(canvas: VoxelCanvas, variation: HeadVariation, seed: int) -> None:
    """Change grey values as a scanner does, before its blur and its noise."""
    if variation.electrode or variation.clip:
        _add_streaks(canvas, generator_of(seed, "streaks"))
    if variation.beam_hardening:
        _harden(canvas, variation.beam_hardening)
    if variation.partial_volume > 1:
        _average(canvas, variation.partial_volume)
    if variation.rings:
        canvas.grey += _rings(canvas, variation.rings, generator_of(seed, "rings"))


def _harden(canvas: VoxelCanvas, share: float) -> None:
    """Darken what lies amid much bone: there few soft rays are left."""
    from scipy.ndimage import gaussian_filter, zoom

    step = max(1, round(1.0 / canvas.spacing))
    coarse = np.maximum(canvas.grey[::step, ::step, ::step] - np.float32(grey.SOFT), 0)
    load = gaussian_filter(coarse, _HARDENING_MM / (step * canvas.spacing), mode="constant", truncate=3.0)
    load /= max(float(load.max()), 1e-6)
    factors = [n / m for n, m in zip(canvas.grey.shape, load.shape, strict=True)]
    canvas.grey *= 1 - np.float32(share) * zoom(load, factors, order=1, mode="nearest", grid_mode=True)


def _average(canvas: VoxelCanvas, edge: float) -> None:
    """Make each voxel the mean of a cube of this edge, in voxels: its share of the outermost is a part."""
    from scipy.ndimage import convolve1d

    reach = int(np.ceil((edge - 1) / 2))
    weights = np.ones(2 * reach + 1)
    weights[[0, -1]] = (edge - (2 * reach - 1)) / 2
    for axis in range(3):
        canvas.grey = convolve1d(canvas.grey, weights / edge, axis=axis, mode="nearest")


def _rings(canvas: VoxelCanvas, strength: float, rng: np.random.Generator) -> Values:
    """Return the (1, ny, nx) error of detectors that are a little off, alike in all slices."""
    radius = _radius(canvas)
    bins = (radius / _RING_MM).astype(np.intp)
    return np.asarray(strength * rng.standard_normal(int(bins.max()) + 1)[bins][None], dtype=np.float32)


def _radius(canvas: VoxelCanvas) -> FloatArray:
    """Return the (ny, nx) distance from the axis of the scanner, the middle of the slices, mm."""
    x, y = (axis - (axis[0] + axis[-1]) / 2 for axis in canvas.axes[:2])
    radius: FloatArray = np.hypot(x[None, :], y[:, None])
    return radius


def _add_streaks(canvas: VoxelCanvas, rng: np.random.Generator) -> None:
    """Draw rays, bright and dark, from the metal in each slice that holds some."""
    x, y = canvas.axes[0][None, :], canvas.axes[1][:, None]
    phase = rng.uniform(0, 2 * np.pi, 2)
    for layer in canvas.grey:
        metal = np.argwhere(layer > (METAL + grey.ENAMEL) / 2)
        if not len(metal):
            continue
        j, i = metal.mean(axis=0)
        dx, dy = x - np.interp(i, np.arange(x.size), x[0]), y - np.interp(j, np.arange(y.size), y[:, 0])
        turn = np.arctan2(dy, dx)
        rays = np.cos(_STREAKS * turn + phase[0]) + np.cos((2 * _STREAKS + 1) * turn + phase[1])
        fade = np.exp(-np.hypot(dx, dy) / _STREAK_MM)
        layer += (_STREAK_GREY / 2 * rays * fade).astype(np.float32)


def with_fill(canvas: VoxelCanvas, voxels: NDArray[np.uint16], circle: float) -> NDArray[np.uint16]:
    """Return (z, y, x) voxels that hold `FILL` outside a circle in every slice, and above it inside."""
    extent = min(np.ptp(canvas.axes[0]), np.ptp(canvas.axes[1]))
    outside = _radius(canvas) > circle * extent / 2
    return np.where(outside[None], np.uint16(FILL), np.maximum(voxels, FILL + 1))


def stored(
    voxels: NDArray[np.uint16], canvas: VoxelCanvas, mirrored: str
) -> tuple[NDArray[np.uint16], FloatArray, dict[str, Any]]:
    """Return the voxels as a file holds them.

    Returns
    -------
    voxels : (z, y, x) array
    T_stored_scan : (4, 4) array
        From where a place is to where the file says it is: the identity, but a mirror in x if that is silent.
    parts : dict
        Spacing, origin and direction of the grid.
    """
    spacing = [canvas.spacing] * 3
    mirror = np.eye(4)
    if not mirrored:
        return voxels, mirror, {"spacing": spacing, "origin": canvas.origin}
    flipped = np.ascontiguousarray(voxels[:, :, ::-1])
    first, last = canvas.axes[0][0], canvas.axes[0][-1]
    if mirrored == "silent":
        mirror[0, 0], mirror[0, 3] = -1.0, first + last
        return flipped, mirror, {"spacing": spacing, "origin": canvas.origin}
    origin = np.array([last, *canvas.origin[1:]])
    return flipped, mirror, {"spacing": spacing, "origin": origin, "direction": np.diag([-1.0, 1.0, 1.0])}
