"""What the feature card says, in words: which feature, how far it is, and the one next thing to do."""

from __future__ import annotations

from dataclasses import dataclass

from gp_core.landmarks.features import FEATURES, Side, feature
from gp_labeler.document.edits import point_text
from gp_labeler.document.state import Landmark
from gp_labeler.models.anatomical_planes import FEATURE_PLANES
from gp_labeler.models.labels import LabelsModel
from gp_labeler.models.workflow import OPENING, PointState
from gp_labeler.views.formatting import mm_text, sentence, suggestion_text
from gp_labeler.views.panels.parts import breakable
from gp_labeler.views.times import time_text

__all__ = ["CardContent", "content_of"]

_VIEWS = {
    "3D": "the 3D view",
    "axial": "axial slices",
    "coronal": "coronal slices",
    "sagittal": "sagittal slices",
}


@dataclass(frozen=True)
class CardContent:
    """Everything that the card shows.

    Parameters
    ----------
    eyebrow, code, name, aside, aside_hint : str
        Such as ``Place next · left · 3 of 20``, ``IN``, ``Incisors``, ``both sides``, and what that means.
    definition, where, mistakes : str
        What the feature is, how to find it, and what often goes wrong.
    status, status_role : str
        How far it is, and the look of that line: ``ghost``, ``good``, ``danger`` or ``hint``.
    state : str
        State for the chip beside it.
    action, action_text : str
        Id and words of the one next action.
    plane, plane_text : str
        Plane in which the feature is defined, one of `ANATOMICAL_PLANES` or ``straight``, and the words
        of the button that shows it; empty where that says no more than `where`.
    skip_text : str
        What the button says that goes on to the next feature.
    can_skip, can_unsee : bool
        Whether the two other buttons mean anything.
    """

    eyebrow: str
    code: str = ""
    name: str = ""
    aside: str = ""
    aside_hint: str = ""
    definition: str = ""
    where: str = ""
    mistakes: str = ""
    status: str = ""
    status_role: str = "hint"
    state: str = "to do"
    action: str = ""
    action_text: str = ""
    plane: str = ""
    plane_text: str = ""
    skip_text: str = "Skip"
    can_skip: bool = True
    can_unsee: bool = True


def content_of(
    labels: LabelsModel, *, has_scan: bool, atlas: str = "", in_head: bool = False, turned: bool = False
) -> CardContent:
    """Return what the card says now.

    Parameters
    ----------
    labels : LabelsModel
        What is placed, and what comes next.
    has_scan : bool
        Whether there is a scan to place anything on.
    atlas : str
        Which atlas is behind ghosts and problems, such as ``the atlas of 8 animals``; empty for the published
        one.
    in_head : bool
        Whether the slices lie in the frame of the head.
    turned : bool
        Whether they are turned out of their frame.
    """
    active = labels.active
    if not has_scan:
        return _without_scan() if labels.document.state.volume is None else _without_its_scan(labels)
    if active.code is None:
        return _between(labels)
    side, row = active.side, feature(active.code)
    state, mark = (
        labels.point_states(side, wait=False)[row.code],
        labels.document.state.landmark(side, row.code),
    )
    status, role = _status(labels, side, row.code, state)
    if atlas and role in ("ghost", "danger"):
        status = f"{status} By {atlas}."
    action, words = ("unlock", "Unlock") if mark.locked else _next_action(labels, side, row.code, state)
    plane = FEATURE_PLANES.get(row.code, "straight" if turned else "")
    of_head = " of the head" if in_head and row.view != "3D" else ""
    aside, hint = _SHARED if row.shared else _EXTERNAL if row.external else ("", "")
    return CardContent(
        eyebrow=f"{_VERBS[state]} · {side.word} · {labels.progress(side).text}",
        code=row.code,
        name=row.name,
        aside=aside,
        aside_hint=hint,
        definition=row.definition,
        where=f"{row.where} Best seen in {_VIEWS[row.view]}{of_head}.",
        mistakes=row.mistakes,
        plane=plane,
        plane_text=_PLANES.get(plane, ""),
        status=f"{_status_words(labels, side, row.code)} Locked against change." if mark.locked else status,
        status_role="hint" if mark.locked else role,
        state="locked" if mark.locked else state.value,
        action=action,
        action_text=words,
        skip_text="Skip" if state in (PointState.TO_DO, PointState.GHOST) else "Next",
        can_skip=action != "next",
        can_unsee=not mark.locked and state is not PointState.UNSEEN,
    )


_PLANES = {
    "along": "Slices along the axis",
    "round window": "Slice through the round window",
    "footplate": "Slice through the footplate",
    "straight": "Straight slices",
}
_SHARED = ("both sides", "One point, shared by both sides")
_EXTERNAL = ("touchable", "A probe can touch it; it can be used to estimate the pose")
_VERBS = {
    PointState.TO_DO: "Place next",
    PointState.GHOST: "Place next",
    PointState.SUGGESTED: "Suggested",
    PointState.PLACED: "Placed",
    PointState.CHECKED: "Checked",
    PointState.DOUBTFUL: "Look again",
    PointState.UNSEEN: "Not seen",
}
_ACTIONS = {
    PointState.TO_DO: ("crosshair", "Place at crosshair"),
    PointState.GHOST: ("ghost", "Accept ghost"),
    PointState.SUGGESTED: ("confirm", "Confirm"),
    PointState.PLACED: ("check", "Mark as checked"),
    PointState.CHECKED: ("next", "Next feature"),
    PointState.DOUBTFUL: ("check", "It is correct"),
    PointState.UNSEEN: ("crosshair", "Place at crosshair"),
}


