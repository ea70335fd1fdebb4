"""Which messages are believed: each fault is named, and what was doubtful is believed again in time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from tracker_cases import message, pose

from gp_labeler.tracker.sample_filter import SampleFilter
from gp_labeler.tracker.samples import Fault, Limits, Sample

_STEP = 1 / 60


def _stream(samples: SampleFilter, xs: list[float], *, start: float = 100.0, seed: int = 0) -> list[Fault]:
    rng = np.random.default_rng(seed)
    faults = []
    for k, x in enumerate(xs):
        at = start + k * _STEP
        noisy = pose(x, *rng.normal(0, 0.1, 2))
        faults += [s.fault for s in samples.take([message(noisy, at)], at)]
    return faults


def _one(
    samples: SampleFilter, matrix: np.ndarray, at: float, received: float | None = None, **more: object
) -> Fault:
    received = at if received is None else received
    (sample,) = samples.take([message(matrix, at, received, **more)], received)
    return sample.fault


def test_a_moving_marker_is_believed() -> None:
    xs = [5 * np.sin(k / 10) for k in range(120)]
    assert set(_stream(SampleFilter("ProbeToTracker"), xs)) == {Fault.NONE}


def test_single_precision_is_made_rigid_exactly() -> None:
    samples = SampleFilter("ProbeToTracker")
    rounded = pose(1, 2, 3).astype(np.float32).astype(np.float64)
    (sample,) = samples.take([message(rounded, 1.0)], 1.0)
    assert sample.usable
    rotation = sample.matrix[:3, :3]
    assert np.abs(rotation.T @ rotation - np.eye(3)).max() < 1e-14


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda m: m * np.nan, "finite"),
        (lambda m: m @ np.diag([1.02, 1.02, 1.02, 1]), "scales by 1.020"),
        (lambda m: m @ np.diag([-1.0, 1, 1, 1]), "reflection"),
        (lambda m: m @ np.diag([0.0, 1, 1, 1]), "singular"),
        (lambda m: m @ np.array([[1, 0.1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "shears"),
    ],
)
def test_a_matrix_that_is_not_rigid_is_named(spoil, word) -> None:
    (sample,) = SampleFilter("ProbeToTracker").take([message(spoil(pose(1)), 1.0)], 1.0)
    assert sample.fault is Fault.NOT_RIGID
    assert word in sample.detail
    assert sample.matrix is None
    assert not sample.usable


def test_a_marker_that_is_not_seen_is_hidden_however_that_is_told() -> None:
    samples = SampleFilter("ProbeToTracker")
    assert _one(samples, np.eye(4), 1.0) is Fault.HIDDEN
    assert _one(samples, pose(1), 1.1, metadata={"TransformStatus": "OUT_OF_VIEW"}) is Fault.HIDDEN
    assert _one(samples, pose(1), 1.2, metadata={"TransformStatus": "TOOL_MISSING"}) is Fault.HIDDEN
    assert _one(samples, pose(1), 1.3, metadata={"TransformValid": "0"}) is Fault.HIDDEN
    assert _one(samples, pose(1), 1.4, metadata={"TransformStatus": "OK"}) is Fault.NONE


def test_repeated_and_out_of_order_messages_are_named() -> None:
    samples = SampleFilter("ProbeToTracker")
    assert _one(samples, pose(1), 10.0) is Fault.NONE
    assert _one(samples, pose(1.1), 10.0, 10.02) is Fault.REPEATED
    assert _one(samples, pose(1.2), 9.9, 10.03) is Fault.BACKWARDS
    assert _one(samples, pose(1.3), 10.1) is Fault.NONE


def test_lateness_is_measured_against_the_quickest_whatever_the_clocks_say() -> None:
    samples = SampleFilter("ProbeToTracker")
    ahead = 1e9  # the tracker's clock
    for k in range(30):
        assert _one(samples, pose(k / 10), ahead + k * _STEP, k * _STEP + 0.02) is Fault.NONE
    assert _one(samples, pose(3), ahead + 0.6, 0.6 + 0.1) is Fault.NONE
    assert _one(samples, pose(3.1), ahead + 0.7, 0.7 + 0.4) is Fault.LATE
    assert _one(samples, pose(3.2), ahead + 1.2, 1.2 + 0.02) is Fault.NONE


def test_a_slow_clock_does_not_make_messages_late() -> None:
    samples = SampleFilter("ProbeToTracker")
    faults = {_one(samples, pose(k % 7), k * (1 - 1e-4), float(k)) for k in range(1, 20000, 20)}
    assert faults == {Fault.NONE}


def test_messages_without_a_time_take_that_of_their_arrival() -> None:
    samples = SampleFilter("ProbeToTracker")
    assert _one(samples, pose(1), 0.0, 5.0) is Fault.NONE
    assert _one(samples, pose(1.1), 0.0, 5.1) is Fault.NONE


def test_a_marker_still_to_the_last_digit_is_frozen() -> None:
    still = [message(pose(1), k * _STEP) for k in range(40)]
    faults = [s.fault for s in SampleFilter("ProbeToTracker").take(still, 1.0)]
    first = faults.index(Fault.FROZEN)
    assert 0.2 <= first * _STEP <= 0.25
    assert set(faults[first:]) == {Fault.FROZEN}
    robot = SampleFilter("ProbeToTracker", limits=Limits(frozen_s=None))
    assert {s.fault for s in robot.take(still, 1.0)} == {Fault.NONE}


def test_other_limits_count_from_the_next_message_on() -> None:
    samples = SampleFilter("ProbeToTracker", "Reference")
    still = [
        message(pose(1), k * _STEP, device=name)
        for k in range(60)
        for name in ("Reference", "ProbeToTracker")
    ]
    assert samples.take(still[:60], 1.0)[-1].fault is Fault.FROZEN
    samples.set_limits(Limits(frozen_s=None))
    assert {s.fault for s in samples.take(still[60:90], 1.5)} == {Fault.NONE}
    samples.set_limits(Limits())
    assert {s.fault for s in samples.take(still[90:], 2.0)} == {Fault.FROZEN}


def test_one_wrong_position_is_passed_over() -> None:
    faults = _stream(SampleFilter("ProbeToTracker"), [0.0] * 20 + [40.0] + [0.0] * 20)
    assert faults[20] is Fault.JUMP
    assert faults.count(Fault.JUMP) == 1


def test_a_jump_and_back_records_nothing_between() -> None:
    faults = _stream(SampleFilter("ProbeToTracker"), [0.0] * 20 + [40.0] * 12 + [0.0] * 20)
    assert faults[20:32] == [Fault.JUMP] * 12
    assert set(faults[:20] + faults[32:]) == {Fault.NONE}


def test_a_second_jump_to_a_third_place_is_held_back_too() -> None:
    faults = _stream(SampleFilter("ProbeToTracker"), [0.0] * 20 + [40.0] * 12 + [-700.0] * 12)
    assert faults[20:] == [Fault.JUMP] * 24


def test_after_a_jump_that_stays_nothing_is_believed_for_two_seconds() -> None:
    faults = _stream(SampleFilter("ProbeToTracker"), [0.0] * 20 + [40.0] * 160)
    held_back = faults.count(Fault.JUMP)
    assert 2.0 <= held_back * _STEP <= 2.05
    assert set(faults[20 + held_back :]) == {Fault.NONE}


def _samples(xs: list[float], step: float = _STEP, seed: int = 0) -> list[Sample]:
    samples, rng, got = SampleFilter("ProbeToTracker"), np.random.default_rng(seed), []
    for k, x in enumerate(xs):
        noisy = pose(x, *rng.normal(0, 0.1, 2))
        got += samples.take([message(noisy, 100 + k * step)], 100 + k * step)
    return got


def test_a_jump_that_stays_begins_another_segment_until_it_is_taken_back() -> None:
    got = _samples([0.0] * 20 + [40.0] * 200 + [0.0] * 20)
    assert {s.segment for s in got[:20]} == {0}
    assert {s.segment for s in got[20:220]} == {1}
    assert {s.segment for s in got[220:]} == {0}
    assert all(s.usable for s in got[220:])


def test_a_hand_that_moved_on_during_a_jump_comes_back_to_the_same_segment() -> None:
    way = [0.15 * k for k in range(600)]  # 9 mm/s
    got = _samples([x + (40.0 if 100 <= k < 400 else 0.0) for k, x in enumerate(way)])
    assert (got[99].segment, got[399].segment, got[400].segment, got[-1].segment) == (0, 1, 0, 0)


@pytest.mark.parametrize("hertz", [20, 60, 250])
def test_a_jump_is_no_less_a_jump_where_readings_are_rare(hertz) -> None:
    rest = hertz // 2
    got = _samples([0.0] * rest + [45.0] * hertz, 1 / hertz)
    assert {s.fault for s in got[:rest]} == {Fault.NONE}
    assert {s.fault for s in got[rest:]} == {Fault.JUMP}


def _there_and_back(hertz: int) -> list[float]:
    """250 mm in half a second, as smoothly as hands move, there and back."""
    s = np.linspace(0, 1, hertz // 2, endpoint=False)
    go = 250 * (10 * s**3 - 15 * s**4 + 6 * s**5)
    return [0.0] * hertz + [*go, *(250 - go)] * 4 + [0.0] * hertz


@pytest.mark.parametrize("hertz", [60, 250])
def test_a_vigorous_hand_is_no_jump(hertz) -> None:
    samples = _samples(_there_and_back(hertz), 1 / hertz)
    assert {(s.fault, s.segment) for s in samples} == {(Fault.NONE, 0)}


def test_where_readings_are_rare_a_vigorous_hand_costs_its_first_one_only() -> None:
    samples = _samples(_there_and_back(20), 1 / 20)
    held_back = [k for k, s in enumerate(samples) if not s.usable]
    assert len(held_back) <= 8
    assert all(b - a > 1 for a, b in pairwise(held_back))
    assert {s.segment for s in samples if s.usable} == {0}


def test_a_flick_costs_samples_and_begins_no_segment() -> None:
    flick = [30 * np.sin(k * 2 * np.pi / 12) for k in range(25)]  # 12 m/s2 at 5 Hz
    got = _samples([0.0] * 60 + flick + [0.0] * 60)
    assert got[-1].segment == 0
    assert all(s.usable for s in got[-50:])


@pytest.mark.parametrize("shift", [-3600.0, -1.2, 0.9, 3600.0])
def test_a_clock_that_was_set_again_is_named_and_followed(shift) -> None:
    samples = SampleFilter("ProbeToTracker")
    got = []
    for k in range(600):
        at = k * _STEP
        got += samples.take(
            [message(pose(5 * np.sin(k / 10)), 5000 + at + (shift if k >= 200 else 0), at)], at
        )
    assert {s.fault for s in got[:200]} == {Fault.NONE}
    assert got[210].fault in (Fault.CLOCK, Fault.LATE)
    lost = [s for s in got[200:] if not s.usable]
    assert 1.0 <= len(lost) * _STEP <= 2.0
    assert {s.fault for s in got[200 + len(lost) :]} == {Fault.NONE}


@pytest.mark.parametrize("shift", [-1e6, -0.7, 0.7, 1e6, 4e9])
def test_one_damaged_time_stamp_costs_one_sample(shift) -> None:
    samples = SampleFilter("ProbeToTracker")
    got = []
    for k in range(200):
        at = k * _STEP
        got += samples.take(
            [message(pose(5 * np.sin(k / 10)), 5000 + at + (shift if k == 100 else 0), at)], at
        )
    assert [k for k, s in enumerate(got) if not s.usable] == [100]


def test_a_damaged_message_is_named_and_changes_nothing() -> None:
    samples = SampleFilter("ProbeToTracker")
    for k in range(20):
        assert _one(samples, pose(k / 10), k * _STEP) is Fault.NONE
    assert _one(samples, pose(2), 1e9, 20 * _STEP, damaged=True) is Fault.DAMAGED
    assert _one(samples, pose(2.1), 21 * _STEP) is Fault.NONE


def test_a_marker_that_flips_has_jumped() -> None:
    samples = SampleFilter("ProbeToTracker")
    assert _one(samples, pose(1, turn=0.3), 1.0) is Fault.NONE
    assert _one(samples, pose(1, turn=1.3), 1.02) is Fault.JUMP


def test_after_a_gap_the_marker_may_be_elsewhere() -> None:
    samples = SampleFilter("ProbeToTracker")
    assert _one(samples, pose(0), 1.0) is Fault.NONE
    assert _one(samples, pose(300), 1.5) is Fault.NONE


def _with_reference(probe_at: float, reference_at: float, now: float, **more: object):
    samples = SampleFilter("ProbeToTracker", "ReferenceToTracker")
    reference = message(pose(10, turn=0.5), reference_at, device="ReferenceToTracker", **more)
    return samples.take([reference, message(pose(12, 1, turn=0.9), probe_at)], now)


def test_positions_are_in_the_reference_s_frame() -> None:
    (sample,) = _with_reference(1.0, 1.0, 1.0)
    assert sample.matrix == pytest.approx(np.linalg.inv(pose(10, turn=0.5)) @ pose(12, 1, turn=0.9))


def test_a_moving_head_is_taken_off() -> None:
    samples = SampleFilter("ProbeToTracker", "ReferenceToTracker")
    fixed = pose(12, 1, turn=0.9)
    for k in range(100):
        head = pose(30 * np.sin(k / 20), 5, turn=0.2 * np.cos(k / 20))
        at = 1 + k * _STEP
        both = [message(head @ fixed, at), message(head, at, device="ReferenceToTracker")]
        (sample,) = samples.take(both, at)
        assert sample.usable
        assert sample.matrix == pytest.approx(fixed, abs=1e-9)


@pytest.mark.parametrize("age", [0.004, 0.012, 0.03])
def test_a_head_that_moves_between_two_readings_does_not_shift_the_tip(age) -> None:
    """The reference is read `age` seconds before the probe; the head moves at 20 mm/s and turns."""
    samples, fixed = SampleFilter("ProbeToTracker", "ReferenceToTracker"), pose(12, 1, turn=0.9)

    def head(at: float) -> np.ndarray:
        return pose(20 * at, 5, turn=0.05 * at)

    got = []
    for k in range(100):
        at = 1 + k / 30
        reference = message(head(at - age), at - age, at, device="ReferenceToTracker")
        got += samples.take([reference, message(head(at) @ fixed, at)], at)
    assert len(got) > 90
    assert all(s.usable for s in got[1:])
    assert max(np.abs(s.matrix - fixed).max() for s in got[1:]) < 0.01


def test_a_reference_of_another_moment_does_not_serve() -> None:
    (sample,) = _with_reference(1.2, 1.0, 1.4)
    assert sample.fault is Fault.NO_REFERENCE
    assert sample.matrix is None  # the probe in the tracker's frame is of no use to anyone here
    assert _with_reference(1.0, 0.98, 1.01) == []  # the next one may still come
    (sample,) = _with_reference(1.0, 0.98, 1.2)  # it did not: how far the head has moved is not known
    assert sample.fault is Fault.NO_REFERENCE


def test_a_reference_that_is_not_seen_hides_the_probe() -> None:
    (sample,) = _with_reference(1.0, 1.0, 1.0, metadata={"TransformStatus": "OUT_OF_VIEW"})
    assert sample.fault is Fault.NO_REFERENCE
    assert not sample.visible
    assert "ReferenceToTracker" in sample.detail
