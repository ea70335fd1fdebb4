"""Which DICOM slices are one volume: by their series, and by places where that does not do."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gp_labeler.imaging.readers.dicom_grid import on_grid
from gp_labeler.imaging.readers.dicom_tags import DicomSlice, same_pixel_size
from gp_labeler.imaging.readers.problems import Problem, warning

__all__ = ["Series", "find_series"]

_SAME_AXES = 0.01
"""Orientations nearer than this, in the largest cosine, are one; `on_grid` looks at the rest."""

_FEWEST_ALONE = 3


@dataclass(frozen=True, eq=False)
class Series:
    """Slices that may be one volume.

    Parameters
    ----------
    slices : tuple of DicomSlice
        In any order.
    part : str
        What parts them from the others of the series, in words.
    found : tuple of Problem
        How they were put together.
    """

    slices: tuple[DicomSlice, ...]
    part: str = ""
    found: tuple[Problem, ...] = ()

    @property
    def first(self) -> DicomSlice:
        """Any of them."""
        return self.slices[0]

    @property
    def id(self) -> str:
        """What names it among others."""
        return " ".join(text for text in (self.first.file.series, self.part) if text)

    @property
    def text(self) -> str:
        """What a person chooses it by."""
        first = self.first
        size = "" if first.pixel is None else f" of {first.pixel[0]:.4g} mm"
        rows, columns = first.file.shape
        part = f", {self.part}" if self.part else ""
        return f"{first.file.description}{part}: {len(self.slices)} slices, {columns} x {rows} pixels{size}"

    @property
    def is_scout(self) -> bool:
        """Whether it is a single slice, or all of it calls itself a scout image."""
        return len(self.slices) < 2 or all(one.file.localizer for one in self.slices)


def find_series(slices: Iterable[DicomSlice]) -> list[Series]:
    """Group slices into volumes; the one with most slices comes first."""
    groups: dict[tuple[object, ...], list[DicomSlice]] = defaultdict(list)
    for one in slices:
        groups[one.file.series, one.file.shape, one.file.channels, one.file.volume].append(one)
    turned = [part for group in groups.values() for part in _by_axes(group)]
    series = [part for group in turned for part in _by_repeats(group)]
    series = _named_apart(_joined(series))
    return sorted(series, key=lambda one: (-len(one.slices), one.first.file.description, one.first.file.path))


def _by_axes(group: Sequence[DicomSlice]) -> list[list[DicomSlice]]:
    """Part slices that are turned against each other; noise in the last digits parts none."""
    return _parted(group, _same_axes)


def _parted(
    group: Sequence[DicomSlice], same: Callable[[DicomSlice, DicomSlice], bool]
) -> list[list[DicomSlice]]:
    parts: list[list[DicomSlice]] = []
    for one in group:
        fitting = (part for part in parts if same(part[0], one))
        part = next(fitting, None)
        parts.append([one]) if part is None else part.append(one)
    return parts


def _same_axes(one: DicomSlice, other: DicomSlice) -> bool:
    if one.axes is None or other.axes is None:
        return one.axes is other.axes
    return bool(np.abs(one.axes - other.axes).max() < _SAME_AXES)


def _same_grid(one: DicomSlice, other: DicomSlice) -> bool:
    return _same_axes(one, other) and same_pixel_size(one, other)


def _by_repeats(group: Sequence[DicomSlice]) -> list[Series]:
    """Part slices at the same places by the tag that tells them apart, and stacks that are no grid."""
    whole = [Series(tuple(group))]
    codes = {problem.code for problem in on_grid(group).problems}
    words = ["stack"] if codes & {"uneven", "gap"} else []
    for word in list(group[0].parts) if "doubled" in codes else words:
        parts: dict[str, list[DicomSlice]] = defaultdict(list)
        for one in group:
            parts[one.parts.get(word, "")].append(one)
        if len(parts) > 1 and all(len(part) > 1 and not _repeats(part) for part in parts.values()):
            return [Series(tuple(part), f"{word} {value}".strip()) for value, part in sorted(parts.items())]
    return whole


def _repeats(part: Sequence[DicomSlice]) -> bool:
    codes = {problem.code for problem in on_grid(part).problems}
    return "doubled" in codes


def _joined(series: list[Series]) -> list[Series]:
    """Join many series of few slices each that lie on one grid: anonymised, or exported one by one."""
    few: dict[tuple[Any, ...], list[Series]] = defaultdict(list)
    for one in series:
        if not one.first.file.localizer and one.first.file.n_frames == 1:
            few[one.first.file.shape, one.first.file.channels].append(one)
    joined = []
    for pool in few.values():
        small = [one for one in pool if len(one.slices) < max(2, len(pool) // 2)]
        others = len(small) < len(series)
        for part in _parted([slice_ for one in small for slice_ in one.slices], _same_grid):
            even = not any(problem.severity == "error" for problem in on_grid(part).problems)
            n = len({one.file.series for one in part})
            if n >= _FEWEST_ALONE and (even or (n == len(part) and not others)):
                joined.append(_as_one(part, n))
    taken = {id(one) for new in joined for one in new.slices}
    return [*joined, *(one for one in series if id(one.first) not in taken)]


def _as_one(slices: Sequence[DicomSlice], n_series: int) -> Series:
    text = f"each of the {len(slices)} slices has its own SeriesInstanceUID; they were put together by place"
    if n_series < len(slices):
        text = f"the {len(slices)} slices have {n_series} SeriesInstanceUIDs; they were put together by place"
    return Series(tuple(slices), found=(warning("uid-per-slice", text),))


def _named_apart(series: list[Series]) -> list[Series]:
    """Say of series that share a UID, or have none, what else they are known by: size and first file."""
    uids = [one.first.file.series for one in series]
    named = []
    for one in series:
        shared = uids.count(one.first.file.series) > 1 or not one.first.file.series
        rows, columns = one.first.file.shape
        part = one.part or (f"{columns} x {rows} {one.first.file.path.name}" if shared else "")
        named.append(Series(one.slices, part, one.found))
    return named
