"""Several touches of one feature in a file: by the same name, or as ``MN#1``, ``MN#2``, ..."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from gp_core.errors import FeatureError
from gp_core.io.labelled_points import LabelledPoint, PointList
from gp_core.io.text import shown
from gp_core.landmarks.labels import tidy_label
from gp_core.landmarks.repeats import RepeatedTouches, combine_repeats

__all__ = ["split_trial", "with_repeats_combined"]

_TRIAL = re.compile(r"(?P<name>.*\S)\s*#\s*(?P<trial>[0-9]{1,4})")


def split_trial(label: str) -> tuple[str, int]:
    """Return the name and the number of a touch from a label such as ``MN#2``.

    Parameters
    ----------
    label : str
        As in a file.

    Returns
    -------
    (str, int)
        The label without the number, and the number; 0 where there is none.

    Examples
    --------
    >>> split_trial("MN#2")
    ('MN', 2)
    """
    found = _TRIAL.fullmatch(label.strip())
    return (label, 0) if found is None else (found["name"], int(found["trial"]))


def with_repeats_combined(points: PointList) -> tuple[PointList, Mapping[str, RepeatedTouches]]:
    """Return the points with one for each name, and the touches of those that were touched several times.

    Parameters
    ----------
    points : PointList
        Touches of one side, named; what was not seen has no position.

    Returns
    -------
    PointList
        Each name once, in the file's order, at the mean of its touches without outliers.
    mapping of str to RepeatedTouches
        By name; a feature that was touched once is left out.

    Raises
    ------
    FeatureError
        A touch is in the file twice: with the same number, or at the same place to the last digit.
    """
    groups: dict[str, list[LabelledPoint]] = {}
    for point in points.points:
        groups.setdefault(tidy_label(point.label).casefold(), []).append(point)
    if len(groups) == len(points.points):
        return points, {}
    for group in groups.values():
        _check_distinct(group, points)
    seen = {name: [p.position for p in group if p.position is not None] for name, group in groups.items()}
    repeats = combine_repeats({name: positions for name, positions in seen.items() if len(positions) > 1})
    combined = tuple(_at_mean(group, repeats.get(name)) for name, group in groups.items())
    names = {name: tidy_label(group[0].label) for name, group in groups.items()}
    return replace(points, points=combined), {names[key]: one for key, one in repeats.items()}


def _at_mean(group: Sequence[LabelledPoint], repeated: RepeatedTouches | None) -> LabelledPoint:
    """Return one point for all of a name: at their mean, or the one that was seen."""
    first = next((point for point in group if point.position is not None), group[0])
    return first if repeated is None else first._replace(position=repeated.mean)


def _check_distinct(group: Iterable[LabelledPoint], points: PointList) -> None:
    for one, other in combinations(group, 2):
        if one.trial and one.trial == other.trial:
            problem, remedy = f"has touch {one.trial} twice", "Number its touches 1, 2, 3, ..."
        elif one.trial == other.trial and _same_place(one, other):
            problem = "is in the file twice at the same position: a copy, and not a second touch"
            remedy = "Remove one of them, or number them (MN#1, MN#2)."
        else:
            continue
        raise FeatureError(problem, file=points.source, landmark=shown(one.label)[:40], remedy=remedy)


def _same_place(one: LabelledPoint, other: LabelledPoint) -> bool:
    if one.position is None or other.position is None:
        return False
    return bool(np.array_equal(one.position, other.position))
