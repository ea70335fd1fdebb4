"""A workbench with a tracked probe: touches in the specimen, nothing false, the pose sent back out."""

from __future__ import annotations

import time

import numpy as np
import pyigtl
import pytest
from tracker_cases import DEADLINE, POINTS, TIP, SimulatorProcess, until

from gp_core import PROBE, Atlas, Side
from gp_core.errors import GpError
from gp_labeler.document import touching
from gp_labeler.document.touches import TouchHow
from gp_labeler.models.pose import ORDER
from gp_labeler.models.workspace import Workbench
from gp_labeler.tracker import LinkPhase, TrackerAddress


@pytest.fixture
def desk():
    desk = Workbench(atlas=Atlas.published(), author="AB")
    yield desk
    desk.close(discard=True)


@pytest.fixture(scope="module")
def simulator(tmp_path_factory):
    process = SimulatorProcess(tmp_path_factory.mktemp("desk"), "--noise", "0.05")
    yield process
    process.close()


def connected(desk, simulator, **fields):
    desk.tracker.set_tip_offset(TIP)
    desk.tracker.connect(TrackerAddress(port=simulator.port, **fields))
    until(lambda: desk.tracker.visible, desk.tracker.poll, "a visible tip")


def recorded(desk, name):
    """Press until the touch is in the specimen: a busy machine may hold messages up."""
    desk.pose.aim(name)
    seen = []
    desk.tracker.touched.connect(seen.append)
    desk.tracker.refused.connect(lambda _: desk.tracker.press())
    desk.tracker.press()
    until(lambda: bool(seen), desk.tracker.poll, "a touch")
    desk.tracker.touched.disconnect()
    desk.tracker.refused.disconnect()


def test_touches_go_into_the_specimen_with_their_spread(desk, simulator):
    connected(desk, simulator)
    for name in POINTS:
        simulator.do(f"go {name} 0.2")
        recorded(desk, name)
    for name, position in POINTS.items():
        touch = desk.session.state.touches[desk.pose.side, name]
        assert np.linalg.norm(np.array(touch.position) - position) < 0.1
        assert touch.how is TouchHow.TRACKED
        assert touch.n_samples >= 8
        assert 0 < touch.spread_mm < 0.2
        assert touch.source == "ProbeToTracker"
    assert desk.pose.estimate.pose is not None
    assert desk.session.undo_text == f"touch {list(POINTS)[-1]} left"
    assert np.linalg.norm(desk.tracker.tip - POINTS["CL"]) < 1.0
    assert len(desk.tracker.trail) > 8


def test_a_hidden_probe_records_nothing_and_says_so(desk, simulator):
    connected(desk, simulator)
    refusals = []
    desk.tracker.refused.connect(refusals.append)
    simulator.do("hide")
    until(lambda: not desk.tracker.visible, desk.tracker.poll, "a hidden tip")
    desk.tracker.press()
    until(lambda: bool(refusals), desk.tracker.poll, "a refusal")
    simulator.do("show")
    assert not desk.session.state.touches
    assert "Touch again" in refusals[0] or "in sight" in refusals[0]
    until(lambda: desk.tracker.visible, desk.tracker.poll, "a visible tip again")


def test_tracker_touches_do_not_mix_with_a_dry_run(desk, simulator):
    touching.record_touch(desk.session, "L", "ZL", (1, 2, 3), TouchHow.SCAN)
    connected(desk, simulator)
    refusals = []
    desk.tracker.refused.connect(refusals.append)
    desk.tracker.press()
    until(lambda: any("cannot mix" in text for text in refusals), desk.tracker.poll, "a refusal")
    assert list(desk.session.state.touches) == [(desk.pose.side, "ZL")]


def test_holding_still_where_nothing_is_asked_for_is_no_touch(desk, simulator):
    for code in ORDER:
        desk.pose.record(Atlas.published()[code], TouchHow.TYPED, name=code)
    assert desk.pose.target is None
    refusals = []
    desk.tracker.refused.connect(refusals.append)
    simulator.do("go RWA 0.2")
    connected(desk, simulator)
    desk.tracker.set_dwell(True)
    end = time.monotonic() + 1.2
    until(lambda: time.monotonic() > end, desk.tracker.poll)
    assert refusals == []
    desk.tracker.press()
    until(lambda: bool(refusals), desk.tracker.poll, "who presses is told")
    assert refusals[0] == "All features are touched. Choose one to touch again."


def test_without_a_tracker_a_press_says_so(desk):
    assert desk.tracker.phase is LinkPhase.OFF
    with pytest.raises(GpError, match="no tracker is connected"):
        desk.tracker.press()


