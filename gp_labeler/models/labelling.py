"""What clicks and keys mean while labelling: a few functions on a session, for actions and scripts alike.

Each takes the point that is active unless another is named by `side` and `code`, and raises `GpError` where
none is, or where the edit cannot be made.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.landmarks.features import FEATURES, Side, feature
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import FloatArray
from gp_labeler.document.edits import (
    ClearPoint,
    ConfirmPoint,
    LockPoints,
    MarkUnseen,
    PlacePoint,
    SuggestPoints,
    as_position,
    point_text,
)
from gp_labeler.document.state import How, Provenance
from gp_labeler.models.session import Session
from gp_labeler.models.workflow import Active, next_point

__all__ = [
    "accept_all_ghosts",
    "accept_ghost",
    "clear",
    "confirm",
    "go_to",
    "lock",
    "lock_all",
    "mark_unseen",
    "nudge",
    "place",
    "place_of",
    "provenance",
    "skip",
    "suggest",
]


def place(
    session: Session,
    position: ArrayLike,
    how: How = How.MESH,
    *,
    side: Side | str | None = None,
    code: str | None = None,
) -> bool:
    """Put a point at `position`, (3,) mm in the scan frame; a new one makes the next point active.

    ``How.GHOST`` only suggests it: nobody has looked.

    Returns
    -------
    bool
        Whether anything changed.
    """
    side, code = _target(session, side, code)
    if how is How.GHOST:  # as scripts of earlier versions have it
        return suggest(session, position, source="atlas", side=side, code=code)
    is_new = session.state.landmark(side, code).position is None
    where = as_position(position, code)
    edit = PlacePoint(side, code, where, provenance(session, how), verb="place" if is_new else "move")
    changed = session.do(edit)
    if is_new:
        _go_on(session, side, code)
    return changed


def accept_ghost(session: Session, *, side: Side | str | None = None, code: str | None = None) -> bool:
    """Suggest a point where it is expected, and go on to the next; nobody has looked at it yet."""
    side, code = _target(session, side, code)
    ghost = session.ghosts(side).get(code)
    if ghost is None:
        raise GpError(
            f"nothing says yet where {point_text(side, code)} should be",
            landmark=code,
            remedy="Place three features of this side first.",
        )
    return _suggest(session, side, {code: ghost.suggestion})


def accept_all_ghosts(session: Session, *, side: Side | str | None = None) -> bool:
    """Suggest every point of one side (by default the one worked on) that is to do and expected somewhere."""
    side = session.active.side if side is None else Side.parse(side)
    ghosts = {
        code: ghost.suggestion
        for code, ghost in session.ghosts(side).items()
        if not session.state.landmark(side, code).locked
    }
    if not ghosts:
        raise GpError(
            f"nothing of the {side.word} side is to do and expected somewhere",
            remedy="Place three features of this side first.",
        )
    return _suggest(session, side, ghosts)


def suggest(
    session: Session,
    position: ArrayLike,
    *,
    radius_95: float | None = None,
    source: str = "",
    side: Side | str | None = None,
    code: str | None = None,
) -> bool:
    """Suggest a point at `position`, (3,) mm in the scan frame, for a person to confirm.

    Parameters
    ----------
    radius_95 : float, optional
        Radius that holds the feature with 95 % probability, mm.
    source : str
        What suggests it.
    """
    side, code = _target(session, side, code)
    suggestion = Suggestion(as_position(position, code), radius_95, source)
    return _suggest(session, side, {code: suggestion})


def confirm(session: Session, *, side: Side | str | None = None, code: str | None = None) -> bool:
    """Make an observation of a suggested point, as someone who has looked at it, and go on to the next.

    The window asks for it only where the point can be judged: in view, a voxel at least two pixels wide.
    """
    side, code = _target(session, side, code)
    suggestion = session.state.landmark(side, code).suggestion
    source = "" if suggestion is None else suggestion.source
    changed = session.do(ConfirmPoint(side, code, provenance(session, How.CONFIRMED, source=source)))
    _go_on(session, side, code)
    return changed


def nudge(
    session: Session, offset: ArrayLike, *, side: Side | str | None = None, code: str | None = None
) -> bool:
    """Move a point by a (3,) offset, mm in the scan frame; nudges in a row are one undo.

    A suggested point becomes an observation by that: a person has corrected it.
    """
    side, code = _target(session, side, code)
    landmark = session.state.landmark(side, code)
    if landmark.shown_position is None:
        raise GpError(f"{point_text(side, code)} is not placed yet", landmark=code, remedy="Place it first.")
    how = landmark.provenance.how if landmark.provenance else How.TYPED
    how = How.NUDGED if landmark.suggestion is not None else how
    where = as_position(np.add(landmark.shown_position, as_position(offset, code)), code)
    return session.do(PlacePoint(side, code, where, provenance(session, how), verb="nudge"), merge=True)


def clear(session: Session, *, side: Side | str | None = None, code: str | None = None) -> bool:
    """Make a point one that is to do, and the active one."""
    side, code = _target(session, side, code)
    changed = session.do(ClearPoint(side, code))
    session.set_active(Active(side, code))
    return changed


def mark_unseen(session: Session, *, side: Side | str | None = None, code: str | None = None) -> bool:
    """Say that a feature cannot be seen, and go on to the next."""
    side, code = _target(session, side, code)
    changed = session.do(MarkUnseen(side, code, provenance(session, How.UNSEEN)))
    _go_on(session, side, code)
    return changed


def skip(session: Session) -> None:
    """Leave the active point for later; it comes again after the others."""
    _go_to_next(session, session.active)


def go_to(session: Session, side: Side | str, code: str) -> None:
    """Make a point active and move the crosshair to it, or to where it is expected; CO only shows."""
    side = Side.parse(side)
    if not feature(code).computed:
        session.set_active(Active(side, code))
    where = place_of(session, side, code)
    if where is not None:
        session.set_crosshair(where)


def place_of(session: Session, side: Side, code: str) -> FloatArray | None:
    """Return where a point is to be looked at, (3,) mm: where it is placed, suggested or expected."""
    landmarks, ghosts = session.landmarks(side), session.ghosts(side)
    if code in landmarks:
        return landmarks[code]
    if code in landmarks.suggested:
        return np.array(landmarks.suggested[code].position)
    return ghosts[code].position if code in ghosts else None


def lock(
    session: Session, locked: bool = True, *, side: Side | str | None = None, code: str | None = None
) -> bool:
    """Lock a point against change, or unlock it."""
    return session.do(LockPoints((_target(session, side, code),), locked))


def lock_all(session: Session, locked: bool = True) -> bool:
    """Lock every point that is placed or not seen, or unlock all."""
    codes = [f.code for f in FEATURES if not f.computed]
    settled = [(side, code) for side in Side for code in codes if session.state.landmark(side, code).settled]
    points = [(side, code) for side, code in settled if not (feature(code).shared and side is Side.RIGHT)]
    return bool(points) and session.do(LockPoints(tuple(points), locked))


def provenance(session: Session, how: How, *, source: str = "") -> Provenance:
    """Return what is to be remembered of a point that is placed now."""
    volume = session.state.volume
    return Provenance(how, session.now(), session.author, volume.spacing if volume else None, source)


def _suggest(session: Session, side: Side, suggestions: Mapping[str, Suggestion]) -> bool:
    changed = session.do(SuggestPoints(side, suggestions, provenance(session, How.GHOST)))
    active = session.active
    if active.side is side and active.code is not None and active.code in suggestions:
        _go_on(session, side, active.code)
    return changed


def _target(session: Session, side: Side | str | None, code: str | None) -> tuple[Side, str]:
    side = session.active.side if side is None else Side.parse(side)
    if code is None:
        code = session.active.code
    if code is None:
        raise GpError("no feature is chosen", remedy="Choose one in the table.")
    return side, feature(code).code


def _go_on(session: Session, side: Side, code: str) -> None:
    """After an edit of the active point, make the next one active, if the user wants that."""
    if session.view.state.auto_advance and session.active == Active(side, code):
        _go_to_next(session, session.active)


def _go_to_next(session: Session, after: Active) -> None:
    upcoming = next_point(session.state, after, session.ghosts)
    session.set_active(upcoming)
    where = None if upcoming.code is None else place_of(session, upcoming.side, upcoming.code)
    if where is not None and session.view.state.follow_ghost:
        session.set_crosshair(where)
