"""Edits that begin another labelling of the specimen, or open one that was made before; see `edits`.

A specimen may be labelled any number of times, by one observer or by several. One labelling is in work; the
others are kept in `SpecimenState.others`, and nothing shows them, or derives anything from them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from gp_core.errors import GpError
from gp_labeler.document.state import SpecimenState, StoredLabelling

__all__ = ["BeginLabelling", "NameObserver", "OpenLabelling", "labelling_text", "next_round"]


def labelling_text(observer: str, number: int) -> str:
    """Name a labelling, such as ``AB, round 2``."""
    return f"{observer or 'unnamed'}, round {number}"


def next_round(state: SpecimenState, observer: str) -> int:
    """Return the round that follows all labellings by an observer, from 1."""
    rounds = [each.round for each in _others(state) if _is_by(each, observer)]
    return max(rounds, default=0) + 1


@dataclass(frozen=True)
class BeginLabelling:
    """Begin another labelling, from nothing; the one in work is kept apart.

    Parameters
    ----------
    observer : str
        Who labels.
    round : int, optional
        By default the one that follows the observer's labellings so far.
    blind : bool
        Whether the observer labels without seeing the others.
    """

    do: ClassVar[str] = "begin_labelling"
    observer: str = ""
    round: int | None = None
    blind: bool = True

    @property
    def text(self) -> str:
        """``label again, blind``."""
        return "label again, blind" if self.blind else "label again"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with an empty labelling in work; raises `GpError` where there is one already."""
        number = next_round(state, self.observer) if self.round is None else self.round
        new = StoredLabelling(" ".join(self.observer.split()), number, {}, self.blind)
        if any(each.round == number and _is_by(each, self.observer) for each in _others(state)):
            raise GpError(
                f"{labelling_text(self.observer, number)} already exists",
                specimen=state.specimen,
                remedy="Open that labelling, or begin the next round.",
            )
        return state.with_labelling(new, _others(state))


@dataclass(frozen=True)
class OpenLabelling:
    """Take up a labelling that was made before; the one in work is kept apart."""

    do: ClassVar[str] = "open_labelling"
    observer: str = ""
    round: int = 1

    @property
    def text(self) -> str:
        """Such as ``open labelling AB, round 2``."""
        return f"open labelling {labelling_text(self.observer, self.round)}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with that labelling in work; raises `GpError` where there is none."""
        others = _others(state)
        found = next((e for e in others if e.round == self.round and _is_by(e, self.observer)), None)
        if found is None:
            there = "; ".join(labelling_text(each.observer, each.round) for each in others)
            raise GpError(
                f"there is no labelling by {labelling_text(self.observer, self.round)}",
                specimen=state.specimen,
                remedy=f"There are: {there}." if there else "It was labelled once.",
            )
        return state.with_labelling(found, tuple(each for each in others if each is not found))


@dataclass(frozen=True)
class NameObserver:
    """Say who makes the labelling in work."""

    do: ClassVar[str] = "name_observer"
    observer: str

    @property
    def text(self) -> str:
        """Such as ``name AB as the observer``."""
        return f"name {self.observer} as the observer"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with this observer; raises `GpError` where that labelling is there already."""
        if any(each.round == state.round and _is_by(each, self.observer) for each in state.others):
            raise GpError(
                f"{labelling_text(self.observer, state.round)} already exists",
                specimen=state.specimen,
                remedy="Name another observer.",
            )
        return replace(state, observer=self.observer)


def _others(state: SpecimenState) -> tuple[StoredLabelling, ...]:
    """Return all labellings, with the one in work unless nothing is in it."""
    is_empty = not (state.landmarks or state.measurements)
    return state.others if is_empty else (*state.others, state.stored)


def _is_by(stored: StoredLabelling, observer: str) -> bool:
    return stored.observer.casefold() == " ".join(observer.split()).casefold()
