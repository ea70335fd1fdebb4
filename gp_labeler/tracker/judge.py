"""Which messages of a tracker can be believed: every doubt has a name, and doubtful ones record nothing."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from gp_core.checks import FloatArray
from gp_labeler.tracker.messages import TrackerMessage
from gp_labeler.tracker.rigid import Step, nearest_rigid, step_between, why_not_rigid

__all__ = ["Fault", "Judge", "Limits", "Sample"]


class Fault(str, Enum):
    """What is wrong with a sample."""

    NONE = ""
    HIDDEN = "hidden"
    """The tracker says that it does not see the marker, by status or by an identity matrix."""
    LATE = "late"
    """It arrived long after it was measured."""
    REPEATED = "repeated"
    """The moment was told before."""
    BACKWARDS = "out of order"
    """Measured before one that has already arrived."""
    NOT_RIGID = "not rigid"
    """Not finite, scaled, sheared or mirrored."""
    FROZEN = "frozen"
    """The last digit has not changed for a while: the tracker repeats what it saw last."""
    JUMP = "jump"
    """Faster than a hand moves."""
    NO_REFERENCE = "no reference"
    """The reference was not seen at that moment."""


_UNTIMELY = (Fault.LATE, Fault.REPEATED, Fault.BACKWARDS)


@dataclass(frozen=True)
class Limits:
    """What is believed.

    Parameters
    ----------
    speed_mm_s, turn_deg_s : float
        The fastest that a hand moves and turns a marker.
    noise_mm, noise_deg : float
        Steps up to this are no jump, however short the time.
    settle_s : float
        After a jump that does not jump back, how long the marker must move steadily to be believed again.
    late_s : float
        How much longer than the quickest a message may take.
    pair_s : float
        How far in time probe and reference may be apart.
    frozen_s : float, optional
        How long a marker may stand still to the last digit; None for a device without noise (a robot's arm).
    rigid : float
        How far a rotation may be from orthonormal.
    """

    speed_mm_s: float = 1000.0
    turn_deg_s: float = 720.0
    noise_mm: float = 2.0
    noise_deg: float = 3.0
    settle_s: float = 0.3
    late_s: float = 0.25
    pair_s: float = 0.03
    frozen_s: float | None = 0.2
    rigid: float = 2e-3


@dataclass(frozen=True, eq=False)
class Sample:
    """Where the probe's marker was at one moment.

    Parameters
    ----------
    time : float
        When it was measured, seconds of the tracker's clock.
    received : float
        When it arrived, seconds of this computer's monotonic clock.
    matrix : (4, 4) array or None
        ``T_tracker_marker``, mm; where a reference is named, ``T_reference_marker``. None where nothing rigid
        is known. It may be there beside a fault, for showing; use it only where `usable`.
    fault : Fault
    detail : str
        The fault in words; empty without one.
    """

    time: float
    received: float
    matrix: FloatArray | None
    fault: Fault = Fault.NONE
    detail: str = ""

    @property
    def usable(self) -> bool:
        """Whether it may become part of a recording."""
        return self.fault is Fault.NONE and self.matrix is not None

    @property
    def visible(self) -> bool:
        """Whether the tracker saw all that it takes."""
        return self.fault not in (Fault.HIDDEN, Fault.FROZEN, Fault.NO_REFERENCE)


class Judge:
    """Makes samples of messages.

    Parameters
    ----------
    probe : str
        Device name of the probe's marker.
    reference : str, optional
        Device name of the marker in whose frame samples are given.
    limits : Limits
    """

    def __init__(self, probe: str, reference: str | None = None, limits: Limits | None = None) -> None:
        self.limits = limits or Limits()
        self._probe = _Device(self.limits)
        self._names = (probe, reference)
        self._reference = None if reference is None else _Device(self.limits)
        self._references: deque[Sample] = deque(maxlen=200)
        self._waiting: deque[Sample] = deque()
        self._motion = _Motion(self.limits)

    def set_limits(self, limits: Limits) -> None:
        """Judge by other limits from now on; what is known of the devices stays."""
        self.limits = self._probe.limits = self._motion.limits = limits
        if self._reference is not None:
            self._reference.limits = limits

    def take(self, messages: list[TrackerMessage], now: float) -> list[Sample]:
        """Judge messages in the order of arrival.

        Parameters
        ----------
        messages : list of TrackerMessage
            Of any device.
        now : float
            This computer's monotonic clock.
        """
        probe, reference = self._names
        for message in messages:
            if message.kind != "TRANSFORM":
                continue
            if message.device == probe:
                self._waiting.append(self._probe.check(message))
            elif message.device == reference and self._reference is not None:
                self._references.append(self._reference.check(message))
        samples = []
        while self._waiting and (pair := self._pair(self._waiting[0], now)) is not None:
            self._waiting.popleft()
            samples.append(self._motion.check(pair))
        return samples

    def _pair(self, probe: Sample, now: float) -> Sample | None:
        """Return the probe in the reference's frame; None where the reference may still come."""
        if self._reference is None:
            return probe
        if not probe.usable:
            return _unknown(probe, probe.fault, probe.detail)
        at_hand = [r for r in self._references if r.fault not in _UNTIMELY]
        passed = bool(at_hand) and at_hand[-1].time >= probe.time
        if not passed and now - probe.received < 2 * self.limits.pair_s:
            return None
        near = min(at_hand, key=lambda r: abs(r.time - probe.time), default=None)
        if near is None or abs(near.time - probe.time) > self.limits.pair_s:
            return _unknown(probe, Fault.NO_REFERENCE, f"no message of {self._names[1]} at that moment")
        if near.matrix is None or not near.usable or probe.matrix is None:
            return _unknown(probe, Fault.NO_REFERENCE, f"{self._names[1]}: {near.detail}")
        T_reference_probe = np.linalg.inv(near.matrix) @ probe.matrix
        return Sample(probe.time, probe.received, nearest_rigid(T_reference_probe))


@dataclass
class _Device:
    """What is known of one device: how long its messages take, what came last."""

    limits: Limits
    quickest: float = np.inf
    _at: float = -np.inf
    _time: float = -np.inf
    _same: FloatArray = field(default_factory=lambda: np.full((4, 4), np.nan))
    _same_since: float = np.inf

    def check(self, message: TrackerMessage) -> Sample:
        """Judge a message by itself, and by when it comes."""
        time = message.time or message.received
        fault, detail = self._check_time(time, message.received)
        if not fault:
            fault, detail = self._check_content(message)
        if fault:
            return Sample(time, message.received, None, fault, detail)
        assert message.matrix is not None
        matrix = nearest_rigid(message.matrix)
        if self._frozen(message):
            return Sample(
                time, message.received, matrix, Fault.FROZEN, "the tracker repeats its last position"
            )
        return Sample(time, message.received, matrix)

    def _check_time(self, time: float, received: float) -> tuple[Fault, str]:
        if time == self._time:
            return Fault.REPEATED, "its moment was told before"
        if time < self._time:
            return Fault.BACKWARDS, f"it is {self._time - time:.3f} s older than one before"
        self._time = time
        takes = received - time  # the two clocks need not agree: only differences of it are used
        drift = 1e-3 * max(received - self._at, 0.0) if np.isfinite(self._at) else 0.0
        self._at = received
        self.quickest = min(self.quickest + drift, takes)
        if takes - self.quickest > self.limits.late_s:
            return Fault.LATE, f"it arrived {takes - self.quickest:.2f} s late; if that lasts, connect again"
        return Fault.NONE, ""

    def _check_content(self, message: TrackerMessage) -> tuple[Fault, str]:
        status = message.metadata.get("TransformStatus", "OK").upper().removeprefix("TOOL_")
        valid = message.metadata.get("TransformValid", "1").strip().upper()
        if status != "OK":
            return Fault.HIDDEN, f"the marker is not seen ({status.replace('_', ' ').lower()})"
        if valid in ("0", "FALSE"):
            return Fault.HIDDEN, "the marker is not seen"
        if message.matrix is None:
            return Fault.NOT_RIGID, message.problem or "it holds no matrix"
        if np.array_equal(message.matrix, np.eye(4)):
            return Fault.HIDDEN, "the marker is not seen (identity)"
        problem = why_not_rigid(message.matrix, self.limits.rigid)
        return (Fault.NOT_RIGID, problem) if problem else (Fault.NONE, "")

    def _frozen(self, message: TrackerMessage) -> bool:
        assert message.matrix is not None
        if not np.array_equal(message.matrix, self._same):
            self._same, self._same_since = message.matrix, message.received
        limit = self.limits.frozen_s
        return limit is not None and message.received - self._same_since > limit


class _Motion:
    """Finds jumps: one that jumps back is passed over, another is believed once it has moved steadily."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._before: Sample | None = None
        self._good: Sample | None = None
        self._since: float | None = None

    def check(self, sample: Sample) -> Sample:
        if not sample.usable:
            return sample
        before, self._before = self._before, sample
        fast = before is not None and self._too_fast(before, sample, sample.time - before.time)
        if fast and self._since is not None and self._back(sample):
            self._since = None
        elif fast:
            self._since = sample.time
        elif self._since is not None and sample.time - self._since >= self.limits.settle_s:
            self._since = None
        if self._since is not None:
            return replace(sample, fault=Fault.JUMP, detail=self._words(sample))
        self._good = sample
        return sample

    def _back(self, sample: Sample) -> bool:
        """Whether a second jump leads back to where the first one began."""
        if self._good is None:
            return False
        seconds = min(sample.time - self._good.time, self.limits.settle_s)
        return not self._too_fast(self._good, sample, seconds)

    def _too_fast(self, before: Sample, after: Sample, seconds: float) -> bool:
        step = _step(before, after)
        far = step.mm > max(self.limits.speed_mm_s * seconds, self.limits.noise_mm)
        turned = step.degrees > max(self.limits.turn_deg_s * seconds, self.limits.noise_deg)
        return far or turned

    def _words(self, sample: Sample) -> str:
        if self._good is None:
            return "the marker has just jumped"
        step = _step(self._good, sample)
        return f"the marker jumped by {step.mm:.0f} mm, {step.degrees:.0f} degrees"


def _step(before: Sample, after: Sample) -> Step:
    assert before.matrix is not None
    assert after.matrix is not None
    return step_between(before.matrix, after.matrix)


def _unknown(sample: Sample, fault: Fault, detail: str) -> Sample:
    """Return the sample without its matrix, which is in the tracker's frame, not in the reference's."""
    return Sample(sample.time, sample.received, None, fault, detail)
