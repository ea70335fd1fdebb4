"""The state of a specimen as the JSON document that is saved and journalled, and back.

What is unknown or still to do has no entry. Numbers have full precision: Python writes the shortest text that
reads back as the same float.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gp_core.errors import FileFormatError, GpError
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.measurements import Measurement
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.document.frozen_json import thaw
from gp_labeler.document.head_frame import HeadFrame
from gp_labeler.document.plain_values import plain, record_of
from gp_labeler.document.state import (
    How,
    Landmark,
    PointKey,
    PoseCheck,
    Position,
    Provenance,
    SpecimenState,
    StoredLabelling,
    point_key,
)
from gp_labeler.document.touches import Touch, Touches, TouchKey, touch_name
from gp_labeler.document.volume_reference import VolumeReference

__all__ = [
    "Document",
    "accepted_ghosts",
    "document_of",
    "provenance_of",
    "state_of",
    "volume_document",
]

Document = dict[str, Any]

BOTH = "both"

_SUGGESTION = {"radius_95": "radius_95_mm", "atlas_distance": "atlas_distance_mm"}
_HEAD = {"matrix": "T_head_scan", "found_by": "foundBy", "left_confirmed": "leftConfirmed"}
"""Fields that have another name in the file."""


def document_of(state: SpecimenState) -> Document:
    """Return the document of a state: dicts, lists, text and finite numbers only."""
    document: Document = {
        "specimen": state.specimen,
        "landmarks": _landmarks_out(state.landmarks),
        "notes": state.notes,
        "import_choices": thaw(state.import_choices),
        "pose_checks": plain(state.pose_checks, full=True),
        "touches": _touches_out(state.touches),
        "skull": plain(state.skull),
    }
    if state.volume is not None:
        document["volume"] = volume_document(state.volume)
    if state.threshold is not None:
        document["threshold"] = state.threshold
    if state.head_frame is not None:
        document["headFrame"] = plain(state.head_frame, names=_HEAD, full=True)
    evidence = {side: found for side in Side if (found := state.side(side).scan_evidence)}
    document |= _labelling_out(state.observer, state.round, state.blind)
    document |= _measured_out(state.measurements, evidence)
    rows = [_stored_labelling_out(each) for each in state.others]
    return document | ({"other_labellings": rows} if rows else {})


def _stored_labelling_out(stored: StoredLabelling) -> Document:
    return {
        **_labelling_out(stored.observer, stored.round, stored.blind),
        **_measured_out(stored.measurements, stored.scan_evidence),
        "landmarks": _landmarks_out(stored.landmarks),
    }


def _labelling_out(observer: str, number: int, blind: bool) -> Document:
    """Return who made a labelling; without what is so of the first by nobody in particular."""
    out: Document = {"observer": observer} if observer else {}
    out |= {"round": number} if number != 1 else {}
    return out | ({"blind": True} if blind else {})


def _measured_out(measurements: tuple[Measurement, ...], evidence: Mapping[Side, ScanEvidence]) -> Document:
    out: Document = {"measurements": plain(measurements)} if measurements else {}
    distances = {side.value: found.as_json() for side, found in evidence.items()}
    return out | ({"bone_distance_mm": distances} if distances else {})


def _landmarks_out(landmarks: Mapping[PointKey, Landmark]) -> Document:
    out: Document = {}
    for owner in (*Side, None):
        marks = {c: _landmark_out(landmarks[owner, c]) for c in CODES if (owner, c) in landmarks}
        if marks:
            out[BOTH if owner is None else owner.value] = marks
    return out


def _landmark_out(landmark: Landmark) -> Document:
    out: Document = plain(landmark, left_out=("suggestion",))
    if landmark.suggestion is not None:
        out["suggestion"] = plain(landmark.suggestion, names=_SUGGESTION)
    return out


def volume_document(volume: VolumeReference) -> Document:
    """Return a reference to a scan as it is saved."""
    out: Document = plain(volume)
    return out


def _touches_out(touches: Touches) -> Document:
    out: Document = {}
    for (side, name), touch in touches.items():
        out.setdefault(side.value, {})[name] = {**plain(touch), "how": touch.how.value}
    return out


def state_of(document: Mapping[str, Any]) -> SpecimenState:
    """Return the state of a document; entries it does not know are left out.

    Raises
    ------
    FileFormatError
        An entry is not what it should be; the message names it.
    """
    try:
        return _state_in(document)
    except FileFormatError:
        raise
    except GpError as error:
        raise FileFormatError(error.problem, landmark=error.landmark, remedy=error.remedy) from None


def _state_in(document: Mapping[str, Any]) -> SpecimenState:
    head = document.get("headFrame")
    others = _entry(document, "other_labellings", list[dict[str, Any]], [])
    return SpecimenState(
        specimen=_entry(document, "specimen", str, "unnamed"),
        volume=_entry(document, "volume", VolumeReference | None, None),
        import_choices=_entry(document, "import_choices", dict[str, Any], {}),
        threshold=_entry(document, "threshold", float | None, None),
        notes=_entry(document, "notes", str, ""),
        pose_checks=_entry(document, "pose_checks", tuple[PoseCheck, ...], ()),
        touches=_touches_in(_entry(document, "touches", dict[str, dict[str, Any]], {})),
        skull=_entry(document, "skull", dict[str, Position], {}),
        head_frame=None if head is None else record_of(HeadFrame, head, "headFrame", names=_HEAD),
        others=tuple(
            StoredLabelling(**_labelling_in(each, f"other_labellings[{n}].")) for n, each in enumerate(others)
        ),
        **_labelling_in(document, ""),
    )


def _entry(document: Mapping[str, Any], name: str, kind: Any, default: Any, where: str = "") -> Any:
    """Return one entry of a document as a record, or a value where it has none."""
    return record_of(kind, document[name], f"{where}{name}") if name in document else default


def _labelling_in(document: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return what a labelling consists of, the one in work or another."""
    number = document.get("round", 1)
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        raise FileFormatError(f"{where}round must be a whole number from 1, got {number!r:.40}")
    landmarks = _entry(document, "landmarks", dict[str, dict[str, Any]], {}, where)
    return {
        "observer": _entry(document, "observer", str, "", where),
        "round": number,
        "blind": _entry(document, "blind", bool, False, where),
        "landmarks": _landmarks_in(landmarks, f"{where}landmarks"),
        "scan_evidence": _scan_evidence_in(document, where),
        "measurements": _entry(document, "measurements", tuple[Measurement, ...], (), where),
    }


