"""The state of a specimen as the JSON document that is saved and journalled, and back.

What is unknown or still to do has no entry. Numbers have full precision: Python writes the shortest text that
reads back as the same float.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from gp_core.errors import FileFormatError, GpError
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.measurements import Measurement
from gp_core.landmarks.provenance import Certainty
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.document.frozen_json import thaw
from gp_labeler.document.head_frame import HeadFrame
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
    provenance_json,
)
from gp_labeler.document.touches import Touch, Touches, TouchHow, TouchKey, touch_name
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
T = TypeVar("T")

BOTH = "both"


def document_of(state: SpecimenState) -> Document:
    """Return the document of a state: dicts, lists, text and finite numbers only."""
    document: Document = {
        "specimen": state.specimen,
        "landmarks": _landmarks_out(state.landmarks),
        "notes": state.notes,
        "import_choices": thaw(state.import_choices),
        "pose_checks": [_pose_check_out(check) for check in state.pose_checks],
        "touches": _touches_out(state.touches),
        "skull": {name: list(position) for name, position in state.skull.items()},
    }
    if state.volume is not None:
        document["volume"] = volume_document(state.volume)
    if state.threshold is not None:
        document["threshold"] = state.threshold
    document |= _measurements_out(state.measurements) | _head_out(state.head_frame)
    if evidence := {
        side.value: found.as_json() for side in Side if (found := state.side(side).scan_evidence)
    }:
        document["bone_distance_mm"] = evidence
    return document | _labelling_out(state.observer, state.round, state.blind) | _others_out(state.others)


def _head_out(head: HeadFrame | None) -> Document:
    if head is None:
        return {}
    rows = [list(row) for row in head.matrix]
    out: Document = {"T_head_scan": rows, "foundBy": head.found_by, "pitch": head.pitch, "left": head.left}
    return {"headFrame": out | {"leftConfirmed": head.left_confirmed, "shown": head.shown}}


def _head_in(document: Mapping[str, Any]) -> HeadFrame | None:
    if document.get("headFrame") is None:
        return None
    content = _typed(document["headFrame"], dict, "headFrame")
    rows = _typed(content.get("T_head_scan"), list, "headFrame.T_head_scan")
    matrix = [_typed(row, list, "headFrame.T_head_scan") for row in rows]
    if [len(row) for row in matrix] != [4, 4, 4, 4]:
        raise FileFormatError("headFrame.T_head_scan must be four rows of four numbers")
    numbers = tuple(tuple(_number(x, "headFrame.T_head_scan") for x in row) for row in matrix)
    return HeadFrame(
        numbers,  # type: ignore[arg-type]
        _typed(content.get("foundBy", "hand"), str, "headFrame.foundBy"),
        _typed(content.get("pitch", ""), str, "headFrame.pitch"),
        _typed(content.get("left", ""), str, "headFrame.left"),
        _typed(content.get("leftConfirmed", False), bool, "headFrame.leftConfirmed"),
        _typed(content.get("shown", True), bool, "headFrame.shown"),
    )


def _labelling_out(observer: str, number: int, blind: bool) -> Document:
    """Return who made a labelling; without what is so of the first by nobody in particular."""
    out: Document = {"observer": observer} if observer else {}
    out |= {"round": number} if number != 1 else {}
    return out | ({"blind": True} if blind else {})


def _others_out(others: tuple[StoredLabelling, ...]) -> Document:
    rows = []
    for each in others:
        evidence = {side.value: found.as_json() for side, found in each.scan_evidence.items()}
        row = {**_labelling_out(each.observer, each.round, each.blind), **_evidence_out(evidence)}
        row |= _measurements_out(each.measurements)
        rows.append({**row, "landmarks": _landmarks_out(each.landmarks)})
    return {"other_labellings": rows} if rows else {}


def _measurements_out(measurements: tuple[Measurement, ...]) -> Document:
    rows = [{"name": each.name, "points": [list(point) for point in each.points]} for each in measurements]
    return {"measurements": rows} if rows else {}


def _evidence_out(evidence: Document) -> Document:
    return {"bone_distance_mm": evidence} if evidence else {}


def state_of(document: Mapping[str, Any]) -> SpecimenState:
    """Return the state of a document; entries it does not know are left out.

    Raises
    ------
    FileFormatError
        An entry is not what it should be; the message names it.
    """
    volume = document.get("volume")
    threshold = document.get("threshold")
    checks = _typed(document.get("pose_checks", []), list, "pose_checks")
    try:
        return SpecimenState(
            specimen=_typed(document.get("specimen", "unnamed"), str, "specimen"),
            landmarks=_landmarks_in(_typed(document.get("landmarks", {}), dict, "landmarks")),
            volume=None if volume is None else _volume_in(_typed(volume, dict, "volume")),
            import_choices=_typed(document.get("import_choices", {}), dict, "import_choices"),
            threshold=None if threshold is None else _number(threshold, "threshold"),
            notes=_typed(document.get("notes", ""), str, "notes"),
            pose_checks=tuple(_pose_check_in(c, f"pose_checks[{i}]") for i, c in enumerate(checks)),
            touches=_touches_in(_typed(document.get("touches", {}), dict, "touches")),
            skull=_skull_in(_typed(document.get("skull", {}), dict, "skull")),
            head_frame=_head_in(document),
            scan_evidence=_scan_evidence_in(
                _typed(document.get("bone_distance_mm", {}), dict, "bone_distance_mm")
            ),
            measurements=_measurements_in(document, ""),
            **_labelling_in(document, ""),
            others=tuple(
                _stored_labelling_in(each, f"other_labellings[{i}]")
                for i, each in enumerate(
                    _typed(document.get("other_labellings", []), list, "other_labellings")
                )
            ),
        )
    except FileFormatError:
        raise
    except GpError as error:
        raise FileFormatError(error.problem, landmark=error.landmark, remedy=error.remedy) from None


def _labelling_in(document: Mapping[str, Any], where: str) -> dict[str, Any]:
    number = document.get("round", 1)
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        raise FileFormatError(f"{where}round must be a whole number from 1, got {number!r:.40}")
    observer = _typed(document.get("observer", ""), str, f"{where}observer")
    return {
        "observer": observer,
        "round": number,
        "blind": _typed(document.get("blind", False), bool, f"{where}blind"),
    }


def _stored_labelling_in(document: Any, where: str) -> StoredLabelling:
    content = _typed(document, dict, where)
    evidence = _typed(content.get("bone_distance_mm", {}), dict, f"{where}.bone_distance_mm")
    return StoredLabelling(
        landmarks=_landmarks_in(_typed(content.get("landmarks", {}), dict, f"{where}.landmarks")),
        scan_evidence=_scan_evidence_in(evidence),
        measurements=_measurements_in(content, f"{where}."),
        **_labelling_in(content, f"{where}."),
    )


def _landmarks_out(landmarks: Mapping[PointKey, Landmark]) -> Document:
    out: Document = {}
    for owner in (*Side, None):
        marks = {c: _landmark_out(landmarks[owner, c]) for c in CODES if (owner, c) in landmarks}
        if marks:
            out[BOTH if owner is None else owner.value] = marks
    return out


def _landmark_out(landmark: Landmark) -> Document:
    out: Document = {}
    if landmark.position is not None:
        out["position"] = list(landmark.position)
    if landmark.suggestion is not None:
        out["suggestion"] = _suggestion_out(landmark.suggestion)
    if landmark.provenance is not None:
        out["provenance"] = provenance_json(landmark.provenance)
    if landmark.certainty is not None:
        out["certainty"] = landmark.certainty.value
    out |= {name: True for name in ("unseen", "locked", "checked") if getattr(landmark, name)}
    return out | {name: text for name in ("checked_by", "note") if (text := getattr(landmark, name))}


def _suggestion_out(suggestion: Suggestion) -> Document:
    out: Document = {"position": list(suggestion.position)}
    if suggestion.radius_95 is not None:
        out["radius_95_mm"] = suggestion.radius_95
    if suggestion.atlas_distance is not None:
        out["atlas_distance_mm"] = suggestion.atlas_distance
    if suggestion.doubtful:
        out["doubtful"] = True
    return out | ({"source": suggestion.source} if suggestion.source else {})


def volume_document(volume: VolumeReference) -> Document:
    """Return a reference to a scan as it is saved."""
    out: Document = {"name": volume.name, "size": list(volume.size), "spacing": list(volume.spacing)}
    return out | {name: text for name in ("checksum", "path") if (text := getattr(volume, name))}


def _pose_check_out(check: PoseCheck) -> Document:
    text = {name: getattr(check, name) for name in ("verdict", "by", "time", "note")}
    return {"side": check.side.value, **text, "pose": thaw(check.pose)}


def _touches_out(touches: Touches) -> Document:
    out: Document = {}
    for (side, name), touch in touches.items():
        out.setdefault(side.value, {})[name] = _touch_out(touch)
    return out


def _touch_out(touch: Touch) -> Document:
    out: Document = {"position": list(touch.position), "how": touch.how.value}
    out |= {name: text for name in ("time", "by", "source") if (text := getattr(touch, name))}
    if touch.n_samples > 1:
        out |= {"n_samples": touch.n_samples, "spread_mm": touch.spread_mm}
    if touch.earlier:
        out["earlier"] = [list(place) for place in touch.earlier]
    return out | ({"left_out": True} if touch.left_out else {})


def _landmarks_in(document: Mapping[str, Any]) -> dict[PointKey, Landmark]:
    found: dict[PointKey, Landmark] = {}
    for owner, marks in document.items():
        side = None if owner == BOTH else Side.parse(owner)
        for code, mark in _typed(marks, dict, f"landmarks.{owner}").items():
            where = f"landmarks.{owner}.{code}"
            key = point_key(side or Side.LEFT, code)
            if (key[0] is None) != (side is None):
                raise FileFormatError(
                    f"{where} is under the wrong key: IN belongs under {BOTH!r}, all else under L or R"
                )
            found[key] = _landmark_in(_typed(mark, dict, where), where)
    return found


def _landmark_in(document: Mapping[str, Any], where: str) -> Landmark:
    position, found = document.get("position"), document.get("provenance")
    provenance = None if found is None else provenance_of(found, f"{where}.provenance")
    is_true = {
        n: _typed(document.get(n, False), bool, f"{where}.{n}") for n in ("unseen", "locked", "checked")
    }
    return Landmark(
        position=None if position is None else _triple(position, f"{where}.position"),
        unseen=is_true["unseen"] and position is None,
        locked=is_true["locked"],
        checked=is_true["checked"] and position is not None,
        provenance=provenance,
        suggestion=_suggestion_in(document, where),
        checked_by=_typed(document.get("checked_by", ""), str, f"{where}.checked_by"),
        certainty=_certainty_in(document.get("certainty"), f"{where}.certainty"),
        note=_typed(document.get("note", ""), str, f"{where}.note"),
    )


def _certainty_in(value: Any, where: str) -> Certainty | None:
    return None if value is None else _parsed(Certainty, value, where)


def _suggestion_in(document: Mapping[str, Any], where: str) -> Suggestion | None:
    if "suggestion" not in document:
        return None
    where = f"{where}.suggestion"
    content = _typed(document["suggestion"], dict, where)
    lengths = [
        None if content.get(key) is None else _number(content[key], f"{where}.{key}")
        for key in ("radius_95_mm", "atlas_distance_mm")
    ]
    return Suggestion(
        _triple(content.get("position"), f"{where}.position"),
        lengths[0],
        _typed(content.get("source", ""), str, f"{where}.source"),
        lengths[1],
        _typed(content.get("doubtful", False), bool, f"{where}.doubtful"),
    )


def accepted_ghosts(document: Mapping[str, Any]) -> list[tuple[Side | None, str]]:
    """Return the points that an earlier version placed where they were expected; they are suggestions now."""
    marks = document.get("landmarks", {})
    return [
        (None if owner == BOTH else Side.parse(owner), code)
        for owner, of_side in marks.items()
        for code, mark in of_side.items()
        if "position" in mark and mark.get("provenance", {}).get("how") == How.GHOST.value
    ]


def provenance_of(document: Any, where: str) -> Provenance:
    """Return a saved provenance; raises `FileFormatError`, which calls it `where`."""
    content = _typed(document, dict, where)
    voxel = content.get("voxel_mm")
    return Provenance(
        how=_parsed(How, content.get("how"), f"{where}.how"),
        voxel_mm=None if voxel is None else _triple(voxel, f"{where}.voxel_mm"),
        **{name: _typed(content.get(name, ""), str, f"{where}.{name}") for name in ("time", "by", "source")},
    )


def _volume_in(document: Mapping[str, Any]) -> VolumeReference:
    path = document.get("path")
    i, j, k = (int(n) for n in _triple(document.get("size"), "volume.size"))
    return VolumeReference(
        name=_typed(document.get("name", ""), str, "volume.name"),
        size=(i, j, k),
        spacing=_triple(document.get("spacing"), "volume.spacing"),
        checksum=_typed(document.get("checksum", ""), str, "volume.checksum"),
        path=None if path is None else _typed(path, str, "volume.path"),
    )


def _pose_check_in(document: Any, where: str) -> PoseCheck:
    content = _typed(document, dict, where)
    return PoseCheck(
        side=_parsed(Side.parse, content.get("side"), f"{where}.side"),
        pose=_typed(content.get("pose", {}), dict, f"{where}.pose"),
        **{n: _typed(content.get(n, ""), str, f"{where}.{n}") for n in ("verdict", "by", "time", "note")},
    )


def _touches_in(document: Mapping[str, Any]) -> dict[TouchKey, Touch]:
    found: dict[TouchKey, Touch] = {}
    for owner, touches in document.items():
        side = _parsed(Side.parse, owner, "a side under touches")
        for name, touch in _typed(touches, dict, f"touches.{owner}").items():
            where = f"touches.{owner}.{name}"
            found[side, touch_name(name)] = _touch_in(_typed(touch, dict, where), where)
    return found


def _touch_in(document: Mapping[str, Any], where: str) -> Touch:
    earlier = _typed(document.get("earlier", []), list, f"{where}.earlier")
    return Touch(
        _triple(document.get("position"), f"{where}.position"),
        _parsed(TouchHow, document.get("how"), f"{where}.how"),
        n_samples=int(_number(document.get("n_samples", 1), f"{where}.n_samples")),
        spread_mm=_number(document.get("spread_mm", 0.0), f"{where}.spread_mm"),
        left_out=_typed(document.get("left_out", False), bool, f"{where}.left_out"),
        earlier=tuple(_triple(place, f"{where}.earlier[{i}]") for i, place in enumerate(earlier)),
        **{name: _typed(document.get(name, ""), str, f"{where}.{name}") for name in ("time", "by", "source")},
    )


def _skull_in(document: Mapping[str, Any]) -> dict[str, Position]:
    return {name: _triple(position, f"skull.{name}") for name, position in document.items()}


def _measurements_in(document: Mapping[str, Any], where: str) -> tuple[Measurement, ...]:
    name = f"{where}measurements"
    rows = _typed(document.get("measurements", []), list, name)
    return tuple(_measurement_in(each, f"{name}[{i}]") for i, each in enumerate(rows))


def _measurement_in(document: Any, where: str) -> Measurement:
    content = _typed(document, dict, where)
    points = _typed(content.get("points"), list, f"{where}.points")
    return Measurement(
        _typed(content.get("name"), str, f"{where}.name"),
        tuple(_triple(point, f"{where}.points[{i}]") for i, point in enumerate(points)),
    )


def _scan_evidence_in(document: Mapping[str, Any]) -> dict[Side, ScanEvidence]:
    return {
        Side.parse(owner): _parsed(ScanEvidence.from_json, content, f"bone_distance_mm.{owner}")
        for owner, content in document.items()
    }


def _typed(value: Any, kind: type[T], where: str) -> T:
    if not isinstance(value, kind):
        words = {dict: "an object", list: "a list", str: "text", bool: "true or false"}
        raise FileFormatError(f"{where} must be {words[kind]}, got {value!r:.60}")
    return value


def _parsed(parse: Callable[[Any], T], value: Any, where: str) -> T:
    try:
        return parse(value)
    except (ValueError, GpError):
        raise FileFormatError(f"{where} is unknown: {value!r:.60}") from None


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise FileFormatError(f"{where} must be a number, got {value!r:.60}")
    if not abs(value) <= sys.float_info.max:  # so written, NaN is refused too
        raise FileFormatError(f"{where} must be finite, got {value!r:.20}")
    return float(value)


def _triple(value: Any, where: str) -> Position:
    numbers = _typed(value, list, where)
    if len(numbers) != 3:
        raise FileFormatError(f"{where} must be three numbers, got {value!r:.60}")
    x, y, z = (_number(v, where) for v in numbers)
    return x, y, z
