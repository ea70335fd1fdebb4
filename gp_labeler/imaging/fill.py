"""Fill values: what a file holds where the scanner measured nothing: outside its circle, in lost slices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Fill", "Replacement", "find_fill", "lowest", "replace_fill", "replacement_of"]

_Array = NDArray[Any]
_Mask = NDArray[np.bool_]

_SLICES, _ACROSS = 24, 128
"""As many slices, and pixels along their edges, are looked at."""

_FEWEST, _MOST = 0.002, 0.95
"""Part of the voxels that can be fill."""

_ALWAYS, _HARDLY_EVER = 0.99, 0.05
"""Part of the voxels outside the circle, and inside, that have its value."""

_APART = 0.1
"""An extreme value stands apart if the next one is this far off, in units of the range of all others."""

_ONCE, _ALIKE = 0.97, 0.5
"""Part of the lines that enter the field once; squared steps between neighbours, over those of any two."""


@dataclass(frozen=True, eq=False)
class Fill:
    """A fill value, which marks voxels that were not measured.

    Parameters
    ----------
    value : float
        The value; NaN for all that are not finite.
    outside : (y, x) bool array, optional
        Where in every slice it marks unmeasured pixels; None: everywhere.
    """

    value: float
    outside: _Mask | None = None

    def where(self, plane: _Array) -> _Mask:
        """Return which pixels of a (y, x) slice were not measured."""
        here = ~np.isfinite(plane) if np.isnan(self.value) else plane == self.value
        return np.asarray(here if self.outside is None else here & self.outside)

    def occurs(self, values: _Array) -> bool:
        """Return whether some of the values, of any shape, were not measured; without a mask of them all."""
        if values.ndim < 3 or len(values) < 2:
            return bool(self.where(values).any())
        return any(bool(self.where(plane).any()) for plane in values)

    def part(self, j: Any, i: Any) -> Fill:
        """Return the fill of some of the pixels, by their indices along y and x."""
        return self if self.outside is None else Fill(self.value, self.outside[j, i])


def find_fill(array: _Array, known: float | None = None, *, sampled: bool = False) -> tuple[Fill, ...]:
    """Find the fill values of a (z, y, x) scan; the file may state one.

    `sampled` looks for values that are not finite in some slices only, as for all others, so that a scan is
    not read as a whole.

    A fill is one exact value. It is known by its place, the same part of every slice around a middle that has
    other values, as outside a scanner's circle; or by standing apart from all others, as the lowest or
    highest, around a part without dents, as a scanner's field is. Air that a program masked or cut off is no
    fill: bone begins there.
    """
    found: list[Fill] = [] if known is None else [Fill(float(known))]
    ks, js, is_ = (_spread(n, most) for n, most in zip(array.shape, (_SLICES, _ACROSS, _ACROSS), strict=True))
    looked_at = (array[k] for k in ks) if sampled else iter(array)
    if array.dtype.kind == "f" and not all(np.isfinite(plane).all() for plane in looked_at):
        found.append(Fill(np.nan))
    sample = array[np.ix_(ks, js, is_)]
    left = np.isfinite(sample) & (True if known is None else sample != known)
    for _ in range(3):
        fill = _circle(array, sample, left, ks) or _extreme(sample, left)
        if fill is None:
            break
        found.append(fill)
        outside = None if fill.outside is None else fill.outside[np.ix_(js, is_)]
        left &= ~np.stack([Fill(fill.value, outside).where(plane) for plane in sample])
    return tuple(found)


@dataclass(frozen=True)
class Replacement:
    """What replaces the fill value of a scan.

    Parameters
    ----------
    below : float
        A value below all measured ones; the lowest where the type has none.
    has_room : bool
        Whether it is below all measured ones.
    notes : tuple of str
        What was found, for the record.
    """

    below: float = 0.0
    has_room: bool = False
    notes: tuple[str, ...] = ()

    @property
    def fill(self) -> float | None:
        """The value that counts as fill; None where measured voxels have it too."""
        return self.below if self.has_room else None


def replacement_of(array: _Array, fills: tuple[Fill, ...]) -> Replacement:
    """Find one value below all measured ones, for wherever a scan has a fill.

    Parameters
    ----------
    array : (z, y, x) array
        Grey values, read plane by plane.
    fills : tuple of Fill
        What `find_fill` found.
    """
    if not fills:
        return Replacement()
    counts, low, high = np.zeros(len(fills), dtype=np.int64), np.inf, -np.inf
    for plane in array:
        nothing = np.zeros(plane.shape, dtype=bool)
        for n, fill in enumerate(fills):
            here = fill.where(plane) & ~nothing
            counts[n] += int(here.sum())
            nothing |= here
        if not nothing.all():
            measured = plane[~nothing]
            low, high = min(low, float(measured.min())), max(high, float(measured.max()))
    if not np.isfinite(low):
        low = high = 0.0
    below, room = _below(low, high, array.dtype)
    if len(fills) == 1 and np.isnan(fills[0].value) and counts[0] < _FEWEST * array.size:
        below, room = low, False  # a few holes, not a part that lies outside
    notes = tuple(_note(fill, int(n), array.size) for fill, n in zip(fills, counts, strict=True) if n)
    return Replacement(below, room, notes)


def lowest(array: _Array) -> float:
    """Return the lowest finite value of some slices of a (z, y, x) scan."""
    planes = (array[k] for k in _spread(len(array), _SLICES))
    return min((float(p[np.isfinite(p)].min()) for p in planes if np.isfinite(p).any()), default=0.0)


def replace_fill(array: _Array, fills: tuple[Fill, ...], replacement: Replacement) -> None:
    """Put the replacement wherever a (z, y, x) scan in memory has a fill."""
    for plane in array if fills else ():
        nothing = np.logical_or.reduce([fill.where(plane) for fill in fills])
        plane[nothing] = replacement.below


def _note(fill: Fill, n: int, size: int) -> str:
    what = "without a finite value" if np.isnan(fill.value) else f"of the value {fill.value:g}"
    part = f"{100 * n / size:.2g} %"
    return f"{n} voxels {what} ({part}) are fill values, and count as neither bone nor air"


def _below(low: float, high: float, dtype: np.dtype[Any]) -> tuple[float, bool]:
    """Return a value below the lowest one, and whether the type has room for it."""
    if dtype.kind in "iu":
        room = low > np.iinfo(dtype).min
        return (low - 1 if room else low), room
    step = 1.0 if high - low >= 1 else 0.05 * (high - low) or 1.0
    below = dtype.type(low - max(step, 4 * float(np.spacing(dtype.type(abs(low))))))
    return float(below), bool(np.isfinite(below))


def _spread(n: int, most: int) -> NDArray[np.intp]:
    """Return at most so many of n indices, the first and last among them."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(np.intp))


