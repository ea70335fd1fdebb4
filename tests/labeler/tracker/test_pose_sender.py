"""The pose sent back out: to whoever connects, or to a pyigtl server in another process."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import threading

import pyigtl
import pytest
from tracker_cases import pose, until

from gp_core.pose.gate import GateReason
from gp_labeler.tracker import LinkPhase, PoseMessage, PoseSender, TrackerAddress, TrackerLink
from gp_labeler.tracker.messages import MessageDecoder, TrackerMessage
from gp_labeler.tracker.pose_message import STATUS_DEVICE

_NAME = "T_tracker_cochlea"
_WRONG_SIDE = GateReason("wrong side", "the touches look like those of the right ear")


def _usable(x: float, y: float, z: float) -> PoseMessage:
    return PoseMessage(pose(x, y, z), (), "L", 0.42, 8.5)


def _read(message: PoseMessage) -> dict[str, TrackerMessage]:
    return {m.kind: m for m in MessageDecoder().feed(message.pack(_NAME, 99.25), 1.0)}


def _status(message: PoseMessage) -> tuple[int, str, str]:
    packed = message.pack(_NAME, 99.25)
    size = struct.unpack("> Q", packed[42:50])[0]
    body = packed[58 : 58 + size]
    assert packed[2:14].rstrip(b"\0") == b"STATUS"
    assert struct.unpack("> Q", packed[50:58])[0] == pyigtl.messages.CRC64(body)
    code, _, name = struct.unpack("> H q 20s", body[:30])
    return code, name.rstrip(b"\0").decode(), body[30:].rstrip(b"\0").decode()


def test_a_usable_pose_goes_out_with_its_state_and_its_region() -> None:
    read = _read(_usable(1, 2, 3))
    assert read["TRANSFORM"].matrix == pytest.approx(pose(1, 2, 3), abs=1e-6)
    assert json.loads(read["STRING"].text) == {
        "state": "ok",
        "reasons": [],
        "side": "L",
        "radius_95_mm": 0.42,
        "cone_95_deg": 8.5,
    }
    assert _status(_usable(1, 2, 3)) == (1, "", "")


@pytest.mark.parametrize(
    ("message", "name", "code"),
    [
        (PoseMessage(), "NO_POSE", "no pose"),
        (PoseMessage(pose(1), (_WRONG_SIDE,), "L", 0.4, 8.0), "HELD_BACK", "wrong side"),
        (_usable(1, 2, 3).held_back_for(_WRONG_SIDE), "HELD_BACK", "wrong side"),
    ],
)
def test_a_pose_that_may_not_be_used_is_said_and_not_sent(message, name, code) -> None:
    read = _read(message)
    assert "TRANSFORM" not in read
    told = json.loads(read["STRING"].text)
    assert (told["state"], told["reasons"]) == ("held back", [code])
    assert _status(message) == (13, name, message.reasons[0].text)


def _listener(port: int) -> TrackerLink:
    link = TrackerLink(TrackerAddress(port=port, probe=_NAME), silent_s=1.0)
    link.open()
    return link


def test_a_pose_reaches_every_client_and_stops_where_it_no_longer_holds() -> None:
    sender = PoseSender(0, period_s=0.02)
    links = [_listener(sender.port), _listener(sender.port)]
    try:
        until(lambda: sender.peers == 2, what="two clients")
        assert "sending no pose, 2 listening" in sender.words
        sender.send(_usable(1, 2, 3))
        for link in links:
            until(lambda ln=link: bool(ln.poll()), what="a pose")
            assert link.latest.matrix == pytest.approx(pose(1, 2, 3), abs=1e-6)
        links[1].close()
        until(lambda: sender.peers == 1, links[0].poll, "one client")
        sender.send(_usable(1, 2, 3).held_back_for(_WRONG_SIDE))
        until(lambda: links[0].state.phase is LinkPhase.SILENT, links[0].poll, "no transform any more")
        assert links[0].devices[STATUS_DEVICE] == "STATUS"  # which is said, not left to silence
        sender.send(_usable(4, 5, 6), renew_s=0.3)
        until(lambda: links[0].state.phase is LinkPhase.CONNECTED, links[0].poll, "the next pose")
        until(lambda: links[0].state.phase is LinkPhase.SILENT, links[0].poll, "one that nobody renewed")
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
        sender.send(_usable(4, 5, 6))
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
