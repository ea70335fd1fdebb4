"""Labelled points: one side of one head (`LandmarkSet`), and one animal (`Specimen`)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gp_core.argument_types import check_fields, checks_arguments
from gp_core.errors import FeatureError, FrameError, GpError
from gp_core.frames import RigidTransform
from gp_core.html_tables import html_table
from gp_core.landmarks.features import CODES, Side, check_codes, feature, index_of
from gp_core.landmarks.labels import is_skull_feature, tidy_label
from gp_core.landmarks.provenance import LabelProvenance
from gp_core.landmarks.repeats import RepeatedTouches, combine_repeats
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import FloatArray, as_points

__all__ = ["LandmarkSet", "Specimen", "Status"]


class Status(str, Enum):
    """The state of a landmark; all values but ``suggested`` are words of 3D Slicer's ``positionStatus``.

    Only a placed landmark is an observation: a person has placed or confirmed it.
    """

    PLACED = "defined"
    SUGGESTED = "suggested"
    TO_DO = "undefined"
    UNSEEN = "missing"


_SAME_MM = 1e-9
"""Up to here a position is that of the mean of its touches: moving both to another frame rounds."""


def _nothing() -> Mapping[str, Any]:
    return MappingProxyType({})


@dataclass(frozen=True)
class LandmarkSet:
    """The landmarks of one side of one head; immutable.

    `points`, `placed`, ``in``, `array`, iteration and everything else that means *observation* exclude points
    that are only suggested. `suggested` alone holds those, until `confirmed` turns them into observations.

    Parameters
    ----------
    points : (20, 3) array_like
        Positions in mm, rows in the feature table's order, NaN where there is none.
    side : Side
        Side of the head.
    frame : str
        The frame of the positions: ``scan``, ``tracker``, ``cochlea`` or ``atlas``.
    unseen : frozenset of str
        Features that were looked for and cannot be seen (Slicer's ``missing``).
    extra : mapping of str to (3,) array
        Further named points, such as the skull features of a physical test, mm.
    suggested : mapping of str to Suggestion
        Suggestions for features that are not labelled yet, in the same frame, in the table's order. Once a
        feature is placed or unseen, a person has decided, and its suggestion is dropped.
    scan_evidence : ScanEvidence, optional
        Distances of the points from bone, as measured in the scan; dropped for a point that is moved.
    provenance : mapping of str to LabelProvenance
        What is known of each placed or unseen feature beside its position: observer, time, certainty, note,
        who checked it; dropped for a point that is placed again.
    observer : str
        Who labelled this side; empty where nobody said.
    round : int
        Which of the observer's labellings of this side it is, from 1.
    repeats : mapping of str to RepeatedTouches
        Points, also extra ones, that were touched more than once: the position is their mean. Dropped for a
        point that is moved.

    Examples
    --------
    >>> touched = LandmarkSet.from_mapping({"RWA": [1, 2, 3]}, "L", frame="tracker")
    >>> touched.placed
    ('RWA',)
    """

    points: FloatArray
    side: Side
    frame: str = "scan"
    unseen: frozenset[str] = frozenset()
    extra: Mapping[str, FloatArray] = field(default_factory=_nothing)
    suggested: Mapping[str, Suggestion] = field(default_factory=_nothing)
    scan_evidence: ScanEvidence | None = None
    provenance: Mapping[str, LabelProvenance] = field(default_factory=_nothing)
    observer: str = ""
    round: int = 1
    repeats: Mapping[str, RepeatedTouches] = field(default_factory=_nothing)

    def __post_init__(self) -> None:
        check_fields(self, leaving_out=("points", "side", "unseen", "extra"))
        points = as_points(self.points, "points", missing_allowed=True).copy()
        if len(points) != len(CODES):
            raise GpError(f"a landmark set has {len(CODES)} rows, got {len(points)}")
        points[np.isnan(points).any(axis=1)] = np.nan
        points.setflags(write=False)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "side", Side.parse(self.side))
        unseen = check_codes(self.unseen, "unseen", at_least=0)
        object.__setattr__(self, "unseen", frozenset(unseen) - set(self.placed))
        self._freeze_extra()
        object.__setattr__(self, "suggested", self._undecided(self.suggested))
        if self.scan_evidence is not None:
            object.__setattr__(self, "scan_evidence", self.scan_evidence.of(self.as_mapping()))
        if self.provenance:
            known = {feature(code).code: about for code, about in self.provenance.items()}
            decided = self.unseen.union(self.placed)
            kept = {code: known[code] for code in CODES if code in known and code in decided}
            object.__setattr__(self, "provenance", MappingProxyType(kept))
        if self.repeats:
            kept_repeats = {name: one for name, one in self.repeats.items() if self._is_mean(name, one)}
            object.__setattr__(self, "repeats", MappingProxyType(kept_repeats))
        if not isinstance(self.round, int) or self.round < 1:
            raise GpError(f"a round is a whole number from 1, got {self.round!r:.40}")

    def _is_mean(self, name: str, repeated: RepeatedTouches) -> bool:
        position = self.points[CODES.index(name)] if name in CODES else self.extra.get(name)
        return position is not None and np.allclose(position, repeated.mean, rtol=0, atol=_SAME_MM)

    def _freeze_extra(self) -> None:
        if not isinstance(self.extra, Mapping):
            raise GpError(f"extra must be a mapping of names to positions, got {type(self.extra).__name__}")
        if self.extra:
            extra = {name: _position(point, name) for name, point in self.extra.items()}
            object.__setattr__(self, "extra", MappingProxyType(extra))

    def _undecided(self, suggested: Mapping[str, Suggestion]) -> Mapping[str, Suggestion]:
        """Return the suggestions of the features that are to do."""
        if not suggested:
            return _nothing()
        given = {_placeable(code): suggestion for code, suggestion in suggested.items()}
        decided = self.unseen.union(self.placed)
        return MappingProxyType(
            {code: given[code] for code in CODES if code in given and code not in decided}
        )

    @classmethod
    @checks_arguments
    def empty(cls, side: Side | str, *, frame: str = "scan") -> LandmarkSet:
        """Make a set with no landmark placed.

        Parameters
        ----------
        side : {"L", "R"}
            Side of the head.
        frame : str
            Frame of the positions to come.

        Returns
        -------
        LandmarkSet
            All positions are NaN.
        """
        return cls(np.full((len(CODES), 3), np.nan), Side.parse(side), frame)

    @classmethod
    @checks_arguments
    def from_touches(
        cls,
        touches: Mapping[str, ArrayLike],
        side: Side | str,
        *,
        frame: str = "tracker",
    ) -> LandmarkSet:
        """Make a set from named touches, of which a feature may have several.

        Parameters
        ----------
        touches : mapping of str to (3,) or (n, 3) array_like
            Positions by name, mm: features, and skull features (``S1``, ...), which go to `extra`.
        side : {"L", "R"}
            Side of the head.
        frame : str
            Frame of the positions.

        Returns
        -------
        LandmarkSet
            With these points placed; a feature that was touched several times at the mean of its touches,
            without outliers, which are all in `repeats`.

        Raises
        ------
        FeatureError
            A name is unknown, or given twice.
        GpError
            A position is not three finite numbers.
        """
        combined = combine_repeats(touches)
        means = {name: combined[name].mean if name in combined else at for name, at in touches.items()}
        skull = {
            tidy_label(name): _position(at, name) for name, at in means.items() if is_skull_feature(name)
        }
        features = {name: at for name, at in means.items() if not is_skull_feature(name)}
        repeats = {tidy_label(name): one for name, one in combined.items() if len(one.points) > 1}
        return replace(cls.from_mapping(features, side, frame=frame), extra=skull, repeats=repeats)

    @classmethod
    @checks_arguments
    def from_mapping(
        cls, points: Mapping[str, ArrayLike], side: Side | str, *, frame: str = "scan"
    ) -> LandmarkSet:
        """Make a set from named points.

        Parameters
        ----------
        points : mapping of str to (3,) array_like
            Positions by feature code, mm.
        side : {"L", "R"}
            Side of the head.
        frame : str
            Frame of the positions.

        Returns
        -------
        LandmarkSet
            With these points placed.

        Raises
        ------
        FeatureError
            A name is unknown.
        GpError
            A position is not three finite numbers.
        """
        rows = np.full((len(CODES), 3), np.nan)
        for code, position in points.items():
            row = index_of(code)
            if not np.isnan(rows[row, 0]):
                raise FeatureError(
                    f"{CODES[row]} is given twice", landmark=CODES[row], remedy="Keep one of them."
                )
            rows[row] = _position(position, code)
        return cls(rows, Side.parse(side), frame)

    def __reduce__(self) -> tuple[object, ...]:
        """Let pickle carry the set to other processes, though it cannot carry a read-only mapping."""
        mappings = (dict(self.extra), dict(self.suggested))
        about = (self.scan_evidence, dict(self.provenance), self.observer, self.round, dict(self.repeats))
        return LandmarkSet, (self.points, self.side, self.frame, self.unseen, *mappings, *about)

    @checks_arguments
    def __getitem__(self, code: str) -> FloatArray:
        """Return the (3,) position of a feature, NaN where it is not placed."""
        point: FloatArray = self.points[index_of(code)]
        return point

    def __contains__(self, code: object) -> bool:
        """Whether a feature has a position."""
        return isinstance(code, str) and not np.isnan(self.points[index_of(code), 0])

    def __iter__(self) -> Iterator[str]:
        """Go through the features that have a position, as through the keys of a mapping."""
        return iter(self.placed)

    def keys(self) -> tuple[str, ...]:
        """Return the placed features, so that ``dict(landmarks)`` holds every position.

        Returns
        -------
        tuple of str
            Codes, in the table's order.
        """
        return self.placed

    @property
    def placed(self) -> tuple[str, ...]:
        """Codes that have a position, in the table's order."""
        missing = np.isnan(self.points[:, 0]).tolist()
        return tuple(code for code, absent in zip(CODES, missing, strict=True) if not absent)

    @checks_arguments
    def status(self, code: str) -> Status:
        """Return the state of a feature.

        Parameters
        ----------
        code : str
            A feature.

        Returns
        -------
        Status
            Placed, unseen, suggested or to do.
        """
        if code in self:
            return Status.PLACED
        code = feature(code).code
        if code in self.unseen:
            return Status.UNSEEN
        return Status.SUGGESTED if code in self.suggested else Status.TO_DO

    @checks_arguments
    def as_mapping(self, codes: Iterable[str] | None = None) -> dict[str, FloatArray]:
        """Return the placed positions by code.

        Parameters
        ----------
        codes : iterable of str, optional
            Only these features.

        Returns
        -------
        dict of str to (3,) array, mm
            In the frame of the set.
        """
        wanted = self.placed if codes is None else tuple(codes)
        return {code: self[code] for code in wanted if code in self}

    @checks_arguments
    def array(self, codes: Iterable[str]) -> FloatArray:
        """Return the positions of features, in the requested order.

        Parameters
        ----------
        codes : iterable of str
            Features.

        Returns
        -------
        (n, 3) array, mm
            In the frame of the set.

        Raises
        ------
        FeatureError
            One of them is not placed.
        """
        rows = [index_of(code) for code in codes]
        for row in rows:
            if np.isnan(self.points[row]).any():
                word, verb = "", "Label"
                if CODES[row] in self.suggested:
                    word, verb = ", it is only suggested", "Confirm"
                raise FeatureError(
                    f"the {self.side.word} side has no {CODES[row]}{word}",
                    landmark=CODES[row],
                    remedy=f"{verb} it, or leave it out of the feature subset.",
                )
        return self.points[rows]

    @checks_arguments
    def with_point(self, code: str, position: ArrayLike | None) -> LandmarkSet:
        """Return a copy with one feature placed or cleared; its suggestion is dropped.

        Parameters
        ----------
        code : str
            A feature.
        position : (3,) array_like or None
            In the frame of the set, mm; None clears it.

        Returns
        -------
        LandmarkSet
            The changed copy.
        """
        points = self.points.copy()
        points[index_of(code)] = np.nan if position is None else _position(position, code)
        code = feature(code).code
        others = {key: value for key, value in self.suggested.items() if key != code}
        about = {key: value for key, value in self.provenance.items() if key != code}
        return replace(self, points=points, unseen=self.unseen - {code}, suggested=others, provenance=about)

    @checks_arguments
    def with_unseen(self, code: str) -> LandmarkSet:
        """Return a copy with one feature marked as not visible.

        Parameters
        ----------
        code : str
            A feature.

        Returns
        -------
        LandmarkSet
            The changed copy.
        """
        cleared = self.with_point(code, None)
        return replace(cleared, unseen=cleared.unseen | {feature(code).code})

    @checks_arguments
    def with_provenance(self, provenance: Mapping[str, LabelProvenance]) -> LandmarkSet:
        """Return a copy with provenance added to features, where they are placed or unseen.

        Parameters
        ----------
        provenance : mapping of str to LabelProvenance
            By feature.

        Returns
        -------
        LandmarkSet
            The changed copy.

        Raises
        ------
        FeatureError
            A name is unknown.
        """
        return replace(self, provenance={**self.provenance, **provenance})

    @property
    def checked(self) -> Mapping[str, str]:
        """Features that a person has reviewed and confirmed, and by whom (empty: unnamed)."""
        return {code: about.checked_by for code, about in self.provenance.items() if about.checked}

    @checks_arguments
    def with_suggestions(self, suggestions: Mapping[str, Suggestion]) -> LandmarkSet:
        """Return a copy with suggestions for features that are not labelled yet.

        Parameters
        ----------
        suggestions : mapping of str to Suggestion
            In the frame of the set.

        Returns
        -------
        LandmarkSet
            The changed copy.

        Raises
        ------
        FeatureError
            A name is unknown, or the feature is computed (CO) and so never suggested.
        """
        return replace(self, suggested={**self.suggested, **suggestions})

    @checks_arguments
    def confirmed(self, codes: Iterable[str]) -> LandmarkSet:
        """Return a copy in which suggestions have become observations, since a person has confirmed them.

        Parameters
        ----------
        codes : iterable of str
            The confirmed features.

        Returns
        -------
        LandmarkSet
            The changed copy.

        Raises
        ------
        FeatureError
            One of them is not suggested.
        """
        landmarks = self
        for code in (feature(code).code for code in codes):
            if code not in self.suggested:
                raise FeatureError(
                    f"the {self.side.word} side has no suggestion for {code} to confirm", landmark=code
                )
            landmarks = landmarks.with_point(code, self.suggested[code].position)
        return landmarks

    @checks_arguments
    def moved(self, T_dst_src: RigidTransform) -> LandmarkSet:
        """Return the set in another frame.

        Parameters
        ----------
        T_dst_src : RigidTransform
            From this set's frame.

        Returns
        -------
        LandmarkSet
            In the frame `dst`.

        Raises
        ------
        FrameError
            The transform does not start at this set's frame.
        """
        if T_dst_src.src != self.frame:
            raise FrameError(f"T_{T_dst_src.dst}_{T_dst_src.src} cannot move points of frame {self.frame!r}")
        extra = {name: T_dst_src.apply(point[None])[0] for name, point in self.extra.items()}
        evidence = self.scan_evidence
        return replace(
            self,
            points=T_dst_src.apply(self.points),
            frame=T_dst_src.dst,
            extra=MappingProxyType(extra),
            suggested={code: suggestion.moved(T_dst_src) for code, suggestion in self.suggested.items()},
            scan_evidence=None if evidence is None else evidence.moved(T_dst_src),
            repeats={name: one.moved(T_dst_src) for name, one in self.repeats.items()},
        )


def _placeable(code: str) -> str:
    row = feature(code)
    if row.computed:
        raise FeatureError(f"{row.code} is computed and cannot be suggested", landmark=row.code)
    return row.code


def _position(position: ArrayLike, code: str) -> FloatArray:
    try:
        xyz = np.asarray(position, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        xyz = np.empty(0)
    if xyz.shape != (3,) or not np.isfinite(xyz).all():
        raise GpError(
            f"position must be three finite numbers in mm, got {position!r}",
            landmark=code,
            remedy="Leave the feature out if it was not seen.",
        )
    return xyz


@dataclass(frozen=True)
class Specimen:
    """One animal with the landmarks of its labelled sides.

    Parameters
    ----------
    name : str
        Specimen identifier.
    sides : mapping of Side to LandmarkSet
        One or both sides.
    """

    name: str
    sides: Mapping[Side, LandmarkSet]

    def __post_init__(self) -> None:
        check_fields(self)
        for side, landmarks in self.sides.items():
            if landmarks.side is not side:
                raise GpError(
                    f"the {side.word} side holds {landmarks.side.word} landmarks", specimen=self.name
                )
        object.__setattr__(self, "sides", MappingProxyType(dict(self.sides)))

    def _repr_html_(self) -> str:
        """Return the animal for a notebook."""
        rows = [
            (side.word, f"{len(landmarks.placed)} placed", " ".join(landmarks.placed))
            for side, landmarks in self.sides.items()
        ]
        return html_table(f"Specimen {self.name}", rows)

    def __reduce__(self) -> tuple[object, ...]:
        """Let pickle carry the animal to other processes, though it cannot carry a read-only mapping."""
        return Specimen, (self.name, dict(self.sides))

    @checks_arguments
    def side(self, side: Side | str) -> LandmarkSet:
        """Return the landmarks of one side.

        Parameters
        ----------
        side : {"L", "R"}
            Which side.

        Returns
        -------
        LandmarkSet
            Its landmarks.

        Raises
        ------
        FeatureError
            That side is not labelled.
        """
        wanted = Side.parse(side)
        if wanted not in self.sides:
            raise FeatureError(
                f"the {wanted.word} side is not labelled",
                specimen=self.name,
                remedy=f"Label it, or ask for the {wanted.other.word} side.",
            )
        return self.sides[wanted]
