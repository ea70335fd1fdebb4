"""Addresses and probes: what cannot be one is refused with a remedy."""

from __future__ import annotations

import numpy as np
import pytest
from tracker_cases import pose

from gp_core.errors import GeometryError, GpError
from gp_labeler.tracker import Fault, PivotCollector, PoseMessage, PoseSender, Probe, Sample, TrackerAddress
from gp_labeler.tracker.rigid import rotation_of, step_between


def test_an_address_reads_as_host_and_port() -> None:
    assert str(TrackerAddress("tracker.local", 18944)) == "tracker.local:18944"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"host": ""}, "host is empty"),
        ({"host": "a b"}, "without spaces"),
        ({"host": "127.0.0.1:18944"}, "Give the port separately"),
        ({"port": 0}, "from 1 to 65535, got 0"),
        ({"port": 70000}, "got 70000"),
        ({"port": True}, "got True"),
        ({"port": "18944"}, "got '18944'"),
        ({"probe": " "}, "device name of the probe is empty"),
        ({"probe": "Sönde"}, "plain ASCII"),
        ({"probe": "TrajectoryGuideToReference"}, "arrive as 'TrajectoryGuideToRef'"),
        ({"reference": "ProbeToTracker"}, "must be different devices"),
        ({"reference": "HeadToCamera"}, "Use ProbeToCamera, or leave the reference empty"),
        ({"probe": "ProbeToReference", "reference": "ReferenceToTracker"}, "Use ProbeToTracker"),
    ],
)
def test_what_cannot_be_an_address_is_refused(given, said) -> None:
    with pytest.raises(GpError, match=said):
        TrackerAddress(**given)


def test_names_of_no_convention_are_taken() -> None:
    TrackerAddress(probe="stylus", reference="head", button="pedal")


def test_the_tip_is_carried_by_the_marker() -> None:
    probe = Probe((1.0, 0.0, -100.0))
    turned = pose(5, 6, 7, turn=np.pi / 2)
    assert probe.tip(Sample(1.0, 1.0, turned)) == pytest.approx((5, 7, -93))
    assert probe.tip(Sample(1.0, 1.0, None, Fault.HIDDEN)) is None


@pytest.mark.parametrize("offset", [(1, 2), "x", (np.nan, 0, 0), (0, 0, 5000)])
def test_what_cannot_be_a_tip_is_refused(offset) -> None:
    with pytest.raises(GpError, match="tip offset"):
        Probe(offset)


def test_a_pose_that_is_not_rigid_is_not_sent() -> None:
    with pytest.raises(GpError, match="not rigid"):
        PoseMessage(np.diag([2.0, 1, 1, 1]), (), "L", 0.4, 8.0)


def test_a_port_that_is_taken_is_said() -> None:
    sender = PoseSender(0)
    try:
        with pytest.raises(GpError, match="choose another port"):
            PoseSender(sender.port)
    finally:
        sender.close()


def test_turning_is_collected_and_resting_is_not() -> None:
    collector = PivotCollector()
    rng = np.random.default_rng(0)
    samples = []
    for k in range(400):
        matrix = np.eye(4)
        tilt = 0.35 * np.array([np.sin(k / 20), np.cos(k / 20), 0]) if k > 100 else np.array([0.35, 0, 0])
        matrix[:3, :3] = rotation_of(tilt + rng.normal(0, 1e-4, 3))
        matrix[:3, 3] = np.array([1, 2, 3]) + matrix[:3, :3] @ [0, 0, 120]
        samples.append(Sample(float(k), float(k), matrix))
    assert collector.update(samples[:100]) == 1
    assert "tilt the probe" in collector.words
    collector.update([Sample(1.0, 1.0, None, Fault.HIDDEN)])
    assert collector.refused[Fault.HIDDEN] == 1
    collector.update(samples[100:])
    assert collector.ready, collector.words
    widest = max(step_between(a.matrix, b.matrix).degrees for a in samples[::10] for b in samples[::10])
    assert collector.turned_deg == pytest.approx(widest, abs=1.0)
    calibration = pytest.importorskip("gp_core.registration.pivot").calibrate_pivot(collector.poses)
    assert collector.finish().tip_offset == pytest.approx(calibration.tip_offset)
    assert collector.finish().tip_offset == pytest.approx((0, 0, -120), abs=0.1)
    collector.clear()
    assert collector.count == 0
    with pytest.raises(GeometryError, match="10"):
        collector.finish()
