"""Messages beside TRANSFORM: TDATA, QTDATA, POSITION and POINT, from their bytes to touches."""

from __future__ import annotations

import struct

import numpy as np
import pyigtl
import pytest
from scipy.spatial.transform import Rotation

from gp_core.errors import GpError
from gp_labeler.system.openigtlink import KINDS
from gp_labeler.tracker import (
    Fault,
    LinkPhase,
    Probe,
    RefusedTouch,
    Sample,
    TouchRecorder,
    TrackerAddress,
    TrackerLink,
)
from gp_labeler.tracker.messages import MessageDecoder, TrackerMessage
from gp_labeler.tracker.pose_bodies import PoseBody, ToolPose
from gp_labeler.tracker.sample_filter import SampleFilter
from gp_labeler.tracker.simulated_probe import SimulatedProbe
from gp_labeler.tracker.simulated_tracker import Simulator

POSE = np.eye(4)
POSE[:3, :3] = Rotation.from_euler("xyz", [0.3, -0.7, 1.1]).as_matrix()
POSE[:3, 3] = [10.5, -20.25, 300.0]
QUATERNION = Rotation.from_matrix(POSE[:3, :3]).as_quat()


def _bytes(kind: str, content: bytes, device: str = "Tracker", version: int = 1) -> bytes:
    """Return a message as the protocol has it, written without any of the code that is tested."""
    body = (
        content if version == 1 else struct.pack("> H H I I", 12, 2, 0, 7) + content + struct.pack("> H", 0)
    )
    header = struct.pack("> H 12s 20s II", version, kind.encode(), device.encode(), 1000, 1 << 31)
    return header + struct.pack("> QQ", len(body), pyigtl.messages.CRC64(body)) + body


def _decoded(data: bytes) -> list[TrackerMessage]:
    decoder = MessageDecoder()
    return [m for i in range(0, len(data), 7) for m in decoder.feed(data[i : i + 7], 5.0)]


TDATA = struct.pack("> 20s B B 12f", b"Probe", 2, 0, *POSE[:3].T.ravel())
QTDATA = struct.pack("> 20s B B 7f", b"Probe", 2, 0, *POSE[:3, 3], *QUATERNION)
POINT = struct.pack("> 64s 32s 4B 3f f 20s", b"Probe", b"G", 1, 2, 3, 4, *POSE[:3, 3], 2.0, b"")


@pytest.mark.parametrize("version", [1, 2, 3])
@pytest.mark.parametrize(
    ("kind", "content", "oriented"),
    [
        ("TDATA", TDATA, True),
        ("QTDATA", QTDATA, True),
        ("POSITION", struct.pack("> 7f", *POSE[:3, 3], *QUATERNION), True),
        ("QTRANS", struct.pack("> 7f", *POSE[:3, 3], *QUATERNION), True),
        ("POSITION", struct.pack("> 6f", *POSE[:3, 3], *(QUATERNION[:3] * np.sign(QUATERNION[3]))), True),
        ("POSITION", struct.pack("> 3f", *POSE[:3, 3]), False),
        ("POINT", POINT, False),
        ("TDATA", struct.pack("> 20s B B 12f", b"Probe", 3, 0, *POSE[:3].T.ravel()), False),
    ],
)
def test_the_bytes_of_the_protocol_are_the_pose(
    kind: str, content: bytes, oriented: bool, version: int
) -> None:
    device = "Probe" if kind in ("POSITION", "QTRANS") else "Tracker"
    (message,) = _decoded(_bytes(kind, content, device, version))
    assert (message.device, message.kind, message.time, message.problem) == ("Probe", kind, 1000.5, "")
    assert message.oriented is oriented
    assert message.matrix is not None
    np.testing.assert_allclose(message.matrix[:3, 3], POSE[:3, 3])
    if oriented:
        np.testing.assert_allclose(message.matrix, POSE, atol=1e-6)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_packed_is_read(kind: str, version: int) -> None:
    tools = [ToolPose("Probe", POSE, kind != "POINT"), ToolPose("Head", np.eye(4), kind != "POINT")]
    metadata = {"TransformStatus": "OK"} if version == 2 else {}
    packed = PoseBody(kind, tools, device="Arm", time=5.0, version=version, metadata=metadata).pack()
    found = _decoded(packed)
    single = kind in ("POSITION", "QTRANS")
    assert [m.device for m in found] == (["Arm"] if single else ["Probe", "Head"])
    assert dict(found[0].metadata) == metadata
    assert found[0].matrix is not None
    np.testing.assert_allclose(found[0].matrix[:3, 3], POSE[:3, 3])
    with pytest.raises(GpError, match="kind of a message"):
        PoseBody("IMAGE", tools, device="Arm", time=5.0)


