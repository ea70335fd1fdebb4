"""What a user can do to a specimen, one small frozen value an edit.

Those that concern no point (threshold, notes, ...) are in `specimen_edits`, the one that takes points from
files is in `landmark_import`. `apply` makes the next state or raises `GpError`; the state it was given is
never touched, so a failed edit leaves nothing behind. `text` finishes the sentence "Undo …".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_core.landmarks.provenance import Certainty
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import as_points, check_option
from gp_labeler.document.state import (
    TO_DO,
    Landmark,
    PointKey,
    Position,
    Provenance,
    SpecimenState,
    point_key,
)

__all__ = [
    "AnnotatePoint",
    "CheckPoint",
    "ClearPoint",
    "ConfirmPoint",
    "Edit",
    "LockPoints",
    "MarkUnseen",
    "PlacePoint",
    "SuggestPoints",
    "SwapPoints",
    "SwapSides",
    "as_position",
    "point_text",
    "require_free",
]


class Edit(Protocol):
    """One thing that a user does, and can undo: also a line of the journal, and a step of a script."""

    do: ClassVar[str]
    """Its name there; see `edit_tables`."""

    @property
    def text(self) -> str:
        """What is done, in a few words."""
        ...

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state after the edit."""
        ...


def as_position(value: ArrayLike, code: str) -> Position:
    """Return a point as three Python floats, mm; raises `GpError` naming the landmark for anything else."""
    try:
        x, y, z = (float(v) for v in as_points(np.reshape(np.asarray(value), (1, -1)), "position")[0])
    except (GpError, TypeError, ValueError, OverflowError):
        raise GpError(f"position must be three finite numbers in mm, got {value!r}", landmark=code) from None
    return x, y, z


def point_text(side: Side, code: str) -> str:
    """Name a point as people do: ``CA left``; plain ``IN`` for what both sides share."""
    return code if feature(code).shared else f"{code} {side.word}"


def require_free(state: SpecimenState, keys: Iterable[PointKey]) -> None:
    """Raise `GpError` where one of these points is locked."""
    locked = [key for key in keys if state.landmarks.get(key, TO_DO).locked]
    if locked:
        names = ", ".join(code if side is None else point_text(side, code) for side, code in locked)
        raise GpError(
            f"{names} {'is' if len(locked) == 1 else 'are'} locked",
            specimen=state.specimen,
            landmark=locked[0][1],
            remedy="Unlock first, then repeat.",
        )


@dataclass(frozen=True)
class _OnPoint:
    """An edit of one point."""

    side: Side
    code: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "side", Side.parse(self.side))
        object.__setattr__(self, "code", feature(self.code).code)

    @property
    def key(self) -> PointKey:
        return point_key(self.side, self.code)

    @property
    def _point(self) -> str:
        return point_text(self.side, self.code)

    def _replaced(self, state: SpecimenState, landmark: Landmark) -> SpecimenState:
        require_free(state, [self.key])
        return state.with_landmarks({self.key: landmark})


@dataclass(frozen=True)
class PlacePoint(_OnPoint):
    """Put a point at `position` (scan frame, mm), or move it there; on IN, for both sides."""

    do: ClassVar[str] = "place_point"
    position: Position
    provenance: Provenance
    verb: str = "place"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "position", as_position(self.position, self.code))

    @property
    def text(self) -> str:
        """Such as ``place FPP left``."""
        return f"{self.verb} {self._point}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the point there; raises `GpError` where it is locked."""
        old = state.landmarks.get(self.key, TO_DO)  # what was noted stays true of a point that is moved
        mark = Landmark(self.position, provenance=self.provenance, certainty=old.certainty, note=old.note)
        return self._replaced(state, mark)


