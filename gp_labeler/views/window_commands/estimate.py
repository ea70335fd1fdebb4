"""What the menu Estimate asks and shows: files, dialogs, the guide, where the camera looks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from qtpy.QtCore import Qt
from qtpy.QtGui import QGuiApplication

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.pose.insertion_path import UNITS
from gp_labeler.document import touching
from gp_labeler.models.pose_exports import FORMATS, InsertionPath
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.pose_camera import CameraPlacement, along_axis, place_camera, through_round_window
from gp_labeler.scene.pose_data import DrawnPose
from gp_labeler.views.guide import GuideWindow
from gp_labeler.views.panels.pose.physical_dialog import PhysicalDialog
from gp_labeler.views.panels.tracker.dialog import TrackerDialog
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.report_file import report_of, reported_estimate, save_report
from gp_labeler.views.window_commands.command import Asking, WindowCommand
from gp_labeler.views.window_commands.file import POINTS

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["ESTIMATE_COMMANDS", "ask_path", "ask_report"]

_TOUCHES = "Touches (*.dat *.csv *.mrk.json *.fcsv *.json *.txt);;All files (*)"
_WHICH_AXES = "Which axes of the path are x (modiolar axis, towards the apex), y (round window), z"
_AROUND_MM = 14.0
_PATHS = "Insertion path (*.csv *.txt);;All files (*)"


# Touches


def ask_open_touches(window: MainWindow) -> None:
    """Ask for a file of touches, and take them."""
    window.set_step("pose")
    for path in window.prompts.open_files("Open touches", _TOUCHES):
        window.take_touches(path)


def ask_open_skull(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for a landmark file that says where the skull features are on the scan."""
    for path in prompts.open_files("Skull features on the scan", POINTS):
        names = touching.load_skull(workspace.document, path)
        workspace.say(f"Read {' '.join(names)} from {path.name}")


def show_tracker(window: MainWindow) -> None:
    """Show the settings of the tracked probe."""
    display = window.tracker_display
    dialog = TrackerDialog(window.workspace, window.memory, window)
    dialog.audible.setChecked(display.audible)
    dialog.audible.toggled.connect(partial(_set_audible, window))
    dialog.show()


def _set_audible(window: MainWindow, audible: bool) -> None:
    window.tracker_display.audible = audible
    window.memory.set(audible=audible)


def show_guide(window: MainWindow) -> None:
    """Lead through the features to touch, on the whole screen."""
    guide = GuideWindow(window.workspace, window)
    guide.settings_asked.connect(partial(show_tracker, window))
    guide.showFullScreen()


# What leaves


def ask_export_pose(workspace: Workspace, prompts: Prompts) -> None:
    """Ask where, and write the pose in the format that the name asks for."""
    kinds = ";;".join(f"{what} (*{suffix})" for suffix, what in FORMATS.items())
    path = prompts.save_file("Export the pose", _proposed(workspace, "pose.json"), kinds)
    if path is not None:
        workspace.pose.export(path)


def ask_report(window: MainWindow) -> None:
    """Ask where, and write the one-page report."""
    workspace = window.workspace
    reported_estimate(workspace)
    kinds = "PDF (*.pdf);;HTML (*.html)"
    path = window.prompts.save_file("Save the report", _proposed(workspace, "report.pdf"), kinds)
    if path is None:
        return
    QGuiApplication.setOverrideCursor(Qt.CursorShape.WaitCursor)  # pictures take a second or more
    try:
        save_report(report_of(window), path)
    finally:
        QGuiApplication.restoreOverrideCursor()
    workspace.say(f"Wrote {path.name}")
    workspace.messages.wrote.emit("report", path)


def ask_save_path(workspace: Workspace, prompts: Prompts) -> None:
    """Ask where, and write the carried path in the frame of the touches."""
    name = _proposed(workspace, "path.csv")
    file = prompts.save_file("Save the path for the robot", name, "CSV (*.csv)")
    if file is not None:
        workspace.pose.save_path(file)


def _proposed(workspace: Workspace, name: str) -> str:
    return f"{workspace.document.state.specimen}_{workspace.pose.side.value}_{name}"


def show_physical(window: MainWindow) -> None:
    """Compare touches with the labelled scan of the same skull."""
    PhysicalDialog(window.workspace, window.prompts, window).open()


# The insertion path


def ask_path(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for an insertion path with its units and side, and carry it to the estimate."""
    for path in prompts.open_files("Insertion path in the cochlea frame", _PATHS):
        units = prompts.item("Insertion path", "Unit of the path", list(UNITS))
        side = prompts.item("Insertion path", "Side of the path", [s.word for s in Side])
        if units and side:
            carried = _read_path(prompts, path, Side.parse(side[0].upper()), units)
            if carried is not None:
                workspace.pose.carry(carried)
                workspace.say(f"Transformed {path.name}, {len(carried.points)} points")


def _read_path(prompts: Prompts, file: Path, side: Side, units: str) -> InsertionPath | None:
    """Read a path; ask what its axes are, and whether all of it is path, where that is not clear."""
    read = InsertionPath.readings(file, side, units=units)
    axes = next(iter(read))
    if len(read) > 1:
        axes = prompts.item("Insertion path", _WHICH_AXES, list(read))
    path = read.get(axes)
    n = None if path is None else path.n_before_centre
    if path is None or n is None:
        return path
    first, whole = f"The first {n}", f"All {len(path.points)}"
    text = f"Row {n + 1} is CO itself, which cannot be part of a path. Which rows are the path?"
    answer = prompts.choose("Insertion path", text, [first, whole])
    return {first: path.first(n), whole: path}.get(answer)


# Looking at the estimate


def look_at_pose(window: MainWindow, placement: Callable[[DrawnPose], CameraPlacement]) -> None:
    """Look at the estimated cochlea from where `placement` puts the camera."""
    view, estimate = window.workspace.view, window.workspace.pose.estimate
    if estimate is None or estimate.pose is None or estimate.registered is None:
        raise GpError(
            "no estimate is registered to the scan yet", remedy="Touch features, and register them."
        )
    scene_view = window.grid.scene_view
    pose = DrawnPose.of(estimate.pose, estimate.registered.T_scan_touches, label="")
    view.show_point(pose.origin)
    place_camera(scene_view.scene.camera, placement(pose))
    scene_view.redraw()
    for slices in window.grid.slice_views.values():
        slices.zoom_to(pose.origin, _AROUND_MM)  # else its region is but a speck there


ESTIMATE_COMMANDS: Mapping[str, WindowCommand] = MappingProxyType(
    {
        "pose.open_touches": ask_open_touches,
        "pose.open_skull": Asking(ask_open_skull),
        "pose.tracker": show_tracker,
        "pose.guide": show_guide,
        "pose.along_axis": partial(look_at_pose, placement=along_axis),
        "pose.through_window": partial(look_at_pose, placement=through_round_window),
        "pose.export": Asking(ask_export_pose),
        "pose.report": ask_report,
        "pose.path": Asking(ask_path),
        "pose.save_path": Asking(ask_save_path),
        "pose.physical": show_physical,
        "pose.accept": lambda window: window.judge_pose("accept"),
        "pose.reject": lambda window: window.judge_pose("reject"),
    }
)
