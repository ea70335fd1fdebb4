"""Where a level runs through a picture: marching squares, in numpy.

VTK's flying edges share their threads with the meshing in the background, and let the window wait for it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray

__all__ = ["level_segments"]

_CORNERS = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
"""Row and column of a square's corners, one after the other round it; edge n runs from corner n to n + 1."""

_CUT: dict[int, tuple[tuple[int, int], ...]] = {
    1: ((3, 0),), 2: ((0, 1),), 3: ((3, 1),), 4: ((1, 2),), 5: ((3, 0), (1, 2)), 6: ((0, 2),), 7: ((3, 2),),
    8: ((2, 3),), 9: ((2, 0),), 10: ((0, 1), (2, 3)), 11: ((2, 1),), 12: ((1, 3),), 13: ((1, 0),),
    14: ((0, 3),),
}  # fmt: skip
"""Which edges a line joins, by which corners are above the level: bit n for corner n."""


def level_segments(values: NDArray[Any], level: float) -> FloatArray:
    """Return the (M, 2, 2) line segments, columns and rows, along which (h, w) values pass a level."""
    values = np.ascontiguousarray(values)
    above = values >= level
    code = (
        above[:-1, :-1].astype(np.uint8)
        | above[:-1, 1:].astype(np.uint8) << 1
        | above[1:, 1:].astype(np.uint8) << 2
        | above[1:, :-1].astype(np.uint8) << 3
    )
    row, column = np.nonzero((code > 0) & (code < 15))
    cases = code[row, column]
    found = [np.empty((0, 2, 2))]
    for case in np.unique(cases).tolist():
        squares = np.stack([row, column], axis=1)[cases == case]
        for first, last in _CUT[case]:
            ends = [_crossing(values, level, squares, edge) for edge in (first, last)]
            found.append(np.stack(ends, axis=1))
    return np.concatenate(found)[:, :, ::-1]


def _crossing(values: NDArray[Any], level: float, squares: NDArray[np.int64], edge: int) -> FloatArray:
    """Return the (N, 2) rows and columns at which the level passes an edge of squares."""
    start, end = squares + _CORNERS[edge], squares + _CORNERS[(edge + 1) % 4]
    low, high = (values[corner[:, 0], corner[:, 1]].astype(np.float64) for corner in (start, end))
    part = (level - low) / (high - low)
    crossing: FloatArray = start + part[:, None] * (end - start)
    return crossing
