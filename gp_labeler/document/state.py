"""Everything a specimen file holds, as one value that is never changed in place.

Each point is kept once: what is shared by both sides (IN) has one record, under the key ``(None, "IN")``, so
the two sides cannot contradict each other. CO has none: it is computed from CA, CB, RWA and RWP whenever they
change.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache, cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from gp_core.errors import FeatureError, GpError
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.features import FEATURES, Side, feature
from gp_core.landmarks.measurements import Measurement
from gp_core.landmarks.provenance import Certainty, LabelProvenance
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.sets import LandmarkSet
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import check_option, near_matches
from gp_labeler.document.frozen_json import freeze
from gp_labeler.document.head_frame import HeadFrame
from gp_labeler.document.touches import Touch, TouchKey, touched_set
from gp_labeler.document.volume_reference import VolumeReference

__all__ = [
    "How",
    "Landmark",
    "PointKey",
    "PoseCheck",
    "Provenance",
    "SpecimenState",
    "StoredLabelling",
    "changed_points",
    "measured",
    "point_key",
    "provenance_json",
]

LARGEST_MM = 1e4
"""No scan is ten metres wide: a coordinate beyond this is a slip of units."""

VERDICTS = ("accept", "reject")

Position = tuple[float, float, float]
PointKey = tuple["Side | None", str]
"""Whose point, and which feature; no side for what both sides share."""


class How(str, Enum):
    """How a point came to be where it is."""

    MESH = "mesh"
    SLICE = "slice"
    GHOST = "accepted ghost"
    CONFIRMED = "confirmed suggestion"
    PAGE = "confirmed from a page"
    CORRECTED = "corrected on a page"
    NUDGED = "nudged suggestion"
    IMPORTED = "imported"
    TYPED = "typed"
    UNSEEN = "looked for"


@dataclass(frozen=True)
class Provenance:
    """Where a position comes from.

    Parameters
    ----------
    how : How
        On the mesh, on a slice, from the atlas, ...
    time : str
        When, ISO 8601 in UTC.
    by : str
        Who.
    voxel_mm : (3,) tuple of float, optional
        Voxel size of the scan it was placed on, mm.
    source : str
        The file it was imported from, or what suggested it.
    """

    how: How
    time: str = ""
    by: str = ""
    voxel_mm: Position | None = None
    source: str = ""


@dataclass(frozen=True)
class Landmark:
    """One point of one side (or shared by both): position in scan mm, and what is known about it.

    A `position` is an observation. A point that is only suggested has none, but a `suggestion`, whose
    `provenance` says who accepted it. A position that came about by accepting a ghost, as earlier versions
    kept it, is a suggestion. How certain the observer was, and a note on what was seen, belong to a point
    that is decided.
    """

    position: Position | None = None
    unseen: bool = False
    locked: bool = False
    checked: bool = False
    provenance: Provenance | None = None
    suggestion: Suggestion | None = None
    checked_by: str = ""
    certainty: Certainty | None = None
    note: str = ""

    def __post_init__(self) -> None:
        suggestion = self.suggestion
        if self.position is not None and self.provenance is not None and self.provenance.how is How.GHOST:
            suggestion = suggestion or Suggestion(self.position, source="atlas")
            object.__setattr__(self, "position", None)
        if self.position is not None or self.unseen:
            suggestion = None
        object.__setattr__(self, "suggestion", suggestion)
        if suggestion is not None:  # there is nothing yet to check or to lock
            object.__setattr__(self, "checked", False)
            object.__setattr__(self, "locked", False)
        if not self.checked:
            object.__setattr__(self, "checked_by", "")
        certainty = self.certainty if self.decided else None
        object.__setattr__(self, "certainty", None if certainty is None else Certainty(certainty))
        object.__setattr__(self, "note", " ".join(self.note.split()) if self.decided else "")

    @property
    def decided(self) -> bool:
        """Whether a person has decided: it was placed, or looked for and not seen."""
        return self.unseen or self.position is not None

    @property
    def shown_position(self) -> Position | None:
        """Where it is shown: where it was placed, else where it is suggested."""
        if self.position is not None:
            return self.position
        return None if self.suggestion is None else self.suggestion.position


TO_DO = Landmark()


@dataclass(frozen=True)
class PoseCheck:
    """A person's verdict on an estimated pose seen over the scan.

    Parameters
    ----------
    side : Side
        Side of the head.
    verdict : str
        ``accept`` or ``reject``.
    by, time, note : str
        Initials, when (ISO 8601, UTC), and why.
    pose : mapping
        The estimate that was judged, as its pose JSON has it.
    """

    side: Side
    verdict: str
    by: str = ""
    time: str = ""
    note: str = ""
    pose: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_option(self.verdict, "verdict", VERDICTS)
        object.__setattr__(self, "side", Side.parse(self.side))
        object.__setattr__(self, "pose", freeze(self.pose, "pose"))


@cache  # asked some hundred times a click, of a few dozen points
def point_key(side: Side | str, code: str) -> PointKey:
    """Return the key under which a state keeps a point.

    Raises
    ------
    FeatureError
        The feature is unknown, or computed (CO): that one is nobody's to place.
    """
    row = feature(code)
    if row.computed:
        raise FeatureError(
            f"{row.code} is computed, not placed",
            landmark=row.code,
            remedy="It moves with CA, CB, RWA and RWP.",
        )
    return (None if row.shared else Side.parse(side), row.code)


@dataclass(frozen=True)
class StoredLabelling:
    """A labelling of the specimen that is not the one in work: by another observer, or of another round.

    Parameters
    ----------
    observer : str
        Who labelled; empty where nobody said.
    round : int
        Which of the observer's labellings, from 1.
    landmarks : mapping of PointKey to Landmark
        What was placed, suggested or marked.
    blind : bool
        Whether it was begun without seeing the others.
    scan_evidence : mapping of Side to ScanEvidence
        Distances of its points from bone, as last measured.
    measurements : tuple of Measurement
        Rulers and angles of that observer, which would show where points are.
    """

    observer: str
    round: int
    landmarks: Mapping[PointKey, Landmark]
    blind: bool = False
    scan_evidence: Mapping[Side, ScanEvidence] = field(default_factory=dict, compare=False)
    measurements: tuple[Measurement, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "landmarks", MappingProxyType(dict(self.landmarks)))
        _check_round(self.round)


def _check_round(number: int) -> None:
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        raise GpError(f"a round is a whole number from 1, got {number!r:.40}")


@dataclass(frozen=True)
class _BothSides:
    """The landmarks of a state as one set a side, and what these sets were made from."""

    landmarks: Mapping[PointKey, Landmark]
    scan_evidence: Mapping[Side, ScanEvidence]
    sets: Mapping[Side, LandmarkSet]

    @classmethod
    def of(
        cls, landmarks: Mapping[PointKey, Landmark], scan_evidence: Mapping[Side, ScanEvidence]
    ) -> _BothSides:
        """Make both sets; raises `GpError` where they cannot be."""
        kept = MappingProxyType({key: mark for key, mark in landmarks.items() if mark != TO_DO})
        sets = {side: _landmark_set(kept, side, scan_evidence.get(side)) for side in Side}
        return cls(kept, scan_evidence, MappingProxyType(sets))

    def are_of(self, state: SpecimenState) -> bool:
        """Whether they were made from the very objects that a state holds."""
        return state.landmarks is self.landmarks and state.scan_evidence is self.scan_evidence


_NOT_MADE = _BothSides({}, {}, {})


@dataclass(frozen=True)
class SpecimenState:
    """Everything that is saved of a specimen.

    Parameters
    ----------
    specimen : str
        Name of the specimen; exported files are called after it.
    landmarks : mapping of PointKey to Landmark
        What was placed, suggested, marked or locked; a point that is to do has no entry.
    volume : VolumeReference, optional
        The scan.
    import_choices : mapping
        What the user answered when the scan was read (spacing, reversed stack, ...).
    threshold : float, optional
        Bone threshold, in grey values of the scan.
    notes : str
        Free text.
    pose_checks : tuple of PoseCheck
        Verdicts, oldest first.
    touches : mapping of TouchKey to Touch
        What was touched with the probe; all touches of a side are in one frame.
    skull : mapping of str to (3,) tuple
        Skull features on the scan by which touches are registered to it, scan frame, mm.
    head_frame : HeadFrame, optional
        How the head lies in its scan; None before it was straightened.
    scan_evidence : mapping of Side to ScanEvidence
        How far the points were from bone when that was last measured in the scan; see `measured`.
    measurements : tuple of Measurement
        Rulers and angles, scan frame, mm, oldest first.
    observer : str
        Who makes the labelling in work, where that was said; see `labeller`.
    round : int
        Which of the observer's labellings it is, from 1.
    blind : bool
        Whether it was begun without seeing the others.
    others : tuple of StoredLabelling
        The other labellings, which are never shown with the one in work.

    Raises
    ------
    GpError
        No file can have the name, the threshold is not finite, CA and CB are at the same place,
        touches of a side are partly in the tracker's frame and partly in the scan's, or two measurements have
        the same name.
    """

    specimen: str = "unnamed"
    landmarks: Mapping[PointKey, Landmark] = field(default_factory=dict)
    volume: VolumeReference | None = None
    import_choices: Mapping[str, Any] = field(default_factory=dict)
    threshold: float | None = None
    notes: str = ""
    pose_checks: tuple[PoseCheck, ...] = ()
    touches: Mapping[TouchKey, Touch] = field(default_factory=dict)
    skull: Mapping[str, Position] = field(default_factory=dict)
    head_frame: HeadFrame | None = None
    scan_evidence: Mapping[Side, ScanEvidence] = field(default_factory=dict, compare=False)
    measurements: tuple[Measurement, ...] = ()
    observer: str = ""
    round: int = 1
    blind: bool = False
    others: tuple[StoredLabelling, ...] = ()
    _sides: _BothSides = field(default=_NOT_MADE, repr=False, compare=False)  # passed on to copies

    def __post_init__(self) -> None:
        name = self.specimen.strip()
        if not name or set(name) & set('/\\:*?"<>|\n\t') or name.startswith("."):
            raise GpError(
                f"a specimen's name must be a valid file name, got {self.specimen!r}",
                remedy="For example GP-014.",
            )
        sides = self._sides if self._sides.are_of(self) else _BothSides.of(self.landmarks, self.scan_evidence)
        if self.threshold is not None:
            object.__setattr__(self, "threshold", freeze(float(self.threshold), "threshold"))
        _check_round(self.round)
        object.__setattr__(self, "observer", " ".join(self.observer.split()))
        object.__setattr__(self, "specimen", name)
        object.__setattr__(self, "landmarks", sides.landmarks)
        object.__setattr__(self, "import_choices", freeze(self.import_choices, "import choices"))
        object.__setattr__(self, "_sides", sides)
        _check_touches(self.touches)
        object.__setattr__(self, "touches", MappingProxyType(dict(self.touches)))
        skull = {name: _plausible(position, name) for name, position in self.skull.items()}
        object.__setattr__(self, "skull", MappingProxyType(skull))
        _check_measurements(self.measurements)

    def side(self, side: Side | str) -> LandmarkSet:
        """Return the landmarks of one side in the scan frame, with IN and, once determined, CO."""
        return self.sets[Side.parse(side)]

    @property
    def sets(self) -> Mapping[Side, LandmarkSet]:
        """Both sides, as `side` returns them."""
        return self._sides.sets

    @property
    def labeller(self) -> str:
        """Who made the labelling in work: as it says, else who placed most of its points."""
        if self.observer:
            return self.observer
        by = Counter(mark.provenance.by for mark in self.landmarks.values() if mark.provenance)
        return by.most_common(1)[0][0] if by else ""

    @property
    def stored(self) -> StoredLabelling:
        """The labelling in work, as it is kept while another one is."""
        return StoredLabelling(
            self.labeller, self.round, self.landmarks, self.blind, self.scan_evidence, self.measurements
        )

    @property
    def labellings(self) -> tuple[SpecimenState, ...]:
        """The specimen once for each labelling, by observer and round; the others of each are left out."""
        every = sorted((self.stored, *self.others), key=lambda each: (each.observer.casefold(), each.round))
        return tuple(self.with_labelling(each, ()) for each in every)

    def with_labelling(self, stored: StoredLabelling, others: tuple[StoredLabelling, ...]) -> SpecimenState:
        """Return a copy with another labelling in work."""
        return replace(
            self,
            landmarks=stored.landmarks,
            observer=stored.observer,
            round=stored.round,
            blind=stored.blind,
            scan_evidence=stored.scan_evidence,
            measurements=stored.measurements,
            others=others,
        )

    def described_side(self, side: Side | str) -> LandmarkSet:
        """Return one side with observer, round, and what is known of each label; as it is exported."""
        landmarks, known = self.side(side), {}
        for code in (row.code for row in FEATURES if not row.computed):
            about = _about(self.landmark(landmarks.side, code))
            if about is not None:
                known[code] = about
        return replace(landmarks, observer=self.labeller, round=self.round).with_provenance(known)

    def touched(self, side: Side | str) -> LandmarkSet:
        """Return the touches of one side that count, in their own frame; skull features in `extra`."""
        return self._touched[Side.parse(side)]

    @cached_property
    def _touched(self) -> Mapping[Side, LandmarkSet]:
        return {side: touched_set(self.touches, side) for side in Side}

    def landmark(self, side: Side | str, code: str) -> Landmark:
        """Return what is known of one point; see `point_key` for what it raises."""
        return self.landmarks.get(point_key(side, code), TO_DO)

    def measurement(self, name: str) -> Measurement:
        """Return the ruler or angle of a name; raises `GpError` where there is none."""
        found = {each.name: each for each in self.measurements}
        if name not in found:
            there = f"There are {', '.join(found)}." if found else "Nothing is measured yet."
            raise GpError(f"no measurement is called {name!r:.80}{near_matches(name, found)}", remedy=there)
        return found[name]

    def with_landmarks(self, changes: Mapping[PointKey, Landmark]) -> SpecimenState:
        """Return a copy in which these points are replaced."""
        return replace(self, landmarks={**self.landmarks, **changes})

    def on_volume(self, volume: VolumeReference | None, import_choices: Mapping[str, Any]) -> SpecimenState:
        """Return a copy that belongs to another volume, or to the same one elsewhere."""
        others = tuple(replace(each, scan_evidence={}) for each in self.others)
        return replace(self, volume=volume, import_choices=import_choices, scan_evidence={}, others=others)


def measured(state: SpecimenState, measure: Callable[[LandmarkSet], ScanEvidence] | None) -> SpecimenState:
    """Return a state with the distances of its points from bone, to be saved or exported.

    Parameters
    ----------
    state : SpecimenState
    measure : callable, optional
        Asks the scan; None where there is none, and what was measured before is kept.
    """
    if measure is None:
        return state
    others = tuple(_measured_labelling(each, measure) for each in state.others)
    found = {side: measure(state.side(side)) for side in Side}
    return replace(state, scan_evidence=found, others=others)


def _measured_labelling(
    stored: StoredLabelling, measure: Callable[[LandmarkSet], ScanEvidence]
) -> StoredLabelling:
    if stored.scan_evidence:
        return stored
    found = {side: measure(_landmark_set(stored.landmarks, side)) for side in Side}
    return replace(stored, scan_evidence=found)


def provenance_json(provenance: Provenance) -> dict[str, Any]:
    """Return a provenance as plain JSON values, as specimen and landmark files have it."""
    out: dict[str, Any] = {"how": provenance.how.value}
    if provenance.voxel_mm is not None:
        out["voxel_mm"] = list(provenance.voxel_mm)
    return out | {name: text for name in ("time", "by", "source") if (text := getattr(provenance, name))}


def _about(mark: Landmark) -> LabelProvenance | None:
    """Return what is known of a label beside its position; None for nothing."""
    if mark.provenance is None and not (mark.checked or mark.certainty or mark.note):
        return None
    about = LabelProvenance.from_json({} if mark.provenance is None else provenance_json(mark.provenance))
    return replace(
        about,
        checked=mark.checked,
        checked_by=mark.checked_by,
        certainty=mark.certainty,
        note=mark.note,
    )


def changed_points(old: SpecimenState, new: SpecimenState) -> frozenset[tuple[Side, str]]:
    """Return the points in which two states differ: IN on both sides, and CO where it was computed again."""
    changed = set()
    for side, code in old.landmarks.keys() | new.landmarks.keys():
        if old.landmarks.get((side, code)) != new.landmarks.get((side, code)):
            changed |= {(each, code) for each in (Side if side is None else (side,))}
    for side in Side:
        computed = (f.code for f in FEATURES if f.computed)
        changed |= {
            (side, code)
            for code in computed
            if not np.array_equal(old.side(side)[code], new.side(side)[code], True)
        }
    return frozenset(changed)


def _landmark_set(
    landmarks: Mapping[PointKey, Landmark], side: Side, evidence: ScanEvidence | None = None
) -> LandmarkSet:
    positions, unseen, suggested = {}, set(), {}
    for row in FEATURES:
        mark = TO_DO if row.computed else landmarks.get(point_key(side, row.code), TO_DO)
        if mark.position is not None:
            positions[row.code] = _plausible(mark.position, row.code)
        elif mark.unseen:
            unseen.add(row.code)
        elif mark.suggestion is not None:
            _plausible(mark.suggestion.position, row.code)
            suggested[row.code] = mark.suggestion
    placed = with_cochlea_origin(LandmarkSet.from_mapping(positions, side))
    if not (unseen or suggested or evidence):  # each copy is checked as a whole
        return placed
    return replace(placed, unseen=frozenset(unseen), suggested=suggested, scan_evidence=evidence)


def _check_touches(touches: Mapping[TouchKey, Touch]) -> None:
    frames: dict[Side, str] = {}
    for (side, name), touch in touches.items():
        for position in touch.positions:
            _plausible(position, name)
        if frames.setdefault(side, touch.frame) != touch.frame:
            raise GpError(
                f"the {side.word} side has touches in the {frames[side]}'s frame already",
                landmark=name,
                remedy="Clear these first: one estimate cannot mix tracker and scan positions.",
            )


def _check_measurements(measurements: tuple[Measurement, ...]) -> None:
    names: set[str] = set()
    for each in measurements:
        for point in each.points:
            _plausible(point, each.name)
        if each.name in names:
            raise GpError(f"a measurement is called {each.name} already", remedy="Choose another name.")
        names.add(each.name)


def _plausible(position: Position, code: str) -> Position:
    if not all(abs(x) <= LARGEST_MM for x in position):
        raise GpError(
            f"a position must be three numbers within ±{LARGEST_MM:g} mm, got {position}",
            landmark=code,
            remedy="Are its units millimetres?",
        )
    return position
