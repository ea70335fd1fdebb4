"""Which messages of a tracker can be believed: every fault has a name, and doubtful ones record nothing."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.system.openigtlink import POSE_KINDS
from gp_labeler.tracker.device_clock import DeviceClock
from gp_labeler.tracker.jump_filter import JumpFilter
from gp_labeler.tracker.messages import TrackerMessage
from gp_labeler.tracker.rigid import nearest_rigid, why_not_rigid
from gp_labeler.tracker.samples import UNTIMELY, Fault, Limits, Sample

__all__ = ["SampleFilter"]

_SAME_MOMENT_S = 1e-4


class SampleFilter:
    """Makes samples of messages.

    Parameters
    ----------
    probe : str
        Device name of the probe's marker.
    reference : str, optional
        Device name of the marker in whose frame samples are given. Its pose is interpolated to the moment at
        which the probe was measured, so that a head that moves does not shift the tip.
    limits : Limits
    """

    def __init__(self, probe: str, reference: str | None = None, limits: Limits | None = None) -> None:
        self.limits = limits or Limits()
        self._names = (probe, reference)
        self._probe = _Device(self.limits)
        self._reference = None if reference is None else _Device(self.limits)
        self._references: deque[Sample] = deque(maxlen=200)
        self._waiting: deque[Sample] = deque()
        self._jumps = JumpFilter(self.limits)
        self._head_jumps = JumpFilter(self.limits.of_head)
        self._segments: dict[tuple[int, int], int] = {(0, 0): 0}
        self.reference_seen: float | None = None
        """When the last good reading of the reference arrived, seconds of this computer's monotonic clock."""

    def set_limits(self, limits: Limits) -> None:
        """Use other limits from now on; what is known of the devices stays."""
        self.limits = self._probe.limits = self._jumps.limits = limits
        self._head_jumps.limits = limits.of_head
        if self._reference is not None:
            self._reference.limits = limits

    def take(self, messages: list[TrackerMessage], now: float) -> list[Sample]:
        """Return the samples that messages, in the order of arrival, complete.

        Parameters
        ----------
        messages : list of TrackerMessage
            Of any device.
        now : float
            This computer's monotonic clock.
        """
        probe, reference = self._names
        for message in messages:
            if message.kind not in POSE_KINDS:
                continue
            if message.device == probe:
                self._waiting.append(self._probe.check(message))
            elif message.device == reference and self._reference is not None:
                self._add_reference(self._reference, message)
        samples = []
        while self._waiting and (paired := self._pair(self._waiting[0], now)) is not None:
            self._waiting.popleft()
            samples.append(self._in_segment(paired))
        return samples

    def _in_segment(self, paired: Sample) -> Sample:
        """Return the sample as jumps leave it, with one number for the segments of probe and reference."""
        sample = self._jumps.check(paired)
        key = (paired.segment, sample.segment)
        return replace(sample, segment=self._segments.setdefault(key, len(self._segments)))

    def _add_reference(self, device: _Device, message: TrackerMessage) -> None:
        changes = device.clock.changes
        sample = device.check(message)
        if device.clock.changes != changes:  # what came before has time stamps of another clock
            self._references.clear()
        checked = self._head_jumps.check(sample)
        self._references.append(checked)
        if checked.usable:
            self.reference_seen = checked.received

    def _pair(self, probe: Sample, now: float) -> Sample | None:
        """Return the probe in the reference's frame; None where the reference may still come."""
        if self._reference is None:
            return probe
        if not probe.usable:
            return _without_pose(probe, probe.fault, probe.detail)
        timely = [r for r in self._references if r.fault not in UNTIMELY]
        at_once = next((r for r in timely if abs(r.time - probe.time) <= _SAME_MOMENT_S), None)
        before = max((r for r in timely if r.time <= probe.time), key=_when, default=None)
        after = min((r for r in timely if r.time >= probe.time), key=_when, default=None)
        gap = self.limits.reference_gap_s
        if at_once is None and after is None and now - probe.received < gap:
            return None
        around = (at_once, at_once) if at_once is not None else (before, after)
        return self._in_reference(probe, *around)

    def _in_reference(self, probe: Sample, before: Sample | None, after: Sample | None) -> Sample:
        assert probe.matrix is not None
        name = self._names[1]
        if before is None or after is None or after.time - before.time > self.limits.reference_gap_s:
            return _without_pose(probe, Fault.NO_REFERENCE, f"no message of {name} at that moment")
        for reference in (before, after):
            if not reference.usable:
                spoils = reference.fault in (Fault.JUMP, Fault.FROZEN)  # of the readings before it too
                fault = reference.fault if spoils else Fault.NO_REFERENCE
                return _without_pose(probe, fault, f"{name}: {reference.detail}")
            if not reference.oriented:
                detail = f"{name}: its messages tell a position without an orientation"
                return _without_pose(probe, Fault.NO_REFERENCE, detail)
        T_reference_probe = np.linalg.inv(_interpolated(before, after, probe.time)) @ probe.matrix
        matrix = nearest_rigid(T_reference_probe)
        return Sample(probe.time, probe.received, matrix, segment=after.segment, oriented=probe.oriented)


