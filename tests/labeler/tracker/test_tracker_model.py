"""A workspace with a tracked probe: touches in the specimen, nothing false, the pose sent back out."""

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
from gp_labeler.models.workspace import Workspace
from gp_labeler.tracker import LinkPhase, TrackerAddress


@pytest.fixture
def workspace():
    workspace = Workspace(atlas=Atlas.published(), author="AB")
    yield workspace
    workspace.close(discard=True)


@pytest.fixture(scope="module")
def simulator(tmp_path_factory):
    process = SimulatorProcess(tmp_path_factory.mktemp("workspace"), "--noise", "0.05")
    yield process
    process.close()


def connected(workspace, simulator, **fields):
    workspace.tracker.set_tip_offset(TIP)
    workspace.tracker.connect(TrackerAddress(port=simulator.port, **fields))
    until(lambda: workspace.tracker.visible, workspace.tracker.poll, "a visible tip")


def recorded(workspace, name):
    """Press until the touch is in the specimen: a busy machine may hold messages up."""
    workspace.pose.set_target(name)
    seen = []
    workspace.tracker.touched.connect(seen.append)
    workspace.tracker.refused.connect(lambda _: workspace.tracker.press())
    workspace.tracker.press()
    until(lambda: bool(seen), workspace.tracker.poll, "a touch")
    workspace.tracker.touched.disconnect()
    workspace.tracker.refused.disconnect()


def test_touches_go_into_the_specimen_with_their_spread(workspace, simulator):
    connected(workspace, simulator)
    for name in POINTS:
        simulator.do(f"go {name} 0.2")
        recorded(workspace, name)
    for name, position in POINTS.items():
        touch = workspace.document.state.touches[workspace.pose.side, name]
        assert np.linalg.norm(np.array(touch.position) - position) < 0.1
        assert touch.how is TouchHow.TRACKED
        assert touch.n_samples >= 8
        assert 0 < touch.spread_mm < 0.2
        assert touch.source == "ProbeToTracker"
    assert workspace.pose.estimate.pose is not None
    assert workspace.document.undo_text == f"touch {list(POINTS)[-1]} left"
    assert np.linalg.norm(workspace.tracker.tip - POINTS["CL"]) < 1.0
    assert len(workspace.tracker.trail) > 8


def test_a_hidden_probe_records_nothing_and_says_so(workspace, simulator):
    connected(workspace, simulator)
    refusals = []
    workspace.tracker.refused.connect(refusals.append)
    simulator.do("hide")
    until(lambda: not workspace.tracker.visible, workspace.tracker.poll, "a hidden tip")
    workspace.tracker.press()
    until(lambda: bool(refusals), workspace.tracker.poll, "a refusal")
    simulator.do("show")
    assert not workspace.document.state.touches
    assert "Touch again" in refusals[0] or "in sight" in refusals[0]
    until(lambda: workspace.tracker.visible, workspace.tracker.poll, "a visible tip again")


def test_tracker_touches_do_not_mix_with_a_dry_run(workspace, simulator):
    touching.record_touch(workspace.document, "L", "ZL", (1, 2, 3), TouchHow.SCAN)
    connected(workspace, simulator)
    refusals = []
    workspace.tracker.refused.connect(refusals.append)
    workspace.tracker.press()
    until(lambda: any("cannot mix" in text for text in refusals), workspace.tracker.poll, "a refusal")
    assert list(workspace.document.state.touches) == [(workspace.pose.side, "ZL")]


def test_holding_still_where_nothing_is_asked_for_is_no_touch(workspace, simulator):
    for code in ORDER:
        workspace.pose.record(Atlas.published()[code], TouchHow.TYPED, name=code)
    assert workspace.pose.target is None
    refusals = []
    workspace.tracker.refused.connect(refusals.append)
    simulator.do("go RWA 0.2")
    connected(workspace, simulator)
    workspace.tracker.set_dwell(True)
    end = time.monotonic() + 1.2
    until(lambda: time.monotonic() > end, workspace.tracker.poll)
    assert refusals == []
    workspace.tracker.press()
    until(lambda: bool(refusals), workspace.tracker.poll, "who presses is told")
    assert refusals[0] == "All features are touched. Select one to touch again."


def test_without_a_tracker_a_press_says_so(workspace):
    assert workspace.tracker.phase is LinkPhase.OFF
    with pytest.raises(GpError, match="no tracker is connected"):
        workspace.tracker.press()


