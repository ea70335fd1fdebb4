"""Jumps: a marker that changes its place faster than a hand can move it.

A jump that is taken back was a false reading, and nothing is recorded between. One that stays may be a false
reading that lasts, or the reference was knocked. After a pause, samples are believed again, in a new
*segment*: positions from before and after the jump may be in frames that differ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.tracker.rigid import step_between, turn_deg
from gp_labeler.tracker.samples import Fault, Limits, Sample

__all__ = ["JumpFilter"]

_MOTION_SHARE = 1 / 3
"""Two steps in a row belong to one movement where the slower has at least this share of the other's speed."""

_MOTION_FACTOR = 2.0
"""How much faster than the limit a step may be that belongs to a movement."""

_ISOLATED_SHARE = 0.25
"""Of the acceleration of a hand: how far one step may differ from those before and after it."""

_OF_STEPS = 0.3
"""And how far beyond that, as a share of these."""

_LONGEST_MEMORY_S = 0.3
"""A velocity or a place from longer ago says nothing about where the marker is now."""

_MOST_SEGMENTS = 20


@dataclass(frozen=True)
class _Motion:
    """The step from one sample to the next: seconds, mm (3,), degrees."""

    seconds: float
    shift: FloatArray
    degrees: float

    @property
    def mm(self) -> float:
        return float(np.linalg.norm(self.shift))

    def continues(self, other: _Motion) -> bool:
        """Whether `other`, next to this one, belongs to the same movement: as fast, and leading on."""
        mine, theirs = self.shift / self.seconds, other.shift / other.seconds
        slow, fast = sorted((float(np.linalg.norm(mine)), float(np.linalg.norm(theirs))))
        return slow >= _MOTION_SHARE * fast and float(mine @ theirs) >= 0.5 * slow * fast


@dataclass(frozen=True)
class _Left:
    """A segment that was left by a jump.

    `T_now_left` carries poses of its frame to where the jumps since then have put them.
    """

    number: int
    last: Sample
    T_now_left: FloatArray


@dataclass(frozen=True)
class _State:
    """What is known of jumps: the segment, its last believed sample, and the segments left before."""

    segment: int = 0
    last: Sample | None = None
    left: tuple[_Left, ...] = ()
    suspicious_since: float | None = None


@dataclass(frozen=True)
class _Step:
    """The step before the last sample: where it began, what moved before it, and what was known there.

    Empty where the step was a jump itself.
    """

    start: Sample | None = None
    motion_before: _Motion | None = None
    state: _State = _State()


