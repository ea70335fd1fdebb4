"""What of a workspace is drawn in every view: marks, ghosts and lines, before a view makes pixels of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gp_core.atlas.label_check import HEAD_MM
from gp_core.constants import CHI2_3_95
from gp_core.landmarks.features import CODES, Side, feature
from gp_core.landmarks.sets import LandmarkSet
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import FloatArray
from gp_labeler.models.workflow import PointState
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.colours import SceneColours
from gp_labeler.scene.ghosts import GhostEllipsoid
from gp_labeler.scene.marks import FREE_POINT, OTHER, REFERENCE, Mark
from gp_labeler.scene.segments import Segment

__all__ = [
    "drawn_free_points",
    "drawn_ghosts",
    "drawn_marks",
    "drawn_references",
    "drawn_segments",
    "key_of",
    "point_of",
]

_BEYOND_MM = 1.0
"""The modiolar axis is drawn this much longer at each end."""

_MARK_STATES: Mapping[PointState, str] = {
    PointState.COMPUTED: "computed",
    PointState.DOUBTFUL: "doubtful",
    PointState.SUGGESTED: "suggested",
}


def key_of(side: Side, code: str) -> str:
    """Return the key of a point among marks and ghosts."""
    return f"{side.value}:{code}"


def point_of(key: str) -> tuple[Side, str]:
    """Return the point that a key is of."""
    side, code = key.split(":")
    return Side(side), code


def drawn_marks(workspace: Workspace) -> list[Mark]:
    """Return the placed and suggested points of both sides; a shared one once, on the side worked on.

    Under an estimate they stand without their names, but for the active one: forty names would hide it.
    """
    drag, marks, document, labels = workspace.interaction.drag, [], workspace.document, workspace.labels
    named = not workspace.pose.overlay.visible
    active = labels.active
    for side in (active.side.other, active.side):
        landmarks, states = document.landmarks(side), labels.point_states(side, wait=False)
        for code in CODES:
            where = _shown_at(landmarks, code)
            if where is None or (feature(code).shared and side is not active.side):
                continue
            dragged = drag is not None and (drag.side, drag.code) == (side, code)
            position = drag.position if drag is not None and dragged else where
            state = _MARK_STATES.get(states[code], "placed" if side is active.side else OTHER)
            is_active = dragged or (side, code) == (active.side, active.code)
            name = code if named or is_active else ""
            marks.append(Mark(key_of(side, code), position, name, state, is_active))
    return marks


def drawn_references(workspace: Workspace) -> list[Mark]:
    """Return the reference points inside the scan: no landmarks, so they are never picked."""
    points, volume = workspace.references.points, workspace.scan.volume
    if not points or volume is None:
        return []
    inside = volume.contains(np.array([point.position for point in points]))
    return [
        Mark(f"reference:{n}", point.position, point.name, REFERENCE)
        for n, point in enumerate(points)
        if inside[n]
    ]


def drawn_free_points(workspace: Workspace) -> list[Mark]:
    """Return the points that were marked to straighten the head by: midline, left and right."""
    points = workspace.head.points
    return [Mark(f"free point:{name}", np.array(at), name, FREE_POINT) for name, at in points.items()]


def _shown_at(landmarks: LandmarkSet, code: str) -> FloatArray | None:
    if code in landmarks:
        return landmarks[code]
    suggestion = landmarks.suggested.get(code)
    return None if suggestion is None else np.array(suggestion.position)


def drawn_ghosts(workspace: Workspace) -> list[GhostEllipsoid]:
    """Return where the active point is expected: to do, suggested, or doubtful where it was placed."""
    document, labels = workspace.document, workspace.labels
    side, code = labels.active.side, labels.active.code
    if code is None or not workspace.view.state.ghosts_visible:
        return []
    ghost = labels.ghosts(side).get(code)
    problem = labels.known_problems(side).get(code)
    if problem is not None and labels.point_states(side, wait=False)[code] is PointState.DOUBTFUL:
        away = problem.deviation_of(code)
        if away is None or away.distance > HEAD_MM:  # such a place would mean nothing
            return []
        return [GhostEllipsoid(key_of(side, code), away.expected, away.covariance, f"{code}?", active=True)]
    suggestion = document.landmarks(side).suggested.get(code)
    if suggestion is not None and suggestion.radius_95 is not None:
        return [_region(key_of(side, code), suggestion, suggestion.radius_95)]
    if ghost is None:
        return []
    return [GhostEllipsoid(key_of(side, code), ghost.position, ghost.covariance, f"{code}?", active=True)]


def _region(key: str, suggestion: Suggestion, radius_95: float) -> GhostEllipsoid:
    """Return where a suggested point lies with 95 %; the point itself is a mark and bears the name."""
    covariance = radius_95**2 / CHI2_3_95 * np.eye(3)
    return GhostEllipsoid(key, np.array(suggestion.position), covariance, "", active=True)


def drawn_segments(workspace: Workspace, colours: SceneColours) -> list[Segment]:
    """Return the modiolar axis, the line across the round window and the one that joins them, each side."""
    document = workspace.document
    if not workspace.view.state.axis_visible:
        return []
    return [line for side in Side for line in _lines(document.landmarks(side), colours.states["computed"])]


def _lines(landmarks: LandmarkSet, colour: str) -> list[Segment]:
    found = []
    if "CA" in landmarks and "CB" in landmarks:
        base, apex = landmarks["CB"], landmarks["CA"]
        beyond = _BEYOND_MM * _unit(apex - base)
        found.append(Segment(base - beyond, apex + beyond, colour, 2.5))
    if "RWA" in landmarks and "RWP" in landmarks:
        found.append(Segment(landmarks["RWA"], landmarks["RWP"], colour, 2.5))
        if "CO" in landmarks:
            middle = (landmarks["RWA"] + landmarks["RWP"]) / 2
            found.append(Segment(landmarks["CO"], middle, colour, 1.5))
    return found


def _unit(vector: FloatArray) -> FloatArray:
    unit: FloatArray = vector / max(float(np.linalg.norm(vector)), 1e-9)
    return unit
