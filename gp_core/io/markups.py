"""3D Slicer's point lists, ``.mrk.json``: read leniently, written exactly as Slicer does."""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.disk import write_text
from gp_core.errors import FileFormatError, GpError
from gp_core.io.header import FileHeader
from gp_core.io.labelled_points import (
    STATUS_WORDS,
    LabelledPoint,
    PointList,
    as_suggested,
    is_computed,
    labelled_point,
    points_of,
    suggestions_of,
)
from gp_core.io.text import check_count, flips_xy, shown
from gp_core.io.text_files import read_text
from gp_core.landmarks.sets import LandmarkSet

__all__ = ["has_point_list", "read_markups", "write_markups", "write_point_lists", "write_suggestions"]

_log = logging.getLogger(__name__)

_SCHEMA = (
    "https://raw.githubusercontent.com/slicer/slicer/master/"
    "Modules/Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#"
)
ACCEPTED = "accepted ghost"
"""The provenance of a point accepted at its predicted position without review."""

_LINES = ("Line",)
"""What this program writes beside point lists: through points of the lists, so that nothing is lost."""

_OTHER_KINDS = frozenset({"Line", "Angle", "Curve", "ClosedCurve", "Plane", "ROI"})
"""Kinds of markups of 3D Slicer that are not point lists."""

_NUMBERS_ON_LINES = re.compile(r"\[\n\s+([-+0-9.eE,\s]+?)\n\s+\]")


def read_markups(path: str | PathLike[str]) -> PointList:
    """Read the points of every point list in a markups file.

    Parameters
    ----------
    path : path
        A ``.mrk.json`` file of 3D Slicer, SlicerMorph, SlicerMorphR or this program.

    Returns
    -------
    PointList
        Positions in mm, LPS, whichever system the file has.

    Raises
    ------
    FileFormatError
        Not a markups file, no point list in it, not in mm, an unknown status or system, or a position
        that is neither three finite numbers nor missing.
    """
    content = load_markups(path)
    header = FileHeader.from_json(content["gpLabeler"], path) if "gpLabeler" in content else None
    lists = _point_lists(content, path, told=_LINES if header else ())
    listed = (markup.get("controlPoints") for markup in lists)
    check_count(sum(len(points) for points in listed if isinstance(points, list)), "points", path)
    points = [point for markup in lists for point in markup_points(markup, path)]
    if header is not None:
        points = _without_accepted_ghosts(points, header, path)
    return PointList(tuple(points), Path(path), "scan" if header is None else header.frame, header)


def _without_accepted_ghosts(
    points: list[LabelledPoint], header: FileHeader, file: str | PathLike[str]
) -> list[LabelledPoint]:
    """Convert ghosts accepted without review, which earlier versions stored as placed, to suggestions."""
    accepted = {
        label
        for label, how in header.provenance.items()
        if isinstance(how, dict) and how.get("how") == ACCEPTED
    }
    found = [as_suggested(p, source="atlas") if p.label in accepted else p for p in points]
    taken = [new.label for old, new in zip(points, found, strict=True) if new is not old]
    if taken:
        _log.warning(
            "%s: accepted ghosts that nobody confirmed are taken as suggestions: %s", file, " ".join(taken)
        )
    return found


def has_point_list(path: str | PathLike[str]) -> bool:
    """Tell whether a file of a folder may hold landmarks: False for lines, angles, curves and planes alone.

    Parameters
    ----------
    path : path
        A ``.mrk.json`` file; one that cannot be read is said to hold landmarks, so that reading it says why
        it cannot.

    Returns
    -------
    bool
        Whether to read its landmarks.
    """
    try:
        markups = load_markups(path)["markups"]
    except GpError:
        return True
    kinds = [markup.get("type") if isinstance(markup, dict) else None for markup in markups]
    return not kinds or any(not isinstance(kind, str) or kind not in _OTHER_KINDS for kind in kinds)


def load_markups(path: str | PathLike[str]) -> dict[str, Any]:
    """Read a markups file as it is.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    dict
        Its content, with a list ``markups``.

    Raises
    ------
    FileFormatError
        It is no markups file.
    """
    try:
        content = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:  # ValueError also for numbers of many thousand digits
        line = f" at line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise FileFormatError(
            f"is not JSON: damaged or cut off{line}", file=path, remedy="Export the landmarks again."
        ) from None
    if isinstance(content, dict) and str(content.get("format", "")).startswith("gp-labeler specimen"):
        raise FileFormatError(
            "is a specimen of gp-labeler, not a landmark file",
            file=path,
            remedy=f"Export its landmarks: gp-labeler export {Path(path).name} -o labelled",
        )
    if not isinstance(content, dict) or not isinstance(content.get("markups"), list):
        raise FileFormatError(
            "is not a markups file: no list 'markups' in it",
            file=path,
            remedy="Save the point list from 3D Slicer as .mrk.json.",
        )
    return content