class JumpFilter:
    """Marks samples between a jump and its way back, or for some time after a jump that stays.

    Parameters
    ----------
    limits : Limits
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._numbers = count(1)
        self._state = _State()
        self._before_jump: _State | None = None
        self._previous: Sample | None = None
        self._motion: _Motion | None = None
        self._last_step = _Step()

    def check(self, sample: Sample) -> Sample:
        """Return the sample with its segment, and with the fault JUMP where it is in doubt."""
        if not sample.usable:
            return replace(sample, segment=self._state.segment)
        previous, earlier = self._previous, self._motion
        self._previous = sample
        if previous is not None:
            self._motion = _motion(previous, sample)
            self._call_off(earlier, self._motion)
            step = _Step(previous, earlier, self._state)
            if self._is_jump(self._motion, earlier):
                self._before_jump = self._state
                self._state = self._jumped(self._state, previous, sample)
                step = _Step()
            elif self._is_isolated(self._last_step.motion_before, earlier, self._motion):
                assert self._last_step.start is not None
                self._state = self._jumped(self._last_step.state, self._last_step.start, previous)
            self._last_step = step
        return self._believe(sample)

    def _believe(self, sample: Sample) -> Sample:
        state = self._state
        suspicious = state.suspicious_since
        if suspicious is not None and sample.received - suspicious < self.limits.confirm_s:
            return replace(sample, fault=Fault.JUMP, detail=self._words(sample), segment=state.segment)
        believed = replace(sample, segment=state.segment)
        self._state = replace(state, last=believed, suspicious_since=None)
        return believed

    def _is_jump(self, motion: _Motion, earlier: _Motion | None) -> bool:
        if earlier is None or earlier.seconds > _LONGEST_MEMORY_S:
            return self._beyond_speed(motion)
        if earlier.continues(motion) and not self._beyond_speed(motion, _MOTION_FACTOR):
            return False
        return self._beyond_speed(motion) or self._beyond_acceleration(motion, earlier)

    def _beyond_speed(self, motion: _Motion, factor: float = 1.0) -> bool:
        limits, seconds = self.limits, factor * motion.seconds
        return motion.mm > max(limits.speed_mm_s * seconds, limits.noise_mm) or (
            motion.degrees > max(limits.turn_deg_s * seconds, limits.noise_deg)
        )

    def _beyond_acceleration(self, motion: _Motion, earlier: _Motion) -> bool:
        """Whether no hand gets so far from where the movement before was leading."""
        limits = self.limits
        again = motion.seconds / earlier.seconds
        reach = 0.5 * motion.seconds * (motion.seconds + earlier.seconds)
        off = min(float(np.linalg.norm(motion.shift - again * earlier.shift)), motion.mm)
        turned = min(abs(motion.degrees - again * earlier.degrees), motion.degrees)
        return off > limits.noise_mm + limits.acceleration_mm_s2 * reach or (
            turned > limits.noise_deg + limits.turn_acceleration_deg_s2 * reach
        )

    def _call_off(self, jump: _Motion | None, motion: _Motion) -> None:
        """Forget a jump that was the beginning of a movement, as the step after it shows."""
        before, self._before_jump = self._before_jump, None
        if before is None or jump is None or self._beyond_speed(jump, _MOTION_FACTOR):
            return
        if motion.continues(jump):
            self._state = before

    def _is_isolated(self, before: _Motion | None, step: _Motion | None, after: _Motion) -> bool:
        """Whether a step, followed by one more, leads away from a movement that goes on as before.

        A hand that moves so far in one step still moves in the next, or has moved in the one before. Where
        readings are slow, a jump of some millimetres is within what a hand could do, but not within that.
        """
        if before is None or step is None or max(before.seconds, after.seconds) > _LONGEST_MEMORY_S:
            return False
        first, last = (step.seconds / one.seconds * one.shift for one in (before, after))
        off = min(float(np.linalg.norm(step.shift - near)) for near in (first, last, (first + last) / 2))
        reach = _ISOLATED_SHARE * self.limits.acceleration_mm_s2 * step.seconds**2
        reach += _OF_STEPS * max(float(np.linalg.norm(near)) for near in (first, last))
        return off > self.limits.noise_mm + reach

    def _jumped(self, state: _State, previous: Sample, sample: Sample) -> _State:
        """Return the state after a jump: back in a segment that was left, or in a new one."""
        assert previous.matrix is not None
        assert sample.matrix is not None
        T_jump = sample.matrix @ np.linalg.inv(previous.matrix)
        left = tuple(replace(one, T_now_left=T_jump @ one.T_now_left) for one in state.left)
        for at in range(len(left) - 1, -1, -1):
            if self._is_back(left[at], sample):
                return _State(left[at].number, left[at].last, left[:at])
        if state.last is not None and state.suspicious_since is None:
            left = (*left, _Left(state.segment, state.last, T_jump))[-_MOST_SEGMENTS:]
        return _State(next(self._numbers), None, left, sample.received)

    def _is_back(self, left: _Left, sample: Sample) -> bool:
        """Whether the jumps since a segment was left cancel out, or lead back to its last place at once."""
        assert sample.matrix is not None
        assert left.last.matrix is not None
        limits = self.limits
        off = step_between(np.linalg.inv(left.T_now_left) @ sample.matrix, sample.matrix)
        if off.mm <= limits.noise_mm and off.degrees <= limits.noise_deg:
            return True
        seconds = sample.received - left.last.received
        step = step_between(left.last.matrix, sample.matrix)
        near = step.mm <= max(limits.speed_mm_s * seconds, limits.noise_mm)
        alike = step.degrees <= max(limits.turn_deg_s * seconds, limits.noise_deg)
        return seconds <= _LONGEST_MEMORY_S and near and alike

    def _words(self, sample: Sample) -> str:
        left = self._state.left
        if not left or left[-1].last.matrix is None or sample.matrix is None:
            return "the marker has just jumped"
        step = step_between(left[-1].last.matrix, sample.matrix)
        return f"the marker jumped by {step.mm:.0f} mm, {step.degrees:.0f} degrees"


def _motion(before: Sample, after: Sample) -> _Motion:
    assert before.matrix is not None
    assert after.matrix is not None
    seconds = after.time - before.time
    if seconds <= 0:  # the tracker's clock was set again between the two
        seconds = after.received - before.received
    degrees = float(turn_deg(before.matrix[:3, :3].T @ after.matrix[:3, :3]))
    return _Motion(max(seconds, 1e-6), after.matrix[:3, 3] - before.matrix[:3, 3], degrees)
