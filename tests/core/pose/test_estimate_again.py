"""A pose file holds all that it was made from: it is estimated again with the same result."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from atlas_cases import draw_specimens, random_pose
from scipy.spatial.transform import Rotation

import gp_core
from gp_core import PROBE, Atlas, CochleaPose, GpError, LandmarkSet, estimate_again, estimate_pose, read_pose
from gp_core.cli.entry import main
from gp_core.errors import FileFormatError
from gp_core.io.lab_names import read_lab_names
from gp_core.landmarks.sets import Specimen


@pytest.fixture(scope="module")
def animals() -> list[Specimen]:
    return draw_specimens(Atlas.published(), 5, np.random.default_rng(3))


def _touches(side: str, animal: Specimen, repeats: int = 3) -> LandmarkSet:
    rng = np.random.default_rng(5)
    points = replace(animal.side(side), frame="scan").moved(random_pose(rng)).as_mapping(PROBE)
    rough = {code: p + 0.2 * rng.normal(size=(repeats, 3)) for code, p in points.items()}
    rough["S1"] = np.ones(3)
    return LandmarkSet.from_touches({**rough, "OI": points["CL"] + [2.0, 1, 0]}, side)


@pytest.mark.parametrize(
    ("side", "settings"),
    [
        ("L", {}),
        ("R", {"shared_error": 0.5, "probe_noise": 0.3, "round_window": "expected"}),
        ("R", {"times": {code: 7.0 * i for i, code in enumerate((*PROBE, "OI"))}}),
        ("L", {"method": "jrmpc"}),
        ("R", {"method": "robust", "own": True}),
    ],
)
def test_the_same_bits_from_the_file(
    side: str, settings: dict[str, Any], animals: list[Specimen], tmp_path: Path
) -> None:
    known = animals[1:] if settings.pop("own", False) or "method" in settings else None
    pose = estimate_pose(_touches(side, animals[0]), side, specimens=known, **settings)
    pose.save(tmp_path / "pose.json")
    read = read_pose(tmp_path / "pose.json")
    again = estimate_again(read)
    assert again.as_dict() == read.as_dict() == pose.as_dict()
    np.testing.assert_array_equal(again.transform, pose.transform)
    assert read.stamp == pose.stamp < again.stamp
    assert again.inputs is not None
    assert pose.inputs is not None
    assert again.inputs.as_dict() == pose.inputs.as_dict()
    assert main(["estimate", str(tmp_path / "pose.json"), "--json", str(tmp_path / "again.json")]) in (0, 3)
    told = json.loads((tmp_path / "again.json").read_text())
    assert {key: told[key] for key in pose.as_dict()} == json.loads(json.dumps(pose.as_dict()))


def test_the_quaternion_is_the_rotation_of_the_transform(animals: list[Specimen]) -> None:
    for side in "LR":
        pose = estimate_pose(_touches(side, animals[0]), side)
        x, y, z, w = pose.quaternion
        assert w >= 0
        matrix = Rotation.from_quat([x, y, z, w]).as_matrix()
        np.testing.assert_allclose(matrix, pose.transform[:3, :3], atol=1e-12)
        assert pose.as_dict()["quaternion_xyzw"] == pose.quaternion.tolist()
    for half_turn in (np.diag([1.0, -1, -1]), np.diag([-1.0, 1, -1]), np.diag([-1.0, -1, 1])):
        q = gp_core.frames.quaternion_xyzw(half_turn)
        np.testing.assert_allclose(Rotation.from_quat(q).as_matrix(), half_turn, atol=1e-12)


def test_an_option_overrules_what_the_file_says(
    animals: list[Specimen], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "pose.json"
    estimate_pose(_touches("L", animals[0]), "L").save(file)
    assert main(["estimate", str(file), "--shared-error", "0", "--json", str(tmp_path / "b.json")]) in (0, 3)
    assert read_pose(tmp_path / "b.json").shared_error == 0
    assert "CO lies 0 mm from that of pose.json" in capsys.readouterr().out
    assert main(["estimate", str(file), "--side", "R"]) == 2
    assert "pose.json: is of the left side" in capsys.readouterr().err


def test_a_file_of_an_earlier_version_says_what_it_lacks(
    animals: list[Specimen], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "pose.json"
    file.write_text(json.dumps(estimate_pose(_touches("L", animals[0]), "L").as_dict()))
    old = read_pose(file)
    with pytest.raises(GpError, match="does not contain the touches"):
        estimate_again(old)
    assert main(["estimate", str(file)]) == 2
    assert "earlier version" in capsys.readouterr().err


@pytest.mark.parametrize(
    "path",
    [
        ("stamp",),
        ("inputs", "touches"),
        ("inputs", "touches", "points_mm", "MN"),
        ("inputs", "settings", "shared_error_mm"),
        ("inputs", "atlas", "covariance_mm2"),
        ("inputs", "specimens"),
    ],
)
@pytest.mark.parametrize("wrong", [None, [1, 2], "x", {"a": 1}])
def test_damaged_inputs_are_refused_in_one_line(
    path: tuple[str, ...], wrong: Any, animals: list[Specimen], tmp_path: Path
) -> None:
    content = estimate_pose(_touches("L", animals[0]), "L").content()
    inner = content
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = wrong
    (tmp_path / "pose.json").write_text(json.dumps(content))
    with pytest.raises(FileFormatError, match=r"pose\.json: is a damaged pose"):
        read_pose(tmp_path / "pose.json")


def test_a_pose_with_its_inputs_goes_to_other_processes(animals: list[Specimen]) -> None:
    pose = estimate_pose(_touches("L", animals[0]), "L")
    again: CochleaPose = pickle.loads(pickle.dumps(pose))
    assert again.content() == pose.content()


_AGAIN = """
import json, sys, gp_core
print(json.dumps([gp_core.estimate_again(gp_core.read_pose(path)).as_dict() for path in sys.argv[1:]]))
"""


def test_another_processor_gives_the_same_to_1e_9(animals: list[Specimen], tmp_path: Path) -> None:
    """OpenBLAS, where NumPy has it, is told to be on an old processor; other libraries ignore that."""
    touches = _touches("L", animals[0])
    poses = [
        estimate_pose(touches, "L"),
        estimate_pose(touches, "L", method="jrmpc", specimens=animals[1:]),
    ]
    files = [tmp_path / f"{pose.method}.json" for pose in poses]
    for pose, file in zip(poses, files, strict=True):
        pose.save(file)
    environment = {**os.environ, "OPENBLAS_CORETYPE": "Prescott"}
    done = subprocess.run(
        [sys.executable, "-c", _AGAIN, *map(str, files)], env=environment, capture_output=True, check=True
    )
    for pose, other in zip(poses, json.loads(done.stdout), strict=True):
        mine = pose.as_dict()
        assert [key for key in mine if not _is_near(mine[key], other[key])] == []


def _is_near(one: Any, other: Any) -> bool:
    """Whether two values of a pose file agree, numbers to 1e-9."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_is_near(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_is_near, one, other))
    if isinstance(one, float):
        return bool(abs(one - other) <= 1e-9)
    return bool(one == other)


@pytest.mark.parametrize("kind", ["pose", "atlas", "names"])
def test_a_name_that_a_json_file_gives_twice_is_refused(
    kind: str, animals: list[Specimen], tmp_path: Path
) -> None:
    file = tmp_path / f"{kind}.json"
    read: Any = {"pose": read_pose, "atlas": Atlas.load, "names": read_lab_names}[kind]
    name = {"pose": "MN", "atlas": "features", "names": "mallear notch"}[kind]
    if kind == "pose":
        estimate_pose(_touches("L", animals[0]), "L").save(file)
    elif kind == "atlas":
        Atlas.published().save(file)
    else:
        file.write_text('{"mallear notch": "MN"}')
    read(file)
    file.write_text(file.read_text().replace(f'"{name}":', f'"{name}": 0, "{name}":', 1))
    with pytest.raises(FileFormatError, match=f"{kind}.json: '{name}' is given twice"):
        read(file)
