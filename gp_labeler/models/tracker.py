"""The tracked probe: its link and tip, touches recorded from it, and the pose that is sent back.

Nothing here waits: whoever shows it calls `poll` 30 times a second while it is `on`.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.pose.gate import PoseGate
from gp_core.registration.pivot import PivotCalibration
from gp_core.validation import FloatArray
from gp_labeler.document import touching
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.touches import Touch, TouchHow
from gp_labeler.models.messages import Messages
from gp_labeler.models.pose import PoseModel
from gp_labeler.models.pose_sending import PoseSending
from gp_labeler.tracker import (
    NO_ORIENTATION,
    FrameCheck,
    Limits,
    LinkPhase,
    PivotCollector,
    Probe,
    RecordedTouch,
    RefusedTouch,
    Sample,
    TouchRecorder,
    TrackerAddress,
    TrackerLink,
)

__all__ = ["TrackerModel"]

_TRAIL = 90
_IN = " in "
"""Between probe and reference in the source of a touch."""


class TrackerModel:
    """Follows a tracked probe, records touches with it, and sends the pose back.

    Parameters
    ----------
    document : SpecimenDocument
        Where touches are recorded.
    pose : PoseModel
        Says which feature is touched next, and holds the pose that is sent.
    messages : Messages
        What the user is told by.
    """

    changed = Signal()
    """The link's state or words, dwell, calibration or sending changed."""
    moved = Signal()
    """The tip moved, or went out of sight: see `tip`, `visible`, `progress`."""
    refused = Signal(str)
    """A press recorded nothing, and why."""
    touched = Signal(object)
    """The `RecordedTouch` that was taken over."""

    def __init__(self, document: SpecimenDocument, pose: PoseModel, messages: Messages) -> None:
        self._document, self._pose, self._messages = document, pose, messages
        self._link: TrackerLink | None = None
        self._limits = Limits()
        self._recorder = TouchRecorder(Probe())
        self._dwell = False
        self._words = ""
        self._sending = PoseSending()
        self._links = 0
        self._frame = FrameCheck()
        self._latest: Sample | None = None
        self._tip: FloatArray | None = None
        self._trail: deque[FloatArray] = deque(maxlen=_TRAIL)
        self.pivot: PivotCollector | None = None
        self.calibration: PivotCalibration | None = None
        self._aim = self._aim_now()
        self._sending.changed.connect(self.changed.emit)
        self._sending.held_back.connect(self._say_held)
        pose.changed.connect(self._update_sending)
        document.details_changed.connect(self._update_sending)
        document.reset.connect(self._on_reset)

    # The link

    @property
    def on(self) -> bool:
        """Whether a tracker is asked for; it may be lost for the moment."""
        return self._link is not None

    @property
    def phase(self) -> LinkPhase:
        """The state of the link."""
        return LinkPhase.OFF if self._link is None else self._link.state.phase

    @property
    def words(self) -> str:
        """The state of the link, as a sentence."""
        return "Not connected." if self._link is None else self._link.state.words

    @property
    def address(self) -> TrackerAddress | None:
        """Where it is connected to."""
        return None if self._link is None else self._link.address

    def connect(self, address: TrackerAddress) -> None:
        """Connect in the background, in place of the link there was."""
        self.disconnect()
        self._links += 1
        self._link = TrackerLink(address, self._limits)
        self._link.open()
        self.changed.emit()

    @property
    def may_stand_still(self) -> bool:
        """Whether a marker may stand still to the last digit, as that of a device without noise does."""
        return self._limits.frozen_s is None

    def set_may_stand_still(self, may: bool) -> None:
        """Accept a marker that stands still to the last digit, or not, from the next message on."""
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
            self._update_sending()
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
        self._update_sending()
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
        latest = self._latest
        if latest is None:
            return ""
        if latest.usable and self.probe.lacks_orientation(latest):
            return NO_ORIENTATION
        return latest.detail

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
            raise GpError("no tracker is connected", remedy="Click Tracker in the step 4 Pose.")
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

    # Whether touches still lie in one frame

    @property
    def doubtful(self) -> tuple[str, ...]:
        """Tracked touches of the side in work that may lie in another frame than what is read now."""
        touches = self._tracked().items()
        return tuple(name for name, touch in touches if self._frame.is_doubtful(touch.position))

    @property
    def frame_words(self) -> str:
        """Since when the reference is verified, or which touches may lie in another frame."""
        if doubtful := self.doubtful:
            if self._frame.is_unknown(self._tracked()[doubtful[0]].position):
                was, it = ("was", "it") if len(doubtful) == 1 else ("were", "them")
                return (
                    f"{', '.join(doubtful)} {was} touched in an earlier session, and the reference may have "
                    f"moved since. Touch {it} again."
                )
            return (
                f"The marker jumped, or the connection was lost, since {', '.join(doubtful)} "
                f"{'was' if len(doubtful) == 1 else 'were'} touched. Touch {doubtful[0]} again to check."
            )
        last = self._frame.last
        if last is None:
            begun = min((touch.time for touch in self._tracked().values()), default="")
            return (
                f"Reference not verified since {_clock_time(begun)}: touch a feature again." if begun else ""
            )
        apart = f"{last.name} touched again {last.distance_mm:.1f} mm from its earlier position"
        if last.agrees:
            return f"Reference verified at {_clock_time(last.time)}: {apart}."
        return f"The reference has moved, or a touch is wrong, at {_clock_time(last.time)}: {apart}."

    def _tracked(self) -> dict[str, Touch]:
        side, touches = self._pose.side, self._document.state.touches
        return {
            name: touch
            for (of, name), touch in touches.items()
            if of is side and touch.how is TouchHow.TRACKED
        }

    # The pose sent back

    @property
    def gate(self) -> PoseGate:
        """The limits within which a pose is sent."""
        return self._sending.gate

    def set_gate(self, gate: PoseGate) -> None:
        """Send poses within other limits from now on."""
        self._sending.gate = gate
        self._update_sending()
        self.changed.emit()

    @property
    def sending(self) -> str:
        """The state of the sending, as a sentence; empty where nothing is sent."""
        return self._sending.words

    @property
    def sending_port(self) -> int | None:
        """Where the pose is sent from, or to; None where nothing is sent."""
        return self._sending.port

    def start_sending(self, port: int, host: str | None = None, device: str = "T_tracker_cochlea") -> None:
        """Send the pose from now on, whenever it may be; raises `GpError` where the port is taken."""
        self._sending.start(port, host, device)
        self._update_sending()
        self.changed.emit()

    def stop_sending(self) -> None:
        """Send nothing any more."""
        self._sending.stop()

    def close(self) -> None:
        """End everything."""
        self.stop_sending()
        self.disconnect()

    # Inside

    def _aim_now(self) -> tuple[Side, str | None]:
        """Return what a press is for now."""
        return self._pose.side, self._pose.target

    def _keep_aim(self) -> None:
        """Drop what was begun for another feature, side or specimen: it is not a touch of this one."""
        before, self._aim = self._aim, self._aim_now()
        self._recorder.dwell = self._dwell and self._aim[1] is not None
        if before == self._aim:
            return
        self._drop_press(before[1])

    def _drop_press(self, name: str | None) -> None:
        was_recording = self._recorder.recording
        self._recorder.cancel()
        if was_recording:
            self.refused.emit(f"{name or 'The feature'} is no longer requested. Touch the one that is.")

    def _take(self, outcome: RecordedTouch | RefusedTouch) -> None:
        if isinstance(outcome, RefusedTouch):
            self.refused.emit(outcome.reason)
            return
        try:
            self._check_frame()
            side, name = self._pose.side, self._pose.require_target()
            before = self._document.state.touches.get((side, name))
            keep = self._pose.keeps_earlier(name, outcome.position, TouchHow.TRACKED) and self._may_keep(
                outcome.position, before
            )
            is_new = touching.record_touch(
                self._document,
                side,
                name,
                outcome.position,
                TouchHow.TRACKED,
                keep=keep,
                source=self._source(),
                n_samples=outcome.n_samples,
                spread_mm=outcome.spread_mm,
            )
        except GpError as error:
            self.refused.emit(f"{str(error)[:1].upper()}{str(error)[1:]}")
            return
        if not is_new:
            self._pose.go_on(name)
        self._compare(name, outcome, before)
        self.touched.emit(outcome)

    def _compare(self, name: str, outcome: RecordedTouch, before: Touch | None) -> None:
        """Compare a touch with the one that it replaces, and say so where something has moved."""
        was = before.position if before is not None and before.how is TouchHow.TRACKED else None
        repeated = self._frame.record(
            name, outcome.position, self._segment(outcome.segment), was, outcome.time
        )
        if repeated is not None and not repeated.agrees:
            self._messages.say(
                f"{name} is {repeated.distance_mm:.1f} mm from its earlier position: "
                "the reference has moved, or one of the two touches is wrong",
                "warning",
            )
        elif self.doubtful:
            self._messages.say(self.frame_words, "warning")
        self._update_sending()
        self.changed.emit()

    def _may_keep(self, position: ArrayLike, before: Touch | None) -> bool:
        """Whether touches may be averaged: not one of another frame with one that disagrees."""
        if before is None or not self._frame.is_doubtful(before.position):
            return True
        mm = float(np.linalg.norm(np.asarray(position, float) - np.array(before.position)))
        return mm <= self._frame.limit_mm

    def _segment(self, segment: int) -> tuple[int, int]:
        connections = 0 if self._link is None else self._link.connections
        return (1000 * self._links + connections, segment)

    def _source(self) -> str:
        assert self._link is not None
        reference = self._link.address.reference
        return self._link.address.probe + (f"{_IN}{reference}" if reference else "")

    def _check_frame(self) -> None:
        """Refuse a touch whose frame is not that of the side's other tracked ones, which are called alike."""
        side, mine = self._pose.side, self._source().partition(_IN)[2]
        for (of, name), touch in self._document.state.touches.items():
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
            if sample.usable:
                self._frame.follow(self._segment(sample.segment))
            tip = self.probe.tip(sample) if sample.usable else None
            if tip is not None:
                self._tip = tip
                self._trail.append(tip)
        self.moved.emit()

    def _forget_tip(self) -> None:
        self._latest = self._tip = None
        self._trail.clear()

    def _on_reset(self) -> None:
        """Drop what was begun for another specimen: it is not a touch of this one."""
        self._drop_press(self._aim[1])
        self._frame.forget()
        self._update_sending()

    def _say_held(self, why: str) -> None:
        self._messages.say(f"The pose is held back from the robot: {why}", "warning")

    def _update_sending(self, *_: object) -> None:
        if self._sending.on:
            pose, state = self._pose, self._document.state
            self._sending.update(
                pose.estimate, state, self.doubtful, self._reference_age(), pose.file_warnings
            )

    def _reference_age(self) -> float | None:
        """Return how long ago the reference was read, s; None where no touch was taken in its frame."""
        if not any(_IN in touch.source for touch in self._tracked().values()):
            return None
        return float("inf") if self._link is None else self._link.reference_age_s


def _clock_time(time: str) -> str:
    """Return the hours and minutes of an ISO time, UTC."""
    return f"{time[11:16]} UTC" if len(time) >= 16 else time