def _landmarks_in(document: Mapping[str, Any], name: str) -> dict[PointKey, Landmark]:
    found: dict[PointKey, Landmark] = {}
    for owner, marks in document.items():
        side = None if owner == BOTH else Side.parse(owner)
        for code, mark in marks.items():
            where = f"{name}.{owner}.{code}"
            key = point_key(side or Side.LEFT, code)
            if (key[0] is None) != (side is None):
                raise FileFormatError(
                    f"{where} is under the wrong key: IN belongs under {BOTH!r}, all else under L or R"
                )
            found[key] = _landmark_in(mark, where)
    return found


def _landmark_in(document: Any, where: str) -> Landmark:
    content = record_of(dict[str, Any], document, where)
    suggested = content.pop("suggestion", None)
    is_placed = content.get("position") is not None
    content |= {"unseen": False} if is_placed else {"checked": False}
    mark = record_of(Landmark, content, where)
    if suggested is None:
        return mark
    suggestion = record_of(Suggestion, suggested, f"{where}.suggestion", names=_SUGGESTION)
    return replace(mark, suggestion=suggestion)


def provenance_of(document: Any, where: str) -> Provenance:
    """Return a saved provenance; raises `GpError`, which calls it `where`."""
    return record_of(Provenance, document, where)


def accepted_ghosts(document: Mapping[str, Any]) -> list[tuple[Side | None, str]]:
    """Return the points that an earlier version placed where they were expected; they are suggestions now."""
    marks = document.get("landmarks", {})
    return [
        (None if owner == BOTH else Side.parse(owner), code)
        for owner, of_side in marks.items()
        for code, mark in of_side.items()
        if "position" in mark and mark.get("provenance", {}).get("how") == How.GHOST.value
    ]


def _touches_in(document: Mapping[str, Any]) -> dict[TouchKey, Touch]:
    return {
        (Side.parse(owner), touch_name(name)): record_of(Touch, touch, f"touches.{owner}.{name}")
        for owner, touches in document.items()
        for name, touch in touches.items()
    }


def _scan_evidence_in(document: Mapping[str, Any], where: str) -> dict[Side, ScanEvidence]:
    name = "bone_distance_mm"
    found = {}
    for owner, content in _entry(document, name, dict[str, Any], {}, where).items():
        try:
            found[Side.parse(owner)] = ScanEvidence.from_json(content)
        except (ValueError, GpError):
            raise FileFormatError(f"{where}{name}.{owner} is unknown: {content!r:.60}") from None
    return found