@pytest.mark.parametrize(
    ("kind", "content"),
    [
        ("TDATA", TDATA[:-1]),
        ("QTDATA", QTDATA + b"\0"),
        ("POSITION", b"\0" * 16),
        ("POSITION", struct.pack("> 7f", 1, 2, 3, 0, 0, 0, 0)),
        ("POSITION", struct.pack("> 7f", 1, 2, 3, np.nan, 0, 0, 1)),
        ("QTDATA", struct.pack("> 20s B B 7f", b"\xff\xfe", 2, 0, *POSE[:3, 3], *QUATERNION)),
    ],
)
def test_a_body_that_cannot_be_read_is_named(kind: str, content: bytes) -> None:
    (message,) = _decoded(_bytes(kind, content, "Probe"))
    assert message.matrix is None
    assert "cannot be read" in message.problem
    (sample,) = SampleFilter("Probe").take([message], 5.0)
    assert sample.fault is Fault.DAMAGED


def test_a_damaged_body_is_found_by_its_checksum() -> None:
    data = bytearray(_bytes("QTDATA", QTDATA, "Probe"))
    data[-3] ^= 4
    (message,) = _decoded(bytes(data))
    assert message.damaged
    assert _decoded(_bytes("TDATA", b"")) == []


def test_probe_and_reference_may_come_in_one_message() -> None:
    head = np.eye(4)
    head[:3, 3] = [5.0, 6, 7]
    data = PoseBody("TDATA", [ToolPose("Head", head), ToolPose("Probe", POSE)], device="NDI", time=3.0).pack()
    (sample,) = SampleFilter("Probe", "Head").take(_decoded(data), 5.0)
    assert sample.usable
    assert sample.matrix is not None
    np.testing.assert_allclose(sample.matrix[:3, 3], POSE[:3, 3] - head[:3, 3], atol=1e-5)


def _points(n: int = 60, step: float = 1 / 60) -> list[Sample]:
    rng, samples, found = np.random.default_rng(0), SampleFilter("Probe"), []
    for k in range(n):
        pose = np.eye(4)
        pose[:3, 3] = np.array([1, 2, 3]) + rng.normal(0, 0.05, 3)
        tool = ToolPose("Probe", pose, oriented=False)
        data = PoseBody("POINT", [tool], device="Arm", time=100 + k * step).pack()
        found += samples.take(MessageDecoder().feed(data, 100 + k * step), 100 + k * step)
    return found


@pytest.mark.parametrize("tip", [(0, 0, 0), (0, 0, -120)])
def test_a_position_alone_is_a_touch_only_where_it_is_the_tip(tip: tuple[float, float, float]) -> None:
    samples = _points()
    recorder = TouchRecorder(Probe(tip), clock=lambda: 100.0)
    recorder.press()
    (outcome,) = recorder.update(samples)
    if any(tip):
        assert isinstance(outcome, RefusedTouch)
        assert "without its orientation" in outcome.reason
    else:
        assert not isinstance(outcome, RefusedTouch)
        np.testing.assert_allclose(outcome.position, [1, 2, 3], atol=0.05)


def test_a_reference_needs_an_orientation() -> None:
    tools = [ToolPose("Head", POSE, oriented=False), ToolPose("Probe", POSE, oriented=False)]
    data = PoseBody("POINT", tools, device="Arm", time=3.0).pack()
    (sample,) = SampleFilter("Probe", "Head").take(_decoded(data), 5.0)
    assert sample.fault is Fault.NO_REFERENCE
    assert "without an orientation" in sample.detail


@pytest.mark.parametrize("kind", KINDS)
def test_the_simulator_sends_them_to_the_link(kind: str) -> None:
    probe = SimulatedProbe({"MN": np.array([1.0, 2, 3])}, (0, 0, 0), rng=np.random.default_rng(0))
    simulator = Simulator(probe, port=0, kind=kind, rate_hz=200)
    link = TrackerLink(TrackerAddress("127.0.0.1", simulator.port, "ProbeToTracker"))
    link.open()
    samples: list[Sample] = []
    try:
        for _ in range(20_000):
            simulator.step()
            samples += link.poll()
            if len(samples) > 3 and link.state.phase is LinkPhase.CONNECTED:
                break
    finally:
        link.close()
        simulator.close()
    assert link.devices["ProbeToTracker"] == kind
    assert any(sample.usable for sample in samples)
    assert all(sample.oriented is (kind != "POINT") for sample in samples if sample.usable)
