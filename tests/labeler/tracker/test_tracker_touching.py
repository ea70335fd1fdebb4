"""Touches: what is averaged, what is refused and in which words, and that standing still records once."""

from __future__ import annotations

import numpy as np
import pytest
from tracker_cases import pose, sample

from gp_core.errors import GpError
from gp_labeler.tracker import Fault, Probe, RecordedTouch, RefusedTouch, Sample, TouchRecorder, TouchSettings

_STEP = 1 / 60
_OFFSET = (0.0, 0.0, -100.0)


class _ProbeRecording:
    """Feeds a recorder with samples on a clock of its own."""

    def __init__(self, *, dwell: bool = False, offset: tuple[float, float, float] = _OFFSET) -> None:
        self.time = 50.0
        self.rng = np.random.default_rng(0)
        self.recorder = TouchRecorder(Probe(offset), dwell=dwell, clock=lambda: self.time)
        self.outcomes: list[RecordedTouch | RefusedTouch] = []

    def hold(self, at: tuple[float, float, float], seconds: float, fault: Fault = Fault.NONE, **more) -> None:
        detail = "it is covered" if fault else ""
        for _ in range(round(seconds / _STEP)):
            self.time += _STEP
            matrix = pose(*(np.array(at) + self.rng.normal(0, more.get("noise", 0.1), 3)))
            matrix[2, 3] += 100
            self.take(Sample(self.time, self.time, matrix, fault, detail))

    def take(self, *samples: Sample) -> None:
        self.outcomes += self.recorder.update(samples)

    def travel(self, a: tuple[float, float, float], b: tuple[float, float, float], seconds: float) -> None:
        for k in range(round(seconds / _STEP)):
            self.hold(tuple(np.array(a) + (np.array(b) - a) * k * _STEP / seconds), _STEP)

    def wait(self, seconds: float) -> None:
        self.time += seconds
        self.take()


_A, _B = (1.0, 2.0, 3.0), (11.0, 2.0, 3.0)


def test_a_press_averages_the_next_half_second_of_the_tip() -> None:
    probe = _ProbeRecording()
    probe.travel(_B, _A, 0.3)
    probe.recorder.press()
    assert probe.recorder.recording
    probe.hold(_A, 0.4)
    assert probe.outcomes == []
    assert 0.7 < probe.recorder.progress < 0.9
    probe.hold(_A, 0.2)
    (touch,) = probe.outcomes
    assert isinstance(touch, RecordedTouch)
    assert touch.position == pytest.approx(_A, abs=0.06)
    assert touch.spread_mm == pytest.approx(0.1 * np.sqrt(3), rel=0.3)
    assert 29 <= touch.n_samples <= 32
    assert touch.duration_s == pytest.approx(0.5, abs=0.05)
    assert touch.time.endswith("+00:00")
    assert not probe.recorder.recording


def test_strays_are_not_averaged() -> None:
    probe = _ProbeRecording()
    probe.recorder.press()
    probe.hold(_A, 0.2)
    probe.hold((1.9, 2.0, 3.0), _STEP, noise=0.0)
    probe.hold(_A, 0.4)
    (touch,) = probe.outcomes
    assert touch.position == pytest.approx(_A, abs=0.06)


@pytest.mark.parametrize(
    ("fault", "seconds"),
    [
        (Fault.HIDDEN, 0.3),
        (Fault.LATE, 0.3),
        (Fault.FROZEN, 0.3),
        (Fault.FROZEN, _STEP),
        (Fault.NO_REFERENCE, 0.3),
        (Fault.JUMP, _STEP),
    ],
)
def test_a_press_among_doubtful_samples_is_refused_with_the_reason(fault, seconds) -> None:
    probe = _ProbeRecording()
    probe.recorder.press()
    probe.hold(_A, 0.1)
    probe.hold(_A, seconds, fault)
    probe.hold(_A, 0.6)
    (refused,) = probe.outcomes
    assert isinstance(refused, RefusedTouch)
    assert refused.fault is fault
    assert refused.reason == "It is covered. Touch again."


def test_one_covered_sample_does_not_spoil_a_touch_and_is_not_averaged() -> None:
    probe = _ProbeRecording()
    probe.recorder.press()
    probe.hold(_A, 0.2)
    probe.hold((5.0, 5.0, 5.0), _STEP, Fault.HIDDEN)
    probe.hold(_A, 0.4)
    (touch,) = probe.outcomes
    assert touch.position == pytest.approx(_A, abs=0.06)


