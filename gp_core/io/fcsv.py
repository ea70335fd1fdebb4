"""3D Slicer's old point lists, ``.fcsv``, in their three layouts."""

from __future__ import annotations

import csv
import io
import logging
from os import PathLike
from pathlib import Path

from gp_core.disk import write_text
from gp_core.errors import FileFormatError
from gp_core.io.labelled_points import (
    STATUS_WORDS,
    LabelledPoint,
    PointList,
    is_computed,
    labelled_point,
    points_of,
)
from gp_core.io.text import flips_xy, shown, split_fields, split_lines, stated_system
from gp_core.io.text_files import read_text
from gp_core.landmarks.sets import LandmarkSet, Status

__all__ = ["read_fcsv", "write_fcsv"]

_log = logging.getLogger(__name__)

_HEADER = """\
# Markups fiducial file version = 4.11
# CoordinateSystem = LPS
# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID
"""
_MOST_COLUMNS = 16
_STATUSES = tuple(STATUS_WORDS.values())  # in the order of Slicer's numbers


def read_fcsv(path: str | PathLike[str]) -> PointList:
    """Read a point list of Slicer 3 (``label,x,y,z,sel,vis``), 4 (14 columns) or 5 (two more, unnamed).

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    PointList
        Positions in mm, LPS. A file that does not name its coordinate system is LPS, except in the layout of
        Slicer 3, which is RAS, as in Slicer.

    Raises
    ------
    FileFormatError
        Wrong number of columns, an unknown status or system, or a position that is not three finite numbers.
    """
    lines = split_lines(read_text(path), path)
    heads = [line.lstrip('" ') for _, line in lines]
    system = stated_system(heads, path)
    body = [numbered for numbered, head in zip(lines, heads, strict=True) if not head.startswith("#")]
    first = body[0][1] if body else ""
    n_marks = first.count(";")  # as saved by a spreadsheet; a description may contain some too
    mark = ";" if n_marks >= 4 and n_marks > first.count(",") else ","
    rows = [(number, _unpadded(split_fields(line, mark, number, path))) for number, line in body]
    old = bool(rows) and all(4 <= len(fields) <= 7 for _, fields in rows)
    if system is None and not old:
        _log.warning("%s: no coordinate system is named; taken as LPS", path)
    flip_xy = flips_xy("RAS" if system is None and old else system, path)
    points = [
        labelled_point(fields[0], fields[1:4], file=path, flip_xy=flip_xy)
        if old
        else _markups_point(fields, number, flip_xy, path)
        for number, fields in rows
    ]
    return PointList(tuple(points), Path(path))


def _unpadded(fields: list[str]) -> list[str]:
    """Return the fields of a row without the empty ones that a spreadsheet appends to it."""
    while len(fields) > _MOST_COLUMNS and not fields[-1]:
        fields = fields[:-1]
    return fields


def _markups_point(fields: list[str], number: int, flip_xy: bool, file: str | PathLike[str]) -> LabelledPoint:
    if not 12 <= len(fields) <= 16:
        raise FileFormatError(
            f"line {number} has {len(fields)} columns; a point has 14 or 16 (or 6 in Slicer 3)",
            file=file,
            remedy="Export the landmarks again.",
        )
    code = fields[14].strip() if len(fields) > 14 else ""
    if code not in ("", "0", "1", "2", "3"):
        raise FileFormatError(
            f"position status (column 15) must be 0 to 3, got {shown(code)} in line {number}",
            file=file,
            landmark=fields[11][:40],
        )
    status = _STATUSES[int(code)] if code else Status.PLACED
    description = fields[12] if len(fields) > 12 else ""
    return labelled_point(
        fields[11], fields[1:4], status, file=file, description=description, flip_xy=flip_xy
    )


def write_fcsv(path: str | PathLike[str], landmarks: LandmarkSet) -> None:
    """Write a landmark set as Slicer 5 does: 16 columns, LPS, mm, with full precision.

    The format cannot store specimen, side and frame; name the file ``<specimen>_L`` or ``_R``. As in Slicer,
    points that are not placed are written at the origin with a status that says so; programs that do not know
    the 15th column take them as placed, so prefer `write_markups`.

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
    for i, point in enumerate(points_of(landmarks), start=1):
        xyz = [0.0, 0.0, 0.0] if point.position is None else point.position.tolist()
        shown_selected_locked = [1, 1, int(is_computed(point.label))]
        status = list(STATUS_WORDS).index(point.status.value)
        texts = [point.label, point.description, ""]
        writer.writerow([i, *xyz, 0, 0, 0, 1, *shown_selected_locked, *texts, status, 0])
    write_text(path, _HEADER + stream.getvalue())