@dataclass(frozen=True)
class SuggestPoints:
    """Suggest where points of one side are, for a person to confirm; those that are placed or unseen stay.

    Parameters
    ----------
    side : Side
        Whose points; IN is of both.
    suggestions : mapping of str to Suggestion
        By feature code; scan frame, mm.
    provenance : Provenance
        Who took them over, and when.
    """

    do: ClassVar[str] = "suggest_points"
    side: Side
    suggestions: Mapping[str, Suggestion]
    provenance: Provenance

    def __post_init__(self) -> None:
        side, codes = Side.parse(self.side), {feature(code).code: code for code in self.suggestions}
        object.__setattr__(self, "side", side)
        object.__setattr__(self, "suggestions", {code: self.suggestions[codes[code]] for code in codes})

    @property
    def text(self) -> str:
        """Such as ``suggest FPP left`` or ``suggest 16 points left``."""
        if len(self.suggestions) == 1:
            return f"suggest {point_text(self.side, next(iter(self.suggestions)))}"
        return f"suggest {len(self.suggestions)} points {self.side.word}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the suggestions of what is still to do; raises `GpError` for CO."""
        wanted = {point_key(self.side, code): value for code, value in self.suggestions.items()}
        open_keys = [key for key in wanted if not state.landmarks.get(key, TO_DO).decided]
        require_free(state, open_keys)
        new = {key: Landmark(suggestion=wanted[key], provenance=self.provenance) for key in open_keys}
        return state.with_landmarks(new)


@dataclass(frozen=True)
class ConfirmPoint(_OnPoint):
    """Make an observation of a suggestion: a person has looked at the point and finds it right."""

    do: ClassVar[str] = "confirm_point"
    provenance: Provenance

    @property
    def text(self) -> str:
        """Such as ``confirm FPP left``."""
        return f"confirm {self._point}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the point placed where it is suggested; raises `GpError` where it is not."""
        suggestion = state.landmark(self.side, self.code).suggestion
        if suggestion is None:
            raise GpError(
                f"{self._point} is not suggested, so there is nothing to confirm",
                specimen=state.specimen,
                landmark=self.code,
                remedy="Accept its ghost first, or place it.",
            )
        return self._replaced(state, Landmark(suggestion.position, provenance=self.provenance))


@dataclass(frozen=True)
class ClearPoint(_OnPoint):
    """Make a point one that is still to do."""

    do: ClassVar[str] = "clear_point"

    @property
    def text(self) -> str:
        """Such as ``clear FPP left``."""
        return f"clear {self._point}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state without the point; raises `GpError` where it is locked."""
        return self._replaced(state, TO_DO)


@dataclass(frozen=True)
class MarkUnseen(_OnPoint):
    """Say that a feature was looked for and cannot be seen."""

    do: ClassVar[str] = "mark_unseen"
    provenance: Provenance | None = None

    @property
    def text(self) -> str:
        """Such as ``mark FPP left as not seen``."""
        return f"mark {self._point} as not seen"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the point so marked; raises `GpError` where it is locked."""
        note = state.landmarks.get(self.key, TO_DO).note
        return self._replaced(state, Landmark(unseen=True, provenance=self.provenance, note=note))


@dataclass(frozen=True)
class AnnotatePoint(_OnPoint):
    """Say how certain the observer is of a point, and note what was seen.

    Parameters
    ----------
    certainty : str, optional
        ``sure``, ``fair`` or ``guess``; empty for none, and by default it stays as it is.
    note : str, optional
        Such as ``broken bulla``; by default it stays as it is.
    """

    do: ClassVar[str] = "annotate_point"
    certainty: str | None = None
    note: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.certainty:
            check_option(self.certainty, "certainty", [each.value for each in Certainty])

    @property
    def text(self) -> str:
        """Such as ``mark FPP left as fair`` or ``note on FPP left``."""
        if self.certainty is None:
            return f"note on {self._point}"
        if not self.certainty:
            return f"unmark the certainty of {self._point}"
        return f"mark {self._point} as {self.certainty}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the point so marked; raises `GpError` where it is still to do."""
        landmark = state.landmark(self.side, self.code)
        if not landmark.decided:
            word, remedy = "still to do", "Place it first, or mark it as one that cannot be seen."
            if landmark.suggestion is not None:
                word, remedy = "only suggested", "Confirm it first."
            problem = f"{self._point} is {word}, so its certainty and notes cannot be set"
            raise GpError(problem, specimen=state.specimen, landmark=self.code, remedy=remedy)
        certainty = landmark.certainty if self.certainty is None else self.certainty or None
        note = landmark.note if self.note is None else self.note
        return self._replaced(state, replace(landmark, certainty=certainty, note=note))  # type: ignore[arg-type]