def _next_action(labels: LabelsModel, side: Side, code: str, state: PointState) -> tuple[str, str]:
    """Return id and words of the one next action: for a problem that has a remedy, that remedy."""
    problem = labels.known_problems(side).get(code) if state is PointState.DOUBTFUL else None
    if problem is not None and problem.kind == "other side":
        return "swap_sides", "Exchange left and right"
    if problem is not None and problem.kind == "exchanged":
        return "swap_names", "Exchange " + " and ".join(problem.landmarks)
    return _ACTIONS[state]


def _status(labels: LabelsModel, side: Side, code: str, state: PointState) -> tuple[str, str]:
    """Return one sentence on how far the point is, and its look."""
    if state is PointState.GHOST:
        ghost = labels.ghosts(side)[code]
        who = "The atlas predicts it" if ghost.source == "atlas" else "The mirrored other side predicts it"
        return f"{who} within {mm_text(ghost.radius_95)} (95 %).", "ghost"
    if state is PointState.SUGGESTED:
        said = suggestion_text(labels.document.landmarks(side).suggested[code])
        source = f" ({said})" if said else ""
        return f"Suggested{source}. Confirm or correct it.", "ghost"
    problem = labels.known_problems(side).get(code)
    if state is PointState.DOUBTFUL and problem is not None:
        return sentence(problem.text), "danger"
    if state is PointState.CHECKED:
        return "Placed, and checked by a person.", "good"
    if state is PointState.PLACED:
        return f"{_status_words(labels, side, code)} Drag, nudge or re-place it to correct it.", "hint"
    if state is PointState.UNSEEN:
        return "Marked as not visible. Click to place it anyway.", "hint"
    return _first_ones(labels, side), "hint"


def _status_words(labels: LabelsModel, side: Side, code: str) -> str:
    """Return how a point came to be where it is, such as ``Placed on bone.``."""
    mark = labels.document.state.landmark(side, code)
    if mark.unseen:
        return "Marked as not visible."
    how = mark.provenance.how.value if mark.provenance else ""
    by = _by_words(labels, mark)
    words = {
        "mesh": "Placed on bone.",
        "slice": "Placed on a slice.",
        "confirmed suggestion": "Suggested and confirmed.",
        "confirmed from a page": "Suggested, and confirmed from a page of close views.",
        "corrected on a page": "Suggested, then placed by hand on a page of close views.",
        "nudged suggestion": "Suggested, then corrected by you.",
    }
    return words.get(how, f"{how.capitalize()}." if how else "Placed.") + by


def _by_words(labels: LabelsModel, mark: Landmark) -> str:
    """Return who placed a point, and when, where that is not the one who labels now."""
    about = mark.provenance
    if about is None or not about.by or about.by == labels.document.author:
        return ""
    return f" By {about.by}, {time_text(about.time)}."


def _first_ones(labels: LabelsModel, side: Side) -> str:
    missing = [code for code in OPENING if code not in labels.document.landmarks(side)]
    n_short = 3 - len(labels.document.landmarks(side).placed)
    if n_short <= 0:
        return "Click on bone or a slice to place it."
    if len(missing) == n_short:
        names = " and ".join([", ".join(missing[:-1]), missing[-1]] if len(missing) > 1 else missing)
        return f"After {names}, the atlas predicts the position."
    return f"After {n_short} more on this side, the atlas predicts the position."


def _without_scan() -> CardContent:
    return CardContent(
        "No scan yet",
        name="Open a scan to begin",
        definition="You place the features on the bone surface or on slices.",
        action="open",
        action_text="Open scan…",
        can_skip=False,
        can_unsee=False,
    )


def _without_its_scan(labels: LabelsModel) -> CardContent:
    reference = labels.document.state.volume
    assert reference is not None
    lost, there = labels.document.volume_is_lost, breakable(str(reference.path))
    return CardContent(
        labels.document.state.specimen,
        name="The scan was not found" if lost else "The scan is not open",
        definition=f"It was at {there}. The labels are kept. Choose the new location of the scan."
        if lost
        else "",
        action="find",
        action_text="Find scan…",
        can_skip=False,
        can_unsee=False,
    )


def _between(labels: LabelsModel) -> CardContent:
    """Say what comes when no feature is active."""
    to_do = [
        point_text(side, row.code)
        for side in Side
        for row in FEATURES
        if not row.computed and not labels.document.state.landmark(side, row.code).decided
    ]
    totals = " · ".join(f"{side.word} {labels.progress(side).text}" for side in Side)
    if to_do:
        return CardContent(
            totals,
            name="No feature is selected",
            definition="Select one in the table, or continue with the next one to place.",
            action="next",
            action_text="Next feature",
            can_skip=False,
            can_unsee=False,
        )
    doubtful = sum(
        s is PointState.DOUBTFUL for side in Side for s in labels.point_states(side, wait=False).values()
    )
    many = "One point" if doubtful == 1 else f"{doubtful} points"
    warning = f"{many} should be reviewed (red triangles). " if doubtful else ""
    return CardContent(
        totals,
        name="Everything is labelled",
        definition=f"{warning}When you are satisfied with the labels, export the landmarks of both sides.",
        status="Nothing is left to do.",
        status_role="good",
        state="checked",
        action="export",
        action_text="Export landmarks…",
        can_skip=False,
        can_unsee=False,
    )
