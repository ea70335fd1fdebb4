"""Telling a holder from bone: a tube or a cradle is the same in every cross-section, a head is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.head_pose.mid_plane import hemisphere

if TYPE_CHECKING:
    from gp_labeler.head_pose.bone import CoarseScan

__all__ = ["sameness_along_axis", "without_holders"]

_Mask = NDArray[np.bool_]

_HEAD, _HOLDER = 0.55, 0.9
"""Sameness along the axis of a head, at most, and of a holder, at least."""

_SMALLEST, _FEWEST_VOXELS, _MOST = 0.05, 100, 6
"""Islands that are looked at: their size over that of the largest, their voxels, and how many."""

_N_POINTS = 4000
_SHIFTS = (-0.3, -0.15, 0.15, 0.3)
"""By how much it is moved along itself, as parts of its length."""

_ENDS_PERCENT = (1.0, 99.0)

_N_AXES, _TURNS_DEG = 150, (8.0, 4.0, 2.0)
"""Axes that are tried, over half of the sphere, and by how much the best is turned then."""


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
    """Return which part of an island lies in the island again when it is moved along itself, at most.

    It is moved along the axis that suits it best, for its main axes do not tell that of a holder: they are
    others where the scan cuts a holder that lies askew.

    Parameters
    ----------
    scan : CoarseScan
    mask : (nz, ny, nx) bool array
        The voxels of the island.

    Returns
    -------
    float
        0 to 1. Holders have 0.96 to 1, the bone of heads 0.47 at most, small bones 0.7 (phantoms and mice).
    """
    from scipy.ndimage import binary_dilation

    places = scan.places(np.argwhere(mask)[:, ::-1])
    chosen = np.random.default_rng(0).permutation(len(places))[:_N_POINTS]
    island = _Island(scan, binary_dilation(mask), places[chosen])
    return island.sameness(_best_axis(island.fewer))


@dataclass(frozen=True, eq=False)
class _Island:
    """Some places (N, 3), LPS mm, of an island, and its voxels with their neighbours."""

    scan: CoarseScan
    grown: _Mask
    places: FloatArray

    @property
    def fewer(self) -> _Island:
        """The same with a fifth of the places."""
        return replace(self, places=self.places[::5])

    def sameness(self, axis: FloatArray) -> float:
        """Return the part that lies in the island again, of the shift for which it is the smallest."""
        along = self.places @ axis
        low, high = np.percentile(along, _ENDS_PERCENT)
        found = []
        for part in _SHIFTS:
            shift = part * (high - low)
            moved = self.places + shift * axis
            stays = (along + shift > low) & (along + shift < high) & self.scan.inside(moved)
            lies_in = _lies_in(self.scan, self.grown, moved[stays])
            found.append(float(lies_in.mean()) if len(lies_in) else 0.0)  # it has no length along the axis
        return min(found)


def _best_axis(island: _Island) -> FloatArray:
    """Return the axis (3,) along which an island is most nearly the same, to about a degree."""
    best: FloatArray = max(hemisphere(_N_AXES), key=island.sameness)
    for angle in np.radians(_TURNS_DEG):
        first, second = np.linalg.svd(best[None])[2][1:]
        turned = [
            np.cos(angle) * best + np.sin(angle) * (np.cos(turn) * first + np.sin(turn) * second)
            for turn in np.radians(np.arange(0.0, 360.0, 60.0))
        ]
        best = max([best, *turned], key=island.sameness)
    return best


def _lies_in(scan: CoarseScan, mask: _Mask, points: FloatArray) -> _Mask:
    index = np.rint(scan.indices(points)).astype(np.intp)
    last = np.array(mask.shape[::-1]) - 1
    i, j, k = np.clip(index, 0, last).T
    there: _Mask = np.all((index >= 0) & (index <= last), axis=1) & mask[k, j, i]
    return there
