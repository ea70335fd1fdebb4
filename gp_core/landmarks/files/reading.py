"""Landmarks from any file: by its kind to points, by their labels to features."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike, fspath
from types import MappingProxyType
from typing import Literal

import numpy as np

from gp_core.checks import FloatArray, check_option, near_matches
from gp_core.errors import FeatureError, FileFormatError, GeometryError
from gp_core.landmarks.features import CODES, Side, feature
from gp_core.landmarks.files.dat import is_sentinel, read_dat
from gp_core.landmarks.files.disk import check_file
from gp_core.landmarks.files.fcsv import read_fcsv
from gp_core.landmarks.files.markups import read_markups
from gp_core.landmarks.files.naming import is_named_suggested, name_parts
from gp_core.landmarks.files.points import LabelledPoint, PointList, as_suggested
from gp_core.landmarks.files.scale import check_plausible_size
from gp_core.landmarks.files.table import read_table
from gp_core.landmarks.files.text import shown
from gp_core.landmarks.labels import is_skull_feature, tidy_label
from gp_core.landmarks.sets import LandmarkSet, Status

__all__ = ["label_names", "landmarks_of", "read_landmarks", "read_points", "read_touches", "specimen_of"]

Unknown = Literal["error", "extra"]

_READERS = {
    ".mrk.json": read_markups,
    ".json": read_markups,
    ".fcsv": read_fcsv,
    ".csv": read_table,
    ".tsv": read_table,
    ".dat": read_dat,
}
_SAME_PLACE_MM = 1e-3  # far below a voxel, and still right for a file in metres, which is told elsewhere
_MIN_TO_TELL_A_POINT_FROM_A_SHAPE = 3


def _suffix(path: str | PathLike[str]) -> str:
    name = fspath(path).lower()
    found = next((suffix for suffix in _READERS if name.endswith(suffix)), None)
    if found is None:
        check_file(path)
        raise FileFormatError(
            "is no kind of landmark file that is known", file=path, remedy=f"Give {', '.join(_READERS)}."
        )
    return found


def read_points(path: str | PathLike[str]) -> PointList:
    """Read the labelled points of a landmark file, whatever their labels are.

    Parameters
    ----------
    path : path
        ``.mrk.json``, ``.json``, ``.fcsv``, ``.csv``, ``.tsv`` or ``.dat``.

    Returns
    -------
    PointList
        Positions in mm; LPS, but of a ``.dat`` in the tracker frame. Points that the file marks as suggested,
        in their description or because its name ends in ``_suggested``, have no position but a suggestion.

    Raises
    ------
    FileFormatError
        Another kind of file, or one that cannot be read.
    """
    suffix = _suffix(path)
    points = _READERS[suffix](path)
    if not is_named_suggested(path, suffix):
        return points
    return replace(points, points=tuple(as_suggested(point) for point in points.points))


def read_landmarks(
    path: str | PathLike[str], *, side: Side | str | None = None, unknown: Unknown = "error"
) -> LandmarkSet:
    """Read the landmarks of one side of a head.

    Parameters
    ----------
    path : path
        See `read_points`.
    side : Side or str, optional
        Needed only where neither the file's ``gpLabeler`` object nor the ending of its name
        (``_L``, ``-left``, ...) says it.
    unknown : {"error", "extra"}
        What to do with labels outside the feature table: refuse, or keep in `LandmarkSet.extra`.
        Skull features ``S1``, ``S2``, ... and what this program wrote as extra are always kept.

    Returns
    -------
    LandmarkSet
        In the frame that the file names, else ``scan`` (``.dat``: ``tracker``). What the file marks as
        suggested is in `LandmarkSet.suggested`.

    Raises
    ------
    FileFormatError
        The file cannot be read.
    FeatureError
        A label is unknown (near matches are named) or doubled, or the side is not known or contradicted.
    GeometryError
        All points are at one place.

    Examples
    --------
    >>> read_landmarks("GP01_L.mrk.json").side  # doctest: +SKIP
    <Side.LEFT: 'L'>
    """
    return landmarks_of(read_points(path), side=side, unknown=unknown)


def landmarks_of(
    points: PointList, *, side: Side | str | None = None, unknown: Unknown = "error"
) -> LandmarkSet:
    """Make landmarks of the points of a file; see `read_landmarks`."""
    return _landmark_set(points, _side_of(points, side), points.frame, unknown)


def read_touches(path: str | PathLike[str], side: Side | str, *, unknown: Unknown = "error") -> LandmarkSet:
    """Read what was touched with the probe on one side of a head.

    Parameters
    ----------
    path : path
        See `read_points`. In a file of any kind, -1000 -1000 -1000 and 0 0 0 stand for *not seen*.
    side : Side or str
        Side of the head.
    unknown : {"error", "extra"}
        See `read_landmarks`.

    Returns
    -------
    LandmarkSet
        Positions in mm, tracker frame; the eight skull features in `extra`.

    Raises
    ------
    FileFormatError
        The file cannot be read.
    FeatureError
        A label is unknown or doubled, or the file says that it is the other side.
    GeometryError
        All points are at one place, or are not in millimetres.
    """
    points = read_points(path)
    wanted = Side.parse(side)
    _check_side(wanted, points.header.side if points.header else None, points)
    seen = replace(points, points=tuple(_without_sentinel(point) for point in points.points))
    touches = _landmark_set(seen, wanted, "tracker", unknown)
    check_plausible_size(touches, path)
    return touches


def specimen_of(points: PointList) -> str:
    """Return the specimen that a file names, in its ``gpLabeler`` object or by its name."""
    name = points.header.specimen if points.header else None
    return name or name_parts(points.source, _suffix(points.source))[0]


def _without_sentinel(point: LabelledPoint) -> LabelledPoint:
    if point.position is None or not is_sentinel(point.position):
        return point
    return point._replace(position=None, status=Status.UNSEEN)


def _side_of(points: PointList, side: Side | str | None) -> Side:
    said = points.header.side if points.header else None
    said = said or name_parts(points.source, _suffix(points.source))[1]
    given = None if side is None else Side.parse(side)
    if given is not None:
        _check_side(given, said, points)
    if (found := said or given) is None:
        raise FeatureError(
            "does not say which side of the head it is",
            file=points.source,
            remedy="Give the side (L or R), or let the file's name end in _L or _R.",
        )
    return found


def _check_side(wanted: Side, said: Side | None, points: PointList) -> None:
    if said not in (None, wanted):
        raise FeatureError(
            f"is the {wanted.other.word} side, but was asked for as the {wanted.word} side",
            file=points.source,
            remedy=f"Give the side {wanted.other.value}, or correct the file.",
        )


def _landmark_set(points: PointList, side: Side, frame: str, unknown: Unknown) -> LandmarkSet:
    check_option(unknown, "unknown", ("error", "extra"))
    names = label_names(points, unknown=unknown)
    positions = dict(zip(names, points.positions, strict=True))
    placed = np.array([p.position for p in points.points if p.position is not None])
    if len(placed) >= _MIN_TO_TELL_A_POINT_FROM_A_SHAPE and (placed == placed[0]).all():
        raise GeometryError(
            f"all {len(placed)} points are at the same place",
            file=points.source,
            remedy="Export the landmarks again.",
        )
    rows = np.array([positions.get(code, np.full(3, np.nan)) for code in CODES])
    unseen = {name for name, status in zip(names, points.statuses, strict=True) if status is Status.UNSEEN}
    extra = {name: p for name, p in positions.items() if name not in CODES and np.isfinite(p).all()}
    suggested = {
        name: point.suggestion
        for name, point in zip(names, points.points, strict=True)
        if point.suggestion is not None and name in CODES and not feature(name).computed
    }
    _check_axis(positions, points)
    found = LandmarkSet(rows, side, frame, frozenset(unseen & set(CODES)), MappingProxyType(extra))
    return found.with_suggestions(suggested)


def _check_axis(positions: dict[str, FloatArray], points: PointList) -> None:
    """Refuse an axis without a direction, whatever else is placed."""
    ca, cb = (positions.get(code, np.full(3, np.nan)) for code in ("CA", "CB"))
    if np.linalg.norm(ca - cb) < _SAME_PLACE_MM:
        raise GeometryError(
            "CA and CB are at the same place, so they give no axis",
            file=points.source,
            landmark="CA",
            remedy="Place one of them again.",
        )


def label_names(points: PointList, *, unknown: Unknown = "extra") -> list[str]:
    """Return the names that the labels of a file stand for, in its order.

    Raises
    ------
    FeatureError
        A label is unknown, where `unknown` says that it is an error, or two of them name one point.
    """
    known = set(points.header.extra) if points.header else set()
    names: dict[str, str] = {}
    for label in points.labels:
        name = tidy_label(label)
        if not (name in CODES or name in known or is_skull_feature(name) or unknown == "extra"):
            raise _unknown(label, points)
        if name.casefold() in names:
            other = names[name.casefold()]
            also = "" if other == label else f", as {shown(label)} too"
            raise FeatureError(
                f"is in the file twice{also}",
                file=points.source,
                landmark=other[:40],
                remedy="Remove one of them.",
            )
        names[name.casefold()] = name
    return list(names.values())


def _unknown(label: str, points: PointList) -> FeatureError:
    return FeatureError(
        f"unknown feature {shown(label)}{near_matches(label[:40], CODES)}",
        file=points.source,
        landmark=label[:40],
        remedy=f"The features are {' '.join(CODES)}.",
    )
