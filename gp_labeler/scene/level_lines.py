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

_FROM = _CORNERS[_JOINED]
_STEPS = _CORNERS[(_JOINED + 1) % 4] - _FROM
"""(18, 2, 2): row and column of the first ends of these two edges, and the steps to the second ones."""


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
    width, flat = values.shape[1], np.ravel(values)
    cell, case = _cut_cells(flat, width, level)
    start = cell[:, None] + (_FROM @ [width, 1]).take(case, axis=0)
    before = flat.take(start).astype(np.float64)
    after = flat.take(start + (_STEPS @ [width, 1]).take(case, axis=0)).astype(np.float64)
    with np.errstate(invalid="ignore"):
        share = (level - before) / (after - before)
    points: FloatArray = _FROM[..., ::-1].astype(np.float64).take(case, axis=0)
    points += np.stack(np.divmod(cell, width)[::-1], axis=1)[:, None]
    points += _STEPS[..., ::-1].astype(np.float64).take(case, axis=0) * share[..., None]
    if values.dtype.kind not in "iub":
        points = points[(np.isfinite(before) & np.isfinite(after)).all(axis=1)]
    return points


def _cut_cells(flat: NDArray[Any], width: int, level: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the numbers of the cells that the level passes through, (N,), and which lines cut them, (N,).

    A cell has the number of its first corner among the values, which are given row by row.
    """
    whole = flat.dtype.kind in "iub"  # compared as they are, not as floats
    above = (flat >= (math.ceil(level) if whole else level)).view(np.uint8)
    n = max(above.size - width - 1, 0)
    case = above[:n] + 2 * above[1 : n + 1] + 4 * above[width + 1 :] + 8 * above[width : width + n]
    cell = np.flatnonzero((case > 0) & (case < 15))
    cell = cell[cell % width < width - 1]  # else it has its right corners in the next row
    case = case[cell].astype(np.intp)
    second = [(cell[case == saddle], line) for saddle, line in _SADDLES.items()]
    lines = [case, *(np.full(len(cells), line) for cells, line in second)]
    return np.concatenate([cell, *(cells for cells, _ in second)]), np.concatenate(lines)
