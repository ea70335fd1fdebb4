"""A scan at reduced resolution: the mean of cubes of voxels, by compiled loops."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["means_of_cubes"]

_WORKERS = 2


@njit(nogil=True, cache=True)
def _fill(values: Any, side: int, level: float, out: Any, first: int, last: int) -> None:
    """Write the layers from `first` to `last` of the means above the level."""
    _, ny, nx = out.shape
    share = np.float32(1.0 / side**3)
    row = np.empty(nx, np.float32)
    for k in range(first, last):
        for j in range(ny):
            row[:] = 0
            for dk in range(side):
                for dj in range(side):
                    line = values[k * side + dk, j * side + dj]
                    for i in range(nx):
                        for di in range(side):
                            row[i] += np.float32(line[i * side + di] - level)
            for i in range(nx):
                out[k, j, i] = row[i] * share


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
    with ThreadPoolExecutor(_WORKERS) as pool:
        list(pool.map(lambda a, b: _fill(values, side, float(level), out, a, b), cuts, cuts[1:]))
    return out