@dataclass(frozen=True)
class CheckPoint(_OnPoint):
    """Say that a placed point was looked at again and is right, and who says so (or take that back)."""

    do: ClassVar[str] = "check_point"
    checked: bool = True
    by: str = ""

    @property
    def text(self) -> str:
        """Such as ``mark FPP left as checked``."""
        return f"{'mark' if self.checked else 'unmark'} {self._point} as checked"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the point so marked; raises `GpError` where it is not placed."""
        landmark = state.landmark(self.side, self.code)
        if landmark.position is None:
            word, remedy = "not placed", "Place it first."
            if landmark.suggestion is not None:
                word, remedy = "only suggested", "Confirm it first."
            problem = f"{self._point} is {word}, so it cannot be checked"
            raise GpError(problem, landmark=self.code, remedy=remedy)
        return state.with_landmarks({self.key: replace(landmark, checked=self.checked, checked_by=self.by)})


@dataclass(frozen=True)
class LockPoints:
    """Lock points against every other edit, or unlock them.

    Parameters
    ----------
    points : tuple of (Side, str)
        Which; they must be placed or marked as not seen.
    locked : bool
        Lock or unlock.
    """

    do: ClassVar[str] = "lock_points"
    points: tuple[tuple[Side, str], ...]
    locked: bool = True

    @property
    def text(self) -> str:
        """Such as ``lock FPP left`` or ``unlock 12 points``."""
        what = point_text(*self.points[0]) if len(self.points) == 1 else f"{len(self.points)} points"
        return f"{'lock' if self.locked else 'unlock'} {what}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the points so; raises `GpError` for a point that is still to do."""
        changes = {}
        for side, code in self.points:
            landmark = state.landmark(side, code)
            if self.locked and not landmark.decided:
                raise GpError(
                    f"{point_text(Side.parse(side), code)} is still to do; there is nothing to lock"
                )
            changes[point_key(side, code)] = replace(landmark, locked=self.locked)
        return state.with_landmarks(changes)


@dataclass(frozen=True)
class SwapPoints:
    """Exchange what is known of two features of one side, placed under each other's names.

    A suggestion was made for its own feature, so it is dropped, not exchanged.
    """

    do: ClassVar[str] = "swap_points"
    side: Side
    code: str
    other: str

    @property
    def text(self) -> str:
        """Such as ``exchange RWA and RWP left``."""
        return f"exchange {self.code} and {self.other} {Side.parse(self.side).word}"

    def dropped_text(self, state: SpecimenState) -> str:
        """Say which suggestions it drops; empty where it drops none."""
        codes = (self.code, self.other)
        dropped = [code for code in codes if state.landmark(self.side, code).suggestion is not None]
        if not dropped:
            return ""
        if len(dropped) == 1:
            return f"The suggestion of {dropped[0]} was dropped; undo brings it back"
        return f"The suggestions of {' and '.join(dropped)} were dropped; undo brings them back"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the two exchanged; raises `GpError` where one is locked."""
        a, b = point_key(self.side, self.code), point_key(self.side, self.other)
        require_free(state, (a, b))
        return state.with_landmarks({a: _observed(state, b), b: _observed(state, a)})


@dataclass(frozen=True)
class SwapSides:
    """Exchange everything of the left and the right side; IN stays."""

    do: ClassVar[str] = "swap_sides"

    @property
    def text(self) -> str:
        """``exchange left and right``."""
        return "exchange left and right"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the sides exchanged; raises `GpError` where a point is locked."""
        of_a_side = [key for key in state.landmarks if key[0] is not None]
        require_free(state, of_a_side)
        crossed = {
            (side if side is None else side.other, code): landmark
            for (side, code), landmark in state.landmarks.items()
        }
        return replace(state, landmarks=crossed)


def _observed(state: SpecimenState, key: PointKey) -> Landmark:
    landmark = state.landmarks.get(key, TO_DO)
    return TO_DO if landmark.suggestion is not None else landmark
