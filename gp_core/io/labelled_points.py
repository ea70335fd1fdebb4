"""Labelled points as a file holds them, before they are matched to features."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gp_core.errors import FileFormatError
from gp_core.io.header import FileHeader
from gp_core.io.text import parse_position
from gp_core.landmarks.features import FEATURES, Feature, Side
from gp_core.landmarks.provenance import LabelProvenance, described, without_description
from gp_core.landmarks.sets import LandmarkSet, Status
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import FloatArray

__all__ = [
    "STATUS_WORDS",
    "LabelledPoint",
    "PointList",
    "as_suggested",
    "is_computed",
    "labelled_point",
    "points_of",
    "suggested_description",
    "suggestions_of",
]

_log = logging.getLogger(__name__)

# Slicer's words in the order of its numbers; a previewed point follows the mouse and is not placed.
STATUS_WORDS: Mapping[str, Status] = {
    "undefined": Status.TO_DO,
    "preview": Status.TO_DO,
    "defined": Status.PLACED,
    "missing": Status.UNSEEN,
}

# Marks a suggestion in the description, which 3D Slicer shows and preserves.
_SUGGESTED = re.compile(
    r"suggested, not confirmed"
    r"(?: \((?P<source>.*?)(?:; 95 % within (?P<radius>[0-9]{1,6}\.?[0-9]*) mm)?"
    r"(?:; (?P<atlas>[0-9]{1,6}\.?[0-9]*) mm from where the atlas expects it)?"
    r"(?P<doubtful>; doubtful)?\)(?=\.|$))?",
    re.IGNORECASE,
)


class LabelledPoint(NamedTuple):
    """One point of a file: label, (3,) position in mm or None, how far it is, free text, side if it says one.

    A suggested point has no `position`, which would be an observation, but a `suggestion`. What the
    description says of observer, certainty, note and check is in `provenance`. `trial` is the number of a
    touch among several of one feature; 0 where the file gives none.
    """

    label: str
    position: FloatArray | None
    status: Status
    description: str = ""
    suggestion: Suggestion | None = None
    side: Side | None = None
    provenance: LabelProvenance | None = None
    round: int = 1
    trial: int = 0


@dataclass(frozen=True, eq=False)
class PointList:
    """The labelled points of one file, in the file's order; labels may be anything, and doubled.

    Parameters
    ----------
    points : tuple of LabelledPoint
        The N points; positions in mm, LPS where the file has a coordinate system.
    source : Path
        The file.
    frame : str
        Frame of the positions.
    header : FileHeader, optional
        What this program wrote into the file, if it did.

    Raises
    ------
    FileFormatError
        There are no points.
    """

    points: tuple[LabelledPoint, ...]
    source: Path
    frame: str = "scan"
    header: FileHeader | None = None

    def __post_init__(self) -> None:
        if not self.points:
            raise FileFormatError("holds no points", file=self.source, remedy="Export the landmarks again.")

    def __len__(self) -> int:
        return len(self.points)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels, in the file's order."""
        return tuple(point.label for point in self.points)

    @property
    def sides(self) -> frozenset[Side]:
        """Sides of the head that the points themselves tell, in their labels or a column of the table.

        What a point of both sides (IN) tells does not count beside other points.
        """
        of_a_side = tuple(point for point in self.points if not _is_shared(point.label))
        return frozenset(point.side for point in of_a_side or self.points if point.side is not None)

    def of_side(self, side: Side) -> PointList:
        """Return the points of one side, including those of both sides or of no given side.

        A point of both sides (IN) that is given once, for either side, counts for both.

        Parameters
        ----------
        side : Side
            Which side.

        Returns
        -------
        PointList
            Those points.

        Raises
        ------
        FileFormatError
            There are none.
        """
        own = {p.label for p in self.points if p.side in (side, None)}
        return replace(
            self,
            points=tuple(
                p
                for p in self.points
                if p.side in (side, None) or (_is_shared(p.label) and p.label not in own)
            ),
        )

    @property
    def positions(self) -> FloatArray:
        """(N, 3) positions in mm, rows of NaN where there is none."""
        return np.array([np.full(3, np.nan) if p.position is None else p.position for p in self.points])

    @property
    def statuses(self) -> tuple[Status, ...]:
        """How far each point is."""
        return tuple(point.status for point in self.points)


