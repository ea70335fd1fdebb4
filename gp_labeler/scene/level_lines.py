"""Where the values of a slice pass a level: marching squares, over those cells only that are cut."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray

__all__ = ["level_segments"]

_CORNERS = np.array([(0, 0), (0, 1), (1, 1), (1, 0)])
"""Row and column of the corners of a cell, around it; edge n leads from corner n to the next."""

_JOINED = np.array(
    [
        *[(0, 0), (3, 0), (0, 1), (3, 1), (1, 2), (3, 0), (0, 2), (3, 2)],
        *[(2, 3), (0, 2), (0, 1), (1, 2), (1, 3), (0, 1), (0, 3), (0, 0)],
        *[(1, 2), (2, 3)],
    ]
)
"""Which two edges a line joins, by which corners lie above: one bit for each. The last two: `_SADDLES`."""

_SADDLES = {0b0101: 16, 0b1010: 17}
"""Where two corners that face each other lie above, each is cut off by a line, as by VTK's flying edges."""

_ENDS = np.stack([_CORNERS[_JOINED], _CORNERS[(_JOINED + 1) % 4]], axis=1)
"""(18, 2, 2, 2): row and column of the first and the second ends of these two edges."""


def level_segments(values: NDArray[Any], level: float) -> FloatArray:
    """Return the lines along which (h, w) values pass a level; none beside values that are not finite.

    These are the lines in which flying edges would cut the slice. VTK is not asked for them: it shares its
    threads with the meshing in the background, and would make the window wait.

    Parameters
    ----------
    values : (h, w) array
        Of any type and strides.
    level : float
        Values of it and above lie on one side.

    Returns
    -------
    (M, 2, 2) float array
        Start and end of each line segment, as column and row.

    References
    ----------
    Lorensen and Cline 1987, Marching cubes, doi:10.1145/37402.37422; here in two dimensions.
    """
    cell, case = _cut_cells(values, level)
    second = [(np.flatnonzero(case == saddle), line) for saddle, line in _SADDLES.items()]
    cell = np.concatenate([cell, *(cell[where] for where, _ in second)])
    case = np.concatenate([case, *(np.full(len(where), line) for where, line in second)])
    start, end = np.moveaxis(_ENDS[case] + cell[:, None, None], 1, 0)
    before, after = (values[at[..., 0], at[..., 1]].astype(np.float64) for at in (start, end))
    finite = np.isfinite(before) & np.isfinite(after)
    share = np.divide(level - before, after - before, where=finite, out=np.zeros_like(before))
    points: FloatArray = start + share[..., None] * (end - start)
    return points[finite.all(axis=1), :, ::-1]


def _cut_cells(values: NDArray[Any], level: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return (N, 2) row and column of the cells that the level passes through, and their case, (N,)."""
    width = values.shape[1]
    whole = values.dtype.kind in "iub"  # compared as they are, not as floats
    above = np.ravel(values >= (math.ceil(level) if whole else level)).view(np.uint8)
    n = max(above.size - width - 1, 0)
    case = above[:n] + 2 * above[1 : n + 1] + 4 * above[width + 1 :] + 8 * above[width : width + n]
    flat = np.flatnonzero((case > 0) & (case < 15))
    flat = flat[flat % width < width - 1]  # else it has its right corners in the next row
    return np.stack(np.divmod(flat, width), axis=1), case[flat].astype(np.intp)
