"""One grey channel of whatever a file holds: colours, palettes, wide and odd number types."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gp_core.errors import GpError

__all__ = ["check_channel", "loaded_dtype", "narrowing", "needs_float64", "palette_as_grey", "to_grey"]

_KEPT = ("uint8", "int16", "uint16", "int32", "uint32", "float32")
_WIDENED = {"bool": "uint8", "int8": "int16"}
_SAMPLES, _FINE_ENOUGH = 200_000, 1e-3
_LUMINANCE = (299, 587, 114)  # ITU-R BT.601, in thousandths


def loaded_dtype(dtype: DTypeLike) -> np.dtype[Any]:
    """Return the native type in which voxels of `dtype` are held: 8, 16 or 32 bit, else float32.

    Raises
    ------
    GpError
        Complex numbers or records.
    """
    stored = np.dtype(dtype)
    if stored.kind not in "biuf":
        problem = f"its voxels must be integers or floats, got {stored}"
        raise GpError(problem, remedy="Save the grey values only.")
    if stored.name in _KEPT:
        return stored.newbyteorder("=")
    return np.dtype(_WIDENED.get(stored.name, "float32"))


def narrowing(dtype: DTypeLike) -> str | None:
    """Return a note where `loaded_dtype` changes the type, else None."""
    stored, loaded = np.dtype(dtype), loaded_dtype(dtype)
    return None if stored.name == loaded.name else f"{stored.name} values were converted to {loaded.name}"


def needs_float64(stored: DTypeLike, loaded: NDArray[Any]) -> bool:
    """Return whether 64-bit values that were loaded as float32 differ too little beside their size for it."""
    if np.dtype(stored).itemsize < 8 or loaded.dtype != np.float32:
        return False
    stride = max(1, round((loaded.size / _SAMPLES) ** (1 / 3)))
    sample = loaded[::stride, ::stride, ::stride]
    sample = sample[np.isfinite(sample)]
    if not sample.size:
        return False
    low, high = np.percentile(sample, (0.1, 99.9))
    step = float(np.spacing(np.float32(max(abs(low), abs(high)))))
    return step > _FINE_ENOUGH * (float(high) - float(low))


def check_channel(channel: int | None, n_channels: int) -> None:
    """Raise `GpError` unless there is such a channel; None asks for none."""
    if channel is not None and not 0 <= channel < n_channels:
        raise GpError(f"channel must be 0 to {n_channels - 1}, got {channel}")


def to_grey(plane: NDArray[Any], channel: int | None = None) -> NDArray[Any]:
    """Return the (y, x) grey image of a (y, x) or (y, x, channels) one, in the same type.

    Three or more channels become luminance (ITU-R BT.601; grey stays exactly as it is, alpha is dropped),
    unless a channel is asked for; of one or two the first is taken.

    Raises
    ------
    GpError
        There is no such channel.
    """
    if plane.ndim == 2:
        return plane
    n_channels = plane.shape[2]
    check_channel(channel, n_channels)
    if channel is not None or n_channels < 3:
        return plane[..., channel or 0]
    wide = np.float64 if plane.dtype.kind == "f" else np.int64
    total = sum(
        (weight * plane[..., c].astype(wide) for c, weight in enumerate(_LUMINANCE)), np.zeros((), wide)
    )
    grey = total / 1000 if plane.dtype.kind == "f" else (total + 500) // 1000
    return np.asarray(grey).astype(plane.dtype)


def palette_as_grey(indices: NDArray[Any], colours: NDArray[Any], channel: int | None = None) -> NDArray[Any]:
    """Return the grey image of (y, x) palette indices and their (n, 3) colours, as uint8.

    Colours of 16 bit, as TIFF has them, are brought down to the 8 bit that the palette stands for.
    """
    table = to_grey(np.asarray(colours)[None], channel)[0]
    if table.dtype.itemsize > 1 and table.size and table.max() > 255:
        table = table >> 8
    lookup = np.zeros(max(256, len(table)), np.uint8)
    lookup[: len(table)] = table
    grey: NDArray[Any] = lookup[indices]
    return grey
