"""Which messages are believed: each doubt is named, and what was doubtful is believed again in time."""

from __future__ import annotations

import numpy as np
import pytest
from tracker_cases import message, pose

from gp_labeler.tracker.judge import Fault, Judge, Limits

_STEP = 1 / 60


def _stream(judge: Judge, xs: list[float], *, start: float = 100.0, seed: int = 0) -> list[Fault]:
    rng = np.random.default_rng(seed)
    faults = []
    for k, x in enumerate(xs):
        at = start + k * _STEP
        noisy = pose(x, *rng.normal(0, 0.1, 2))
        faults += [s.fault for s in judge.take([message(noisy, at)], at)]
    return faults


def _one(judge: Judge, matrix: np.ndarray, at: float, received: float | None = None, **more: object) -> Fault:
    received = at if received is None else received
    (judged,) = judge.take([message(matrix, at, received, **more)], received)
    return judged.fault


def test_a_moving_marker_is_believed() -> None:
    xs = [5 * np.sin(k / 10) for k in range(120)]
    assert set(_stream(Judge("ProbeToTracker"), xs)) == {Fault.NONE}


def test_single_precision_is_made_rigid_exactly() -> None:
    judge = Judge("ProbeToTracker")
    rounded = pose(1, 2, 3).astype(np.float32).astype(np.float64)
    (judged,) = judge.take([message(rounded, 1.0)], 1.0)
    assert judged.usable
    rotation = judged.matrix[:3, :3]
    assert np.abs(rotation.T @ rotation - np.eye(3)).max() < 1e-14


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda m: m * np.nan, "finite"),
        (lambda m: m @ np.diag([1.02, 1.02, 1.02, 1]), "scales by 1.020"),
        (lambda m: m @ np.diag([-1.0, 1, 1, 1]), "mirrors"),
        (lambda m: m @ np.diag([0.0, 1, 1, 1]), "flat"),
        (lambda m: m @ np.array([[1, 0.1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "shears"),
    ],
)
def test_a_matrix_that_is_not_rigid_is_named(spoil, word) -> None:
    (judged,) = Judge("ProbeToTracker").take([message(spoil(pose(1)), 1.0)], 1.0)
    assert judged.fault is Fault.NOT_RIGID
    assert word in judged.detail
    assert judged.matrix is None
    assert not judged.usable


def test_a_marker_that_is_not_seen_is_hidden_however_that_is_told() -> None:
    judge = Judge("ProbeToTracker")
    assert _one(judge, np.eye(4), 1.0) is Fault.HIDDEN
    assert _one(judge, pose(1), 1.1, metadata={"TransformStatus": "OUT_OF_VIEW"}) is Fault.HIDDEN
    assert _one(judge, pose(1), 1.2, metadata={"TransformStatus": "TOOL_MISSING"}) is Fault.HIDDEN
    assert _one(judge, pose(1), 1.3, metadata={"TransformValid": "0"}) is Fault.HIDDEN
    assert _one(judge, pose(1), 1.4, metadata={"TransformStatus": "OK"}) is Fault.NONE


def test_repeated_and_out_of_order_messages_are_named() -> None:
    judge = Judge("ProbeToTracker")
    assert _one(judge, pose(1), 10.0) is Fault.NONE
    assert _one(judge, pose(1.1), 10.0, 10.02) is Fault.REPEATED
    assert _one(judge, pose(1.2), 9.9, 10.03) is Fault.BACKWARDS
    assert _one(judge, pose(1.3), 10.1) is Fault.NONE


def test_lateness_is_measured_against_the_quickest_whatever_the_clocks_say() -> None:
    judge = Judge("ProbeToTracker")
    ahead = 1e9  # the tracker's clock
    for k in range(30):
        assert _one(judge, pose(k / 10), ahead + k * _STEP, k * _STEP + 0.02) is Fault.NONE
    assert _one(judge, pose(3), ahead + 0.6, 0.6 + 0.1) is Fault.NONE
    assert _one(judge, pose(3.1), ahead + 0.7, 0.7 + 0.4) is Fault.LATE
    assert _one(judge, pose(3.2), ahead + 1.2, 1.2 + 0.02) is Fault.NONE


def test_a_slow_clock_does_not_make_messages_late() -> None:
    judge = Judge("ProbeToTracker")
    faults = {_one(judge, pose(k % 7), k * (1 - 1e-4), float(k)) for k in range(1, 20000, 20)}
    assert faults == {Fault.NONE}


def test_messages_without_a_time_take_that_of_their_arrival() -> None:
    judge = Judge("ProbeToTracker")
    assert _one(judge, pose(1), 0.0, 5.0) is Fault.NONE
    assert _one(judge, pose(1.1), 0.0, 5.1) is Fault.NONE


def test_a_marker_still_to_the_last_digit_is_frozen() -> None:
    still = [message(pose(1), k * _STEP) for k in range(40)]
    faults = [s.fault for s in Judge("ProbeToTracker").take(still, 1.0)]
    first = faults.index(Fault.FROZEN)
    assert 0.2 <= first * _STEP <= 0.25
    assert set(faults[first:]) == {Fault.FROZEN}
    robot = Judge("ProbeToTracker", limits=Limits(frozen_s=None))
    assert {s.fault for s in robot.take(still, 1.0)} == {Fault.NONE}


def test_other_limits_count_from_the_next_message_on() -> None:
    judge = Judge("ProbeToTracker", "Reference")
    still = [
        message(pose(1), k * _STEP, device=name)
        for k in range(60)
        for name in ("Reference", "ProbeToTracker")
    ]
    assert judge.take(still[:60], 1.0)[-1].fault is Fault.FROZEN
    judge.set_limits(Limits(frozen_s=None))
    assert {s.fault for s in judge.take(still[60:90], 1.5)} == {Fault.NONE}
    judge.set_limits(Limits())
    assert {s.fault for s in judge.take(still[90:], 2.0)} == {Fault.FROZEN}


def test_one_wrong_position_is_passed_over() -> None:
    faults = _stream(Judge("ProbeToTracker"), [0.0] * 20 + [40.0] + [0.0] * 20)
    assert faults[20] is Fault.JUMP
    assert faults.count(Fault.JUMP) == 1


def test_a_jump_and_back_records_nothing_between() -> None:
    faults = _stream(Judge("ProbeToTracker"), [0.0] * 20 + [40.0] * 12 + [0.0] * 20)
    assert faults[20:32] == [Fault.JUMP] * 12
    assert set(faults[:20] + faults[32:]) == {Fault.NONE}


def test_a_second_jump_to_a_third_place_is_doubted_too() -> None:
    faults = _stream(Judge("ProbeToTracker"), [0.0] * 20 + [40.0] * 12 + [-700.0] * 12)
    assert faults[20:] == [Fault.JUMP] * 24


def test_a_jump_that_stays_is_believed_after_a_while() -> None:
    faults = _stream(Judge("ProbeToTracker"), [0.0] * 20 + [40.0] * 60)
    doubted = faults.count(Fault.JUMP)
    assert 0.3 <= doubted * _STEP <= 0.35
    assert set(faults[20 + doubted :]) == {Fault.NONE}


def test_a_marker_that_flips_has_jumped() -> None:
    judge = Judge("ProbeToTracker")
    assert _one(judge, pose(1, turn=0.3), 1.0) is Fault.NONE
    assert _one(judge, pose(1, turn=1.3), 1.02) is Fault.JUMP


def test_after_a_gap_the_marker_may_be_elsewhere() -> None:
    judge = Judge("ProbeToTracker")
    assert _one(judge, pose(0), 1.0) is Fault.NONE
    assert _one(judge, pose(300), 1.5) is Fault.NONE


def _with_reference(probe_at: float, reference_at: float, now: float, **more: object):
    judge = Judge("ProbeToTracker", "ReferenceToTracker")
    reference = message(pose(10, turn=0.5), reference_at, device="ReferenceToTracker", **more)
    return judge.take([reference, message(pose(12, 1, turn=0.9), probe_at)], now)


def test_positions_are_in_the_reference_s_frame() -> None:
    (judged,) = _with_reference(1.0, 1.0, 1.0)
    assert judged.matrix == pytest.approx(np.linalg.inv(pose(10, turn=0.5)) @ pose(12, 1, turn=0.9))


def test_a_moving_head_is_taken_off() -> None:
    judge = Judge("ProbeToTracker", "ReferenceToTracker")
    fixed = pose(12, 1, turn=0.9)
    for k in range(100):
        head = pose(30 * np.sin(k / 20), 5, turn=0.2 * np.cos(k / 20))
        at = 1 + k * _STEP
        both = [message(head @ fixed, at), message(head, at, device="ReferenceToTracker")]
        (judged,) = judge.take(both, at)
        assert judged.usable
        assert judged.matrix == pytest.approx(fixed, abs=1e-9)


def test_a_reference_of_another_moment_does_not_serve() -> None:
    (judged,) = _with_reference(1.2, 1.0, 1.3)
    assert judged.fault is Fault.NO_REFERENCE
    assert judged.matrix is None  # the probe in the tracker's frame is of no use to anyone here
    assert _with_reference(1.0, 0.98, 1.01) == []  # a nearer one may still come
    (judged,) = _with_reference(1.0, 0.98, 1.2)
    assert judged.usable


def test_a_reference_that_is_not_seen_hides_the_probe() -> None:
    (judged,) = _with_reference(1.0, 1.0, 1.0, metadata={"TransformStatus": "OUT_OF_VIEW"})
    assert judged.fault is Fault.NO_REFERENCE
    assert not judged.visible
    assert "ReferenceToTracker" in judged.detail
