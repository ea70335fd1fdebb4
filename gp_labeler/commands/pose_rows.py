"""The rows of the menu Estimate: touches, the estimate, how it is looked at, the verdict."""

from __future__ import annotations

from collections.abc import Iterator

from gp_labeler.commands.action import IN_WINDOW, Action, Run, Test
from gp_labeler.commands.conditions import always
from gp_labeler.document import touching
from gp_labeler.models.workspace import Workspace

__all__ = ["pose_rows"]

_METHODS = (
    ("robust", "Method: robust", ("robust",)),
    ("jrmpc", "Method: JRMPC", ("jrmpc",)),
    ("both", "Method: both, side by side", ("robust", "jrmpc")),
)


def _is_touched(workspace: Workspace) -> bool:
    return any(side is workspace.pose.side for side, _ in workspace.document.state.touches)


def _has_target(workspace: Workspace) -> bool:
    return workspace.pose.target is not None


def _has_pose(workspace: Workspace) -> bool:
    estimate = workspace.pose.estimate
    return estimate is not None and estimate.pose is not None


def _is_tracked(workspace: Workspace) -> bool:
    return workspace.tracker.on and workspace.pose.target is not None


def _in_scan(workspace: Workspace) -> bool:
    estimate = workspace.pose.estimate
    return workspace.scan.volume is not None and estimate is not None and estimate.in_scan() is not None


def _has_method(methods: tuple[str, ...]) -> Test:
    return lambda workspace: workspace.pose.settings.methods == methods


def _set_method(methods: tuple[str, ...]) -> Run:
    return lambda workspace: workspace.pose.choose(methods=methods)


def _window_is_touched(workspace: Workspace) -> bool:
    return workspace.pose.settings.round_window == "touched"


def _toggle_window(workspace: Workspace) -> None:
    workspace.pose.choose(round_window="expected" if _window_is_touched(workspace) else "touched")


def _toggle_touching(workspace: Workspace) -> None:
    workspace.interaction.set_tool("look" if workspace.interaction.tool == "touch" else "touch")


def _toggle_overlay(workspace: Workspace) -> None:
    workspace.pose.draw(visible=not workspace.pose.overlay.visible)


# fmt: off
def pose_rows() -> Iterator[Action]:
    """Return the commands of the menu Estimate."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run | None, enabled: Test = always, *,
            checked: Test | None = None, group: str = "", hint: str = "", icon: str = "") -> Action:
        return Action(f"pose.{id}", "Estimate", title, keys, run, enabled, checked, hint, group, icon)

    yield row("open_touches", "Open touches…", ("Ctrl+Shift+I",), IN_WINDOW,
              hint="Touches of a probe from a file: .dat, .csv, .mrk.json, .fcsv", group="touches",
              icon="import")
    yield row("touch", "Touch on the scan", ("I",), _toggle_touching, lambda w: w.scan.volume is not None,
              checked=lambda w: w.interaction.tool == "touch", group="touches",
              hint="Dry run: a click on bone or on a slice records the requested feature")
    yield row("skip", "Skip this feature", ("Shift+N",), lambda w: w.pose.skip(), _has_target,
              hint="It is requested again after the others", group="touches", icon="skip")
    yield row("clear", "Clear touches", (),
              lambda w: touching.clear_touches(w.document, w.pose.side), _is_touched,
              hint="Removes all touches of this side; undo restores them", group="touches")
    yield row("open_skull", "Skull features on the scan…", (), IN_WINDOW,
              hint="Landmark file with the skull features, to register touches to the scan", group="touches")
    yield row("other_side", "Other side", ("Shift+Q",), lambda w: w.pose.choose(side=w.pose.side.other),
              group="estimate")
    for name, title, methods in _METHODS:
        yield row(name, title, (), _set_method(methods), checked=_has_method(methods), group="estimate")
    yield row("touched_window", "Robot's y to the touched round window", (), _toggle_window,
              checked=_window_is_touched, group="estimate",
              hint="When off, y points to the round window predicted by the atlas: better for rough touches")
    yield row("overlay", "Show the estimate over bone and slices", ("Y",), _toggle_overlay,
              checked=lambda w: w.pose.overlay.visible, group="look", icon="eye")
    yield row("along_axis", "Look along the axis", ("A",), IN_WINDOW, _in_scan,
              hint="Looking at the apex from outside, round window up", group="look")
    yield row("through_window", "Look through the round window", ("Shift+A",),
              IN_WINDOW, _in_scan, group="look")
    yield row("tracker", "Tracked probe…", (), IN_WINDOW, group="tracker",
              hint="Connect a tracker over OpenIGTLink, calibrate the tip, send the pose")
    yield row("record", "Record a touch", ("J",), lambda w: w.tracker.press(), _is_tracked,
              hint="While the tip rests on the requested feature", group="tracker")
    yield row("guide", "Guided touching", ("F9",), IN_WINDOW, group="tracker",
              hint="One feature at a time, in large letters", icon="play")
    yield row("export", "Export the pose…", ("Ctrl+Shift+E",), IN_WINDOW, _has_pose,
              hint="JSON, ITK or Slicer transform, 4 x 4 matrix, or markups", group="out", icon="export")
    yield row("report", "Report…", (), IN_WINDOW, _has_pose,
              hint="One page with touches, estimate, errors and pictures (PDF or HTML)", group="out")
    yield row("path", "Insertion path…", (), IN_WINDOW,
              hint="Transform a curve from the cochlea frame to the estimated pose", group="out")
    yield row("save_path", "Save the transformed path…", (), IN_WINDOW,
              lambda w: _has_pose(w) and w.pose.path is not None,
              hint="In the frame of the touches, for a robot", group="out")
    yield row("physical", "Test against the scan…", (), IN_WINDOW,
              lambda w: _has_pose(w) and bool(w.document.state.skull),
              hint="The paper's physical test: compare a touched skull with its labelled scan",
              group="out")
    yield row("accept", "Accept the estimate", (), IN_WINDOW, _has_pose,
              hint="Stores the verdict in the specimen", group="verdict", icon="check")
    yield row("reject", "Reject the estimate", (), IN_WINDOW, _has_pose, group="verdict")
