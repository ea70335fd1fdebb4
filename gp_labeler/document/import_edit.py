"""The edit that takes over the landmarks of files; see `edits` for what an edit is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_core.landmarks.provenance import LabelProvenance
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.document.edits import as_position, require_free
from gp_labeler.document.state import TO_DO, Landmark, PointKey, Provenance, SpecimenState, point_key

__all__ = ["ImportLandmarks"]


@dataclass(frozen=True)
class ImportLandmarks:
    """Take over the landmarks of a file.

    Parameters
    ----------
    landmarks : tuple of LandmarkSet
        One or both sides, scan frame. A computed CO in them is not taken: it is computed again.
    provenance : Provenance
        Of those points that bring none of their own. Certainty, note and check come with the landmarks.
    known : mapping of (Side, str) to Provenance
        Provenance that the file carries.
    replace_placed : bool
        Whether placed points give way; otherwise only what is still to do is filled. A suggestion never
        replaces a placed or unseen point.
    asked : mapping, optional
        How `import_landmarks` was asked for it, for a script that does it again.
    """

    do: ClassVar[str] = "import_landmarks"
    landmarks: tuple[LandmarkSet, ...]
    provenance: Provenance
    known: Mapping[tuple[Side, str], Provenance] | None = None
    replace_placed: bool = True
    asked: Mapping[str, Any] | None = None

    @property
    def text(self) -> str:
        """Such as ``import 38 points``."""
        marks = self._marks().values()
        n, n_suggested = (sum(bool(getattr(m, name)) for m in marks) for name in ("position", "suggestion"))
        text = f"import {n} point{'' if n == 1 else 's'}"
        return f"{text}, {n_suggested} suggestion{'' if n_suggested == 1 else 's'}" if n_suggested else text

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the points taken over.

        Raises
        ------
        GpError
            They are not in the scan frame, the sides disagree on IN, or a locked point would change.
        """
        for landmarks in self.landmarks:
            if landmarks.frame != "scan":
                raise GpError(f"landmarks to import must be in the scan frame, got {landmarks.frame!r}")
        changes = {
            key: mark
            for key, mark in self._marks().items()
            if not state.landmarks.get(key, TO_DO).decided
            or (self.replace_placed and mark.suggestion is None)
        }
        moved = [key for key, mark in changes.items() if _moves(state.landmarks.get(key, TO_DO), mark)]
        require_free(state, moved)
        said = {
            key: _annotated_by(state.landmarks[key], mark)
            for key, mark in changes.items()
            if key not in moved and key in state.landmarks
        }
        new = state.with_landmarks(said | {key: changes[key] for key in moved})
        return self._labelled_by(new) if not state.landmarks else new

    def _labelled_by(self, state: SpecimenState) -> SpecimenState:
        """Take observer and round of the files, where they have one of each and nothing was labelled yet."""
        who = {(each.observer, each.round) for each in self.landmarks}
        if state.observer or len(who) != 1 or who == {("", 1)}:
            return state
        observer, number = who.pop()
        is_there = any((each.observer, each.round) == (observer, number) for each in state.others)
        return state if is_there else replace(state, observer=observer, round=number)

    def _marks(self) -> dict[PointKey, Landmark]:
        marks: dict[PointKey, Landmark] = {}
        for landmarks in self.landmarks:
            for code in (*landmarks.placed, *sorted(landmarks.unseen)):
                if feature(code).computed:
                    continue
                key, mark = point_key(landmarks.side, code), self._mark(landmarks, code)
                if _moves(marks.setdefault(key, mark), mark):
                    raise GpError(
                        f"the sides share {code}, but have it at {marks[key].position} and {mark.position}",
                        landmark=code,
                        remedy="Correct one of the files, or import one side.",
                    )
        for landmarks in self.landmarks:
            for code in landmarks.suggested:
                marks.setdefault(point_key(landmarks.side, code), self._mark(landmarks, code))
        return marks

    def _mark(self, landmarks: LandmarkSet, code: str) -> Landmark:
        about = landmarks.provenance.get(code, LabelProvenance())
        provenance = (self.known or {}).get((landmarks.side, code)) or self._told(about)
        if code in landmarks.unseen:
            return Landmark(unseen=True, provenance=provenance, certainty=about.certainty, note=about.note)
        if code in landmarks.suggested:
            return Landmark(suggestion=landmarks.suggested[code], provenance=provenance)
        return Landmark(
            as_position(landmarks[code], code),
            checked=about.checked,
            provenance=provenance,
            checked_by=about.checked_by,
            certainty=about.certainty,
            note=about.note,
        )

    def _told(self, about: LabelProvenance) -> Provenance:
        """Return the provenance of a point whose file states only who placed it, and when."""
        if not about.observer:
            return self.provenance
        return replace(self.provenance, by=about.observer, time=about.time or self.provenance.time)


def _annotated_by(old: Landmark, new: Landmark) -> Landmark:
    """Return a point that stays where it is, with what a file says of it; a locked one as it is."""
    if old.locked or old.suggestion is not None:
        return old
    return replace(
        old,
        certainty=new.certainty or old.certainty,
        note=new.note or old.note,
        checked=old.checked or new.checked,
        checked_by=old.checked_by or new.checked_by,
    )


def _moves(old: Landmark, new: Landmark) -> bool:
    return (old.position, old.unseen, old.suggestion) != (new.position, new.unseen, new.suggestion)