def labelled_point(
    label: str,
    coordinates: Sequence[object],
    status: Status = Status.PLACED,
    *,
    file: str | PathLike[str],
    description: str = "",
    flip_xy: bool = False,
) -> LabelledPoint:
    """Build a point from the content of a file.

    Parameters
    ----------
    label, description : str
        As read; stray blanks and carriage returns are removed.
    coordinates : sequence
        Three numbers or texts. Ignored unless `status` says that the point is placed: Slicer keeps the last
        position, or the origin, of points that are not.
    status : Status
        State of the point; a placed one without a position is still to do, as in Slicer.
    file : path-like
        For messages.
    flip_xy : bool
        Whether the coordinates are RAS.

    Returns
    -------
    LabelledPoint
        Position in mm, LPS.

    Raises
    ------
    FileFormatError
        The coordinates are not three finite numbers, nor all missing.
    """
    label = " ".join(label.split())
    description, about, round_ = without_description(description.strip())
    if status is not Status.PLACED:
        return LabelledPoint(label, None, status, description, provenance=about, round=round_)
    position = parse_position(coordinates, file=file, landmark=label)
    if position is None:
        _log.warning("%s: landmark %s is said to be placed but has no position", file, label)
        return LabelledPoint(label, None, Status.TO_DO, description)
    if flip_xy:
        position[:2] *= -1.0
    point = LabelledPoint(label, position, status, description, provenance=about, round=round_)
    return as_suggested(point) if _SUGGESTED.match(description) else point


def as_suggested(point: LabelledPoint, source: str = "") -> LabelledPoint:
    """Return a placed point as a suggestion.

    Parameters
    ----------
    point : LabelledPoint
        Its description may name the source.
    source : str
        Otherwise this is the source.

    Returns
    -------
    LabelledPoint
        The suggestion.
    """
    if point.position is None:
        return point
    said = _SUGGESTED.match(point.description)
    radius = float(said["radius"]) if said and said["radius"] else 0.0
    away = float(said["atlas"]) if said and said["atlas"] else 0.0
    x, y, z = point.position.tolist()
    origin = (said["source"] if said else "") or source
    doubtful = bool(said and said["doubtful"])
    suggestion = Suggestion((x, y, z), radius or None, origin, away or None, doubtful)
    return point._replace(position=None, status=Status.SUGGESTED, suggestion=suggestion)


def points_of(landmarks: LandmarkSet) -> tuple[LabelledPoint, ...]:
    """Return the points of a set as a file holds them: all features in the table's order, then the others.

    A feature that is only suggested is written as still to do: other programs would take its position as
    observed.

    Parameters
    ----------
    landmarks : LandmarkSet
        One side, mm.

    Returns
    -------
    tuple of LabelledPoint
        In the frame of the set.
    """
    observed = replace(landmarks, suggested={})
    positions = observed.as_mapping()
    features = [
        LabelledPoint(f.code, positions.get(f.code), observed.status(f.code), _described(f, observed))
        for f in FEATURES
    ]
    extra = [LabelledPoint(name, position, Status.PLACED) for name, position in landmarks.extra.items()]
    return (*features, *extra)


def suggestions_of(landmarks: LandmarkSet) -> tuple[LabelledPoint, ...]:
    """Return the suggestions of a set as a separate file holds them.

    All features are there, in the table's order. The suggested ones have positions, for 3D Slicer to show;
    each description says that nobody has confirmed the point.

    Parameters
    ----------
    landmarks : LandmarkSet
        One side, mm.

    Returns
    -------
    tuple of LabelledPoint
        In the frame of the set.
    """
    return tuple(_suggested_point(f, landmarks.suggested.get(f.code)) for f in FEATURES)


def _suggested_point(feature: Feature, suggestion: Suggestion | None) -> LabelledPoint:
    if suggestion is None:
        return LabelledPoint(feature.code, None, Status.TO_DO, _description(feature))
    text = suggested_description(suggestion, _description(feature))
    return LabelledPoint(feature.code, np.array(suggestion.position), Status.PLACED, text)


def suggested_description(suggestion: Suggestion, about: str = "") -> str:
    """Return the description by which every reader of this library takes a point as a suggestion.

    Parameters
    ----------
    suggestion : Suggestion
        Its source, its radius, how far the atlas disagrees, and whether it is doubtful are told.
    about : str
        What else the description says.

    Returns
    -------
    str
        One line.
    """
    radius = "" if suggestion.radius_95 is None else f"; 95 % within {suggestion.radius_95:.3f} mm"
    away = suggestion.atlas_distance
    atlas = "" if away is None else f"; {away:.3f} mm from where the atlas expects it"
    doubtful = "; doubtful" if suggestion.doubtful else ""
    said = f"{suggestion.source}{radius}{atlas}{doubtful}"
    origin = f" ({said})" if said else ""
    return f"Suggested, not confirmed{origin}. {about}".rstrip()


def _description(feature: Feature) -> str:
    return f"{feature.name}. {feature.where}" if feature.computed else feature.name


def _is_shared(label: str) -> bool:
    return any(feature.code == label and feature.shared for feature in FEATURES)


def _described(feature: Feature, landmarks: LandmarkSet) -> str:
    """Describe a feature, with what is known of its label where a person has decided on it."""
    text, about = _description(feature), landmarks.provenance.get(feature.code)
    if feature.computed or landmarks.status(feature.code) is Status.TO_DO:
        return text
    return described(text, about, landmarks.observer, landmarks.round)


def is_computed(label: str) -> bool:
    """Return whether a label names a computed feature, which must not be dragged in Slicer.

    Parameters
    ----------
    label : str
        A label.

    Returns
    -------
    bool
        True for CO.
    """
    return any(feature.code == label and feature.computed for feature in FEATURES)
