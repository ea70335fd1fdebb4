"""Edits as plain tables, as in journals and scripts: ``{"do": "clear_point", "side": "L", "code": "CA"}``.

The keys are the fields of the edit; those that have their default are left out. In a script, who did it and
when are left out as well: whoever runs the script does it again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.validation import near_matches
from gp_labeler.document.edits import (
    AnnotatePoint,
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
from gp_labeler.document.head_edits import ClearHeadFrame, ConfirmLeft, SetHeadFrame
from gp_labeler.document.import_edit import ImportLandmarks
from gp_labeler.document.labelling_edits import BeginLabelling, NameObserver, OpenLabelling
from gp_labeler.document.measurement_edits import (
    AddMeasurements,
    MoveMeasurement,
    RemoveMeasurements,
    RenameMeasurement,
)
from gp_labeler.document.page_confirmation import ConfirmPage
from gp_labeler.document.plain_values import plain, record_of
from gp_labeler.document.specimen_edits import RenameSpecimen, SetNotes, SetThreshold
from gp_labeler.document.state import How, Provenance
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

if TYPE_CHECKING:
    from gp_labeler.document.specimen_document import SpecimenDocument

__all__ = ["EDITS", "Table", "edit_of", "edit_table", "redone", "script_table"]

Table = dict[str, Any]

EDITS: Mapping[str, type[Any]] = MappingProxyType(
    {
        kind.do: kind
        for kind in (
            *(PlacePoint, SuggestPoints, ConfirmPoint, ClearPoint, MarkUnseen, CheckPoint, LockPoints),
            *(ConfirmPage, AnnotatePoint, BeginLabelling, OpenLabelling, NameObserver),
            *(SwapPoints, SwapSides, SetThreshold, SetNotes, RenameSpecimen),
            *(RecordTouch, TakeTouches, RemoveTouches, LeaveOutTouch, SwapTouches, MoveTouches, SetSkull),
            *(SetHeadFrame, ClearHeadFrame, ConfirmLeft),
            *(AddMeasurements, MoveMeasurement, RenameMeasurement, RemoveMeasurements),
        )
    }
)
"""Edits by name that a table says all of. A script imports landmarks, and judges a pose, by steps of its own:
what these are made of is in files, and in the estimate."""

_WHO_AND_WHEN = ("time", "by", "voxel_mm")


def edit_table(edit: Edit) -> Table:
    """Return an edit as a table of texts, numbers, lists and tables, with who did it and when."""
    if isinstance(edit, ImportLandmarks):
        return {"do": edit.do, **(edit.asked or {})}
    return {"do": edit.do, **plain(edit)}


def script_table(edit: Edit) -> Table | None:
    """Return an edit as a step of a script; None where a table does not say all of it."""
    return {"do": edit.do, **plain(edit, left_out=_WHO_AND_WHEN)} if edit.do in EDITS else None


def edit_of(table: Mapping[str, Any]) -> Any:
    """Return the edit that a table says.

    Raises
    ------
    GpError
        There is no such edit, or a key or value that it does not take; the message names it.
    """
    do = str(table.get("do"))
    if do not in EDITS:
        raise GpError(f"unknown edit {do!r:.40}{near_matches(do, EDITS).lower()}")
    kind, given = EDITS[do], {key: value for key, value in table.items() if key != "do"}
    known = [field.name for field in fields(kind)]
    for key in given.keys() - set(known):
        allowed = f"It takes {', '.join(known)}." if known else "It takes nothing."
        raise GpError(f"{do}: unknown key {key!r}{near_matches(key, known).lower()}", remedy=allowed)
    if any(field.name == "provenance" and field.default is MISSING for field in fields(kind)):
        given.setdefault("provenance", {"how": How.TYPED.value})
    if isinstance(side := given.get("side"), str):
        given["side"] = Side.parse(side).value
    try:
        return record_of(kind, given, "")
    except GpError as error:
        raise GpError(f"{do}: {error.problem}", landmark=error.landmark, remedy=error.remedy) from None


def redone(edit: Any, document: SpecimenDocument) -> Any:
    """Return an edit as whoever works on the document makes it now."""
    if isinstance(edit, CheckPoint):
        return replace(edit, by=document.author)
    if isinstance(edit, BeginLabelling) and not edit.observer:
        return replace(edit, observer=document.author)
    if isinstance(edit, RecordTouch):
        return replace(edit, touch=_touched_now(edit.touch, document))
    if isinstance(edit, TakeTouches):
        touches = {name: _touched_now(touch, document) for name, touch in edit.touches.items()}
        return replace(edit, touches=touches)
    provenance = getattr(edit, "provenance", None)
    if not isinstance(provenance, Provenance):
        return edit
    return replace(edit, provenance=document.provenance(provenance.how, source=provenance.source))


def _touched_now(touch: Touch, document: SpecimenDocument) -> Touch:
    return replace(touch, time=document.now(), by=document.author)
