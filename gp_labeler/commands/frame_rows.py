"""The rows of the menu View about planes: straightening the head, and planes along the anatomy."""

from __future__ import annotations

from collections.abc import Iterator

from gp_labeler.commands.action import IN_WINDOW, Action, Run, Test
from gp_labeler.commands.conditions import has_scan
from gp_labeler.models.anatomical_planes import FEATURE_PLANES
from gp_labeler.models.workspace import Workspace

__all__ = ["frame_rows"]

_PLANES = (
    ("along", "Slices along the modiolar axis", "4"),
    ("across", "Slices across the modiolar axis", "6"),
    ("round window", "Slices through the round window", "8"),
    ("footplate", "Slices through the footplate", "9"),
)


def _has_head(workspace: Workspace) -> bool:
    return has_scan(workspace) and workspace.head.frame is not None


def _has_points(workspace: Workspace) -> bool:
    return has_scan(workspace) and bool(workspace.head.points)


def _can_straighten(workspace: Workspace) -> bool:
    return has_scan(workspace) and not workspace.head.is_running


def _can_take_planes(workspace: Workspace) -> bool:
    return has_scan(workspace) and not workspace.view.shows_anatomy


def _is_turned(workspace: Workspace) -> bool:
    return has_scan(workspace) and workspace.view.planes_are_turned


def _mark(name: str) -> Run:
    return lambda workspace: workspace.head.mark_point(name)


def _show(kind: str) -> Run:
    return lambda workspace: workspace.planes.show(kind)


def _can_show(kind: str) -> Test:
    return lambda workspace: has_scan(workspace) and workspace.planes.can_show(kind)


def _can_show_for_feature(workspace: Workspace) -> bool:
    code = workspace.labels.active.code
    kind = FEATURE_PLANES.get(code or "")
    return has_scan(workspace) and code is not None and (kind is None or workspace.planes.can_show(kind))


def _show_for_feature(workspace: Workspace) -> None:
    code = workspace.labels.active.code
    if code is not None:
        workspace.planes.show_for(code)


def _turn_by_hand(workspace: Workspace) -> None:
    interaction = workspace.interaction
    if interaction.tool == "turn":
        interaction.leave_turning()
    else:
        workspace.planes.straighten()  # what is turned are the planes of the frame
        interaction.set_tool("turn")


# fmt: off
def frame_rows() -> Iterator[Action]:
    """Return the commands of the menu View that turn the planes of the slices."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run | None, enabled: Test = has_scan, *,
            checked: Test | None = None, hint: str = "", group: str = "head") -> Action:
        return Action(id, "View", title, keys, run, enabled, checked, hint, group)

    yield row("head.straighten", "Straighten the head", ("Ctrl+H",), lambda w: w.head.straighten(),
              _can_straighten, hint="Align the views with the head, found by the symmetry of its bone")
    yield row("head.like", "Straighten like another head…", (), IN_WINDOW, _can_straighten,
              hint="Front, up and pitch are taken from a saved specimen of the same species")
    yield row("head.by_landmarks", "Straighten by the placed landmarks", (),
              lambda w: w.head.straighten_by_landmarks(), _can_straighten,
              hint="Uses IN and a pair such as OI, or two pairs; refined by the symmetry of the bone")
    yield row("head.midline", "Mark the midline at the crosshair", (), _mark("midline"),
              hint="One of the three points that define the frame of the head")
    yield row("head.left", "Mark the left of a pair at the crosshair", (), _mark("left"),
              hint="The same anatomical point on both sides, such as the edge of the ear canal")
    yield row("head.right", "Mark the right of a pair at the crosshair", (), _mark("right"),
              hint="When all three points are set, the head is straightened")
    yield row("head.forget_points", "Remove the marked points", (), lambda w: w.head.forget_points(),
              _has_points, hint="Forgets the points marked on the midline, left and right")
    yield row("head.by_hand", "Turn the head by hand", ("Ctrl+Shift+H",), _turn_by_hand,
              checked=lambda w: w.interaction.tool == "turn",
              hint="Drag on a slice to rotate the head: pitch in the sagittal, roll in the coronal, "
                   "yaw in the axial view")
    yield row("head.take_planes", "Use these planes as the head frame", (),
              lambda w: w.head.take_planes(), _can_take_planes,
              hint="After you have dragged the arms of the crosshair")
    yield row("head.take_mid_plane", "Move the mid-plane to the crosshair", (),
              lambda w: w.head.take_mid_plane(), _has_head)
    yield row("head.confirm_left", "Confirm that left is correct", (), lambda w: w.head.confirm_left(),
              lambda w: _has_head(w) and w.head.asks_left,
              hint="A scan cannot prove which side is left: check it against a mark on the animal")
    yield row("head.left_is_right", "Left and right are exchanged in this scan…", (),
              IN_WINDOW, _has_head,
              hint="Reload the scan with the order of its slices reversed")
    yield row("head.forget", "Remove the head frame", (), lambda w: w.head.forget(), _has_head)
    yield row("view.frame", "Views in the head frame", ("Shift+F",), lambda w: w.head.show(),
              _has_head, checked=lambda w: w.head.is_shown, group="planes",
              hint="When off, views follow the axes of the scan. Positions are always in the scan frame")
    yield row("view.straight_planes", "Reset the planes", ("0",),
              lambda w: w.planes.straighten(), _is_turned, group="planes")
    for kind, title, key in _PLANES:
        yield row(f"view.plane_{kind.replace(' ', '_')}", title, (key,), _show(kind), _can_show(kind),
                  group="planes", hint="For the current side, as labelled, predicted or estimated")
    yield row("view.plane_of_feature", "Plane in which the feature is defined", ("2",), _show_for_feature,
              _can_show_for_feature, group="planes",
              hint="Needs the features that define the plane, or three others that predict them")
# fmt: on
