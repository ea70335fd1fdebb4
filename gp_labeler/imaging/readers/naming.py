"""Slices among the files of a folder: which belong together, in which order, and which are missing."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gp_core.errors import GpError

__all__ = ["Numbering", "SliceGroup", "group_slices", "number_slices"]

_RUN = re.compile(r"(\d+)")
_POSITION = re.compile(r"(\d+)\.(\d+)")
_HEX_TAIL = re.compile(r"(.*?)([0-9a-fA-F]{2,8})")
_FEWEST_HEX, _HOLES = 10, 0.1
_SPARSEST = 100
_SPELLINGS = {".tiff": ".tif", ".jpeg": ".jpg"}


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
    the most values; files with other values in the other places (``c1``) are another group, unless these
    run along with it, as the time of writing does. A position with a point in it (``z1.35``) is one number,
    and so is a hexadecimal one (``001f``). A file without a number is a group of its own.
    """
    hexadecimal, others = _hexadecimal(list(files))
    shapes: dict[str, list[Path]] = defaultdict(list)
    for file in others:
        shapes[_RUN.sub("#", file.name).lower()].append(file)
    groups = [*hexadecimal, *(group for members in shapes.values() for group in _split(members))]
    groups = _under_two_suffixes(groups)
    return tuple(sorted(groups, key=lambda group: (-len(group.files), group.pattern)))


def _under_two_suffixes(groups: Sequence[SliceGroup]) -> list[SliceGroup]:
    """Join groups that differ in their suffix only (``.tif``, ``.tiff``) and share no number."""
    alike: dict[str, list[SliceGroup]] = defaultdict(list)
    for group in groups:
        name = group.pattern.lower()
        alike[
            next((name.removesuffix(s) + t for s, t in _SPELLINGS.items() if name.endswith(s)), name)
        ].append(group)
    joined = []
    for members in alike.values():
        slices = sorted(
            zip((n for g in members for n in g.numbers), (f for g in members for f in g.files), strict=True)
        )
        numbers, files = zip(*slices, strict=True)
        if len(members) > 1 and len(set(numbers)) == len(numbers):
            joined.append(SliceGroup(members[0].pattern, files, numbers))
        else:
            joined += members
    return joined


def _hexadecimal(files: Sequence[Path]) -> tuple[list[SliceGroup], list[Path]]:
    """Take out files that are counted in hexadecimal digits, with few gaps."""
    alike: dict[tuple[str, int, str], list[tuple[int, Path]]] = defaultdict(list)
    for file in files:
        if found := _HEX_TAIL.fullmatch(file.stem):
            key = (found[1].lower(), len(found[2]), file.suffix.lower())
            alike[key].append((int(found[2], 16), file))
    groups = []
    for (_, width, _), members in alike.items():
        numbers = {number for number, _ in members}
        tails = [file.stem[-width:].lower() for _, file in members]
        differs = (n for n, letters in enumerate(zip(*tails, strict=True)) if len(set(letters)) > 1)
        same = next(differs, width)  # letters before it belong to a word
        tails = [tail[same:] for tail in tails]
        lettered = sum(not tail.isdecimal() for tail in tails if tail)
        counted = lettered < len(tails) or any(tail[-1:].isalpha() for tail in tails)
        holes = max(numbers) - min(numbers) + 1 - len(numbers)
        if lettered and counted and len(tails) > _FEWEST_HEX and holes <= _HOLES * len(tails):
            counts, ordered = zip(*sorted(members), strict=True)
            first = ordered[0]
            groups.append(SliceGroup(f"{first.stem[:-width]}#{first.suffix}", ordered, counts))
    taken = {file for group in groups for file in group.files}
    return groups, [file for file in files if file not in taken]


def _split(files: Sequence[Path]) -> list[SliceGroup]:
    """Split files with names of one shape by all numbers but those that count."""
    runs = np.array([[int(run) for run in _RUN.findall(file.stem)] for file in files], dtype=object)
    if runs.size == 0:
        return [SliceGroup(file.name, (file,), (0,)) for file in files]
    if (positions := _positions(files)) is not None:
        return [positions]
    variety = [len(set(column)) for column in runs.T]
    counting = max(range(len(variety)), key=lambda place: (variety[place], place))
    along = _along(runs.tolist(), variety, counting)
    parts: dict[tuple[int, ...], list[tuple[int, Path]]] = defaultdict(list)
    for row, file in zip(runs.tolist(), files, strict=True):
        rest = tuple(number for place, number in enumerate(row) if place not in (counting, *along))
        parts[rest].append((row[counting], file))
    return [_group(sorted(part), (counting, *along)) for part in parts.values()]


def _along(rows: Sequence[Sequence[int]], variety: Sequence[int], counting: int) -> tuple[int, ...]:
    """Return the numbers that run along with the one that counts: together, another for each slice."""
    follows = [
        place
        for place in range(len(variety))
        if place != counting
        and variety[place] > 1
        and len({(row[counting], row[place]) for row in rows}) == variety[counting]
    ]
    together = {tuple(row[place] for place in follows) for row in rows}
    return tuple(follows) if follows and len(together) == variety[counting] else ()


def _positions(files: Sequence[Path]) -> SliceGroup | None:
    """Return files as one group that are named by positions, such as ``z0.30``, at equal distances."""
    found = [_POSITION.findall(file.stem) for file in files]
    if len(files) < 3 or any(len(each) != 1 for each in found):
        return None
    rest = {_POSITION.sub("#", file.stem) for file in files}
    whole, part = zip(*(each[0] for each in found), strict=True)
    if len(rest) > 1 or len({len(p) for p in part}) > 1 or min(len(set(whole)), len(set(part))) < 2:
        return None
    values = [int(w + p) for w, p in zip(whole, part, strict=True)]
    steps = set(np.diff(sorted(values)).tolist())
    if len(steps) != 1 or 0 in steps:
        return None
    step, first = steps.pop(), min(values)
    numbers, ordered = zip(
        *sorted(((value - first) // step, file) for value, file in zip(values, files, strict=True)),
        strict=True,
    )
    return SliceGroup(f"{rest.pop()}{files[0].suffix}", ordered, numbers)


def _group(members: list[tuple[int, Path]], counting: Sequence[int]) -> SliceGroup:
    numbers, files = zip(*members, strict=True)
    pieces = _RUN.split(files[0].stem)
    for place in counting:
        pieces[2 * place + 1] = "#"
    return SliceGroup("".join(pieces) + files[0].suffix, files, numbers)


def number_slices(group: SliceGroup) -> Numbering:
    """Put the files of a group on a regular count: missing ones become None, doubled ones go aside.

    Raises
    ------
    GpError
        Nearly all would be missing.
    """
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
    n_slices = (numbers[-1] - numbers[0]) // step + 1
    if n_slices > _SPARSEST * len(numbers) + _SPARSEST:
        raise GpError(
            f"the numbers of {len(numbers)} images named {group.pattern} run from {numbers[0]} "
            f"to {numbers[-1]}, too far apart for slices",
            remedy="Keep the slices of one stack alone in a folder.",
        )
    every = range(numbers[0], numbers[-1] + 1, step)
    missing = tuple(number for number in every if number not in first)
    return Numbering(tuple(first.get(number) for number in every), step, missing, tuple(doubled))