def test_a_pivot_calibration_finds_the_tip_and_uses_it(desk, simulator):
    desk.tracker.connect(TrackerAddress(port=simulator.port))
    simulator.do("go RWA 0.2")
    until(lambda: desk.tracker.visible, desk.tracker.poll, "a visible tip")
    desk.tracker.start_pivot()
    simulator.tell("turn 20")
    until(lambda: desk.tracker.pivot.ready, desk.tracker.poll, "enough turning")
    found = desk.tracker.finish_pivot()
    assert np.linalg.norm(found.tip_offset - TIP) < 1.0
    np.testing.assert_array_equal(desk.tracker.probe.tip_offset, found.tip_offset)
    assert desk.tracker.pivot is None


def test_the_pose_is_sent_back_while_it_holds(desk):
    atlas = Atlas.published()
    desk.tracker.start_sending(0)
    port = desk.tracker.sending_port
    for name in (*PROBE, "IN"):
        desk.pose.record(atlas[name], TouchHow.TYPED, name=name)
    assert "nobody has accepted it" in desk.tracker.sending
    desk.pose.estimating.judge("accept")
    client = pyigtl.OpenIGTLinkClient("127.0.0.1", port)
    try:
        message = client.wait_for_message("T_tracker_cochlea", timeout=DEADLINE)
        np.testing.assert_allclose(message.matrix, desk.pose.estimate.pose.transform, atol=1e-4)
    finally:
        client.stop()
    desk.tracker.stop_sending()
    assert desk.tracker.sending == ""


@pytest.mark.parametrize("trouble", ["names", "side", "rejected"])
def test_a_pose_that_looks_wrong_is_held_back(desk, trouble):
    atlas, right = Atlas.published(), np.array([-1.0, 1.0, 1.0])
    said, words = [], []
    desk.message.connect(lambda text, _: said.append(text))
    desk.tracker.start_sending(0)
    desk.tracker.changed.connect(lambda: words.append(desk.tracker.sending))
    client = pyigtl.OpenIGTLinkClient("127.0.0.1", desk.tracker.sending_port)
    try:
        for name in (*PROBE, "IN"):
            source = {"MN": "OS", "OS": "MN"}.get(name, name) if trouble == "names" else name
            position = atlas[source] * (right if trouble == "side" else 1.0)
            desk.pose.record(position, TouchHow.TYPED, name=name)
        desk.pose.estimating.judge("accept")
        if trouble == "rejected":
            assert client.wait_for_message("T_tracker_cochlea", timeout=DEADLINE) is not None
            desk.pose.estimating.judge("reject")
        why = {"names": "look exchanged", "side": "look like those of the", "rejected": "it was rejected"}[
            trouble
        ]
        assert "Held back: " in words[-1], "a dialog that is open shows it at once"
        assert why in words[-1]
        assert any(text.startswith("The pose is held back from the robot: ") for text in said)
        if trouble == "names":
            desk.pose.swap_names()
        elif trouble == "side":
            desk.pose.change_side()
        if trouble != "rejected":
            assert "nobody has accepted it" in words[-1], "the touches have changed since"
        desk.pose.estimating.judge("accept")
        assert "Held back" not in words[-1]
        message = client.wait_for_message("T_tracker_cochlea", timeout=DEADLINE)
        np.testing.assert_allclose(message.matrix, desk.pose.estimate.pose.transform, atol=1e-4)
    finally:
        client.stop()


@pytest.mark.parametrize("change", ["skip", "side", "specimen"])
def test_a_press_for_one_feature_is_never_recorded_as_another(desk, simulator, change):
    connected(desk, simulator)
    simulator.do("go RWA 0.2")
    refusals = []
    desk.tracker.refused.connect(refusals.append)
    desk.pose.aim("RWA")
    desk.tracker.press()
    desk.tracker.poll()
    if change == "skip":
        desk.pose.skip()
    elif change == "side":
        desk.pose.choose(side=Side.RIGHT)
    else:
        desk.begin()
    until(lambda: bool(refusals), desk.tracker.poll, "a refusal")
    assert refusals[0].startswith("RWA is no longer asked for")
    end = time.monotonic() + 0.8
    until(lambda: time.monotonic() > end, desk.tracker.poll, "the end of a window")
    assert not desk.session.state.touches


def test_touches_in_two_frames_of_the_tracker_do_not_mix(desk, simulator):
    source = "ProbeToTracker in ReferenceToTracker"
    touching.record_touch(desk.session, "L", "ZL", (1, 2, 3), TouchHow.TRACKED, source=source)
    connected(desk, simulator)
    refusals = []
    desk.tracker.refused.connect(refusals.append)
    desk.tracker.refused.connect(lambda text: "frame" in text or desk.tracker.press())
    desk.tracker.press()
    until(lambda: any("in the frame of ReferenceToTracker" in t for t in refusals), desk.tracker.poll, "it")
    assert list(desk.session.state.touches) == [(desk.pose.side, "ZL")]
