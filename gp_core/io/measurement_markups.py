"""Rulers and angles as 3D Slicer's line and angle markups, ``.mrk.json``, one file for each."""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.disk import all_or_none, make_room
from gp_core.errors import FileFormatError, GpError
from gp_core.io.header import FileHeader
from gp_core.io.labelled_points import LabelledPoint
from gp_core.io.markups import as_markup, load_markups, markup_points, write_content
from gp_core.io.text import shown
from gp_core.landmarks.measurements import ANGLE, KINDS, LINE, Measurement
from gp_core.landmarks.sets import Status

__all__ = ["measurement_file_names", "read_measurements", "write_measurements"]

_log = logging.getLogger(__name__)

_SLICER = {LINE: "Line", ANGLE: "Angle"}
_KINDS = {word: kind for kind, word in _SLICER.items()}
_SUFFIX = ".mrk.json"
_NOT_IN_FILE_NAMES = re.compile(r'[/\\:*?"<>|]')


def measurement_file_names(specimen: str, names: Iterable[str]) -> dict[str, str]:
    """Return the file that each measurement is written into.

    Parameters
    ----------
    specimen : str
        Name of the animal.
    names : iterable of str
        Of the measurements.

    Returns
    -------
    dict of str to str
        File names, such as ``GP-014_Ruler 1.mrk.json``, by measurement. No two are alike, also where
        capitals do not count; none is that of a landmark file (``_L``, ``_R``).
    """
    taken, files = {f"{specimen}_{side}{_SUFFIX}".lower() for side in "LR"}, {}
    for name in names:
        stem, n = f"{specimen}_{_NOT_IN_FILE_NAMES.sub('_', name)}", 1
        file = f"{stem}{_SUFFIX}"
        while file.lower() in taken:
            n += 1
            file = f"{stem} ({n}){_SUFFIX}"
        taken.add(file.lower())
        files[name] = file
    return files


@checks_arguments
def write_measurements(
    folder: str | PathLike[str],
    measurements: Sequence[Measurement],
    *,
    specimen: str,
    volume: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Write rulers and angles as 3D Slicer does, a file for each, to the last bit of every coordinate.

    Parameters
    ----------
    folder : path
        Made if need be; for the names of the files see `measurement_file_names`.
    measurements : sequence of Measurement
        What to write.
    specimen : str
        Name of the animal.
    volume : mapping, optional
        ``name``, ``size``, ``spacing`` and ``checksum`` of the scan.
    overwrite : bool
        Whether files of these names may be replaced.

    Returns
    -------
    tuple of Path
        The files.

    Raises
    ------
    GpError
        There is nothing to write, a file is there already, or cannot be written.
    """
    if not measurements:
        raise GpError("nothing is measured", specimen=specimen, remedy="Place a ruler or an angle first.")
    names = measurement_file_names(specimen, [each.name for each in measurements])
    paths = [Path(folder) / names[each.name] for each in measurements]
    make_room(folder, paths, overwrite=overwrite)
    header = FileHeader(specimen=specimen, volume=volume)
    with all_or_none():
        for path, measurement in zip(paths, measurements, strict=True):
            write_content(path, [_as_json(measurement)], header)
    return tuple(paths)


@checks_arguments
def read_measurements(path: str | PathLike[str]) -> tuple[Measurement, ...]:
    """Read the rulers and angles of a markups file.

    Parameters
    ----------
    path : path
        A ``.mrk.json`` file of 3D Slicer or this program, with ``Line`` or ``Angle`` markups; others are
        passed over.

    Returns
    -------
    tuple of Measurement
        Positions in mm, LPS. One without a name, as Slicer writes it, is called after its file.

    Raises
    ------
    FileFormatError
        Not a markups file, no line or angle in it, not in the frame of the scan, or one that is not complete.
    """
    content, stem = load_markups(path), Path(path).name.removesuffix(_SUFFIX).removesuffix(".json")
    header = FileHeader.from_json(content["gpLabeler"], path) if "gpLabeler" in content else FileHeader()
    if header.frame != "scan":
        raise FileFormatError(
            f"is in the {header.frame} frame, not in that of the scan",
            file=path,
            remedy="Choose rulers and angles that were measured in a scan.",
        )
    kinds = [markup.get("type") if isinstance(markup, dict) else None for markup in content["markups"]]
    known = [isinstance(kind, str) and kind in _KINDS for kind in kinds]
    found = [markup for markup, is_known in zip(content["markups"], known, strict=True) if is_known]
    for kind, is_known in zip(kinds, known, strict=True):
        if not is_known:
            _log.warning("%s: passed over a markup of type %s", path, shown(kind))
    if not found:
        raise FileFormatError(
            "holds no ruler or angle (type 'Line' or 'Angle'); its markups are: "
            f"{', '.join(map(shown, kinds[:5])) or 'none'}",
            file=path,
            remedy="Save the line or angle from 3D Slicer as .mrk.json.",
        )
    return tuple(
        _measurement(markup, stem if len(found) == 1 else f"{stem} {n}", path)
        for n, markup in enumerate(found, start=1)
    )


def _measurement(markup: dict[str, Any], name: str, file: str | PathLike[str]) -> Measurement:
    kind, given = _KINDS[markup["type"]], markup.get("name")
    name = given if isinstance(given, str) and given.strip() else name
    points = [point.position for point in markup_points(markup, file)]
    placed = [tuple(point.tolist()) for point in points if point is not None]
    if len(placed) != KINDS[kind] or len(points) != KINDS[kind]:
        raise FileFormatError(
            f"{name} must have {KINDS[kind]} placed points, got {len(placed)}",
            file=file,
            remedy="Place all of them in 3D Slicer and save it again.",
        )
    try:
        return Measurement(name, tuple(placed))
    except GpError as error:
        raise FileFormatError(error.problem, file=file, remedy=error.remedy) from None


def _as_json(measurement: Measurement) -> dict[str, Any]:
    kind = measurement.kind
    points = [
        LabelledPoint(f"{measurement.name}-{n}", np.array(position), Status.PLACED)
        for n, position in enumerate(measurement.points, start=1)
    ]
    markup = {"type": _SLICER[kind], "name": measurement.name} | as_markup(points, _SLICER[kind])
    angle = measurement.angle
    value = (
        {"name": "length", "enabled": True, "value": measurement.length_mm, "units": "mm"}
        if angle is None
        else {"name": "angle", "enabled": True, "value": math.degrees(angle), "units": "deg"}
    )
    markup["measurements"] = [value | {"printFormat": "%-#4.4gmm" if kind == LINE else "%3.1f%s"}]
    markup["display"] |= {"propertiesLabelVisibility": True, "pointLabelsVisibility": False}
    return markup
