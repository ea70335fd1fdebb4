"""Edits as steps of a script: what doing each again takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from gp_core.landmarks.features import Side
from gp_labeler.document.edits import (
    CheckPoint,
    ClearPoint,
    ConfirmPoint,
    Edit,
    LockPoints,
    MarkUnseen,
    PlacePoint,
    SuggestPoints,
    SwapPoints,
    SwapSides,
)
from gp_labeler.document.landmark_import import ImportLandmarks
from gp_labeler.document.specimen_edits import RecordPoseCheck, RenameSpecimen, SetNotes, SetThreshold
from gp_labeler.document.state import PointKey, SpecimenState, point_key
from gp_labeler.document.touch_edits import (
    LeaveOutTouch,
    MoveTouches,
    RecordTouch,
    RemoveTouches,
    SetSkull,
    SwapTouches,
    TakeTouches,
)
from gp_labeler.document.touches import Touch

__all__ = ["RECORDED", "Table", "step", "steps_of"]

Table = dict[str, Any]
"""One step, as a script has it."""


def step(do: str, **keys: Any) -> Table:
    """Return a step without the keys that say nothing."""
    said = {key: value for key, value in keys.items() if value is not None and value is not False}
    return {"do": do, **said}


def steps_of(edit: Edit, before: SpecimenState, *, merge: bool = False) -> list[Table] | None:
    """Return the steps that make an edit again.

    Parameters
    ----------
    edit : Edit
        What was done.
    before : SpecimenState
        To what.
    merge : bool
        Whether it was told to continue the gesture before it.

    Returns
    -------
    list of dict, or None
        None where no step does the same.
    """
    find = RECORDED.get(type(edit))
    return None if find is None else find(edit, before, merge)


Find = Callable[[Any, SpecimenState, bool], "list[Table] | None"]


def _put(edit: PlacePoint, _: SpecimenState, merge: bool) -> list[Table]:
    point = {"feature": edit.code, "side": edit.side.value}
    return [step("put", **point, at=list(edit.position), how=edit.provenance.how.value, nudge=merge)]


def _suggest(edit: SuggestPoints, *_: object) -> list[Table] | None:
    sources = {found.source for found in edit.suggestions.values()}
    if len(sources) != 1:
        return None
    points = {code: list(found.position) for code, found in edit.suggestions.items()}
    radii = {code: found.radius_95 for code, found in edit.suggestions.items() if found.radius_95}
    source = sources.pop() or None
    return [step("suggest", side=edit.side.value, points=points, radii=radii or None, source=source)]


def _confirm(edit: ConfirmPoint, *_: object) -> list[Table]:
    return [step("confirm", feature=edit.code, side=edit.side.value)]


def _on_chosen(side: Side, code: str, id: str, **more: Any) -> list[Table]:
    return [step("choose", feature=code, side=side.value), step("action", id=id, **more)]


def _clear(edit: ClearPoint, *_: object) -> list[Table]:
    return _on_chosen(edit.side, edit.code, "point.clear")


def _unseen(edit: MarkUnseen, *_: object) -> list[Table]:
    return _on_chosen(edit.side, edit.code, "point.unseen")


def _check(edit: CheckPoint, *_: object) -> list[Table]:
    return _on_chosen(edit.side, edit.code, "point.check")


def _lock(edit: LockPoints, before: SpecimenState, _: bool) -> list[Table] | None:
    if len(edit.points) == 1:
        return _on_chosen(*edit.points[0], "point.lock")
    settled = {key: mark for key, mark in before.landmarks.items() if mark.settled}
    chosen: set[PointKey] = {point_key(*point) for point in edit.points}
    if chosen == settled.keys() and edit.locked != all(mark.locked for mark in settled.values()):
        return [step("action", id="point.lock_all")]
    return None


def _swap(edit: SwapPoints, *_: object) -> list[Table]:
    return _on_chosen(Side.parse(edit.side), edit.code, "edit.swap", answers=[edit.other])


def _swap_sides(*_: object) -> list[Table]:
    return [step("action", id="edit.swap_sides")]


def _threshold(edit: SetThreshold, *_: object) -> list[Table]:
    return [step("threshold", value=edit.threshold)]


def _notes(edit: SetNotes, _: SpecimenState, merge: bool) -> list[Table]:
    return [{**step("specimen", more=merge), "notes": edit.notes}]  # also where they are empty


def _rename(edit: RenameSpecimen, *_: object) -> list[Table]:
    return [step("specimen", name=edit.name)]


def _import(edit: ImportLandmarks, *_: object) -> list[Table] | None:
    if edit.asked is None:
        return None
    asked = {key: value for key, value in edit.asked.items() if key != "names" or value}
    return [step("import", **asked, keep=not edit.replace_placed)]


def _touch(edit: RecordTouch, *_: object) -> list[Table]:
    points = {edit.name: list(edit.touch.position)}
    about = _about(edit.touch)
    return [step("touches", side=edit.side.value, points=points, **about, add=True)]


def _touches(edit: TakeTouches, *_: object) -> list[Table] | None:
    touches = list(edit.touches.values())
    abouts = [_about(touch) for touch in touches]
    if not touches or any(about != abouts[0] for about in abouts) or any(t.left_out for t in touches):
        return None
    points = {name: list(touch.position) for name, touch in edit.touches.items()}
    return [step("touches", side=Side.parse(edit.side).value, points=points, **abouts[0])]


def _about(touch: Touch) -> Table:
    """Return how a touch was made, as the keys of a step."""
    about: Table = {"how": touch.how.value, "source": touch.source or None}
    return about | (
        {"n_samples": touch.n_samples, "spread_mm": touch.spread_mm} if touch.n_samples > 1 else {}
    )


def _leave_out(edit: LeaveOutTouch, *_: object) -> list[Table]:
    key = "leave_out" if edit.left_out else "take_in"
    return [step("touches", side=Side.parse(edit.side).value, **{key: [edit.name]})]


def _forget(edit: RemoveTouches, before: SpecimenState, _: bool) -> list[Table]:
    if edit.name is not None:
        return [step("touches", side=Side.parse(edit.side).value, forget=[edit.name])]
    return [step("touches", side=Side.parse(edit.side).value, clear=True)]


def _swap_touches(edit: SwapTouches, *_: object) -> list[Table]:
    return [step("touches", side=Side.parse(edit.side).value, swap=[edit.name, edit.other])]


def _move_touches(edit: MoveTouches, *_: object) -> list[Table]:
    return [step("touches", side=Side.parse(edit.side).value, other_side=True)]


def _skull(edit: SetSkull, *_: object) -> list[Table]:
    return [{"do": "skull", "points": {name: list(point) for name, point in edit.skull.items()}}]


def _verdict(edit: RecordPoseCheck, *_: object) -> list[Table]:
    check = edit.check
    said = {"verdict": check.verdict, "by": check.by, "note": check.note or None}
    return [step("verdict", side=check.side.value, **said)]


RECORDED: Mapping[type, Find] = MappingProxyType(
    {
        PlacePoint: _put,
        SuggestPoints: _suggest,
        ConfirmPoint: _confirm,
        ClearPoint: _clear,
        MarkUnseen: _unseen,
        CheckPoint: _check,
        LockPoints: _lock,
        SwapPoints: _swap,
        SwapSides: _swap_sides,
        SetThreshold: _threshold,
        SetNotes: _notes,
        RenameSpecimen: _rename,
        ImportLandmarks: _import,
        RecordTouch: _touch,
        TakeTouches: _touches,
        LeaveOutTouch: _leave_out,
        RemoveTouches: _forget,
        SetSkull: _skull,
        SwapTouches: _swap_touches,
        MoveTouches: _move_touches,
        RecordPoseCheck: _verdict,
    }
)
"""How each kind of edit is written down."""
