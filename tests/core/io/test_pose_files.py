"""Files of a pose: what is written is read back, and what is damaged is refused in one line."""

from __future__ import annotations

import json
import logging
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from atlas_cases import draw_side, draw_specimens, random_pose
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gp_core import PROBE, Atlas, CochleaPose, Side, estimate_pose, read_landmarks
from gp_core.errors import FileFormatError, GpError
from gp_core.io.pose_export import AXIS_POINT_MM
from gp_core.io.pose_json import read_pose


def _pose(side: Side = Side.RIGHT, seed: int = 0) -> CochleaPose:
    rng = np.random.default_rng(seed)
    animal = draw_side(Atlas.published(), rng, side).moved(random_pose(rng))
    touches = {code: p + 0.2 * rng.normal(size=3) for code, p in animal.as_mapping(PROBE).items()}
    touches["MN"] = touches["MN"] + 4.0
    return estimate_pose(touches, side)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "pose.json"
    _pose().save(path)
    return path


@pytest.mark.parametrize("side", Side)
def test_a_pose_comes_back_to_the_last_bit(side: Side, tmp_path: Path) -> None:
    pose = _pose(side)
    pose.save(tmp_path / "pose.json")
    again = read_pose(tmp_path / "pose.json")
    assert again.as_dict() == pose.as_dict()
    assert pose.suspects == again.suspects == ("MN",)
    assert (again.side, again.probe_noise) == (side, pose.probe_noise)
    assert pose.T_touches_atlas is not None
    assert again.T_touches_atlas is not None
    np.testing.assert_array_equal(again.T_touches_atlas.matrix, pose.T_touches_atlas.matrix)
    again.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "pose.json").read_bytes()


def test_names_that_look_exchanged_come_back(tmp_path: Path) -> None:
    touches = Atlas.published()
    exchanged = {code: touches[{"MN": "OS", "OS": "MN"}.get(code, code)] for code in PROBE}
    pose = estimate_pose(exchanged, "L")
    assert pose.swapped is not None
    pose.save(tmp_path / "pose.json")
    assert read_pose(tmp_path / "pose.json").swapped == pose.swapped
    content = json.loads((tmp_path / "pose.json").read_text())
    del content["swapped"]  # as files of before have it
    (tmp_path / "pose.json").write_text(json.dumps(content))
    assert read_pose(tmp_path / "pose.json").swapped is None


def test_a_pose_of_jrmpc_comes_back_too(tmp_path: Path) -> None:
    atlas = Atlas.published()
    animals = draw_specimens(atlas, 4, np.random.default_rng(1))
    touches = draw_side(atlas, np.random.default_rng(2)).as_mapping(PROBE)
    pose = estimate_pose(touches, "L", method="jrmpc", specimens=animals)
    pose.save(tmp_path / "pose.json")
    assert read_pose(tmp_path / "pose.json").as_dict() == pose.as_dict()


def test_a_file_of_before_the_registered_atlas_is_read(file: Path) -> None:
    content = json.loads(file.read_text())
    del content["registered_atlas"]
    file.write_text(json.dumps(content))
    assert read_pose(file).T_touches_atlas is None


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("gpPose", 2, "pose version 2, not 1"),
        ("side", "X", "damaged pose"),
        ("method", "guess", "unknown frame 'tracker' or method 'guess'"),
        ("frame", "moon", "unknown frame 'moon'"),
        ("transform", [[1, 0], [0, 1]], r"transform must be finite numbers in \(4, 4\)"),
        ("transform", (2 * np.eye(4)).tolist(), "damaged pose"),
        ("transform", np.eye(4).tolist(), "cochlea_origin_mm is not that of its transform"),
        ("covariance", np.full((6, 6), np.nan).tolist(), "covariance must be finite"),
        ("covariance", (-np.eye(6)).tolist(), "its covariance is not valid"),
        ("cochlea_origin_mm", [0, 0, 0], "cochlea_origin_mm is not that of its transform"),
        ("modiolar_axis", [1, 0, 0], "modiolar_axis is not that of its transform"),
        ("residuals_mm", {"OS": "far"}, "expected a number, got 'far'"),
        ("residuals_mm", 3, "missing or misplaced"),
        ("suspect", "OS", "expected a list, got 'OS'"),
        ("swapped", ["OS"], r"expected two names, got \['OS'\]"),
        ("swapped", ["OS", 3], "expected a name, got 3"),
        ("warnings", [1], "expected a name, got 1"),
        ("probe_noise_mm", True, "expected a number, got True"),
        ("atlas", None, "expected a name, got None"),
    ],
)
def test_a_damaged_pose_is_refused(file: Path, key: str, value: Any, message: str) -> None:
    file.write_text(json.dumps({**json.loads(file.read_text()), key: value}))
    with pytest.raises(FileFormatError, match=rf"pose\.json: .*{message}.*\. [A-Z]"):
        read_pose(file)