@dataclass
class _Device:
    """What is known of one device: its clock, and what came last."""

    limits: Limits
    _same: FloatArray = field(default_factory=lambda: np.full((4, 4), np.nan))
    _same_since: float = np.inf

    def __post_init__(self) -> None:
        self.clock = DeviceClock(self.limits.late_s)

    def check(self, message: TrackerMessage) -> Sample:
        """Return the sample of one message: its pose, or what is wrong with it."""
        time = message.time or message.received
        if message.damaged:  # then nothing that it says can be relied on, its time included
            return Sample(time, message.received, None, Fault.DAMAGED, message.problem)
        self.clock.late_s = self.limits.late_s
        fault, detail = self.clock.check(time, message.received)
        if not fault:
            fault, detail = self._check_content(message)
        if fault:
            return Sample(time, message.received, None, fault, detail)
        assert message.matrix is not None
        matrix = nearest_rigid(message.matrix)
        if self._frozen(message):
            detail = "the readings do not change"
            return Sample(time, message.received, matrix, Fault.FROZEN, detail, oriented=message.oriented)
        return Sample(time, message.received, matrix, oriented=message.oriented)

    def _check_content(self, message: TrackerMessage) -> tuple[Fault, str]:
        status = message.metadata.get("TransformStatus", "OK").upper().removeprefix("TOOL_")
        valid = message.metadata.get("TransformValid", "1").strip().upper()
        if status != "OK":
            return Fault.HIDDEN, f"the marker is not visible ({status.replace('_', ' ').lower()})"
        if valid in ("0", "FALSE"):
            return Fault.HIDDEN, "the marker is not visible"
        if message.matrix is None:
            return Fault.DAMAGED, message.problem or "it contains no matrix"
        if np.array_equal(message.matrix, np.eye(4)):
            return Fault.HIDDEN, "the marker is not visible (identity)"
        problem = why_not_rigid(message.matrix, self.limits.rigid)
        return (Fault.NOT_RIGID, problem) if problem else (Fault.NONE, "")

    def _frozen(self, message: TrackerMessage) -> bool:
        assert message.matrix is not None
        if not np.array_equal(message.matrix, self._same):
            self._same, self._same_since = message.matrix, message.received
        limit = self.limits.frozen_s
        return limit is not None and message.received - self._same_since > limit


def _when(sample: Sample) -> float:
    return sample.time


def _interpolated(before: Sample, after: Sample, time: float) -> FloatArray:
    """Return the (4, 4) pose at a time between two samples of a marker."""
    assert before.matrix is not None
    assert after.matrix is not None
    span = after.time - before.time
    if span <= 0:
        return before.matrix
    share = (time - before.time) / span
    from scipy.spatial.transform import Rotation, Slerp  # takes long to import: not at start-up

    turns = Slerp([0.0, 1.0], Rotation.from_matrix(np.array([before.matrix[:3, :3], after.matrix[:3, :3]])))
    pose = np.eye(4)
    pose[:3, :3] = turns(share).as_matrix()
    pose[:3, 3] = (1 - share) * before.matrix[:3, 3] + share * after.matrix[:3, 3]
    return pose


def _without_pose(sample: Sample, fault: Fault, detail: str) -> Sample:
    """Return the sample without its matrix, which is in the tracker's frame, not in the reference's."""
    return Sample(sample.time, sample.received, None, fault, detail)
