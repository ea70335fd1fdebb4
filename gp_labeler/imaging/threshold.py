"""Where bone ends: a threshold proposed from the histogram, and the level at which a surface is cut."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.imaging.volume import Volume
from gp_labeler.imaging.voxels import Voxels

__all__ = ["LEVEL_SAMPLES", "holds_integers", "propose_threshold", "surface_level", "volume_level"]

_BINS = 256
_SAMPLES = 500_000
LEVEL_SAMPLES = 500_000
"""Voxels that are asked whether a scan holds whole numbers."""

_TAILS_PERCENT = (0.05, 99.9)
"""Metal and teeth are few and very bright; left in, they stretch the histogram and pull the threshold up."""

_TWO_CLASSES_ABOVE = 0.3
_INTEGER_TOLERANCE = 1e-3


def propose_threshold(volume: Volume) -> float:
    """Propose the grey value that parts bone from soft tissue and air.

    Otsu's method with three classes gives two thresholds. Where air, tissue and bone stand apart, the upper
    one is meant. Where tissue is nearly as dark as air, or there is none (a dry skull), bone is one of only
    two real classes, and the plain two-class threshold is nearer to the edge of thin bone: it then lies well
    above the lower of the three-class thresholds.

    Parameters
    ----------
    volume : Volume
        The scan.

    Returns
    -------
    float
        Grey value in the volume's own units.

    Raises
    ------
    GpError
        All voxels have the same value.

    References
    ----------
    Otsu 1979, doi:10.1109/TSMC.1979.4310076; Liao, Chen and Chung 2001, J. Inf. Sci. Eng. 17, 713-727.
    """
    values = _block_means(volume.voxels, volume.fill)
    volume.check()
    values = values[np.isfinite(values)]
    low, high = np.percentile(values, _TAILS_PERCENT) if len(values) else (0.0, 0.0)
    if not low < high:
        low, high = (values.min(), values.max()) if len(values) else (0.0, 0.0)
    if not low < high:
        raise GpError(
            f"the volume has no contrast: every voxel is {low:g}",
            file=volume.path,
            remedy="Check that the right series or folder was opened.",
        )
    counts, edges = np.histogram(values.clip(low, high), bins=_BINS)
    histogram = (counts, (edges[1:] + edges[:-1]) / 2)
    two = _otsu(histogram, 2)[0]
    if np.count_nonzero(counts) < 3:
        return two
    lower, upper = _otsu(histogram, 3)
    return two if two - lower > _TWO_CLASSES_ABOVE * (upper - lower) else upper


def _otsu(histogram: tuple[NDArray[Any], FloatArray], classes: int) -> list[float]:
    from skimage.filters import threshold_multiotsu  # imports much of scipy: only where it is needed

    found = threshold_multiotsu(hist=histogram, classes=classes)  # type: ignore[no-untyped-call]
    return [float(threshold) for threshold in found]


def _block_means(voxels: Voxels, fill: float | None) -> FloatArray:
    """Average 2 x 2 x 2 blocks on a coarse grid: noise falls by 2.8, and large scans stay quick.

    A block that holds a voxel that was not measured has no mean.
    """
    stride = max(1, int(np.ceil((voxels.size / _SAMPLES) ** (1 / 3))))
    span = [max(1, n - 1) for n in voxels.shape]
    total = np.zeros(1)
    for corner in np.ndindex(2, 2, 2):
        shift = [c if n > 1 else 0 for c, n in zip(corner, voxels.shape, strict=True)]
        k, j, i = (slice(s, n + s, stride) for s, n in zip(shift, span, strict=True))
        values = voxels.read(k, j, i).astype(np.float64)
        if fill is not None:
            values[values == fill] = np.nan
        total = total + values
    return np.asarray(total / 8).ravel()


def holds_integers(array: NDArray[Any]) -> bool:
    """Whether the values are whole numbers, also where they are stored as floats (seen from a sample)."""
    if not np.issubdtype(array.dtype, np.floating):
        return True
    stride = max(1, int(np.ceil((array.size / LEVEL_SAMPLES) ** (1 / 3))))
    sample = array[::stride, ::stride, ::stride]
    sample = sample[np.isfinite(sample)]
    return bool(np.array_equal(sample, np.rint(sample)))


def volume_level(volume: Volume, threshold: float) -> float:
    """Return the level at which the isosurface of a scan is cut; see `surface_level`.

    Parameters
    ----------
    volume : Volume
        The scan.
    threshold : float
        Voxels of this value and above are bone.
    """
    is_whole = abs(threshold - round(threshold)) < _INTEGER_TOLERANCE
    if not is_whole or volume.dtype.kind in "iub":  # its type says it all: nothing has to be read
        return surface_level(threshold, np.zeros((1, 1, 1), volume.dtype))
    return surface_level(threshold, volume.voxels.sample(LEVEL_SAMPLES))


def surface_level(threshold: float, array: NDArray[Any]) -> float:
    """Return the level at which the isosurface of `threshold` is cut.

    A level that equals voxel values makes the surface run through voxel centres, in needles of no area. On
    integer data the level is therefore half a step lower: the same voxels lie inside.

    Parameters
    ----------
    threshold : float
        Voxels of this value and above are bone.
    array : numpy array
        The voxels.
    """
    nearest = round(threshold)
    if abs(threshold - nearest) < _INTEGER_TOLERANCE and holds_integers(array):
        return nearest - 0.5
    return float(threshold)
