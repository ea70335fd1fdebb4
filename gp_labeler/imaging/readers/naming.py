"""Slices among the files of a folder: which belong together, in which order, and which are missing."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

__all__ = ["Numbering", "SliceGroup", "group_slices", "number_slices"]

_RUN = re.compile(r"(\d+)")


@dataclass(frozen=True)
class SliceGroup:
    """Files whose names differ in one number only.

    Parameters
    ----------
    pattern : str
        Their name with ``#`` for the number.
    files : tuple of Path
        In the order of the numbers.
    numbers : tuple of int
        One for each file.
    """

    pattern: str
    files: tuple[Path, ...]
    numbers: tuple[int, ...]


@dataclass(frozen=True)
class Numbering:
    """The slices of a group on a regular count.

    Parameters
    ----------
    files : tuple of Path or None
        One for each slice; None where the number is missing.
    step : int
        From one number to the next.
    missing : tuple of int
        Numbers that are missing.
    doubled : tuple of Path
        Files that repeat a number, not used.
    """

    files: tuple[Path | None, ...]
    step: int
    missing: tuple[int, ...]
    doubled: tuple[Path, ...]


def group_slices(files: Iterable[Path]) -> tuple[SliceGroup, ...]:
    """Group files by the number that counts their slices; the largest group comes first.

    Names of one shape (``ear1_c0_012.tif``) may hold several numbers. The slice number is the one that takes
    the most values; files with other values in the other places (``c1``) are another group. A file without a
    number is a group of its own.
    """
    shapes: dict[str, list[Path]] = defaultdict(list)
    for file in files:
        shapes[_RUN.sub("#", file.name).lower()].append(file)
    groups = [group for members in shapes.values() for group in _split(members)]
    return tuple(sorted(groups, key=lambda group: (-len(group.files), group.pattern)))


def _split(files: Sequence[Path]) -> list[SliceGroup]:
    """Split files with names of one shape by all numbers but the one that counts."""
    runs = np.array([[int(run) for run in _RUN.findall(file.stem)] for file in files], dtype=object)
    if runs.size == 0:
        return [SliceGroup(file.name, (file,), (0,)) for file in files]
    variety = [len(set(column)) for column in runs.T]
    counting = max(range(len(variety)), key=lambda place: (variety[place], place))
    parts: dict[tuple[int, ...], list[tuple[int, Path]]] = defaultdict(list)
    for row, file in zip(runs.tolist(), files, strict=True):
        rest = tuple(number for place, number in enumerate(row) if place != counting)
        parts[rest].append((row[counting], file))
    return [_group(sorted(part), counting) for part in parts.values()]


def _group(members: list[tuple[int, Path]], counting: int) -> SliceGroup:
    numbers, files = zip(*members, strict=True)
    pieces = _RUN.split(files[0].stem)
    pieces[2 * counting + 1] = "#"
    return SliceGroup("".join(pieces) + files[0].suffix, files, numbers)


def number_slices(group: SliceGroup) -> Numbering:
    """Put the files of a group on a regular count: missing ones become None, doubled ones go aside."""
    first: dict[int, Path] = {}
    doubled = []
    for number, file in zip(group.numbers, group.files, strict=True):
        if number in first:
            doubled.append(file)
        first.setdefault(number, file)
    numbers = sorted(first)
    steps = Counter(np.diff(numbers).tolist())
    step = int(max(steps, key=lambda value: (steps[value], -value))) if steps else 1
    if any(value % step for value in steps):
        step = 1
    every = range(numbers[0], numbers[-1] + 1, step)
    missing = tuple(number for number in every if number not in first)
    return Numbering(tuple(first.get(number) for number in every), step, missing, tuple(doubled))
