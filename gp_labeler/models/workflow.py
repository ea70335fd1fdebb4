"""What is done, what comes next, and what the next click will do, in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from gp_core.atlas.label_check import Finding
from gp_core.landmarks.features import CODES, FEATURES, Side, feature
from gp_labeler.document.edits import point_text
from gp_labeler.document.state import SpecimenState
from gp_labeler.models.ghosts import Ghost

__all__ = [
    "Active",
    "LabellingProgress",
    "PointState",
    "click_text",
    "next_point",
    "placing_order",
    "point_state",
    "progress",
]

OPENING = ("CA", "RWP", "OS")
"""Easily found, and far enough apart for the atlas to show where all others are."""

SURE_MM = 1.5
"""A ghost whose 95 % radius is below this is worth following first."""

GhostsOf = Callable[[Side], Mapping[str, Ghost]]


class PointState(str, Enum):
    """The state of a point, as the table shows it."""

    TO_DO = "to do"
    GHOST = "ghost"
    SUGGESTED = "suggested"
    PLACED = "placed"
    CHECKED = "checked"
    DOUBTFUL = "doubtful"
    UNSEEN = "unseen"
    COMPUTED = "computed"


@dataclass(frozen=True)
class Active:
    """What the next click places; no code where it places nothing."""

    side: Side
    code: str | None = None


@dataclass(frozen=True)
class LabellingProgress:
    """How far one side is; CO counts once it is computed."""

    n_placed: int
    n_unseen: int
    n_total: int = len(CODES)
    n_suggested: int = 0

    @property
    def text(self) -> str:
        """Such as ``3 of 20``, ``18 of 20, 2 not seen``, or ``3 placed, 16 suggested``."""
        placed = f"{self.n_placed} of {self.n_total}"
        if self.n_suggested:
            placed = f"{self.n_placed} placed, {self.n_suggested} suggested"
        return f"{placed}, {self.n_unseen} not seen" if self.n_unseen else placed


def progress(state: SpecimenState, side: Side) -> LabellingProgress:
    """Count the points of one side."""
    landmarks = state.side(side)
    return LabellingProgress(
        len(landmarks.placed), len(landmarks.unseen), n_suggested=len(landmarks.suggested)
    )


def point_state(
    state: SpecimenState,
    side: Side,
    code: str,
    *,
    ghosts: Mapping[str, Ghost],
    problems: Mapping[str, Finding],
) -> PointState:
    """Return the state of a point; one that a person has checked has no problem."""
    if feature(code).computed:
        return PointState.COMPUTED if code in state.side(side) else PointState.TO_DO
    landmark = state.landmark(side, code)
    if landmark.unseen:
        return PointState.UNSEEN
    if landmark.suggestion is not None:
        return PointState.SUGGESTED
    if landmark.position is None:
        return PointState.GHOST if code in ghosts else PointState.TO_DO
    if landmark.checked:
        return PointState.CHECKED
    return PointState.DOUBTFUL if code in problems else PointState.PLACED


def placing_order(ghosts: Mapping[str, Ghost]) -> tuple[str, ...]:
    """Return the order in which the 19 features of a side are proposed.

    Those come first whose ghost is sure enough to jump to. While there are none: the three that open the
    atlas's eyes. Otherwise the feature table's order.
    """
    sure = {code for code, ghost in ghosts.items() if ghost.radius_95 < SURE_MM}
    codes = [f.code for f in FEATURES if not f.computed]
    early = [c for c in codes if c in sure] if sure else list(OPENING)
    return (*early, *(c for c in codes if c not in early))


def next_point(state: SpecimenState, active: Active, ghosts_of: GhostsOf) -> Active:
    """Return what to place after `active`: round this side, then the other side, then what was left standing.

    What is suggested on a side comes after what is to do there, the most doubtful first: in doubt by its
    radius, or because the atlas disagrees.

    Returns
    -------
    Active
        Without a code once nothing is to do on either side.
    """
    for side in (active.side, active.side.other):
        order = placing_order(ghosts_of(side))
        if side is active.side and active.code in order:
            at = order.index(active.code)
            order = order[at + 1 :] + order[:at]
        for code in order:
            mark = state.landmark(side, code)
            if not mark.decided and mark.suggestion is None:
                return Active(side, code)
        if suggested := _most_doubtful_first(state, side, after=active.code if side is active.side else None):
            return Active(side, suggested[0])
    if active.code is not None and not state.landmark(active.side, active.code).decided:
        return active
    return Active(active.side)


def _most_doubtful_first(state: SpecimenState, side: Side, *, after: str | None) -> list[str]:
    """Return what is suggested on one side, the most doubtful first; round from `after`, which comes last."""
    suggested = state.side(side).suggested
    order = sorted(suggested, key=lambda code: suggested[code].uncertainty, reverse=True)
    at = order.index(after) + 1 if after in order else 0
    return order[at:] + order[:at]


def click_text(state: SpecimenState, active: Active) -> str:
    """Say what the next click does."""
    if active.code is None:
        left = any(
            not state.landmark(side, f.code).decided for side in Side for f in FEATURES if not f.computed
        )
        return "Choose a feature to place" if left else "All features are placed · drag a point to move it"
    point, landmark = point_text(active.side, active.code), state.landmark(active.side, active.code)
    if feature(active.code).shared:
        point += " (both sides)"
    if landmark.locked:
        return f"{point} is locked"
    if landmark.suggestion is not None:
        return f"{point} is suggested · press Enter to confirm it, or drag it or Ctrl+click to correct it"
    if landmark.position is not None:
        return (
            f"{point} is placed; a click does not move it. Drag it, use the arrow keys, or Shift+P and click"
        )
    after_all = " after all" if landmark.unseen else ""
    return f"Click on bone or a slice to place {point}{after_all}"