def _point_lists(
    content: dict[str, Any], file: str | PathLike[str], told: Sequence[str]
) -> list[dict[str, Any]]:
    """Return the point lists; other kinds of markups are reported, unless their kind is in `told`."""
    found = []
    kinds = []
    for markup in content["markups"]:
        kind = markup.get("type") if isinstance(markup, dict) else markup
        kinds.append(shown(kind))
        if isinstance(markup, dict) and kind == "Fiducial":
            found.append(markup)
        elif kind not in told:
            _log.warning("%s: passed over a markup of type %s", file, shown(kind))
    if not found:
        raise FileFormatError(
            f"holds no point list (type 'Fiducial'); its markups are: {', '.join(kinds[:5]) or 'none'}",
            file=file,
            remedy="Save the point list from 3D Slicer as .mrk.json.",
        )
    return found


def markup_points(markup: dict[str, Any], file: str | PathLike[str]) -> list[LabelledPoint]:
    """Return the control points of one markup.

    Parameters
    ----------
    markup : dict
        As the file has it.
    file : path
        For messages.

    Returns
    -------
    list of LabelledPoint
        Positions in mm, LPS.

    Raises
    ------
    FileFormatError
        A point, the unit or the coordinate system is not what it should be.
    """
    _check_units(markup.get("coordinateUnits"), file)
    flip_xy = flips_xy(markup.get("coordinateSystem"), file)
    rows = markup.get("controlPoints", [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise FileFormatError("its 'controlPoints' must be a list of objects", file=file)
    return [_point(row, flip_xy, file) for row in rows]


def _check_units(unit: object, file: str | PathLike[str]) -> None:
    if isinstance(unit, list) and len(unit) == 3 and unit[1] == "UCUM":
        unit = unit[0]
    if unit not in (None, "", "mm"):
        raise FileFormatError(
            f"coordinates must be in mm, got the unit {shown(unit)}",
            file=file,
            remedy="3D Slicer ignores the unit and takes the numbers as mm: convert them to mm (um: divide "
            "by 1000) and write mm.",
        )


def _point(row: dict[str, Any], flip_xy: bool, file: str | PathLike[str]) -> LabelledPoint:
    label, description = row.get("label"), row.get("description")
    text = "" if label is None else str(label)
    word = row.get("positionStatus") or "defined"
    if not isinstance(word, str) or word.strip() not in STATUS_WORDS:
        raise FileFormatError(
            f"positionStatus must be one of {', '.join(STATUS_WORDS)}, got {shown(word)}",
            file=file,
            landmark=text[:40],
            remedy="Correct it.",
        )
    position = row.get("position") or [None]  # "", null, absent: not placed
    return labelled_point(
        text,
        position if isinstance(position, list) else [position],
        STATUS_WORDS[word.strip()],
        file=file,
        description=description if isinstance(description, str) else "",
        flip_xy=flip_xy,
    )


@checks_arguments
def write_markups(
    path: str | PathLike[str],
    landmarks: LandmarkSet,
    *,
    specimen: str,
    volume: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> None:
    """Write one side of a specimen as 3D Slicer would, to the last bit of every coordinate.

    All features are in the file, in the table's order, placed or not, since SlicerMorph goes by the index.

    Parameters
    ----------
    path : path
        ``<specimen>_L.mrk.json`` or ``<specimen>_R.mrk.json``.
    landmarks : LandmarkSet
        Positions in mm, LPS.
    specimen : str
        Name of the animal.
    volume : mapping, optional
        ``name``, ``size``, ``spacing`` and ``checksum`` of the labelled volume.
    provenance : mapping, optional
        For each feature code, how the point came to be, in plain JSON values; it goes before what
        `LandmarkSet.provenance` says of that feature.

    Raises
    ------
    GpError
        The file cannot be written, or `volume` or `provenance` holds what JSON cannot.
    """
    header = FileHeader(
        specimen=specimen,
        side=landmarks.side,
        frame=landmarks.frame,
        volume=volume,
        provenance={
            **{code: about.as_json() for code, about in landmarks.provenance.items()},
            **(provenance or {}),
        },
        extra=tuple(landmarks.extra),
        scan_evidence=landmarks.scan_evidence,
        observer=landmarks.observer or None,
        round=landmarks.round,
    )
    write_point_lists(path, {"Fiducial": points_of(landmarks)}, header)


@checks_arguments
def write_suggestions(
    path: str | PathLike[str],
    landmarks: LandmarkSet,
    *,
    specimen: str,
    volume: Mapping[str, Any] | None = None,
) -> None:
    """Write what is suggested on one side of a specimen, which `write_markups` leaves out.

    3D Slicer shows such points like any others. So each description says that the point is suggested, and
    every reader of this library takes it as a suggestion, also after Slicer has saved the file.

    Parameters
    ----------
    path : path
        ``<specimen>_L_suggested.mrk.json`` or ``<specimen>_R_suggested.mrk.json``.
    landmarks : LandmarkSet
        Suggested positions in mm, LPS.
    specimen, volume
        As for `write_markups`.

    Raises
    ------
    GpError
        Nothing is suggested, or the file cannot be written.
    """
    if not landmarks.suggested:
        raise GpError(f"nothing is suggested on the {landmarks.side.word} side", specimen=specimen)
    header = FileHeader(
        specimen=specimen,
        side=landmarks.side,
        frame=landmarks.frame,
        volume=volume,
        observer=landmarks.observer or None,
        round=landmarks.round,
    )
    write_point_lists(path, {"Fiducial": suggestions_of(landmarks)}, header)


def write_point_lists(
    path: str | PathLike[str], lists: Mapping[str, Sequence[LabelledPoint]], header: FileHeader
) -> None:
    """Write points as 3D Slicer would, one markup for each kind.

    Parameters
    ----------
    path : path
        A ``.mrk.json`` file.
    lists : mapping of str to sequence of LabelledPoint
        Points by Slicer's word for the kind of markup, ``Fiducial`` or ``Line``; mm, LPS.
    header : FileHeader

    Raises
    ------
    GpError
        The file cannot be written, or the header holds what JSON cannot.
    """
    write_content(path, [as_markup(points, kind) for kind, points in lists.items()], header)


def write_content(
    path: str | PathLike[str], markups: Sequence[Mapping[str, Any]], header: FileHeader
) -> None:
    """Write markups that are made already.

    Parameters
    ----------
    path : path
        A ``.mrk.json`` file.
    markups : sequence of mapping
        As Slicer's JSON has them; see `as_markup`.
    header : FileHeader
        What this program says of them.

    Raises
    ------
    GpError
        The file cannot be written, or the header holds what JSON cannot.
    """
    # A list, as markups are: pandas, by which SlicerMorph reads these files, takes no object beside a list.
    content = {"@schema": _SCHEMA, "markups": markups, "gpLabeler": [header.as_json()]}
    try:
        text = json.dumps(content, indent=4, ensure_ascii=False, allow_nan=False, default=_plain)
    except (TypeError, ValueError) as error:
        raise GpError(f"volume or provenance cannot be written as JSON ({error})", file=path) from None
    write_text(path, _NUMBERS_ON_LINES.sub(_on_one_line, text) + "\n")


def _on_one_line(numbers: re.Match[str]) -> str:
    return f"[{' '.join(numbers[1].split())}]"


def _plain(value: object) -> Any:
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__}")


def _as_json(point: LabelledPoint, index: int, kind: str) -> dict[str, Any]:
    return {
        "id": f"vtkMRMLMarkups{kind}Node_{index}",
        "label": point.label,
        "description": point.description,
        "associatedNodeID": "",
        "position": "" if point.position is None else point.position.tolist(),
        "orientation": [-1.0, -0.0, -0.0, -0.0, -1.0, -0.0, 0.0, 0.0, 1.0],  # the identity in RAS
        "selected": True,
        "locked": is_computed(point.label),
        "visibility": True,
        "positionStatus": point.status.value,
    }


def as_markup(points: Sequence[LabelledPoint], kind: str) -> dict[str, Any]:
    """Return points as one markup of 3D Slicer.

    Parameters
    ----------
    points : sequence of LabelledPoint
        Its control points, mm, LPS.
    kind : str
        ``Fiducial``, ``Line`` or ``Angle``.

    Returns
    -------
    dict
        Plain values for JSON.
    """
    return {
        "type": kind,
        "coordinateSystem": "LPS",
        "coordinateUnits": "mm",
        "locked": False,
        "fixedNumberOfControlPoints": True,
        "labelFormat": "%N-%d",
        "lastUsedControlPointNumber": len(points),
        "controlPoints": [_as_json(point, i, kind) for i, point in enumerate(points)],
        "measurements": [],
        "display": _display(),
    }


def _display() -> dict[str, Any]:
    """Return 3D Slicer's defaults, in its order."""
    return {
        "visibility": True,
        "opacity": 1.0,
        "color": [0.4, 1.0, 1.0],
        "selectedColor": [1.0, 0.5, 0.5],
        "activeColor": [0.4, 1.0, 0.0],
        "propertiesLabelVisibility": False,
        "pointLabelsVisibility": True,
        "textScale": 3.0,
        "glyphType": "Sphere3D",
        "glyphScale": 3.0,
        "glyphSize": 5.0,
        "useGlyphScale": True,
        "sliceProjection": False,
        "sliceProjectionUseFiducialColor": True,
        "sliceProjectionOutlinedBehindSlicePlane": False,
        "sliceProjectionColor": [1.0, 1.0, 1.0],
        "sliceProjectionOpacity": 0.6,
        "lineThickness": 0.2,
        "lineColorFadingStart": 1.0,
        "lineColorFadingEnd": 10.0,
        "lineColorFadingSaturation": 1.0,
        "lineColorFadingHueOffset": 0.0,
        "handlesInteractive": False,
        "translationHandleVisibility": True,
        "rotationHandleVisibility": True,
        "scaleHandleVisibility": False,
        "interactionHandleScale": 3.0,
        "snapMode": "toVisibleSurface",
    }
