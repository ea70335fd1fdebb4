"""The rows of the menu View about planes: straightening the head, and planes along the anatomy."""

from __future__ import annotations

from collections.abc import Iterator

from gp_labeler.commands.action import Action, Run, Test, Ui
from gp_labeler.models.anatomical_planes import FEATURE_PLANES
from gp_labeler.models.workspace import Workspace

__all__ = ["frame_rows"]

_PLANES = (
    ("along", "Slices along the modiolar axis", "4"),
    ("across", "Slices across the modiolar axis", "6"),
    ("round window", "Slices through the round window", "8"),
    ("footplate", "Slices through the footplate", "9"),
)


def _has_scan(workspace: Workspace) -> bool:
    return workspace.scan.volume is not None


def _has_head(workspace: Workspace) -> bool:
    return _has_scan(workspace) and workspace.head.frame is not None


def _has_points(workspace: Workspace) -> bool:
    return _has_scan(workspace) and bool(workspace.head.points)


def _can_straighten(workspace: Workspace) -> bool:
    return _has_scan(workspace) and not workspace.head.is_running


def _can_take_planes(workspace: Workspace) -> bool:
    return _has_scan(workspace) and not workspace.view.shows_anatomy


def _is_turned(workspace: Workspace) -> bool:
    return _has_scan(workspace) and workspace.view.planes_are_turned


def _mark(name: str) -> Run:
    return lambda workspace, ui: workspace.head.mark_point(name)


def _show(kind: str) -> Run:
    return lambda workspace, ui: ui.look_closely(workspace.planes.show(kind))


def _can_show(kind: str) -> Test:
    return lambda workspace: _has_scan(workspace) and workspace.planes.can_show(kind)


def _can_show_for_feature(workspace: Workspace) -> bool:
    code = workspace.labels.active.code
    kind = FEATURE_PLANES.get(code or "")
    return _has_scan(workspace) and code is not None and (kind is None or workspace.planes.can_show(kind))


def _show_for_feature(workspace: Workspace, ui: Ui) -> None:
    code = workspace.labels.active.code
    if code is not None:
        ui.look_closely(workspace.planes.show_for(code))


def _turn_by_hand(workspace: Workspace, ui: Ui) -> None:
    interaction = workspace.interaction
    if interaction.tool == "turn":
        interaction.leave_turning()
    else:
        workspace.planes.straighten()  # what is turned are the planes of the frame
        interaction.set_tool("turn")


# fmt: off
def frame_rows() -> Iterator[Action]:
    """Return the commands of the menu View that turn the planes of the slices."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run, enabled: Test = _has_scan, *,
            checked: Test | None = None, hint: str = "", group: str = "head") -> Action:
        return Action(id, "View", title, keys, run, enabled, checked, hint, group)

    yield row("head.straighten", "Straighten the head", ("Ctrl+H",), lambda w, ui: w.head.straighten(),
              _can_straighten, hint="Find how the head lies in its scan, from the symmetry of its bone")
    yield row("head.by_landmarks", "Straighten by the placed landmarks", (),
              lambda w, ui: w.head.straighten_by_landmarks(), _can_straighten,
              hint="By IN and a pair such as OI, or two pairs; then refined by the symmetry of the bone")
    yield row("head.midline", "Straighten: the crosshair is on the midline", (), _mark("midline"),
              hint="One of three points from which the head can be straightened")
    yield row("head.left", "Straighten: the crosshair is on the left of a pair", (), _mark("left"),
              hint="The same place on both sides, such as the edge of the ear canal")
    yield row("head.right", "Straighten: the crosshair is on the right of a pair", (), _mark("right"),
              hint="Once all three points are there, the head is straightened")
    yield row("head.forget_points", "Take the marked points away", (), lambda w, ui: w.head.forget_points(),
              _has_points, hint="Midline, left and right: no head is straightened by them")
    yield row("head.by_hand", "Turn the head by hand", ("Ctrl+Shift+H",), _turn_by_hand,
              checked=lambda w: w.interaction.tool == "turn",
              hint="Drag over a slice: the head turns about the crosshair; in the sagittal slice, its pitch")
    yield row("head.take_planes", "Take these planes for those of the head", (),
              lambda w, ui: w.head.take_planes(), _can_take_planes,
              hint="After the arms of the crosshair were dragged")
    yield row("head.take_mid_plane", "Let the mid-plane go through the crosshair", (),
              lambda w, ui: w.head.take_mid_plane(), _has_head)
    yield row("head.confirm_left", "Left is left, as the file says", (), lambda w, ui: w.head.confirm_left(),
              lambda w: _has_head(w) and w.head.asks_left,
              hint="Nothing in a scan tells left from right: check it against a mark on the animal")
    yield row("head.left_is_right", "Left and right are exchanged in this scan…", (),
              lambda w, ui: ui.ask_reopen_mirrored(), _has_head,
              hint="Read it again with the order of its slices reversed")
    yield row("head.forget", "Forget how the head lies", (), lambda w, ui: w.head.forget(), _has_head)
    yield row("view.frame", "Views in the frame of the head", ("Shift+F",), lambda w, ui: w.head.show(),
              _has_head, checked=lambda w: w.head.is_shown, group="planes",
              hint="Off: in the axes of the scan. Positions are those of the scan in both")
    yield row("view.straight_planes", "Straight planes again", ("0",),
              lambda w, ui: w.planes.straighten(), _is_turned, group="planes")
    for kind, title, key in _PLANES:
        yield row(f"view.plane_{kind.replace(' ', '_')}", title, (key,), _show(kind), _can_show(kind),
                  group="planes", hint="Of the side that is worked on: as labelled, expected or estimated")
    yield row("view.plane_of_feature", "The plane in which the feature is defined", ("2",), _show_for_feature,
              _can_show_for_feature, group="planes",
              hint="Needs the features that it goes through, or three others from which they are expected")
# fmt: on
