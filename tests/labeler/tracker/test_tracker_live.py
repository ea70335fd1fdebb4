"""The whole chain against pyigtl servers in other processes: nothing false is recorded, states are right."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tracker_cases import DEADLINE, POINTS, TIP, Bench, SimulatorProcess, until

from gp_labeler.tracker import (
    Fault,
    Limits,
    LinkPhase,
    PivotCollector,
    Probe,
    RefusedTouch,
    TouchRecorder,
    TouchSettings,
    TrackerAddress,
    TrackerLink,
)

_PATIENT = Limits(late_s=5.0)
"""For a busy machine, in the tests that are not about lateness."""

_CLOSE = 0.15
"""mm. A touch is the mean of some 20 readings of 0.15 mm noise per coordinate."""


@pytest.fixture(scope="module")
def simulators(tmp_path_factory) -> Iterator[tuple[SimulatorProcess, SimulatorProcess]]:
    """Two, that start at the same time."""
    moving = ("--reference", "HeadToTracker", "--sway", "5")
    both = (
        SimulatorProcess(tmp_path_factory.mktemp("swaying"), *moving),
        SimulatorProcess(tmp_path_factory.mktemp("resting"), "--hidden", "stop"),
    )
    yield both
    for simulator in both:
        simulator.close()


@pytest.fixture
def swaying(simulators) -> SimulatorProcess:
    """A head that moves by 5 mm, with a reference on it; a covered marker is told by its status."""
    return simulators[0]


@pytest.fixture
def resting(simulators) -> SimulatorProcess:
    """A head at rest, no reference; a covered marker sends nothing, as PLUS is often set."""
    return simulators[1]


def _bench(simulator: SimulatorProcess, *, dwell: bool = False, limits: Limits = _PATIENT, **more) -> Bench:
    link = TrackerLink(TrackerAddress(port=simulator.port, button="Button", **more), limits)
    settings = TouchSettings(window_s=0.3, max_gap_s=0.3)
    return Bench(link, TouchRecorder(Probe(TIP), settings, dwell=dwell))


@pytest.fixture
def bench(swaying) -> Iterator[Bench]:
    bench = _bench(swaying, reference="HeadToTracker")
    bench.link.open()
    bench.wait_until_idle()
    yield bench
    bench.link.close()


@pytest.fixture
def plain(resting) -> Iterator[Bench]:
    bench = _bench(resting)
    bench.link.open()
    bench.wait_until_idle()
    yield bench
    bench.link.close()


def _off(touch, name: str) -> float:
    return float(np.linalg.norm(touch.position - POINTS[name]))


def test_touches_by_key_lie_at_the_truth_though_the_head_moves(swaying, bench) -> None:
    for name in ("RWA", "OS"):
        swaying.do(f"go {name} 0.1")
        touch = bench.touch()
        assert _off(touch, name) < _CLOSE
        assert 0.1 < touch.spread_mm < 0.5
        assert touch.n_samples >= 8
        assert touch.duration_s == pytest.approx(0.3, abs=0.2)
    assert bench.link.state.phase is LinkPhase.CONNECTED
    assert "Receiving ProbeToTracker" in bench.link.state.words


def test_touches_by_dwell_are_recorded_once_each(swaying, bench) -> None:
    swaying.do("go home 0.1")
    bench.recorder.dwell = True
    bench.until(lambda: bool(bench.touches), "the dwell at home")  # a hand that rests anywhere dwells
    bench.outcomes.clear()
    for number, name in enumerate(("MN", "CL"), start=1):
        swaying.do(f"go {name} 0.1")
        bench.until(lambda n=number: len(bench.touches) >= n, "a dwell")
        assert _off(bench.touches[-1], name) < _CLOSE
    before = len(bench.samples)
    bench.until(lambda: len(bench.samples) > before + 60, "another second")
    assert len(bench.touches) == 2


def test_a_covered_marker_is_said_and_records_nothing(swaying, bench) -> None:
    swaying.do("hide probe")
    bench.until(lambda: bool(bench.seen(Fault.HIDDEN)), "a hidden sample")
    refused = bench.press()
    assert isinstance(refused, RefusedTouch)
    assert refused.fault is Fault.HIDDEN
    assert "not visible (out of view)" in refused.reason
    assert bench.link.state.phase is LinkPhase.CONNECTED
    swaying.do("show")
    swaying.do("hide reference")
    bench.until(lambda: bool(bench.seen(Fault.NO_REFERENCE)), "a hidden reference")
    assert bench.samples[-1].matrix is None
    assert isinstance(bench.press(), RefusedTouch)
    swaying.do("show")
    bench.wait_until_idle()


def test_a_jump_records_nothing_false(swaying, bench) -> None:
    swaying.do("go RWA 0.1")
    bench.touch()
    bench.recorder.dwell = True
    bench.outcomes.clear()
    bench.samples.clear()
    swaying.do("jump 40")
    bench.until(lambda: bool(bench.seen(Fault.JUMP)), "a jump")
    assert re.search(r"jumped by (3[5-9]|4\d) mm", bench.seen(Fault.JUMP)[0].detail)  # and it sways
    bench.wait_until_idle()
    swaying.do("jump 40 0.3")
    assert isinstance(bench.press(), RefusedTouch)
    bench.wait_until_idle()
    assert bench.touches == []
    assert _off(bench.touch(), "RWA") < _CLOSE


def test_every_bad_message_is_named(swaying, bench) -> None:
    kinds = {
        "nan": Fault.NOT_RIGID,
        "scale": Fault.NOT_RIGID,
        "mirror": Fault.NOT_RIGID,
        "repeat": Fault.REPEATED,
        "back": Fault.BACKWARDS,
    }
    for kind, fault in kinds.items():
        bench.samples.clear()
        swaying.do(f"bad {kind}")
        bench.until(lambda f=fault: bool(bench.seen(f)), kind)
        assert not any(s.usable for s in bench.seen(fault))
    assert bench.link.faults[Fault.NOT_RIGID] == 3


def test_a_repeated_position_is_frozen(swaying, bench) -> None:
    swaying.do("stale 0.6")
    bench.until(lambda: bool(bench.seen(Fault.FROZEN) or bench.seen(Fault.NO_REFERENCE)), "frozen samples")
    bench.wait_until_idle()


def test_the_button_presses_once(swaying, bench) -> None:
    swaying.tell("press")
    presses = []

    def step() -> None:
        bench.step()
        presses.append(bench.link.take_presses())

    until(lambda: sum(presses) > 0, step, "a press")
    before = len(bench.samples)
    until(lambda: len(bench.samples) > before + 20, step, "more samples")
    assert sum(presses) == 1


def test_late_messages_are_named_and_record_nothing(resting) -> None:
    bench = _bench(resting, limits=Limits(late_s=0.25))
    bench.link.open()
    bench.wait_until_idle()
    resting.do("late 0.7")
    bench.until(lambda: bool(bench.seen(Fault.LATE)), "late messages")
    refused = bench.press()
    assert isinstance(refused, RefusedTouch)
    resting.do("late 0")
    bench.until(lambda: bool(bench.seen(Fault.BACKWARDS)), "messages overtaken by others")
    bench.wait_until_idle()
    bench.link.close()


def test_a_marker_that_sends_nothing_is_silence(resting, plain) -> None:
    resting.do("go OS 0.1")
    assert _off(plain.touch(), "OS") < _CLOSE
    resting.do("hide probe")
    plain.until(lambda: plain.link.state.phase is LinkPhase.SILENT, "silence")
    assert "is hidden" in plain.link.state.words
    refused = plain.press()
    assert isinstance(refused, RefusedTouch)
    assert "No message" in refused.reason
    resting.do("show")
    plain.until(lambda: plain.link.state.phase is LinkPhase.CONNECTED, "messages again")


def test_a_cut_connection_is_lost_and_comes_back(resting, plain) -> None:
    resting.do("go MN 0.1")
    resting.tell("cut 3")
    plain.until(lambda: plain.link.state.phase is LinkPhase.LOST, "the loss")
    assert "Trying again" in plain.link.state.words
    assert plain.link.latest is None
    assert isinstance(plain.press(), RefusedTouch)
    plain.until(lambda: plain.link.state.phase is LinkPhase.CONNECTED, "the connection")
    plain.wait_until_idle()
    assert _off(plain.touch(), "MN") < _CLOSE


def test_turning_the_probe_calibrates_its_tip(resting, plain) -> None:
    pivot = pytest.importorskip("gp_core.registration.pivot")
    resting.do("go CL 0.1")
    collector = PivotCollector(poses_wanted=40)
    resting.do("turn")
    until(lambda: collector.ready, lambda: collector.update(plain.link.poll()), "enough turning")
    calibration = collector.finish()
    assert isinstance(calibration, pivot.PivotCalibration)
    assert calibration.tip_offset == pytest.approx(TIP, abs=0.5)
    assert calibration.pivot == pytest.approx(POINTS["CL"], abs=0.5)
    resting.do("still")


def test_a_wrong_name_is_told_with_what_there_is(resting) -> None:
    link = TrackerLink(TrackerAddress(port=resting.port, probe="StylusToTracker"), silent_s=0.2)
    link.open()
    until(lambda: "ProbeToTracker; check the name." in link.state.words, link.poll, "the right name")
    assert link.state.phase is LinkPhase.SILENT
    link.close()


def _open_files() -> int:
    folder = Path("/proc/self/fd")
    return len(list(folder.iterdir())) if folder.is_dir() else 0


def test_opening_and_closing_leaves_nothing_behind(resting) -> None:
    link = TrackerLink(TrackerAddress(port=resting.port))
    threads, files = threading.active_count(), _open_files()
    for cycle in range(20):
        link.open()
        if cycle % 5 == 0:
            until(lambda: bool(link.poll()), what="samples")
        link.close()
        assert link.state.phase is LinkPhase.OFF
        assert link.poll() == []
    until(lambda: threading.active_count() == threads and _open_files() == files, what="all to be closed")


def test_where_nobody_listens_it_says_so_and_blocks_nobody() -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    link = TrackerLink(TrackerAddress(port=port))
    link.open()
    assert link.state.phase is LinkPhase.CONNECTING
    until(lambda: link.state.phase is LinkPhase.LOST, link.poll, "the failure")
    assert f"No server listens at 127.0.0.1:{port}. Trying again in" in link.state.words
    link.close()


def test_a_server_of_another_kind_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            client, _ = server.accept()
            with client:
                client.sendall(b"HTTP/1.1 400 Bad Request\r\n" * 20)
                client.recv(1)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        link = TrackerLink(TrackerAddress(port=server.getsockname()[1]))
        link.open()
        until(lambda: link.state.phase is LinkPhase.LOST, link.poll, "the refusal")
        assert "does not use OpenIGTLink" in link.state.words
        link.close()
        thread.join(DEADLINE)


_PLAIN_SERVER = """
import time, numpy as np, pyigtl
server = pyigtl.OpenIGTLinkServer(port=0, local_server=True)
print(server.server_address[1], flush=True)
rng = np.random.default_rng(0)
matrix = np.eye(4)
while True:
    matrix[:3, 3] = [7, 8, 9] + rng.normal(0, 0.1, 3)
    if server.is_connected():
        server.send_message(pyigtl.TransformMessage(matrix, device_name="StylusToTracker"), wait=False)
    time.sleep(0.02)
"""


def test_a_server_that_is_pyigtl_s_own() -> None:
    server = subprocess.Popen(
        [sys.executable, "-c", _PLAIN_SERVER], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        assert server.stdout is not None
        port = int(server.stdout.readline())
        link = TrackerLink(TrackerAddress(port=port, probe="StylusToTracker"), _PATIENT)
        bench = Bench(link, TouchRecorder(Probe(), TouchSettings(max_gap_s=0.3)))
        link.open()
        bench.wait_until_idle()
        assert bench.touch().position == pytest.approx((7, 8, 9), abs=0.15)
        server.kill()
        bench.until(lambda: link.state.phase is LinkPhase.LOST, "the loss")
        link.close()
    finally:
        server.kill()
        server.wait()
        if server.stdout is not None:
            server.stdout.close()
