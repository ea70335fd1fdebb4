"""Parsing of text shared by all landmark formats: lines, fields, numbers, positions, coordinate systems."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Sequence
from os import PathLike

import numpy as np

from gp_core.errors import FileFormatError
from gp_core.validation import FloatArray

__all__ = [
    "DECIMAL_POINTS",
    "MAX_POINTS",
    "as_csv_cell",
    "check_count",
    "flips_xy",
    "has_decimal_comma",
    "of_csv_cell",
    "parse_position",
    "rows_text",
    "shown",
    "split_fields",
    "split_lines",
    "stated_system",
]

MAX_POINTS = 10_000
"""Maximum number of points in a file; a larger file is rejected before parsing."""

_MAX_COORDINATE_MM = 1e9  # larger than a head in nanometres: keeps squares and sums finite

# What stands for "no number": R writes NA, or null through its JSON writer.
_MISSING_WORDS = frozenset({"", "na", "null"})
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NUMBER_WITH_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
DECIMAL_POINTS = "Write decimal points, not commas."

# 3D Slicer's words, and the numbers that old files have instead.
_SYSTEM = re.compile(r"#\s*CoordinateSystem\s*=(.*)", re.IGNORECASE)
_FLIPS_XY = {"LPS": False, "1": False, "RAS": True, "0": True, "": False}


def check_count(n: int, what: str, file: str | PathLike[str], *, at_most: int = MAX_POINTS) -> None:
    """Check that a file does not hold too many items.

    Parameters
    ----------
    n : int
        Number of items.
    what : str
        What they are, for the message.
    file : path-like
        For messages.
    at_most : int
        Maximum number.

    Raises
    ------
    FileFormatError
        There are more.
    """
    if n > at_most:
        raise FileFormatError(
            f"holds {n} {what}, more than {at_most}", file=file, remedy=f"Give at most {at_most}."
        )


def shown(value: object) -> str:
    """Return a value as a message may show it.

    Parameters
    ----------
    value : object
        Any value.

    Returns
    -------
    str
        One line, shortened.
    """
    text = str(value) if isinstance(value, (int, float)) and abs(value) < 1e300 else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def split_lines(text: str, file: str | PathLike[str], *, at_most: int = MAX_POINTS) -> list[tuple[int, str]]:
    """Return the numbered lines that are not blank, without stray carriage returns.

    Parameters
    ----------
    text : str
        Content of a file.
    file : path-like
        For messages.
    at_most : int
        Maximum number of lines.

    Returns
    -------
    list of (int, str)
        Line number and line.

    Raises
    ------
    FileFormatError
        There are more than `at_most` lines.
    """
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    check_count(text.count("\n"), "lines", file, at_most=at_most)
    lines = text.split("\n")
    return [(number, line) for number, line in enumerate(lines, start=1) if line.strip()]


def split_fields(line: str, delimiter: str, number: int, file: str | PathLike[str]) -> list[str]:
    """Return the fields of a line, without surrounding blanks; quoted as in CSV.

    Parameters
    ----------
    line : str
        A line.
    delimiter : str
        Between the fields.
    number : int
        Line number, for messages.
    file : path-like
        For messages.

    Returns
    -------
    list of str
        The fields.

    Raises
    ------
    FileFormatError
        The quotes do not close.
    """
    try:
        return [field.strip() for field in next(csv.reader([line], delimiter=delimiter, strict=True))]
    except csv.Error as error:
        raise FileFormatError(
            f"line {number} cannot be split into columns ({error})", file=file, remedy="Mend its quotes."
        ) from None


def as_csv_cell(text: str) -> str:
    """Return a text as a cell of a CSV file that no spreadsheet takes as a formula.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        The cell.
    """
    return f"'{text}" if text.lstrip("'").startswith(_FORMULA) else text


def of_csv_cell(cell: str) -> str:
    """Return the text of a cell that `as_csv_cell` made.

    Parameters
    ----------
    cell : str
        A cell.

    Returns
    -------
    str
        The text.
    """
    return cell[1:] if cell.startswith("'") and cell.lstrip("'").startswith(_FORMULA) else cell


def rows_text(rows: FloatArray) -> str:
    """Return rows of numbers as comma-separated lines with full precision.

    Parameters
    ----------
    rows : (N, C) array
        Numbers.

    Returns
    -------
    str
        N lines.
    """
    return "".join(f"{','.join(repr(float(n)) for n in row)}\n" for row in rows)


def flips_xy(system: object, file: str | PathLike[str]) -> bool:
    """Return whether x and y change sign between a file's coordinate system and LPS.

    Parameters
    ----------
    system : object
        As the file names it.
    file : path-like
        For messages.

    Returns
    -------
    bool
        True for RAS.

    Raises
    ------
    FileFormatError
        Neither LPS nor RAS, by name or by Slicer's old numbers.
    """
    word = "" if system is None else str(system).strip().upper()
    if word not in _FLIPS_XY:
        raise FileFormatError(
            f"coordinate system must be LPS or RAS, got {shown(system)}",
            file=file,
            remedy="Export it in one of them.",
        )
    return _FLIPS_XY[word]


def stated_system(lines: Iterable[str], file: str | PathLike[str]) -> str | None:
    """Return the coordinate system that a comment such as ``# CoordinateSystem = RAS`` states.

    Parameters
    ----------
    lines : iterable of str
        Lines of a file, without blanks and quotes before them.
    file : path-like
        For messages.

    Returns
    -------
    str or None
        As the file names it; None where it states none.

    Raises
    ------
    FileFormatError
        It states several, as files do that were joined by hand, or one that is neither LPS nor RAS.
    """
    stated = [found[1].strip(' ",;') for line in lines if (found := _SYSTEM.match(line))]
    if len({flips_xy(system, file) for system in stated}) > 1:
        raise FileFormatError(
            f"names several coordinate systems: {', '.join(dict.fromkeys(stated))}",
            file=file,
            remedy="Export each point list to a file of its own.",
        )
    return stated[0] if stated else None


def parse_position(
    values: Sequence[object], *, file: str | PathLike[str], landmark: str
) -> FloatArray | None:
    """Parse a position.

    Parameters
    ----------
    values : sequence
        Three numbers or texts, mm.
    file : path-like
        For messages.
    landmark : str
        For messages.

    Returns
    -------
    (3,) array or None
        None where all three are missing.

    Raises
    ------
    FileFormatError
        Not three, not numbers, not finite, or some missing and some not.
    """
    if all(_is_missing(value) for value in values):
        return None
    numbers = [_number(value) for value in values]
    if len(numbers) == 3 and all(n is not None and abs(n) <= _MAX_COORDINATE_MM for n in numbers):
        return np.array(numbers, dtype=np.float64)
    got = ", ".join(shown(value) for value in values[:4])
    raise FileFormatError(
        f"position must be three finite numbers in mm, got [{got}]",
        file=file,
        landmark=landmark[:40],
        remedy=DECIMAL_POINTS
        if any(has_decimal_comma(value) for value in values)
        else "Correct it, or clear all three if the landmark is not placed.",
    )


def has_decimal_comma(value: object) -> bool:
    """Return whether a text is a number with a decimal comma, such as ``1,5``.

    Parameters
    ----------
    value : object
        Any value.

    Returns
    -------
    bool
        False for other types.
    """
    return isinstance(value, str) and _NUMBER_WITH_COMMA.fullmatch(value.strip()) is not None


def _is_missing(value: object) -> bool:
    return value is None or (isinstance(value, str) and value.strip().lower() in _MISSING_WORDS)


def _number(value: object) -> float | None:
    """Parse a float (may be NaN or infinite); None if it is not numeric."""
    if isinstance(value, str):
        return float(value) if _NUMBER.fullmatch(value := value.strip()) else None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf
