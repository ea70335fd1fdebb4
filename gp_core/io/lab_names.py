"""A lab's own names of points: a table with two columns, their name and our code."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from gp_core.disk import parse_json
from gp_core.errors import FeatureError, FileFormatError, blaming
from gp_core.io.table import read_rows
from gp_core.io.text import of_csv_cell
from gp_core.io.text_files import read_text
from gp_core.landmarks.labels import LabelNames

__all__ = ["read_lab_names"]

_HEADERS = ("their name", "name", "label", "landmark", "from")
_CODE_HEADERS = ("our code", "code", "feature", "to")
_FORM = "Give two columns, their name and our code (CA, or CA_L), or a JSON object of the same."


def read_lab_names(path: str | PathLike[str]) -> LabelNames:
    """Read a lab's own names of the features.

    Parameters
    ----------
    path : path-like
        ``.csv``, ``.tsv`` or text: *their name*, *our code* in each row, with or without a header. ``.json``:
        an object of the same. An empty code leaves the point out.

    Returns
    -------
    LabelNames
        The names.

    Raises
    ------
    FileFormatError
        Not such a file.
    FeatureError
        A code is unknown, or a name occurs twice.
    """
    pairs = _json_pairs(path) if Path(path).suffix.lower() == ".json" else _table_pairs(path)
    names = [name for name, _ in pairs]
    double = next((name for name in names if names.count(name) > 1), None)
    if double is not None:
        raise FeatureError("occurs twice", file=path, landmark=double[:40], remedy="Keep one of them.")
    try:
        return LabelNames(dict(pairs))
    except FeatureError as error:
        raise FeatureError(error.problem, file=path, landmark=error.landmark, remedy=error.remedy) from None


def _json_pairs(path: str | PathLike[str]) -> list[tuple[str, str]]:
    try:
        with blaming(path):
            content = parse_json(read_text(path))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"is not JSON ({error})", file=path, remedy=_FORM) from None
    if not isinstance(content, dict) or not all(isinstance(code, str) for code in content.values()):
        raise FileFormatError("must hold a JSON object of names and codes", file=path, remedy=_FORM)
    return list(content.items())


def _table_pairs(path: str | PathLike[str]) -> list[tuple[str, str]]:
    rows = _without_row_names(read_rows(path))
    if rows and rows[0][1][0].lower() in _HEADERS:
        rows = rows[1:]
    wrong = next((number for number, fields in rows if len(fields) != 2 or not fields[0]), None)
    if not rows or wrong is not None:
        what = "holds no names" if not rows else f"line {wrong} does not hold two columns"
        raise FileFormatError(what, file=path, remedy=_FORM)
    return [(of_csv_cell(theirs), of_csv_cell(ours)) for _, (theirs, ours) in rows]


def _without_row_names(rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Return rows without the first column where R wrote its row names there, under a blank name or none."""
    if len(rows) < 2 or len(rows[1][1]) != 3 or rows[0][1][-1].lower() not in _CODE_HEADERS:
        return rows
    header = rows[0][1]
    if len(header) == 2:
        return [rows[0], *((number, fields[1:]) for number, fields in rows[1:])]
    return [(number, fields[1:]) for number, fields in rows] if len(header) == 3 and not header[0] else rows