def _circle(array: _Array, sample: _Array, left: _Mask, ks: NDArray[np.intp]) -> Fill | None:
    """Return the value that fills the corners of every slice, and the same part of each."""
    there = left.any(axis=(1, 2))
    sample, left, ks = sample[there], left[there], ks[there]
    rows, columns = [0, 0, -1, -1], [0, -1, 0, -1]
    if len(ks) < 4 or not left[:, rows, columns].all():
        return None
    value = sample[0, 0, 0]
    if (sample[:, rows, columns] == value).mean() < _ALWAYS:
        return None
    here = (sample == value) & left
    outside = here.mean(axis=0) > 0.5
    if not _FEWEST <= outside.mean() <= _MOST:
        return None
    if here[:, outside].mean() < _ALWAYS or here[:, ~outside].mean() > _HARDLY_EVER:
        return None
    return Fill(float(value), (array[ks] == value).mean(axis=0) > 0.5)


def _extreme(sample: _Array, left: _Mask) -> Fill | None:
    """Return the lowest or highest value, if it stands apart, around a measured part without dents."""
    if not left.any():
        return None
    for value in (sample[left].min(), sample[left].max()):
        measured = left & (sample != value)
        rest = sample[measured].astype(np.float64)
        if not _FEWEST <= 1 - len(rest) / left.sum() <= _MOST or not len(rest):
            continue
        low, high = np.percentile(rest, (0.1, 99.9))
        gap = min(abs(rest.min() - value), abs(rest.max() - value))
        if gap > _APART * (high - low) and _has_no_dents(measured) and _has_structure(sample, measured):
            return Fill(float(value))
    return None


def _has_no_dents(measured: _Mask) -> bool:
    """Return whether lines along two axes or more enter what was measured once only."""
    single = []
    for axis in range(3):
        along = np.moveaxis(measured, axis, -1)
        enters = along[..., 0] + (along[..., 1:] & ~along[..., :-1]).sum(axis=-1)
        single.append(float((enters[enters > 0] == 1).mean()))
    return sorted(single)[1] > _ONCE


def _has_structure(sample: _Array, measured: _Mask) -> bool:
    """Return whether neighbours are more alike than any two voxels; in mere noise they are not."""
    pairs = measured[..., 1:] & measured[..., :-1]
    values = sample[measured].astype(np.float64)
    if not pairs.any():
        return False
    steps = sample[..., 1:][pairs].astype(np.float64) - sample[..., :-1][pairs]
    return bool(np.mean(steps**2) < 2 * _ALIKE * values.var())
