"""Tables of named points, ``.csv`` and ``.tsv``: Slicer's own, or simply ``name,x,y,z``."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from gp_core.disk import write_text
from gp_core.errors import FeatureError, FileFormatError, GpError
from gp_core.io.labelled_points import (
    STATUS_WORDS,
    LabelledPoint,
    PointList,
    is_computed,
    labelled_point,
    points_of,
)
from gp_core.io.text import (
    MAX_POINTS,
    as_csv_cell,
    flips_xy,
    has_decimal_comma,
    of_csv_cell,
    shown,
    split_fields,
    split_lines,
    stated_system,
)
from gp_core.io.text_files import read_text
from gp_core.landmarks.features import Side
from gp_core.landmarks.provenance import LabelProvenance
from gp_core.landmarks.sets import LandmarkSet, Status

__all__ = ["read_rows", "read_table", "write_csv"]

_NAME_COLUMNS = ("label", "name", "landmark", "feature", "code", "point")
_AXES = {"lps": False, "ras": True, "xyz": None}  # whether x and y change sign to LPS; None: not said
_UNIT_MM = re.compile(r"\s*[\[(_ ]\s*mm\s*[\])]?$")  # x_mm, "x (mm)", "x [mm]"
_HEADER = ("label", "l", "p", "s", "defined", "selected", "visible", "locked", "description", "status")
_ABOUT = {
    "certainty": "certainty",
    "observer": "by",
    "time": "time",
    "checked_by": "checked_by",
    "note": "note",
}
"""Columns of what is known of a label, and the keys of `LabelProvenance.from_json`."""

_NO = ("0", "false", "no")
_SEPARATOR_LINE = re.compile(r"\"?sep=([,;\t|]?)\"?[,;]*", re.IGNORECASE)  # for Excel; a tab is stripped
_SIDE_COLUMNS = ("side", "ear", "laterality")
_TRIAL_COLUMNS = ("trial", "repeat", "replicate")


@dataclass(frozen=True)
class _Columns:
    """Column of each value."""

    label: int
    axes: tuple[int, ...]
    width: int
    flip_xy: bool | None
    others: Mapping[str, int]


def read_table(path: str | PathLike[str]) -> PointList:
    """Read a table of named points.

    With a header, columns are found by name: ``label`` (or ``name``, ``landmark``, ...); ``l,p,s``,
    ``r,a,s`` or ``x,y,z`` (LPS, unless a line such as ``# CoordinateSystem = RAS`` states another system);
    and, where present, ``side``, ``trial``, ``defined``, ``status`` and ``description``. Without one, the
    columns are name, x, y, z. Row names as written by R, whose column has no name, are labels; the first line
    ``sep=;`` of a spreadsheet is understood, and its empty rows are passed over.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    PointList
        Positions in mm, LPS.

    Raises
    ------
    FileFormatError
        Columns are missing, a row has the wrong number of them, a position is not three finite numbers, or
        the columns contradict the stated coordinate system.
    """
    lines = split_lines(read_text(path), path)
    rows = [(number, fields) for number, fields in _split(lines, path, aligned=True) if any(fields)]
    names = _header_names(rows)
    has_header = any(name in _NAME_COLUMNS for name in names)
    columns = _columns(names, path) if has_header else _Columns(0, (1, 2, 3), 4, None, {})
    columns = _in_stated_system(columns, lines, path)
    points = tuple(_point(fields, columns, number, path) for number, fields in rows[has_header:])
    return PointList(points, Path(path))


def _header_names(rows: list[tuple[int, list[str]]]) -> list[str]:
    """Return the names of the columns from the first row; that of R's row names is empty or absent."""
    if not rows:
        return []
    names = [_UNIT_MM.sub("", field.lower()) for field in rows[0][1]]
    if not any(set(axes) <= set(names) for axes in _AXES):
        return names
    named = any(name in _NAME_COLUMNS for name in names)
    if not named and not names[0]:
        return ["name", *names[1:]]
    unnamed = len(rows) > 1 and len(rows[1][1]) == len(names) + 1 and rows[1][1][-1] != ""
    return ["" if named else "name", *names] if unnamed else names


def read_rows(
    path: str | PathLike[str], *, aligned: bool = False, at_most: int = MAX_POINTS
) -> list[tuple[int, list[str]]]:
    """Return the numbered rows of a table, split into fields, without comments (``#``) and blank lines.

    Parameters
    ----------
    path : path-like
        Text with commas, semicolons, tabs or blanks between the columns.
    aligned : bool
        Whether several blanks count as one, as where they align the columns; no field can then be empty.
    at_most : int
        Maximum number of lines.

    Returns
    -------
    list of (int, list of str)
        Line number and fields.

    Raises
    ------
    FileFormatError
        Not such a text, or quotes that do not close.
    """
    return _split(split_lines(read_text(path), path, at_most=at_most), path, aligned=aligned)


def _split(
    lines: list[tuple[int, str]], path: str | PathLike[str], *, aligned: bool
) -> list[tuple[int, list[str]]]:
    """Return the fields of lines; the arguments are those of `read_rows`."""
    lines = [(number, line) for number, line in lines if not line.startswith("#")]
    stated = _SEPARATOR_LINE.fullmatch(lines[0][1].strip()) if lines else None
    if stated is not None:
        lines = lines[1:]
    delimiter = stated[1] or "\t" if stated is not None else _delimiter_of(lines[0][1]) if lines else ","
    if aligned and delimiter == " ":
        lines = [(number, " ".join(line.split())) for number, line in lines]
    return [(number, split_fields(line, delimiter, number, path)) for number, line in lines]


def _delimiter_of(line: str) -> str:
    """Return the column separator of a table, guessed from its first line."""
    if all(has_decimal_comma(field) for field in line.split()[1:]) and len(line.split()) > 2:
        return " "  # decimal commas: needed for the message, since such numbers are rejected
    return next((mark for mark in "\t;," if mark in line), " ")


def _columns(names: list[str], file: str | PathLike[str]) -> _Columns:
    label = next(names.index(name) for name in _NAME_COLUMNS if name in names)
    for axes, flip_xy in _AXES.items():
        if all(axis in names for axis in axes):
            others = {name: i for i, name in enumerate(names)}
            return _Columns(label, tuple(names.index(axis) for axis in axes), len(names), flip_xy, others)
    raise FileFormatError(
        f"its header must name the columns l,p,s or r,a,s or x,y,z (mm), got {shown(','.join(names))}",
        file=file,
        remedy="Rename them.",
    )


def _in_stated_system(columns: _Columns, lines: list[tuple[int, str]], file: str | PathLike[str]) -> _Columns:
    """Return the columns with the coordinate system that a comment of the file states, if it does."""
    system = stated_system((line.lstrip('" ') for _, line in lines), file)
    if system is None:
        return columns
    flip_xy = flips_xy(system, file)
    if columns.flip_xy not in (None, flip_xy):
        named = "r,a,s" if columns.flip_xy else "l,p,s"
        raise FileFormatError(
            f"states the coordinate system {system}, but has the columns {named}",
            file=file,
            remedy="Correct one of them.",
        )
    return replace(columns, flip_xy=flip_xy)


def _point(fields: list[str], columns: _Columns, number: int, file: str | PathLike[str]) -> LabelledPoint:
    needed = max(columns.label, *columns.axes) + 1
    if len(fields) < needed or any(fields[columns.width :]):
        raise FileFormatError(
            f"line {number} has {len(fields)} columns, must have {columns.width}",
            file=file,
            remedy="Write name, x, y, z in every row, with decimal points, not commas.",
        )

    def other(name: str) -> str:
        i = columns.others.get(name, len(fields))
        return fields[i] if i < len(fields) else ""

    label = of_csv_cell(fields[columns.label])
    point = labelled_point(
        label,
        [fields[i] for i in columns.axes],
        _status(other("status"), other("defined"), label, file),
        file=file,
        description=of_csv_cell(other("description")),
        flip_xy=bool(columns.flip_xy),
    )._replace(side=_side(other, label, file), trial=_trial(other, label, file))
    about = {key: text for name, key in _ABOUT.items() if (text := of_csv_cell(other(name)))}
    if point.provenance is not None or not about:
        return point
    try:
        return point._replace(provenance=LabelProvenance.from_json(about))
    except GpError as error:
        raise FileFormatError(error.problem, file=file, landmark=label[:40], remedy="Correct it.") from None


def _side(other: Callable[[str], str], label: str, file: str | PathLike[str]) -> Side | None:
    """Return the side in a row's own column; None where it is empty."""
    word = next((found for name in _SIDE_COLUMNS if (found := other(name))), "")
    try:
        return Side.parse(word) if word else None
    except FeatureError:
        raise FileFormatError(
            f"its column 'side' must hold L, R, left or right, got {shown(word)}",
            file=file,
            landmark=label[:40],
            remedy="Correct it, or leave it empty.",
        ) from None


def _trial(other: Callable[[str], str], label: str, file: str | PathLike[str]) -> int:
    """Return the number of a touch among several of one feature; 0 where the row gives none."""
    word = next((found for name in _TRIAL_COLUMNS if (found := other(name).strip())), "")
    if not word:
        return 0
    if not (word.isascii() and word.isdigit() and 0 < int(word) < 10_000):
        raise FileFormatError(
            f"its column 'trial' must hold a whole number from 1, got {shown(word)}",
            file=file,
            landmark=label[:40],
            remedy="Correct it, or leave it empty.",
        )
    return int(word)


def _status(word: str, defined: str, label: str, file: str | PathLike[str]) -> Status:
    if word and word not in STATUS_WORDS:
        raise FileFormatError(
            f"status must be one of {', '.join(STATUS_WORDS)}, got {shown(word)}",
            file=file,
            landmark=label[:40],
            remedy="Correct it.",
        )
    return STATUS_WORDS[word] if word else Status.TO_DO if defined.lower() in _NO else Status.PLACED


def write_csv(path: str | PathLike[str], landmarks: LandmarkSet) -> None:
    """Write a landmark set as Slicer's table, with full precision.

    One column is added, ``status``, since Slicer's ``defined`` does not distinguish *to do* from *cannot be
    seen*. The format cannot store specimen, side and frame; name the file ``<specimen>_L`` or ``_R``.

    Parameters
    ----------
    path : path-like
        Where to write.
    landmarks : LandmarkSet
        One side, mm.

    Raises
    ------
    GpError
        The file cannot be written.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    about = _ABOUT if landmarks.provenance else {}
    writer.writerow((*_HEADER, *about))
    for point in points_of(landmarks):
        lps = ["", "", ""] if point.position is None else point.position.tolist()
        defined = int(point.position is not None)
        locked = int(is_computed(point.label))
        label, description = as_csv_cell(point.label), as_csv_cell(point.description)
        known = landmarks.provenance.get(point.label)
        content = {} if known is None else known.as_json()
        told = [as_csv_cell(str(content.get(key, ""))) for key in about.values()]
        writer.writerow([label, *lps, defined, 1, 1, locked, description, point.status.value, *told])
    write_text(path, stream.getvalue())
