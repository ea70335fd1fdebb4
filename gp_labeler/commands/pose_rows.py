"""The rows of the menu Estimate: touches, the estimate, how it is looked at, the verdict."""

from __future__ import annotations

from collections.abc import Iterator

from gp_labeler.commands.action import Action, Run, Test, Ui
from gp_labeler.document import touching
from gp_labeler.models.workspace import Workbench

__all__ = ["pose_rows"]

_METHODS = (
    ("robust", "Method: robust", ("robust",)),
    ("jrmpc", "Method: JRMPC", ("jrmpc",)),
    ("both", "Method: both, side by side", ("robust", "jrmpc")),
)


def _always(desk: Workbench) -> bool:
    return True


def _is_touched(desk: Workbench) -> bool:
    return any(side is desk.pose.side for side, _ in desk.session.state.touches)


def _has_target(desk: Workbench) -> bool:
    return desk.pose.target is not None


def _has_pose(desk: Workbench) -> bool:
    estimate = desk.pose.estimate
    return estimate is not None and estimate.pose is not None


def _is_tracked(desk: Workbench) -> bool:
    return desk.tracker.on and desk.pose.target is not None


def _in_scan(desk: Workbench) -> bool:
    estimate = desk.pose.estimate
    return desk.volume is not None and estimate is not None and estimate.in_scan() is not None


def _has_method(methods: tuple[str, ...]) -> Test:
    return lambda desk: desk.pose.estimating.settings.methods == methods


def _set_method(methods: tuple[str, ...]) -> Run:
    return lambda desk, ui: desk.pose.choose(methods=methods)


def _window_is_touched(desk: Workbench) -> bool:
    return desk.pose.estimating.settings.round_window == "touched"


def _toggle_window(desk: Workbench, ui: Ui) -> None:
    desk.pose.choose(round_window="expected" if _window_is_touched(desk) else "touched")


def _toggle_touching(desk: Workbench, ui: Ui) -> None:
    desk.set_tool("look" if desk.tool == "touch" else "touch")


def _toggle_overlay(desk: Workbench, ui: Ui) -> None:
    desk.pose.draw(visible=not desk.pose.overlay.visible)


def _judge(verdict: str) -> Run:
    return lambda desk, ui: ui.judge_pose(verdict)


# fmt: off
def pose_rows() -> Iterator[Action]:
    """Return the commands of the menu Estimate."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run, enabled: Test = _always, *,
            checked: Test | None = None, group: str = "", hint: str = "", icon: str = "") -> Action:
        return Action(f"pose.{id}", "Estimate", title, keys, run, enabled, checked, hint, group, icon)

    yield row("open_touches", "Open touches…", ("Ctrl+Shift+I",), lambda d, ui: ui.ask_open_touches(),
              hint="What was touched with the probe: .dat, .csv, .mrk.json, .fcsv", group="touches",
              icon="import")
    yield row("touch", "Touch on the scan", ("I",), _toggle_touching, lambda d: d.volume is not None,
              checked=lambda d: d.tool == "touch", group="touches",
              hint="A dry run: a click on bone or a slice touches the feature asked for")
    yield row("skip", "Skip this feature", ("Shift+N",), lambda d, ui: d.pose.skip(), _has_target,
              hint="It is asked for again after the others", group="touches", icon="skip")
    yield row("clear", "Clear touches", (),
              lambda d, ui: touching.clear_touches(d.session, d.pose.side), _is_touched,
              hint="Of this side; undo brings them back", group="touches")
    yield row("open_skull", "Skull features on the scan…", (), lambda d, ui: ui.ask_open_skull(),
              hint="A landmark file that says where they are, to register the touches by", group="touches")
    yield row("other_side", "Other side", ("Shift+Q",), lambda d, ui: d.pose.choose(side=d.pose.side.other),
              group="estimate")
    for name, title, methods in _METHODS:
        yield row(name, title, (), _set_method(methods), checked=_has_method(methods), group="estimate")
    yield row("touched_window", "Robot's y to the touched round window", (), _toggle_window,
              checked=_window_is_touched, group="estimate",
              hint="Unticked: to the round window that the atlas expects, better where touches are rough")
    yield row("overlay", "Estimate over bone and slices", ("Y",), _toggle_overlay,
              checked=lambda d: d.pose.overlay.visible, group="look", icon="eye")
    yield row("along_axis", "Look along the axis", ("A",), lambda d, ui: ui.look_along_axis(), _in_scan,
              hint="From without the apex, the round window up", group="look")
    yield row("through_window", "Look through the round window", ("Shift+A",),
              lambda d, ui: ui.look_through_window(), _in_scan, group="look")
    yield row("tracker", "Tracked probe…", (), lambda d, ui: ui.show_tracker(), group="tracker",
              hint="Connect a tracker over OpenIGTLink, find the probe's tip, send the pose back")
    yield row("record", "Record a touch", ("J",), lambda d, ui: d.tracker.press(), _is_tracked,
              hint="With the tip held still on the feature asked for", group="tracker")
    yield row("guide", "Guided touching", ("F9",), lambda d, ui: ui.show_guide(), group="tracker",
              hint="One feature after the other, in large letters", icon="play")
    yield row("export", "Export the pose…", ("Ctrl+Shift+E",), lambda d, ui: ui.ask_export_pose(), _has_pose,
              hint="JSON, ITK and Slicer transform, 4 x 4 table, markups", group="out", icon="export")
    yield row("report", "Report…", (), lambda d, ui: ui.ask_report(), _has_pose,
              hint="One page with touches, estimate, errors and pictures, PDF or HTML", group="out")
    yield row("path", "Insertion path…", (), lambda d, ui: ui.ask_path(),
              hint="A curve in the cochlea frame, carried to the estimate", group="out")
    yield row("save_path", "Save the carried path…", (), lambda d, ui: ui.ask_save_path(),
              lambda d: _has_pose(d) and d.pose.path is not None,
              hint="In the frame of the touches, for a robot", group="out")
    yield row("physical", "Test against the scan…", (), lambda d, ui: ui.show_physical(),
              lambda d: _has_pose(d) and bool(d.session.state.skull),
              hint="The paper's physical test: a touched skull held against its own labelled scan",
              group="out")
    yield row("accept", "Accept the estimate", (), _judge("accept"), _has_pose,
              hint="Keeps the verdict in the specimen", group="verdict", icon="check")
    yield row("reject", "Reject the estimate", (), _judge("reject"), _has_pose, group="verdict")
