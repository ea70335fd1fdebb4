"""The labellings of a specimen as rows: who, which round, how far, and when it was last worked on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gp_core.landmarks.features import Side
from gp_labeler.document.labelling_edits import labelling_text
from gp_labeler.document.state import Landmark, PointKey, SpecimenState
from gp_labeler.models.workflow import LabellingProgress, progress

__all__ = ["LabellingRow", "labelling_rows", "last_change"]


@dataclass(frozen=True)
class LabellingRow:
    """One labelling.

    Parameters
    ----------
    observer : str
        Who labelled.
    round : int
        Which of the observer's labellings, from 1.
    progress : mapping of Side to LabellingProgress
        How far both sides are.
    blind : bool
        Whether it was begun blind, with the others hidden.
    changed : str
        When a point was last placed, ISO 8601, UTC; empty where nothing is.
    is_open : bool
        Whether it is the one in work.
    """

    observer: str
    round: int
    progress: Mapping[Side, LabellingProgress]
    blind: bool
    changed: str
    is_open: bool

    @property
    def text(self) -> str:
        """Such as ``AB, round 2``."""
        return labelling_text(self.observer, self.round)


def labelling_rows(state: SpecimenState) -> tuple[LabellingRow, ...]:
    """Return the labellings of a specimen by observer and round; the one in work also while it is empty."""
    here = (state.labeller, state.round)
    return tuple(
        LabellingRow(
            each.observer,
            each.round,
            {side: progress(each, side) for side in Side},
            each.blind,
            last_change(each.landmarks),
            (each.observer, each.round) == here,
        )
        for each in state.labellings
    )


def last_change(landmarks: Mapping[PointKey, Landmark]) -> str:
    """Return when the latest of some points was placed or marked, ISO 8601, UTC; empty where none is."""
    return max((mark.provenance.time for mark in landmarks.values() if mark.provenance), default="")
