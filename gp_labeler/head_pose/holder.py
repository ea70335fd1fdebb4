"""Telling a holder from bone: a tube or a cradle is the same in every cross-section, a head is not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray

if TYPE_CHECKING:
    from gp_labeler.head_pose.bone import CoarseScan

__all__ = ["sameness_along_axis", "without_holders"]

_Mask = NDArray[np.bool_]

_HEAD, _HOLDER = 0.55, 0.7
"""Sameness along the axis of a head, at most, and of a holder, at least."""

_SMALLEST, _FEWEST_VOXELS, _MOST = 0.05, 100, 6
"""Islands that are looked at: their size over that of the largest, their voxels, and how many."""

_N_POINTS = 4000
_SHIFTS = (-0.3, -0.15, 0.15, 0.3)
"""By how much it is moved along itself, as parts of its length."""

_ENDS_PERCENT = (1.0, 99.0)


def without_holders(scan: CoarseScan, levels: Sequence[float]) -> CoarseScan:
    """Return a scan as if tubes and cradles as bright as bone had not been measured.

    They are as symmetric as a head, about a plane of their own. Only what touches no bone is told from it,
    and only if something else is clearly no holder.

    Parameters
    ----------
    scan : CoarseScan
    levels : sequence of float
        Grey values at which bone may begin.
    """
    for level in levels:
        numbers, sizes = scan.islands_above(level)
        holders = _holders(scan, numbers, sizes)
        if len(holders):
            scan = scan.without(np.isin(numbers, holders))
    return scan


def _holders(scan: CoarseScan, numbers: NDArray[Any], sizes: NDArray[Any]) -> NDArray[np.intp]:
    """Return the numbers of the large islands that are holders, if another one is clearly none."""
    largest = np.argsort(-sizes)[:_MOST]
    large: NDArray[np.intp] = largest[sizes[largest] > max(_SMALLEST * sizes.max(), _FEWEST_VOXELS)]
    if len(large) < 2:
        return large[:0]
    same = np.array([sameness_along_axis(scan, numbers == island) for island in large])
    holders: NDArray[np.intp] = large[(same > _HOLDER) & (same.min() < _HEAD)]
    return holders


def sameness_along_axis(scan: CoarseScan, mask: NDArray[np.bool_]) -> float:
    """Return which part of an island lies in the island again when it is moved along one of its main axes.

    The axis of what is extruded is one of its three main axes, since its cross-section does not change along
    it; of the three, the one of the largest part counts.

    Parameters
    ----------
    scan : CoarseScan
    mask : (nz, ny, nx) bool array
        The voxels of the island.

    Returns
    -------
    float
        0 to 1. Holders have 0.76 to 1, the bone of heads 0.47 at most (phantoms and mice).
    """
    from scipy.ndimage import binary_dilation

    places = scan.places(np.argwhere(mask)[:, ::-1])
    around = places - places.mean(axis=0)
    axes = np.linalg.eigh(np.cov(around.T))[1].T
    chosen = np.random.default_rng(0).permutation(len(places))[:_N_POINTS]
    grown = binary_dilation(mask)
    return max(_sameness(scan, grown, places[chosen], (around @ axis)[chosen], axis) for axis in axes)


def _sameness(
    scan: CoarseScan, grown: _Mask, places: FloatArray, along: FloatArray, axis: FloatArray
) -> float:
    """Return the part that lies in the island again, of the shift for which it is the smallest."""
    low, high = np.percentile(along, _ENDS_PERCENT)
    found = []
    for part in _SHIFTS:
        moved = along + part * (high - low)
        stays = (moved > low) & (moved < high)
        lies_in = _lies_in(scan, grown, places[stays] + part * (high - low) * axis)
        found.append(float(lies_in.mean()) if len(lies_in) else 0.0)  # it has no length along the axis
    return min(found)


def _lies_in(scan: CoarseScan, mask: _Mask, points: FloatArray) -> _Mask:
    index = np.rint(scan.indices(points)).astype(np.intp)
    last = np.array(mask.shape[::-1]) - 1
    i, j, k = np.clip(index, 0, last).T
    there: _Mask = np.all((index >= 0) & (index <= last), axis=1) & mask[k, j, i]
    return there
