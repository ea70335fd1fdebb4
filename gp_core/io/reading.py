"""Read landmarks from any file: points by the file's format, features by their labels."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import replace
from os import PathLike, fspath
from types import MappingProxyType
from typing import Literal

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.errors import FeatureError, FileFormatError, GeometryError, GpError, blaming
from gp_core.extensions import Extensions
from gp_core.io.dat import is_sentinel, read_dat
from gp_core.io.fcsv import read_fcsv
from gp_core.io.file_names import is_named_suggested, labelling_named, name_parts, named_side, specimen_named
from gp_core.io.labelled_points import LabelledPoint, PointList, as_suggested
from gp_core.io.markups import read_markups
from gp_core.io.repeated_points import split_trial, with_repeats_combined
from gp_core.io.table import read_table
from gp_core.io.text import shown
from gp_core.io.text_files import check_file
from gp_core.landmarks.features import CODES, Side, feature
from gp_core.landmarks.labels import LabelNames, is_skull_feature, parse_label, tidy_label
from gp_core.landmarks.plausible_size import check_plausible_size
from gp_core.landmarks.provenance import LabelProvenance
from gp_core.landmarks.sets import LandmarkSet, Status
from gp_core.validation import FloatArray, check_option, near_matches

__all__ = [
    "FORMATS",
    "label_names",
    "landmarks_of",
    "read_landmarks",
    "read_points",
    "read_touches",
    "sides_of",
    "specimen_of",
    "unknown_labels",
]

_log = logging.getLogger(__name__)

Unknown = Literal["error", "extra"]

FORMATS: Extensions[Callable[[str | PathLike[str]], PointList]] = Extensions(
    "gp_labeler.landmark_formats",
    {
        "mrk.json": read_markups,
        "json": read_markups,
        "fcsv": read_fcsv,
        "csv": read_table,
        "tsv": read_table,
        "dat": read_dat,
    },
)
"""Readers of landmark files by the ending of their names."""

_SAME_PLACE_MM = 1e-3  # far below a voxel, even for a file in metres, which is detected elsewhere
_MIN_TO_TELL_A_POINT_FROM_A_SHAPE = 3


def _suffix(path: str | PathLike[str]) -> str:
    name = fspath(path).lower()
    found = _ending(name, FORMATS.builtin) or _ending(name, FORMATS.added)
    if found is None and name.endswith((".mha", ".mhd", ".nrrd")):
        raise FileFormatError(
            "is an image, or a recording of a tracker, and holds no named points",
            file=path,
            remedy="Make touches of a recording with 'gp-core touches'.",
        )
    if found is None:
        check_file(path)
        raise FileFormatError(
            "is not a known kind of landmark file",
            file=path,
            remedy=f"Give {', '.join(f'.{ending}' for ending in FORMATS.names())}.",
        )
    return found


def _ending(name: str, formats: Iterable[str]) -> str | None:
    return next((f".{ending}" for ending in formats if name.endswith(f".{ending.lower()}")), None)


def _read_as(suffix: str, path: str | PathLike[str]) -> PointList:
    ending = suffix.removeprefix(".")
    if not FORMATS.is_added(ending):
        return FORMATS.get(ending)(path)
    check_file(path)
    with blaming(path):
        try:
            points = FORMATS.get(ending)(path)
        except Exception as error:
            raise FORMATS.failure(ending, error) from error
        if not isinstance(points, PointList):
            raise GpError(
                f"{FORMATS.described(ending)} gave no PointList", remedy="Report this to its authors."
            )
    return points


def read_points(
    path: str | PathLike[str], *, names: LabelNames | None = None, numbered: bool = False
) -> PointList:
    """Read the labelled points of a landmark file, whatever their labels are.

    Parameters
    ----------
    path : path
        ``.mrk.json``, ``.json``, ``.fcsv``, ``.csv``, ``.tsv``, ``.dat``, or of a format that a package adds.
    names : LabelNames, optional
        A lab's own names of the features.
    numbered : bool
        Whether a label may end in the number of a touch, as ``MN#2`` does.

    Returns
    -------
    PointList
        Sides in labels, such as ``CA_L`` or ``left CA``, are taken out of them.
        Positions in mm; LPS, but of a ``.dat`` in the tracker frame. Points that the file marks as suggested,
        in their description or because its name ends in ``_suggested``, have no position but a suggestion.

    Raises
    ------
    FileFormatError
        Another kind of file, or one that cannot be read.
    FeatureError
        A label tells another side than the table's column.
    """
    suffix = _suffix(path)
    points = _read_as(suffix, path)
    known = names or LabelNames({})
    listed = (_with_trial(p, known) if numbered else p for p in points.points)
    taken = tuple(_with_name(p, known, path) for p in listed if not known.leaves_out(p.label))
    points = replace(points, points=taken)
    if not is_named_suggested(path, suffix):
        return points
    return replace(points, points=tuple(as_suggested(point) for point in points.points))


def _with_trial(point: LabelledPoint, names: LabelNames) -> LabelledPoint:
    """Return a point with the number of its touch taken out of its label, unless a lab's name ends in it."""
    label, trial = split_trial(point.label)
    if not trial or names.translate(point.label) != point.label or names.leaves_out(point.label):
        return point
    return point._replace(label=label, trial=point.trial or trial)