def test_a_moving_tip_is_refused() -> None:
    probe = _ProbeRecording()
    probe.recorder.press()
    probe.travel(_A, _B, 0.6)
    (refused,) = probe.outcomes
    assert "moved by" in refused.reason
    probe.outcomes.clear()
    probe.recorder.press()
    probe.travel(_A, (2.2, 2.0, 3.0), 0.6)  # slowly: within the radius, but it wanders
    assert "(0.5 is allowed)" in probe.outcomes[0].reason


def test_a_press_ends_even_where_nothing_comes() -> None:
    probe = _ProbeRecording()
    probe.recorder.press()
    probe.wait(0.6)
    assert probe.outcomes == []
    probe.wait(0.3)
    (refused,) = probe.outcomes
    assert "No message" in refused.reason
    assert not probe.recorder.recording


def test_too_few_samples_are_refused() -> None:
    probe = _ProbeRecording()
    probe.recorder.press()
    for _ in range(5):
        probe.time += 0.11
        probe.take(sample(1.0, probe.time))
    (refused,) = probe.outcomes
    assert "Only 5 readings" in refused.reason


def test_what_was_held_up_and_comes_at_once_is_no_touch() -> None:
    probe = _ProbeRecording()
    probe.recorder.press()
    probe.time += 0.6
    held_up = [
        Sample(probe.time - 0.6 + k * _STEP, probe.time, pose(1 + k % 3 / 10, 2, 3)) for k in range(36)
    ]
    probe.take(*held_up)
    assert all(isinstance(o, RefusedTouch) for o in probe.outcomes)
    dwelling = _ProbeRecording(dwell=True)
    dwelling.take(*held_up)
    at = held_up[-1].time + _STEP
    dwelling.take(Sample(at, probe.time + _STEP, pose(1, 2, 3)))
    assert dwelling.outcomes == []


def test_standing_still_records_once_until_the_tip_has_been_elsewhere() -> None:
    probe = _ProbeRecording(dwell=True)
    probe.hold(_A, 2.0)
    (touch,) = probe.outcomes
    assert touch.position == pytest.approx(_A, abs=0.06)
    assert not probe.recorder.armed
    probe.travel(_A, (4.0, 2.0, 3.0), 0.3)  # not far enough
    probe.hold((4.0, 2.0, 3.0), 1.0)
    probe.travel((4.0, 2.0, 3.0), _A, 0.3)
    probe.hold(_A, 1.0)
    assert len(probe.outcomes) == 1
    probe.travel(_A, _B, 0.4)
    probe.hold(_B, 1.0)
    assert len(probe.outcomes) == 2
    assert probe.outcomes[1].position == pytest.approx(_B, abs=0.06)


def test_without_dwell_standing_still_records_nothing() -> None:
    probe = _ProbeRecording()
    probe.hold(_A, 2.0)
    assert probe.outcomes == []


def test_dwell_takes_an_unbroken_half_second() -> None:
    probe = _ProbeRecording(dwell=True)
    for _ in range(5):
        probe.hold(_A, 0.4)
        probe.hold(_A, 0.2, Fault.HIDDEN)
        probe.hold(_A, 0.4)
        probe.hold(_A, _STEP, Fault.JUMP)
    assert probe.outcomes == []
    probe.hold(_A, 0.55)
    assert len(probe.outcomes) == 1


def test_a_tracker_that_comes_back_with_another_clock_dwells_again() -> None:
    probe = _ProbeRecording(dwell=True)
    probe.hold(_A, 0.3)
    for k in range(60):
        probe.time += _STEP
        probe.take(Sample(1.0 + k * _STEP, probe.time, pose(1 + k % 3 / 10, 2, 103)))
    assert len(probe.outcomes) == 1


def test_a_moving_tip_never_dwells() -> None:
    probe = _ProbeRecording(dwell=True)
    probe.travel(_A, _B, 2.0)
    assert probe.outcomes == []


def test_pressing_disarms_dwell_at_that_place() -> None:
    probe = _ProbeRecording(dwell=True)
    probe.recorder.press()
    probe.hold(_A, 2.0)
    assert len(probe.outcomes) == 1


def test_cancelling_forgets_a_press() -> None:
    probe = _ProbeRecording()
    probe.recorder.press()
    probe.hold(_A, 0.3)
    probe.recorder.cancel()
    probe.hold(_A, 1.0)
    probe.wait(1.0)
    assert probe.outcomes == []


@pytest.mark.parametrize("name", ["window_s", "radius_mm", "drift_mm", "away_mm", "min_samples", "max_gap_s"])
def test_settings_must_be_positive(name) -> None:
    with pytest.raises(GpError, match=f"{name} of a touch must be above 0"):
        TouchSettings(**{name: 0})
