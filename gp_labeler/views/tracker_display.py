"""Keeps a tracked probe going: messages taken 30 times a second, the tip drawn, a sound for every touch."""

from __future__ import annotations

from qtpy.QtCore import QObject, QTimer
from qtpy.QtWidgets import QApplication

from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.pose_data import DrawnTip
from gp_labeler.views.pose_display import PoseDisplay
from gp_labeler.views.signals import follow

__all__ = ["TrackerDisplay"]

_PERIOD_MS = 33


class TrackerDisplay(QObject):
    """Polls the tracker, draws the tip, and beeps at every touch.

    Parameters
    ----------
    workspace : Workspace
        Whose tracker.
    display : PoseDisplay
        Draws the tip; owns this.
    """

    def __init__(self, workspace: Workspace, display: PoseDisplay) -> None:
        super().__init__(display)
        self._workspace, self._display = workspace, display
        self.audible = False
        self._timer = QTimer(self, interval=_PERIOD_MS)
        self._timer.timeout.connect(workspace.tracker.poll)
        tracker = workspace.tracker
        follow(self, tracker.changed, self._on_changed)
        follow(self, tracker.moved, self._on_moved)
        follow(self, tracker.touched, self._on_touched)
        follow(self, tracker.refused, self._on_refused)
        self._on_changed()

    def _on_changed(self) -> None:
        if self._workspace.tracker.on != self._timer.isActive():
            (self._timer.start if self._workspace.tracker.on else self._timer.stop)()

    def _on_moved(self) -> None:
        self._display.set_tip(self._tip())

    def _tip(self) -> DrawnTip | None:
        tracker, estimate = self._workspace.tracker, self._workspace.pose.estimate
        if tracker.tip is None or estimate is None or estimate.registered is None:
            return None
        T_scan_tracker = estimate.registered.T_scan_touches
        if T_scan_tracker.src != "tracker":
            return None
        handle = tracker.handle
        return DrawnTip(
            T_scan_tracker.apply(tracker.tip[None])[0],
            None if handle is None else T_scan_tracker.apply_vector(handle),
            T_scan_tracker.apply(tracker.trail),
            tracker.visible,
            "" if tracker.visible else "not seen",
        )

    def _on_touched(self, _: object) -> None:
        if self.audible:
            QApplication.beep()

    def _on_refused(self, reason: str) -> None:
        self._workspace.say(reason, "warning")
        if self.audible:
            QApplication.beep()
            QTimer.singleShot(180, QApplication.beep)
