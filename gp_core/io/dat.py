"""The probe's touches, ``.dat``: rows of three numbers without names; their number tells the layout."""

from __future__ import annotations

import logging
import re
from os import PathLike
from pathlib import Path

import numpy as np

from gp_core.errors import FileFormatError
from gp_core.io.labelled_points import LabelledPoint, PointList, labelled_point
from gp_core.io.text import DECIMAL_POINTS, has_decimal_comma, split_lines
from gp_core.io.text_files import read_text
from gp_core.landmarks.features import named_set
from gp_core.landmarks.sets import Status
from gp_core.validation import FloatArray

__all__ = ["is_sentinel", "read_dat", "skull_feature_names"]

_log = logging.getLogger(__name__)

_SENTINELS_MM = np.array(
    [[-1000.0, -1000.0, -1000.0], [1000.0, 1000.0, -1000.0], [0.0, 0.0, 0.0]]  # the second: out of a RAS file
)
_N_SKULL = 8
_UNUSED = ""

# Rows by their number: the touched features, then the skull features; the long form has two empty rows.
_TOUCHED = list(named_set("probe_dat"))
_SKULL = [f"S{i}" for i in range(1, _N_SKULL + 1)]
_LAYOUTS = {
    6: _TOUCHED,
    14: [*_TOUCHED, *_SKULL],
    16: [*_TOUCHED[:3], _UNUSED, *_TOUCHED[3:], _UNUSED, *_SKULL],
}


def skull_feature_names() -> tuple[str, ...]:
    """Return the names of the eight skull features that register a touched skull to its CT.

    Returns
    -------
    tuple of str
        ``S1`` to ``S8``.
    """
    return tuple(_SKULL)


def is_sentinel(position: FloatArray, *, zero: bool = True) -> bool:
    """Return whether coordinates mark a point that the tracker did not see.

    Parameters
    ----------
    position : (3,) array
        As read, mm.
    zero : bool
        Whether 0 0 0 is such a mark; in a scan it may be a position.

    Returns
    -------
    bool
        True for the trackers' marks of a missing point.
    """
    return bool((position == (_SENTINELS_MM if zero else _SENTINELS_MM[:2])).all(axis=1).any())


def read_dat(path: str | PathLike[str]) -> PointList:
    """Read the touches of one side of a skull.

    Parameters
    ----------
    path : path
        6 rows (the probe features), 14 (and eight skull features) or 16 (the same with two unused rows),
        each of three numbers in mm apart by tabs, blanks or commas.

    Returns
    -------
    PointList
        Positions in mm, tracker frame; what the tracker did not see (-1000 -1000 -1000 or 0 0 0) has none.

    Raises
    ------
    FileFormatError
        Another number of rows or columns, or not finite numbers.
    """
    lines = dict(split_lines(read_text(path), path))
    rows = [(number, re.split(r"[\s,;]+", line.strip())) for number, line in lines.items()]
    layout = _LAYOUTS.get(len(rows))
    for number, fields in rows:
        if len(fields) != 3:
            raise FileFormatError(
                f"line {number} has {len(fields)} columns, must have 3 (x y z in mm)",
                file=path,
                remedy=DECIMAL_POINTS
                if all(has_decimal_comma(field) for field in lines[number].split())
                else "For points with names, give a .csv file with name,x,y,z.",
            )
    if layout is None:
        raise FileFormatError(
            f"has {len(rows)} rows; touches have {', '.join(str(n) for n in _LAYOUTS)} rows",
            file=path,
            remedy="For any other set of points, give a .csv file with name,x,y,z.",
        )
    points = [_point(name, fields, number, path) for name, (number, fields) in zip(layout, rows, strict=True)]
    return PointList(tuple(point for point in points if point.label != _UNUSED), Path(path), frame="tracker")


def _point(name: str, fields: list[str], number: int, file: str | PathLike[str]) -> LabelledPoint:
    point = labelled_point(name, fields, file=file)
    if point.position is None or is_sentinel(point.position):
        return LabelledPoint(name, None, Status.UNSEEN)
    if name == _UNUSED:
        _log.warning("%s: passed over the numbers in line %d, which no feature has", file, number)
    return point