def _with_name(point: LabelledPoint, names: LabelNames, file: str | PathLike[str]) -> LabelledPoint:
    """Return a point with the name and the side that its label gives."""
    name, side = parse_label(names.translate(point.label))
    if side is not None and point.side not in (None, side):
        raise FeatureError(
            f"is of the {side.word} side by its label, of the {side.other.word} by its column",
            file=file,
            landmark=point.label[:40],
            remedy="Correct one of them.",
        )
    return point._replace(label=name, side=side or point.side)


@checks_arguments
def read_landmarks(
    path: str | PathLike[str],
    *,
    side: Side | str | None = None,
    unknown: Unknown = "error",
    names: LabelNames | None = None,
) -> LandmarkSet:
    """Read the landmarks of one side of a head.

    Parameters
    ----------
    path : path
        See `read_points`.
    side : Side or str, optional
        Needed only where neither the file's ``gpLabeler`` object, nor its labels (``CA_L``), nor a column
        ``side``, nor its name (``_L``, ``left``, ...) says it, or where the file holds both sides.
    unknown : {"error", "extra"}
        What to do with labels outside the feature table: refuse, or keep in `LandmarkSet.extra`.
        Skull features ``S1``, ``S2``, ... and what this program wrote as extra are always kept.
    names : LabelNames, optional
        A lab's own names of the features.

    Returns
    -------
    LandmarkSet
        In the frame that the file names, else ``scan`` (``.dat``: ``tracker``). What the file marks as
        suggested is in `LandmarkSet.suggested`; what is at -1000 -1000 -1000 was not seen.

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
    return landmarks_of(read_points(path, names=names), side=side, unknown=unknown)


def landmarks_of(
    points: PointList, *, side: Side | str | None = None, unknown: Unknown = "error"
) -> LandmarkSet:
    """Build the landmarks of one side from the points of a file; see `read_landmarks`.

    Parameters
    ----------
    points : PointList
        Of a file.
    side : {"L", "R"}, optional
        Which side; by default the one that the file gives.
    unknown : {"error", "skip", "extra"}
        What to do with labels that name no feature.

    Returns
    -------
    LandmarkSet
        In the frame of the file, mm.

    Raises
    ------
    GpError
        As for `read_landmarks`.
    """
    chosen = _side_of(points, side)
    points = _one_side(points, chosen)
    marked = [
        p.label for p in points.points if p.position is not None and is_sentinel(p.position, zero=False)
    ]
    if marked:
        _log.warning("%s: at -1000, -1000, -1000, so not seen: %s", points.source, " ".join(marked))
        points = replace(points, points=tuple(_without_sentinel(p, zero=False) for p in points.points))
    return _landmark_set(points, chosen, points.frame, unknown)


def sides_of(points: PointList, *, unknown: Unknown = "error") -> tuple[LandmarkSet, ...]:
    """Build the landmarks of each side that a file holds; see `read_landmarks`.

    Parameters
    ----------
    points : PointList
        Of a file.
    unknown : {"error", "skip", "extra"}
        What to do with labels that name no feature.

    Returns
    -------
    tuple of LandmarkSet
        One or two sides, left first.

    Raises
    ------
    GpError
        As for `read_landmarks`.
    """
    if len(points.sides) < 2:
        return (landmarks_of(points, unknown=unknown),)
    return tuple(landmarks_of(points, side=side, unknown=unknown) for side in Side)


@checks_arguments
def read_touches(
    path: str | PathLike[str],
    side: Side | str,
    *,
    unknown: Unknown = "error",
    names: LabelNames | None = None,
) -> LandmarkSet:
    """Read what was touched with the probe on one side of a head.

    Parameters
    ----------
    path : path
        See `read_points`. In a file of any kind, -1000 -1000 -1000 and 0 0 0 stand for *not seen*. A feature
        may be there several times, by the same name, or as ``MN#1``, ``MN#2``, ...: each is one touch.
    side : Side or str
        Side of the head.
    unknown : {"error", "extra"}
        See `read_landmarks`.
    names : LabelNames, optional
        A lab's own names of the features.

    Returns
    -------
    LandmarkSet
        Positions in mm, tracker frame; the eight skull features in `extra`. What was touched several times is
        at the mean of its touches, without outliers, and all of them are in `LandmarkSet.repeats`.

    Raises
    ------
    FileFormatError
        The file cannot be read.
    FeatureError
        A label is unknown, a touch is a copy of another one, or the file says that it is the other side.
    GeometryError
        All points are at one place, or are not in millimetres.
    """
    points = read_points(path, names=names, numbered=True)
    wanted = Side.parse(side)
    _check_side(wanted, points.header.side if points.header else None, points)
    points = _one_side(points, wanted)
    seen = replace(points, points=tuple(_without_sentinel(point) for point in points.points))
    each_once, repeats = with_repeats_combined(seen)
    touches = replace(_landmark_set(each_once, wanted, "tracker", unknown), repeats=repeats)
    check_plausible_size(touches, path)
    if touches.suggested:
        _log.warning("%s: suggestions are no touches, left out: %s", path, " ".join(touches.suggested))
    return touches


def specimen_of(points: PointList) -> str:
    """Return the specimen of a file, from its ``gpLabeler`` object or its name.

    Parameters
    ----------
    points : PointList
        Of a file.

    Returns
    -------
    str
        Name of the animal.
    """
    name = points.header.specimen if points.header else None
    return name or specimen_named(points.source, _suffix(points.source))


def _without_sentinel(point: LabelledPoint, *, zero: bool = True) -> LabelledPoint:
    if point.position is None or not is_sentinel(point.position, zero=zero):
        return point
    return point._replace(position=None, status=Status.UNSEEN)


def _side_of(points: PointList, side: Side | str | None) -> Side:
    given = None if side is None else Side.parse(side)
    if len(points.sides) > 1:
        if given is None:
            raise FeatureError(
                "holds both sides of the head, as its labels or its column 'side' say",
                file=points.source,
                remedy="Give the side (L or R) that is wanted.",
            )
        return given
    if given is not None and points.sides:
        return given
    if points.header is None and points.sides:
        _check_named_side(next(iter(points.sides)), points)
    said = points.header.side if points.header else next(iter(points.sides), None)
    said = said or name_parts(points.source, _suffix(points.source))[1]
    if given is not None:
        _check_side(given, said, points)
    if (found := said or given) is None:
        raise FeatureError(
            "does not say which side of the head it is",
            file=points.source,
            remedy="Give the side (L or R), or let the file's name end in _L or _R.",
        )
    return found


def _check_named_side(told: Side, points: PointList) -> None:
    if named_side(points.source) is told.other:
        raise FeatureError(
            f"is named as the {told.other.word} side, but its labels or its column 'side' say {told.word}",
            file=points.source,
            remedy=f"Give the side {told.value}, or correct the file or its name.",
        )


def _one_side(points: PointList, side: Side) -> PointList:
    """Return the points of one side; in a file with sides, only shared points may lack one."""
    told = points.sides
    if told == {side.other}:
        raise FeatureError(
            f"holds points of the {side.other.word} side, as its labels or its column 'side' say, but was "
            f"asked for as the {side.word} side",
            file=points.source,
            remedy=f"Give the side {side.other.value}, or correct the file.",
        )
    if len(told) < 2:
        return points.of_side(side)
    without = (p.label for p in points.points if p.side is None and p.label in CODES)
    lost = next((label for label in without if not feature(label).shared), None)
    if lost is not None:
        raise FeatureError(
            "gives no side, although other points of the file do",
            file=points.source,
            landmark=lost,
            remedy=f"Name it {lost}_L or {lost}_R.",
        )
    return points.of_side(side)


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
    evidence = points.header.scan_evidence if points.header else None
    observer, round_ = _labelling_of(points)
    found = LandmarkSet(
        rows,
        side,
        frame,
        frozenset(unseen & set(CODES)),
        MappingProxyType(extra),
        scan_evidence=evidence,
        provenance=_provenance(points, names),
        observer=observer,
        round=round_,
    )
    return found.with_suggestions(suggested)


def _labelling_of(points: PointList) -> tuple[str, int]:
    """Return who labelled, and in which round: as the header says, else all descriptions, else the name."""
    if points.header is not None and points.header.observer is not None:
        return points.header.observer, points.header.round
    said = {(p.provenance.observer, p.round) for p in points.points if p.provenance is not None}
    observer, round_ = labelling_named(points.source, _suffix(points.source))
    if len(said) == 1 and not observer:
        observer, round_ = said.pop()
    return observer, max(round_, points.header.round if points.header else 1)


def _provenance(points: PointList, names: list[str]) -> dict[str, LabelProvenance]:
    """Return what is known of each feature: as the header says, else its description."""
    told = points.header.provenance if points.header else {}
    found = {}
    for name, point in zip(names, points.points, strict=True):
        if name not in CODES:
            continue
        content = told.get(point.label)
        if isinstance(content, dict):
            try:
                found[name] = LabelProvenance.from_json(content)
            except GpError as error:
                raise FileFormatError(
                    f"its gpLabeler object has a wrong provenance: {error.problem}",
                    file=points.source,
                    landmark=name,
                    remedy="Correct it, or remove the entry.",
                ) from None
        elif point.provenance is not None and points.header is None:
            found[name] = point.provenance
    return found


def _check_axis(positions: dict[str, FloatArray], points: PointList) -> None:
    """Reject an axis without a direction."""
    ca, cb = (positions.get(code, np.full(3, np.nan)) for code in ("CA", "CB"))
    if np.linalg.norm(ca - cb) < _SAME_PLACE_MM:
        raise GeometryError(
            "CA and CB are at the same place, so they give no axis",
            file=points.source,
            landmark="CA",
            remedy="Place one of them again.",
        )


def unknown_labels(points: PointList) -> tuple[str, ...]:
    """Return the labels of a file that name neither a feature nor a skull feature.

    Parameters
    ----------
    points : PointList
        Of a file.

    Returns
    -------
    tuple of str
        Each once, in the order of the file.
    """
    known = set(points.header.extra) if points.header else set()
    strange = (p.label for p in points.points if p.label not in CODES and not is_skull_feature(p.label))
    return tuple(dict.fromkeys(label for label in strange if label not in known))


def label_names(points: PointList, *, unknown: Unknown = "extra") -> list[str]:
    """Return the names that the labels of a file stand for.

    Parameters
    ----------
    points : PointList
        Of a file.
    unknown : {"error", "skip", "extra"}
        What to do with labels that name no feature.

    Returns
    -------
    list of str
        In the order of the file.

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
        remedy=f"The features are {' '.join(CODES)}. Or give a table of your own names (--names FILE).",
    )
