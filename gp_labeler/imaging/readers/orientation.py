"""The Orientation tag of TIFF and EXIF: how stored rows and columns lie in the picture."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["ORIENTATION_TAG", "oriented", "orienting", "swaps_axes"]

ORIENTATION_TAG = 274
_FLIPS_ROWS, _FLIPS_COLUMNS, _SWAPS = (3, 4, 7, 8), (2, 3, 6, 7), (5, 6, 7, 8)


def swaps_axes(orientation: int) -> bool:
    """Return whether stored rows are columns of the picture."""
    return orientation in _SWAPS


def oriented(plane: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Return a (y, x) plane as the picture shows it, a view.

    Parameters
    ----------
    plane : (y, x) array
        As stored.
    orientation : int
        1 to 8, as TIFF 6.0 (tag 274) and EXIF number them; anything else counts as 1.
    """
    if orientation in _SWAPS:
        plane = plane.T
    rows = slice(None, None, -1 if orientation in _FLIPS_ROWS else 1)
    columns = slice(None, None, -1 if orientation in _FLIPS_COLUMNS else 1)
    return plane[rows, columns]


def orienting(
    finish: Callable[[NDArray[Any]], NDArray[Any]], orientation: int
) -> Callable[[NDArray[Any]], NDArray[Any]]:
    """Return `finish`, followed by `oriented` where that changes anything."""
    return finish if orientation not in range(2, 9) else partial(_then_oriented, finish, orientation)


def _then_oriented(
    finish: Callable[[NDArray[Any]], NDArray[Any]], orientation: int, plane: NDArray[Any]
) -> NDArray[Any]:
    return np.asarray(oriented(finish(plane), orientation))