def test_a_pivot_calibration_finds_the_tip_and_uses_it(workspace, simulator):
    workspace.tracker.connect(TrackerAddress(port=simulator.port))
    simulator.do("go RWA 0.2")
    until(lambda: workspace.tracker.visible, workspace.tracker.poll, "a visible tip")
    workspace.tracker.start_pivot()
    simulator.tell("turn 20")
    until(lambda: workspace.tracker.pivot.ready, workspace.tracker.poll, "enough turning")
    found = workspace.tracker.finish_pivot()
    assert np.linalg.norm(found.tip_offset - TIP) < 1.0
    np.testing.assert_array_equal(workspace.tracker.probe.tip_offset, found.tip_offset)
    assert workspace.tracker.pivot is None


def test_the_pose_is_sent_back_while_it_holds(workspace):
    atlas = Atlas.published()
    workspace.tracker.start_sending(0)
    port = workspace.tracker.sending_port
    for name in (*PROBE, "IN"):
        workspace.pose.record(atlas[name], TouchHow.TYPED, name=name)
    assert "nobody has accepted it" in workspace.tracker.sending
    workspace.pose.record_verdict("accept")
    client = pyigtl.OpenIGTLinkClient("127.0.0.1", port)
    try:
        message = client.wait_for_message("T_tracker_cochlea", timeout=DEADLINE)
        np.testing.assert_allclose(message.matrix, workspace.pose.estimate.pose.transform, atol=1e-4)
    finally:
        client.stop()
    workspace.tracker.stop_sending()
    assert workspace.tracker.sending == ""


@pytest.mark.parametrize("trouble", ["names", "side", "rejected"])
def test_a_pose_that_looks_wrong_is_held_back(workspace, trouble):
    atlas, right = Atlas.published(), np.array([-1.0, 1.0, 1.0])
    said, words = [], []
    workspace.messages.said.connect(lambda text, _: said.append(text))
    workspace.tracker.start_sending(0)
    workspace.tracker.changed.connect(lambda: words.append(workspace.tracker.sending))
    client = pyigtl.OpenIGTLinkClient("127.0.0.1", workspace.tracker.sending_port)
    try:
        for name in (*PROBE, "IN"):
            source = {"MN": "OS", "OS": "MN"}.get(name, name) if trouble == "names" else name
            position = atlas[source] * (right if trouble == "side" else 1.0)
            workspace.pose.record(position, TouchHow.TYPED, name=name)
        workspace.pose.record_verdict("accept")
        if trouble == "rejected":
            assert client.wait_for_message("T_tracker_cochlea", timeout=DEADLINE) is not None
            workspace.pose.record_verdict("reject")
        why = {"names": "look exchanged", "side": "look like those of the", "rejected": "it was rejected"}[
            trouble
        ]
        assert "Held back: " in words[-1], "a dialog that is open shows it at once"
        assert why in words[-1]
        assert any(text.startswith("The pose is held back from the robot: ") for text in said)
        if trouble == "names":
            workspace.pose.swap_names()
        elif trouble == "side":
            workspace.pose.change_side()
        if trouble != "rejected":
            assert "nobody has accepted it" in words[-1], "the touches have changed since"
        workspace.pose.record_verdict("accept")
        assert "Held back" not in words[-1]
        message = client.wait_for_message("T_tracker_cochlea", timeout=DEADLINE)
        np.testing.assert_allclose(message.matrix, workspace.pose.estimate.pose.transform, atol=1e-4)
    finally:
        client.stop()


@pytest.mark.parametrize("change", ["skip", "side", "specimen"])
def test_a_press_for_one_feature_is_never_recorded_as_another(workspace, simulator, change):
    connected(workspace, simulator)
    simulator.do("go RWA 0.2")
    refusals = []
    workspace.tracker.refused.connect(refusals.append)
    workspace.pose.set_target("RWA")
    workspace.tracker.press()
    workspace.tracker.poll()
    if change == "skip":
        workspace.pose.skip()
    elif change == "side":
        workspace.pose.choose(side=Side.RIGHT)
    else:
        workspace.document.begin()
    until(lambda: bool(refusals), workspace.tracker.poll, "a refusal")
    assert refusals[0].startswith("RWA is no longer requested")
    end = time.monotonic() + 0.8
    until(lambda: time.monotonic() > end, workspace.tracker.poll, "the end of a window")
    assert not workspace.document.state.touches


def test_touches_in_two_frames_of_the_tracker_do_not_mix(workspace, simulator):
    source = "ProbeToTracker in ReferenceToTracker"
    touching.record_touch(workspace.document, "L", "ZL", (1, 2, 3), TouchHow.TRACKED, source=source)
    connected(workspace, simulator)
    refusals = []
    workspace.tracker.refused.connect(refusals.append)
    workspace.tracker.refused.connect(lambda text: "frame" in text or workspace.tracker.press())
    workspace.tracker.press()
    until(
        lambda: any("in the frame of ReferenceToTracker" in t for t in refusals), workspace.tracker.poll, "it"
    )
    assert list(workspace.document.state.touches) == [(workspace.pose.side, "ZL")]
