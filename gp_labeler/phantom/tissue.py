"""What the bone and the soft tissue of a phantom are like: marrow, density, fat and muscle."""

from __future__ import annotations

import numpy as np

from gp_labeler.phantom import grey
from gp_labeler.phantom.canvas import VoxelCanvas
from gp_labeler.phantom.solids import Values
from gp_labeler.phantom.variation import HeadVariation, generator_of

__all__ = ["alter_tissue"]

_MARROW = 15_000.0
_FAT = 7_500.0
_DEEP_MM, _TRABECULA_MM, _LOBULE_MM = 0.3, 0.25, 1.2
_ALIKE = 200.0
"""Grey values this near to soft tissue are: brain, fluid and edges are farther."""


def alter_tissue(canvas: VoxelCanvas, variation: HeadVariation, seed: int) -> None:
    """Change the grey values of a painted head as a variation says; shapes stay."""
    if variation.marrow:
        _hollow_bone(canvas, variation.marrow, generator_of(seed, "marrow"))
    if variation.bone_density != 1:
        above = np.maximum(canvas.grey - np.float32(grey.LENS), 0)
        canvas.grey += np.float32(variation.bone_density - 1) * above
    if variation.soft_tissue:
        _mix_soft_tissue(canvas, variation.soft_tissue, generator_of(seed, "soft_tissue"))
    if variation.dry:
        _take_soft_tissue_away(canvas)


def _hollow_bone(canvas: VoxelCanvas, contrast: float, rng: np.random.Generator) -> None:
    """Put marrow between trabeculae wherever bone is thick; what lies near its surface stays."""
    from scipy.ndimage import gaussian_filter

    bone = canvas.grey > (grey.LENS + grey.BONE) / 2
    filled = gaussian_filter(bone.astype(np.float32), _DEEP_MM / canvas.spacing, truncate=3.0)
    deep = np.clip((filled - 0.9) / 0.06, 0, 1)
    deep *= canvas.grey < grey.BONE + 500  # neither enamel nor dentine
    gaps = 1 / (1 + np.exp(-4 * (_field(canvas, _TRABECULA_MM, rng) + 0.2)))
    canvas.grey -= np.float32(contrast) * deep * gaps * np.maximum(canvas.grey - np.float32(_MARROW), 0)


def _mix_soft_tissue(canvas: VoxelCanvas, contrast: float, rng: np.random.Generator) -> None:
    """Make some of the soft tissue fat, in lobules."""
    soft = np.abs(canvas.grey - np.float32(grey.SOFT)) < _ALIKE
    fat = np.clip(2 * _field(canvas, _LOBULE_MM, rng), 0, 1)
    canvas.grey -= np.float32(contrast) * soft * fat * np.float32(grey.SOFT - _FAT)


def _take_soft_tissue_away(canvas: VoxelCanvas) -> None:
    """Make air of all that is no bone; its edges stay between bone and air."""
    share = np.clip((canvas.grey - np.float32(grey.SOFT)) / np.float32(grey.BONE - grey.SOFT), 0, None)
    canvas.grey[:] = np.where(share < 1, grey.AIR + share * np.float32(grey.BONE - grey.AIR), canvas.grey)


def _field(canvas: VoxelCanvas, width: float, rng: np.random.Generator) -> Values:
    """Return random values of mean 0 and standard deviation 1 that change over about `width` mm."""
    from scipy.ndimage import gaussian_filter

    noise = rng.standard_normal(canvas.grey.shape, dtype=np.float32)
    smooth: Values = gaussian_filter(noise, width / canvas.spacing, mode="wrap", truncate=3.0)
    smooth /= smooth.std() or np.float32(1)
    return smooth
