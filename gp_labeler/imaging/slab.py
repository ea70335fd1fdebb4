"""Thick slabs and light denoising of slices: to look at, never to measure or to place on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GpError
from gp_core.validation import check_option

__all__ = ["DENOISERS", "SLAB_MODES", "THICKEST_MM", "THINNEST_MM", "Slab", "denoised", "reduced"]

THINNEST_MM, THICKEST_MM = 0.1, 2.0

_SMOOTHING_VOXELS = 1.0
_RANGE_NOISE = 2.5
"""Grey values that differ by so many times the noise are taken for an edge, and not mixed."""

_NOISE_ROWS = 64


@dataclass(frozen=True)
class Slab:
    """A thick slab in place of a single slice.

    Parameters
    ----------
    mode : str
        ``mean``, ``maximum`` or ``minimum`` of the grey values across the slab.
    mm : float
        Its thickness, 0.1 to 2 mm.

    Raises
    ------
    GpError
        Another mode, or another thickness.
    """

    mode: str
    mm: float

    def __post_init__(self) -> None:
        check_option(self.mode, "slab", SLAB_MODES)
        if not THINNEST_MM <= self.mm <= THICKEST_MM:
            raise GpError(f"a slab must be {THINNEST_MM:g} to {THICKEST_MM:g} mm thick, got {self.mm:g} mm")

    def n_layers(self, step_mm: float) -> int:
        """Return how many layers of a step lie in it: an odd number, so that the slice is its middle."""
        return 2 * round((self.mm / step_mm - 1) / 2) + 1 if self.mm > step_mm else 1


_REDUCE: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {"mean": np.mean, "maximum": np.max, "minimum": np.min}
)
SLAB_MODES = tuple(_REDUCE)


def reduced(layers: NDArray[Any], axis: int, mode: str) -> NDArray[Any]:
    """Return the mean, maximum or minimum of layers of grey values along an axis, in their own type.

    Parameters
    ----------
    layers : array
        Grey values.
    axis : int
        Across the slab.
    mode : str
        One of `SLAB_MODES`.
    """
    if mode != "mean":
        return np.asarray(_REDUCE[mode](layers, axis=axis))
    mean = np.mean(layers, axis=axis, dtype=np.float32 if layers.dtype.itemsize <= 4 else np.float64)
    return np.rint(mean).astype(layers.dtype) if layers.dtype.kind in "iu" else mean.astype(layers.dtype)


def denoised(values: NDArray[Any], kind: str) -> NDArray[Any]:
    """Return a slice with less noise, in the type it has.

    Parameters
    ----------
    values : (h, w) array
        Grey values.
    kind : str
        ``median`` of 3 by 3 pixels, ``gaussian`` (standard deviation of one pixel), or ``bilateral``: as the
        Gaussian, but grey values that differ by more than some 2.5 times the noise do not mix.

    Raises
    ------
    GpError
        Another kind.

    References
    ----------
    Tomasi and Manduchi 1998, Bilateral filtering, doi:10.1109/ICCV.1998.710815.
    """
    check_option(kind, "denoise", DENOISERS)
    smooth = DENOISERS[kind](np.ascontiguousarray(values))
    return np.rint(smooth).astype(values.dtype) if values.dtype.kind in "iu" else smooth.astype(values.dtype)


def _median(values: NDArray[Any]) -> NDArray[Any]:
    import SimpleITK as sitk  # noqa: N813 - here: it is not needed before somebody asks for it

    odd = values.dtype.kind == "b" or values.dtype.itemsize > 4
    median: Any = sitk.Median  # it has no types
    image = sitk.GetImageFromArray(values.astype(np.float32) if odd else values)
    return np.asarray(sitk.GetArrayFromImage(median(image, [1, 1])))


def _gaussian(values: NDArray[Any]) -> NDArray[Any]:
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(values.astype(np.float32), _SMOOTHING_VOXELS, truncate=2.5))


def _bilateral(values: NDArray[Any]) -> NDArray[Any]:
    from skimage.restoration import denoise_bilateral

    grey = values.astype(np.float32)
    noise = _noise(grey)
    if not noise > 0:
        return grey
    low = float(grey.min())
    smooth: Any = denoise_bilateral(
        grey - low, win_size=5, sigma_color=_RANGE_NOISE * noise, sigma_spatial=_SMOOTHING_VOXELS, mode="edge"
    )
    return np.asarray(smooth) + low


def _noise(values: NDArray[np.float32]) -> float:
    """Return the standard deviation of the noise, from differences of neighbours in some rows."""
    rows = values[:: max(1, len(values) // _NOISE_ROWS)]
    if rows.shape[1] < 2:
        return 0.0
    return float(np.median(np.abs(np.diff(rows, axis=1)))) / (0.6745 * 2**0.5)


DENOISERS: Mapping[str, Callable[[NDArray[Any]], NDArray[Any]]] = MappingProxyType(
    {"median": _median, "gaussian": _gaussian, "bilateral": _bilateral}
)
"""How a slice is denoised, by name."""