@pytest.mark.parametrize("key", ["transform", "covariance", "residuals_mm", "suspect", "side", "frame"])
def test_a_lacking_entry_is_named(file: Path, key: str) -> None:
    content = json.loads(file.read_text())
    del content[key]
    file.write_text(json.dumps(content))
    with pytest.raises(FileFormatError, match=f"it lacks '{key}'"):
        read_pose(file)


def test_other_files_are_refused(tmp_path: Path, file: Path) -> None:
    for text, message in (
        ("", "empty"),
        ("{", "not JSON"),
        ("[]", "not a pose"),
        (file.read_text()[:200], "not JSON"),
        ('{"gpAtlas": 1}', "not a pose"),
    ):
        file.write_text(text)
        with pytest.raises(FileFormatError, match=message):
            read_pose(file)
    with pytest.raises(GpError, match="does not exist"):
        read_pose(tmp_path / "none.json")


@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    key=st.sampled_from(sorted(_pose().as_dict())),
    value=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
        max_leaves=8,
    ),
)
def test_nothing_but_a_refusal_comes_of_a_wrong_entry(file: Path, key: str, value: Any) -> None:
    damaged = file.with_name("damaged.json")
    damaged.write_text(json.dumps({**json.loads(file.read_text()), key: value}))
    with suppress(FileFormatError):
        read_pose(damaged)


def test_the_matrix_is_sixteen_plain_numbers(tmp_path: Path) -> None:
    pose = _pose()
    pose.save_csv(tmp_path / "pose.csv")
    assert (tmp_path / "pose.csv").read_text().count("\n") == 4
    matrix = np.loadtxt(tmp_path / "pose.csv", delimiter=",")
    np.testing.assert_array_equal(matrix, pose.transform)
    np.testing.assert_array_equal(matrix[:3, 3], pose.origin)
    np.testing.assert_array_equal(matrix[:3, 0], pose.axis)


def test_the_landmarks_are_co_and_a_point_of_the_axis(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pose, path = _pose(Side.LEFT), tmp_path / "pose.mrk.json"
    pose.save_landmarks(path)
    with caplog.at_level(logging.INFO):
        read = read_landmarks(path)
    assert not caplog.records  # what this program wrote itself is nothing to tell of
    assert (read.side, read.frame, read.placed) == (Side.LEFT, "tracker", ("CO",))
    np.testing.assert_array_equal(read["CO"], pose.origin)
    np.testing.assert_allclose(read.extra["axis"], pose.origin + AXIS_POINT_MM * pose.axis)
    points, line = json.loads(path.read_text())["markups"]
    assert (points["type"], line["type"]) == ("Fiducial", "Line")
    for markup in (points, line):
        assert (markup["coordinateSystem"], markup["coordinateUnits"]) == ("LPS", "mm")
        assert [point["label"] for point in markup["controlPoints"]] == ["CO", "axis"]
    assert line["controlPoints"][0]["id"] == "vtkMRMLMarkupsLineNode_0"


def test_an_unwritable_file_is_named(tmp_path: Path) -> None:
    for save in (_pose().save_csv, _pose().save_landmarks, _pose().save_tfm):
        with pytest.raises(GpError, match=r"none.*cannot be written"):
            save(tmp_path / "none" / "pose")
