"""A scan at reduced resolution: the mean of cubes of voxels, by compiled loops."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["means_of_cubes"]

_WORKERS = 2

_SUMMED_AS_INTEGERS = ("bool", "uint8", "int8", "uint16", "int16")
"""Types of which the values of many cubes' worth of rows fit into 32 bit."""

_MOST_ROWS = 1 << 14
"""Of 16-bit values, as many still fit."""


@njit(nogil=True, cache=True)
def _fill(values: Any, side: int, level: float, out: Any, total: Any, first: int, last: int) -> None:
    """Write the layers from `first` to `last` of the means above the level.

    The rows of a cube are added up along their whole length, which the compiler makes fast; only then their
    voxels. `total` is room for the row, and says by its type how to add.
    """
    _, ny, nx = out.shape
    share = 1.0 / side**3
    below = np.float32(level * side**3)
    length = nx * side
    for k in range(first, last):
        for j in range(ny):
            line = values[k * side, j * side]
            for i in range(length):
                total[i] = line[i]
            for n in range(1, side * side):
                line = values[k * side + n // side, j * side + n % side]
                for i in range(length):
                    total[i] += line[i]
            for i in range(nx):
                whole = total[i * side]
                for di in range(1, side):
                    whole += total[i * side + di]
                out[k, j, i] = np.float32((np.float32(whole) - below) * share)


@njit(nogil=True, cache=True)
def _fill_exactly(values: Any, side: int, level: float, out: Any, total: Any, first: int, last: int) -> None:
    """Do the same, taking the level from each value first: so large values keep their differences near it."""
    _, ny, nx = out.shape
    share = 1.0 / side**3
    for k in range(first, last):
        for j in range(ny):
            total[:] = 0.0
            for n in range(side * side):
                line = values[k * side + n // side, j * side + n % side]
                for i in range(nx * side):
                    total[i] += line[i] - level
            for i in range(nx):
                whole = 0.0
                for di in range(side):
                    whole += total[i * side + di]
                out[k, j, i] = np.float32(whole * share)


def means_of_cubes(values: NDArray[Any], side: int, level: float = 0.0) -> NDArray[np.float32]:
    """Return the mean of every cube of voxels above a level; what is left over at the far ends is dropped.

    Parameters
    ----------
    values : (nz, ny, nx) array
        Grey values.
    side : int
        Voxels along each edge of a cube.
    level : float
        Taken from each value first, so that 32 and 64-bit values keep their differences near it.

    Returns
    -------
    (nz // side, ny // side, nx // side) float32 array
    """
    out = np.empty([n // side for n in values.shape], np.float32)
    cuts = np.linspace(0, len(out), _WORKERS + 1).astype(int).tolist()
    narrow = values.dtype.name in _SUMMED_AS_INTEGERS and side**3 < _MOST_ROWS
    fill, kind = (_fill, np.int32) if narrow else (_fill_exactly, np.float64)

    def work(first: int, last: int) -> None:
        fill(values, side, float(level), out, np.empty(values.shape[2], kind), first, last)

    with ThreadPoolExecutor(_WORKERS) as pool:
        list(pool.map(work, cuts, cuts[1:]))
    return out
