"""What of a workbench concerns the tracked probe: link, tip, touches recorded from it, the pose sent back.

Nothing here waits: whoever shows it calls `poll` 30 times a second while it is `on`.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from psygnal import Signal

from gp_core.atlas.pose_quality import pose_quality
from gp_core.checks import FloatArray
from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.registration.pivot import PivotCalibration
from gp_labeler.session.estimate import Estimate
from gp_labeler.session.session import Session
from gp_labeler.session.state import SpecimenState
from gp_labeler.session.touches import TouchHow
from gp_labeler.tracker import (
    Limits,
    LinkPhase,
    PivotCollector,
    PoseSender,
    Probe,
    RecordedTouch,
    RefusedTouch,
    Sample,
    TouchRecorder,
    TrackerAddress,
    TrackerLink,
)

if TYPE_CHECKING:
    from gp_labeler.workbench import Workbench

__all__ = ["TrackerDesk"]

_TRAIL = 90
_IN = " in "
"""Between probe and reference in the source of a touch."""


class TrackerDesk:
    """Keeps the tracked probe of a workbench.

    Parameters
    ----------
    desk : Workbench
        Whose part it is; touches go to its `pose`.
    """

    changed = Signal()
    """The link's state or words, dwell, calibration or sending changed."""
    moved = Signal()
    """The tip moved, or went out of sight: see `tip`, `visible`, `progress`."""
    refused = Signal(str)
    """A press recorded nothing, and why."""
    touched = Signal(object)
    """The `RecordedTouch` that was taken over."""

    def __init__(self, desk: Workbench) -> None:
        self._desk = desk
        self._link: TrackerLink | None = None
        self._sender: PoseSender | None = None
        self._limits = Limits()
        self._recorder = TouchRecorder(Probe())
        self._dwell = False
        self._words = ""
        self._held = ""
        self._latest: Sample | None = None
        self._tip: FloatArray | None = None
        self._trail: deque[FloatArray] = deque(maxlen=_TRAIL)
        self.pivot: PivotCollector | None = None
        self.calibration: PivotCalibration | None = None
        self._aim = self._aim_now()
        desk.pose.changed.connect(self._on_pose_changed)
        desk.details_changed.connect(self._on_pose_changed)

    # The link

    @property
    def on(self) -> bool:
        """Whether a tracker is asked for; it may be lost for the moment."""
        return self._link is not None

    @property
    def phase(self) -> LinkPhase:
        """How the link stands."""
        return LinkPhase.OFF if self._link is None else self._link.state.phase

    @property
    def words(self) -> str:
        """How it stands, for a person."""
        return "Not connected." if self._link is None else self._link.state.words

    @property
    def address(self) -> TrackerAddress | None:
        """Where it is connected to."""
        return None if self._link is None else self._link.address

    def connect(self, address: TrackerAddress) -> None:
        """Connect in the background, in place of the link there was."""
        self.disconnect()
        self._link = TrackerLink(address, self._limits)
        self._link.open()
        self.changed.emit()

    @property
    def may_stand_still(self) -> bool:
        """Whether a marker may stand still to the last digit, as that of a device without noise does."""
        return self._limits.frozen_s is None

    def set_may_stand_still(self, may: bool) -> None:
        """Believe a marker that stands still to the last digit, or not; from the next message on."""
        self._limits = replace(self._limits, frozen_s=None if may else Limits().frozen_s)
        if self._link is not None:
            self._link.set_limits(self._limits)
        self.changed.emit()

    def disconnect(self) -> None:
        """End the link."""
        link, self._link = self._link, None
        if link is not None:
            link.close()
            self._recorder.cancel()
            self._forget_tip()
            self.changed.emit()
            self.moved.emit()

    def poll(self) -> None:
        """Take what has come since the last call, and record what it completes."""
        if self._link is None:
            return
        samples = self._link.poll()
        self._follow_tip(samples)
        if self.pivot is not None:
            self.pivot.update(samples)
        else:
            self._keep_aim()
            for _ in range(self._link.take_presses()):
                self.press()
            for outcome in self._recorder.update(samples):
                self._take(outcome)
        if self._words != self.words or self.pivot is not None:
            self._words = self.words
            self.changed.emit()

    # The tip

    @property
    def probe(self) -> Probe:
        """The probe, with its tip offset."""
        return self._recorder.probe

    def set_tip_offset(self, offset: ArrayLike) -> None:
        """Say where the tip is in the marker's frame, (3,) mm; raises `GpError` where that cannot be."""
        self._recorder.probe = Probe(offset)
        self._recorder.cancel()
        found = self.calibration
        if found is not None and not np.allclose(self.probe.tip_offset, found.tip_offset, atol=0.001):
            self.calibration = None
        self.changed.emit()

    @property
    def tip(self) -> FloatArray | None:
        """(3,) tip, tracker frame, mm; where it was last seen while it is not `visible`."""
        return self._tip

    @property
    def visible(self) -> bool:
        """Whether the newest reading can be believed."""
        return self._latest is not None and self._latest.usable and self.phase is LinkPhase.CONNECTED

    @property
    def trouble(self) -> str:
        """What is wrong with the newest reading; empty where nothing is."""
        return "" if self._latest is None else self._latest.detail

    @property
    def handle(self) -> FloatArray | None:
        """(3,) direction from the tip to the marker, tracker frame; None where the tip is the marker."""
        latest = self._latest
        if latest is None or latest.matrix is None or not self.probe.tip_offset.any():
            return None
        direction: FloatArray = -latest.matrix[:3, :3] @ self.probe.tip_offset
        return direction / np.linalg.norm(direction)

    @property
    def trail(self) -> FloatArray:
        """(N, 3) where the tip was in the last seconds, the oldest first, mm."""
        return np.array(self._trail).reshape(-1, 3)

    # Touching

    @property
    def dwell(self) -> bool:
        """Whether holding still records."""
        return self._dwell

    def set_dwell(self, dwell: bool) -> None:
        """Let holding still record, or not; nothing is while no feature is asked for."""
        self._dwell = dwell
        self.changed.emit()

    @property
    def progress(self) -> float:
        """How much of a touch has passed, 0 to 1."""
        return self._recorder.progress

    @property
    def recording(self) -> bool:
        """Whether a press is being recorded."""
        return self._recorder.recording

    def press(self) -> None:
        """Record the tip from now on, as a key or a foot switch asks.

        Raises
        ------
        GpError
            No tracker is connected.
        """
        if self._link is None:
            raise GpError("no tracker is connected", remedy="Connect one in the Pose panel.")
        self._keep_aim()
        self._recorder.press()

    # Pivot calibration

    def start_pivot(self) -> None:
        """Collect rotations about the tip; nothing is recorded meanwhile."""
        self._recorder.cancel()
        self.pivot = PivotCollector()
        self.changed.emit()

    def cancel_pivot(self) -> None:
        """End that without a result."""
        self.pivot = None
        self.changed.emit()

    def finish_pivot(self) -> PivotCalibration:
        """Find the tip, and use it; raises `GpError`, and goes on collecting, where it cannot be found."""
        if self.pivot is None:
            raise GpError("no pivot calibration was begun")
        found = self.pivot.finish()
        self.pivot, self.calibration = None, found
        self.set_tip_offset(found.tip_offset)
        return found

    # The pose sent back

    @property
    def sending(self) -> str:
        """How the sending of the pose stands, for a person; empty where nothing is sent."""
        if self._sender is None:
            return ""
        return f"{self._sender.words} Held back: {self._held}." if self._held else self._sender.words

    def start_sending(self, port: int, host: str | None = None, device: str = "T_tracker_cochlea") -> None:
        """Send the pose from now on, whenever there is one; raises `GpError` where the port is taken."""
        self.stop_sending()
        self._sender = PoseSender(port, host=host, device=device)
        self._on_pose_changed()
        self.changed.emit()

    def stop_sending(self) -> None:
        """Send nothing any more."""
        sender, self._sender, self._held = self._sender, None, ""
        if sender is not None:
            sender.close()
            self.changed.emit()

    def close(self) -> None:
        """End everything."""
        self._desk.pose.changed.disconnect(self._on_pose_changed)
        self._desk.details_changed.disconnect(self._on_pose_changed)
        self.stop_sending()
        self.disconnect()

    # Inside

    def _aim_now(self) -> tuple[Session, Side, str | None]:
        """Return what a press is for now."""
        return self._desk.session, self._desk.pose.side, self._desk.pose.target

    def _keep_aim(self) -> None:
        """Drop what was begun for another feature, side or specimen: it is not a touch of this one."""
        before, self._aim = self._aim, self._aim_now()
        self._recorder.dwell = self._dwell and self._aim[2] is not None
        if before == self._aim:
            return
        was_recording = self._recorder.recording
        self._recorder.cancel()
        if was_recording:
            self.refused.emit(f"{before[2] or 'Nothing'} is no longer asked for. Touch again.")

    def _take(self, outcome: RecordedTouch | RefusedTouch) -> None:
        if isinstance(outcome, RefusedTouch):
            self.refused.emit(outcome.reason)
            return
        try:
            self._check_frame()
            self._desk.pose.record(
                outcome.position,
                TouchHow.TRACKED,
                source=self._source(),
                n_samples=outcome.n_samples,
                spread_mm=outcome.spread_mm,
            )
        except GpError as error:
            self.refused.emit(f"{str(error)[:1].upper()}{str(error)[1:]}")
            return
        self.touched.emit(outcome)

    def _source(self) -> str:
        assert self._link is not None
        reference = self._link.address.reference
        return self._link.address.probe + (f"{_IN}{reference}" if reference else "")

    def _check_frame(self) -> None:
        """Refuse a touch whose frame is not that of the side's other tracked ones, which are called alike."""
        side, mine = self._desk.pose.side, self._source().partition(_IN)[2]
        for (of, name), touch in self._desk.session.state.touches.items():
            theirs = touch.source.partition(_IN)[2]
            if of is side and touch.how is TouchHow.TRACKED and theirs != mine:
                raise GpError(
                    f"{name} was touched in the frame of {theirs or 'the tracker'}, this is in that of "
                    f"{mine or 'the tracker'}",
                    remedy="Connect as before, or clear the touches of this side.",
                )

    def _follow_tip(self, samples: list[Sample]) -> None:
        if not samples:
            if self._latest is not None and self.phase is not LinkPhase.CONNECTED:
                self._latest = None
                self.moved.emit()
            return
        self._latest = samples[-1]
        for sample in samples:
            tip = self.probe.tip(sample) if sample.usable else None
            if tip is not None:
                self._tip = tip
                self._trail.append(tip)
        self.moved.emit()

    def _forget_tip(self) -> None:
        self._latest = self._tip = None
        self._trail.clear()

    def _on_pose_changed(self) -> None:
        if self._sender is None:
            return
        estimate = self._desk.pose.estimate
        pose = None if estimate is None else estimate.pose
        self._hold("" if estimate is None else _why_held(estimate, self._desk.session.state))
        if pose is None or pose.transform_to_touches.dst != "tracker" or self._held:
            self._sender.clear()
        else:
            self._sender.send(pose.transform_to_touches)

    def _hold(self, why: str) -> None:
        """Hold the pose back, or no longer, and say so: whoever waits for it may not see the dialog."""
        if why == self._held:
            return
        self._held = why
        if why:
            self._desk.say(f"The pose is held back from the robot: {why}", "warning")
        self.changed.emit()


def _why_held(estimate: Estimate, state: SpecimenState) -> str:
    """Return why an estimate is not for a robot, although there is one; empty where it may have it."""
    pose = estimate.pose
    if pose is None:
        return ""
    if pose.side_state == "wrong" or pose.names_state == "wrong":
        return pose_quality(pose).word.lower()
    last = next((check for check in reversed(state.pose_checks) if check.side is estimate.side), None)
    is_rejected = last is not None and last.verdict == "reject" and estimate.moved_since(last.pose) is None
    return "it was rejected" if is_rejected else ""
