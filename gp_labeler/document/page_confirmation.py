"""Confirming several suggestions at once: those on a page of close views with which nothing is wrong."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.document.edits import point_text, require_free
from gp_labeler.document.state import How, Landmark, PointKey, Provenance, SpecimenState, point_key

__all__ = ["LARGEST_RADIUS_MM", "ConfirmPage", "page_refusal"]

LARGEST_RADIUS_MM = 1.5
"""A close view shows a few millimetres: where the feature may lie outside, it says nothing."""


def page_refusal(suggestion: Suggestion) -> str:
    """Return why a suggestion cannot be confirmed from a page, in words; empty where it can.

    Parameters
    ----------
    suggestion : Suggestion
        One that nobody has confirmed yet.
    """
    if suggestion.atlas_distance is not None:
        return "the atlas disagrees"
    if suggestion.radius_95 is None:
        return "its 95 % radius is not known"
    if suggestion.doubtful or suggestion.radius_95 > LARGEST_RADIUS_MM:
        return "its 95 % radius is large"
    return ""


@dataclass(frozen=True)
class ConfirmPage:
    """Make observations of suggestions whose close views a person has seen together on a page.

    Parameters
    ----------
    points : tuple of (Side, str)
        Those that were shown, and that nobody wants to look at again.
    provenance : Provenance
        Who saw the page, and when; each label says how, and what suggested it.
    """

    do: ClassVar[str] = "confirm_page"
    points: tuple[tuple[Side, str], ...]
    provenance: Provenance

    def __post_init__(self) -> None:
        points = tuple((Side.parse(side), feature(code).code) for side, code in self.points)
        if not points:
            raise GpError("a page needs at least one point to confirm")
        object.__setattr__(self, "points", points)

    @property
    def text(self) -> str:
        """Such as ``confirm 8 points from a page``."""
        n = len(self.points)
        what = point_text(*self.points[0]) if n == 1 else f"{n} points"
        return f"confirm {what} from a page"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with all of them placed.

        Raises
        ------
        GpError
            One is not suggested, is locked, or must be looked at by itself; then none is confirmed.
        """
        require_free(state, self._keys())
        return state.with_landmarks({key: self._confirmed(state, *key) for key in self._keys()})

    def _keys(self) -> Iterable[PointKey]:
        return (point_key(side, code) for side, code in self.points)

    def _confirmed(self, state: SpecimenState, side: Side | None, code: str) -> Landmark:
        side = side or Side.LEFT
        suggestion = state.landmark(side, code).suggestion
        if suggestion is None:
            raise GpError(f"{point_text(side, code)} is not suggested", landmark=code)
        refusal = page_refusal(suggestion)
        if refusal:
            raise GpError(
                f"{point_text(side, code)} cannot be confirmed from a page: {refusal}",
                landmark=code,
                remedy="Look at it in the views, then confirm or correct it.",
            )
        about = replace(self.provenance, how=How.PAGE, source=suggestion.source)
        return Landmark(suggestion.position, provenance=about)
