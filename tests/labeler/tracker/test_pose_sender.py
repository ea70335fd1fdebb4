"""The pose sent back out: to whoever connects, or to a pyigtl server in another process."""

from __future__ import annotations

import subprocess
import sys
import threading

import pytest
from tracker_cases import pose, until

from gp_core.frames import RigidTransform
from gp_labeler.tracker import LinkPhase, PoseSender, TrackerAddress, TrackerLink

_NAME = "T_tracker_cochlea"


def _listener(port: int) -> TrackerLink:
    link = TrackerLink(TrackerAddress(port=port, probe=_NAME), silent_s=1.0)
    link.open()
    return link


def test_a_pose_reaches_every_client_and_stops_where_it_no_longer_holds() -> None:
    sender = PoseSender(0, period_s=0.02)
    links = [_listener(sender.port), _listener(sender.port)]
    try:
        until(lambda: sender.peers == 2, what="two clients")
        assert "no pose yet, 2 listening" in sender.words
        sender.send(RigidTransform(pose(1, 2, 3), "tracker", "cochlea"))
        for link in links:
            until(lambda ln=link: bool(ln.poll()), what="a pose")
            assert link.latest.matrix == pytest.approx(pose(1, 2, 3), abs=1e-6)
        links[1].close()
        until(lambda: sender.peers == 1, links[0].poll, "one client")
        sender.clear()
        until(lambda: links[0].state.phase is LinkPhase.SILENT, links[0].poll, "silence")
    finally:
        for link in links:
            link.close()
        sender.close()


_SERVER = """
import sys, pyigtl
server = pyigtl.OpenIGTLinkServer(port=0, local_server=True)
print(server.server_address[1], flush=True)
message = server.wait_for_message("T_tracker_cochlea", timeout=60)
print(*message.matrix[:3, 3], flush=True)
sys.stdin.readline()
"""


def test_a_pose_reaches_a_server() -> None:
    server = subprocess.Popen(
        [sys.executable, "-c", _SERVER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert server.stdout is not None
    assert server.stdin is not None
    sender = PoseSender(int(server.stdout.readline()), host="127.0.0.1")
    try:
        sender.send(pose(4, 5, 6))
        assert [float(x) for x in server.stdout.readline().split()] == [4, 5, 6]
        assert sender.words == f"Sending {_NAME}."
        server.kill()
        until(lambda: "Trying again" in sender.words, what="the loss")
        assert sender.peers == 0
    finally:
        sender.close()
        server.kill()
        server.wait()
        server.stdin.close()
        server.stdout.close()


def test_closing_leaves_no_thread() -> None:
    before = threading.active_count()
    for host in (None, "127.0.0.1"):
        PoseSender(0 if host is None else 9, host=host).close()
    until(lambda: threading.active_count() == before, what="the threads' end")
