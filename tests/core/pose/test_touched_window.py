"""The frame a robot reads: y to the round window as it was touched."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from atlas_cases import draw_side, draw_specimens, random_pose
from scipy.spatial.transform import Rotation

from gp_core import PROBE, Atlas, CochleaPose, LandmarkSet, RigidTransform, Side, estimate_pose
from gp_core.cli import main
from gp_core.errors import GpError
from gp_core.io.pose_json import read_pose
from gp_core.landmarks.anatomy import axis_frame
from gp_core.pose.touched_window import towards_touched_window

ATLAS = Atlas.published()


def _animal(seed: int, side: Side = Side.LEFT) -> LandmarkSet:
    rng = np.random.default_rng(seed)
    return draw_side(ATLAS, rng, side).moved(random_pose(rng))


def _touched(animal: LandmarkSet, seed: int, noise: float = 0.15) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {code: p + noise * rng.normal(size=3) for code, p in animal.as_mapping(PROBE).items()}


def _check_letter(pose: CochleaPose, touches: dict[str, np.ndarray]) -> None:
    x, y, z = pose.transform[:3, :3].T
    middle = (touches["RWA"] + touches["RWP"]) / 2
    to_window = middle - pose.origin
    np.testing.assert_allclose(np.cross(x, y), z, atol=1e-12)
    np.testing.assert_allclose(x, pose.axis, atol=1e-12)
    assert to_window @ z == pytest.approx(0, abs=1e-9)
    assert to_window @ y > 0


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("method", ["robust", "jrmpc"])
def test_y_points_to_the_touched_middle_and_nothing_else_changes(side: Side, method: str) -> None:
    animals = draw_specimens(ATLAS, 4, np.random.default_rng(1))
    touches = _touched(_animal(2, side), 3)
    pose = estimate_pose(touches, side, ATLAS, method=method, specimens=animals)
    other = estimate_pose(touches, side, ATLAS, method=method, specimens=animals, round_window="expected")
    assert (pose.round_window, other.round_window) == ("touched", "expected")
    _check_letter(pose, touches)
    np.testing.assert_allclose(pose.origin, other.origin, atol=1e-12)
    np.testing.assert_allclose(pose.axis, other.axis, atol=1e-12)
    assert pose.radius_95 == pytest.approx(other.radius_95, rel=1e-9)
    assert pose.cone_95 == pytest.approx(other.cone_95, rel=1e-9)
    assert abs(other.transform[:3, 1] @ pose.transform[:3, 2]) > 1e-4  # else this test says nothing


def test_a_window_not_touched_or_mistouched_is_the_expected_one() -> None:
    touches = _touched(_animal(4), 5, noise=0.05)
    few = {code: p for code, p in touches.items() if code != "RWP"}
    assert estimate_pose(few, "L", ATLAS).round_window == "expected"
    off = {**touches, "RWA": touches["RWA"] + (0.0, 4.0, 0.0)}
    pose = estimate_pose(off, "L", ATLAS)
    assert pose.suspects == ("RWA",)
    assert pose.round_window == "expected"


@pytest.mark.parametrize(("a", "b", "wanted"), [("RWP", "LLI", "expected"), ("RWA", "RWP", "touched")])
def test_an_edge_under_another_name_is_no_window(a: str, b: str, wanted: str) -> None:
    touches = _touched(_animal(1), 2, noise=0.05)
    pose = estimate_pose({**touches, a: touches[b], b: touches[a]}, "L", ATLAS)
    assert pose.swapped is not None
    assert set(pose.swapped) == {a, b}
    assert pose.suspects == ()
    assert pose.round_window == wanted


def test_the_covariance_of_the_rotation_is_conservative() -> None:
    squared = []
    for seed in range(120):
        animal = _animal(seed, side := Side.LEFT if seed % 2 else Side.RIGHT)
        pose = estimate_pose(_touched(animal, seed + 1000), side, ATLAS, probe_noise=0.15, shared_error=0)
        if pose.round_window == "expected":
            continue
        co, ca, rwa, rwp = (animal[code] for code in ("CO", "CA", "RWA", "RWP"))
        truth = axis_frame(co, ca - co, (rwa + rwp) / 2 - co, dst="tracker", src="cochlea").rotation
        error = Rotation.from_matrix(truth @ pose.transform[:3, :3].T).as_rotvec()
        variance = pose.axis @ pose.covariance[3:, 3:] @ pose.axis
        squared.append((error @ pose.axis) ** 2 / variance)
    assert len(squared) > 100
    assert 0.5 < np.mean(squared) < 1.0  # 0.67 in 400 animals


def _moved(pose: CochleaPose, by: np.ndarray) -> CochleaPose:
    """The pose off by (origin, rotation vector) of its own frame of reference."""
    frame = pose.transform_to_touches
    rotation = Rotation.from_rotvec(by[3:]).as_matrix() @ frame.rotation
    moved = RigidTransform.from_parts(rotation, frame.translation + by[:3], dst=frame.dst, src=frame.src)
    return replace(pose, transform_to_touches=moved)


def test_the_covariance_is_that_of_small_errors() -> None:
    touches = LandmarkSet.from_mapping(_touched(_animal(10), 11), "L", frame="tracker")
    pose = estimate_pose(touches, "L", ATLAS, probe_noise=0.15, round_window="expected")
    rotated = towards_touched_window(pose, touches)

    def error(by: np.ndarray) -> np.ndarray:
        """What (pose, middle of the window) off by that does to the rotated frame."""
        off = {c: p + by[6:] * (c in ("RWA", "RWP")) for c, p in touches.as_mapping(PROBE).items()}
        window = LandmarkSet.from_mapping(off, "L", frame="tracker")
        found = towards_touched_window(_moved(pose, by[:6]), window)
        turn = found.transform[:3, :3] @ rotated.transform[:3, :3].T
        return np.append(found.origin - rotated.origin, Rotation.from_matrix(turn).as_rotvec())

    step = 1e-6
    jacobian = np.array([(error(step * row) - error(-step * row)) / (2 * step) for row in np.eye(9)]).T
    errors = np.zeros((9, 9))
    errors[:6, :6], errors[6:, 6:] = pose.covariance, 0.15**2 / 2 * np.eye(3)
    np.testing.assert_allclose(rotated.covariance, jacobian @ errors @ jacobian.T, rtol=1e-4, atol=1e-9)


def test_the_choice_is_kept_in_the_file_and_older_files_are_read(tmp_path: Path) -> None:
    pose = estimate_pose(_touched(_animal(6), 7), "L", ATLAS)
    file = tmp_path / "pose.json"
    pose.save(file)
    assert read_pose(file).as_dict() == pose.as_dict()
    content = json.loads(file.read_text())
    del content["round_window"]
    file.write_text(json.dumps(content))
    assert read_pose(file).round_window == "expected"
    file.write_text(json.dumps({**content, "round_window": "open"}))
    with pytest.raises(GpError, match="unknown round window 'open'"):
        read_pose(file)


def test_the_shell_has_the_choice_too(tmp_path: Path) -> None:
    touches = _touched(_animal(8), 9)
    file, csv = tmp_path / "touches.csv", tmp_path / "pose.csv"
    file.write_text("name,x,y,z\n" + "".join(f"{c},{p[0]},{p[1]},{p[2]}\n" for c, p in touches.items()))
    for choice in ("touched", "expected"):
        assert main(["estimate", str(file), "--side", "L", "--csv", str(csv), "--round-window", choice]) == 0
        wanted = estimate_pose(touches, "L", ATLAS, round_window=choice)
        np.testing.assert_allclose(np.loadtxt(csv, delimiter=","), wanted.transform, atol=1e-9)


def test_another_word_is_refused() -> None:
    with pytest.raises(GpError, match="round window must be one of touched, expected, got 'seen'"):
        estimate_pose(_touched(_animal(1), 1), "L", ATLAS, round_window="seen")
