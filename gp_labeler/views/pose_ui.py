"""What actions of the menu Estimate ask of the window: files, dialogs, the guide, where the camera looks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from qtpy.QtCore import Qt
from qtpy.QtGui import QGuiApplication

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.pose.insertion_path import UNITS
from gp_labeler.document import touching
from gp_labeler.models.pose_exports import FORMATS, InsertionPath
from gp_labeler.scene.pose_camera import CameraPlacement, along_axis, place_camera, through_round_window
from gp_labeler.scene.pose_data import DrawnPose
from gp_labeler.views.guide import GuideWindow
from gp_labeler.views.panels.pose.physical_dialog import PhysicalDialog
from gp_labeler.views.panels.tracker.dialog import TrackerDialog
from gp_labeler.views.report_file import report_of, reported_estimate, save_report
from gp_labeler.views.ui_part import UiPart

__all__ = ["PoseUi"]

_TOUCHES = "Touches (*.dat *.csv *.mrk.json *.fcsv *.json *.txt);;All files (*)"
_POINTS = "Landmarks (*.mrk.json *.json *.fcsv *.csv *.dat);;All files (*)"
_WHICH_AXES = "Which axes of the path are x (modiolar axis, towards the apex), y (round window), z"
_AROUND_MM = 14.0
_PATHS = "Insertion path (*.csv *.txt);;All files (*)"


class PoseUi(UiPart):
    """The part of `WindowUi` that concerns the pose."""

    def ask_open_touches(self) -> None:
        """Ask for a file of touches, and take them."""
        self._window.set_step("pose")
        for path in self.prompts.open_files("Open touches", self._folder, _TOUCHES):
            self._remember_folder(path)
            self._window.take_touches(path)

    def ask_open_skull(self) -> None:
        """Ask for a landmark file that says where the skull features are on the scan."""
        for path in self.prompts.open_files("Skull features on the scan", self._folder, _POINTS):
            self._remember_folder(path)
            names = touching.load_skull(self._workspace.document, path)
            self._workspace.say(f"Took {' '.join(names)} from {path.name}")

    def judge_pose(self, verdict: str) -> None:
        """Keep a verdict on the estimate, with the initials and the note of the panel."""
        self._window.judge_pose(verdict)

    def ask_export_pose(self) -> None:
        """Ask where, and write the pose in the format that the name asks for."""
        kinds = ";;".join(f"{what} (*{suffix})" for suffix, what in FORMATS.items())
        path = self.prompts.save_file("Export the pose", self._proposed("pose.json"), kinds)
        if path is not None:
            self._remember_folder(path)
            self._workspace.pose.export(path)

    def ask_report(self) -> None:
        """Ask where, and write the one-page report."""
        reported_estimate(self._workspace)
        kinds = "PDF (*.pdf);;HTML (*.html)"
        path = self.prompts.save_file("Save the report", self._proposed("report.pdf"), kinds)
        if path is None:
            return
        self._remember_folder(path)
        QGuiApplication.setOverrideCursor(Qt.CursorShape.WaitCursor)  # pictures take a second or more
        try:
            save_report(report_of(self._window), path)
        finally:
            QGuiApplication.restoreOverrideCursor()
        self._workspace.say(f"Wrote {path.name}")
        self._workspace.messages.wrote.emit("report", path)

    def ask_path(self) -> None:
        """Ask for an insertion path with its units and side, and carry it to the estimate."""
        for path in self.prompts.open_files("Insertion path in the cochlea frame", self._folder, _PATHS):
            units = self.prompts.item("Insertion path", "Unit of the path", list(UNITS))
            side = self.prompts.item("Insertion path", "Side of the path", [s.word for s in Side])
            if units and side:
                self._remember_folder(path)
                carried = self._read_path(path, Side.parse(side[0].upper()), units)
                if carried is not None:
                    self._workspace.pose.carry(carried)
                    self._workspace.say(f"Transformed {path.name}, {len(carried.points)} points")

    def _read_path(self, file: Path, side: Side, units: str) -> InsertionPath | None:
        """Read a path; ask what its axes are, and whether all of it is path, where that is not clear."""
        read = InsertionPath.readings(file, side, units=units)
        axes = next(iter(read))
        if len(read) > 1:
            axes = self.prompts.item("Insertion path", _WHICH_AXES, list(read))
        path = read.get(axes)
        n = None if path is None else path.n_before_centre
        if path is None or n is None:
            return path
        first, whole = f"The first {n}", f"All {len(path.points)}"
        text = f"Row {n + 1} is CO itself, which cannot be part of a path. Which rows are the path?"
        answer = self.prompts.choose("Insertion path", text, [first, whole])
        return {first: path.first(n), whole: path}.get(answer)

    def ask_save_path(self) -> None:
        """Ask where, and write the carried path in the frame of the touches."""
        file = self.prompts.save_file(
            "Save the path for the robot", self._proposed("path.csv"), "CSV (*.csv)"
        )
        if file is not None:
            self._workspace.pose.save_path(file)

    def show_tracker(self) -> None:
        """Show the settings of the tracked probe."""
        dialog = TrackerDialog(self._workspace, self._window.memory, self._window)
        dialog.audible.setChecked(self._window.tracker_display.audible)
        dialog.audible.toggled.connect(self._set_audible)
        dialog.show()

    def show_guide(self) -> None:
        """Lead through the features to touch, on the whole screen."""
        guide = GuideWindow(self._workspace, self._window)
        guide.settings_asked.connect(self.show_tracker)
        guide.showFullScreen()

    def show_physical(self) -> None:
        """Compare touches with the labelled scan of the same skull."""
        PhysicalDialog(self._workspace, self.prompts, self._window).open()

    def look_along_axis(self) -> None:
        """Look at the estimated cochlea along its axis, the apex first."""
        self._look_at_pose(along_axis)

    def look_through_window(self) -> None:
        """Look at the estimated cochlea through its round window."""
        self._look_at_pose(through_round_window)

    def _look_at_pose(self, placement: Callable[[DrawnPose], CameraPlacement]) -> None:
        estimate = self._workspace.pose.estimate
        if estimate is None or estimate.pose is None or estimate.registered is None:
            raise GpError(
                "no estimate is registered to the scan yet", remedy="Touch features, and register them."
            )
        view = self._window.grid.scene_view
        pose = DrawnPose.of(estimate.pose, estimate.registered.T_scan_touches, label="")
        self._workspace.view.set_crosshair(pose.origin)
        self._workspace.view.point_shown.emit(pose.origin)
        place_camera(view.scene.camera, placement(pose))
        view.redraw()
        for slices in self._window.grid.slice_views.values():
            slices.zoom_to(pose.origin, _AROUND_MM)  # else its region is but a speck there

    def _set_audible(self, audible: bool) -> None:
        self._window.tracker_display.audible = audible
        self._window.memory.set(audible=audible)

    def _proposed(self, name: str) -> str:
        state, side = self._workspace.document.state, self._workspace.pose.side
        return str(Path(self._folder) / f"{state.specimen}_{side.value}_{name}")
