"""The simulator's probe is where it is told to be, and its command says what is wrong."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tracker_cases import POINTS, TIP

from gp_core import Atlas, estimate_pose
from gp_core.errors import GpError
from gp_labeler.cli.simulate_tracker import run_simulator
from gp_labeler.tracker import Probe, Sample
from gp_labeler.tracker.simulated_probe import SimulatedProbe
from gp_labeler.tracker.simulated_tracker import Simulator


def _probe(**more) -> SimulatedProbe:
    return SimulatedProbe(POINTS, TIP, rng=np.random.default_rng(0), **more)


def _tip(probe: SimulatedProbe, time: float) -> np.ndarray:
    readings = {name: reading.matrix for name, reading in probe.read(time).items()}
    T_head_tracker = np.linalg.inv(readings.get("reference", np.eye(4)))
    tip = Probe(TIP).tip(Sample(time, time, T_head_tracker @ readings["probe"]))
    assert tip is not None
    return tip


@pytest.mark.parametrize("reference", [False, True])
def test_without_noise_the_tip_is_at_the_point(reference) -> None:
    probe = _probe(noise_mm=0, noise_deg=0, reference=reference, sway_mm=5)
    probe.go("OS", 1.0, time=2.0)
    assert _tip(probe, 3.5) == pytest.approx(POINTS["OS"], abs=1e-9)
    assert _tip(probe, 2.5) == pytest.approx(probe.tip(2.5), abs=1e-9)
    probe.turn(True)
    assert _tip(probe, 9.0) == pytest.approx(POINTS["OS"], abs=1e-9)


def test_noise_is_as_large_as_said() -> None:
    probe = _probe(noise_mm=0.1, noise_deg=0.0)
    probe.go("RWA", 0.0, time=0.0)
    off = np.array([_tip(probe, 1 + k / 60) - POINTS["RWA"] for k in range(2000)])
    assert off.std(axis=0) == pytest.approx(0.1, rel=0.1)
    assert np.linalg.norm(off.mean(axis=0)) < 0.02


def test_a_point_that_is_not_there_is_told() -> None:
    with pytest.raises(GpError, match="Known: home, RWA"):
        _probe().go("XX", 1.0, 0.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--rate", "0"], "--rate must be from 1 to 1000"),
        (["--touches", "nowhere.csv"], "nowhere.csv"),
        (["--probe", ""], "device name of the probe is empty"),
        (["--side", "X"], "side must be L or R"),
    ],
)
def test_wrong_options_are_said_in_one_line(options, said, capsys) -> None:
    assert run_simulator(["--port", "0", *options]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1


def test_the_truth_of_a_drawn_animal_is_an_animal(tmp_path, monkeypatch) -> None:
    truth = tmp_path / "truth.json"
    monkeypatch.setattr("gp_labeler.tracker.simulator.serve", lambda simulator, *_: simulator.close() or 0)
    monkeypatch.setattr("gp_labeler.tracker.simulator.Simulator", _Silent)
    assert run_simulator(["--port", "0", "--seed", "3", "--side", "R", "--truth", str(truth)]) == 0
    told = json.loads(truth.read_text(encoding="utf-8"))
    touched = {name: told["points"][name] for name in ("CL", "LLI", "MN", "OS", "RWA", "RWP")}
    found = estimate_pose(touched, told["side"], Atlas.published())
    assert np.linalg.norm(found.origin - told["cochlea"]["CO"]) < 1.0


class _Silent:
    """In the place of the server, whose signal handlers are not for the process of the tests."""

    port = 1

    def __init__(self, *_: object, **__: object) -> None: ...

    def close(self) -> None: ...


@pytest.mark.parametrize(
    "command",
    ["wait -1", "wait nan", "go CL inf", "jump nan", "late -0.5", "stale nan", "cut -1", "lift 1e9"],
)
def test_a_time_or_length_that_cannot_be_is_refused(command: str) -> None:
    said: list[str] = []
    names = {"probe": "Probe", "button": "Button"}
    simulator = Simulator(_probe(), port=0, names=names, say=said.append)
    try:
        simulator.tell(command)
        simulator.step()
        assert simulator.now < 60
        assert len(said) == 1
        assert said[0].startswith(f"error {command}: ")
    finally:
        simulator.close()
