"""Distances from bone: kept with the labels and in their files, and dropped for a point that moves."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

from gp_core.cli import main
from gp_core.errors import FileFormatError
from gp_core.frames import RigidTransform
from gp_core.io import read_landmarks, write_csv, write_markups
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.sets import LandmarkSet

POINTS = {"IN": (1.0, 2.0, 3.0), "ZL": (0.1, 20.0, 0.7), "OS": (5.0, 5.0, 5.0)}


@pytest.fixture
def measured() -> LandmarkSet:
    evidence = ScanEvidence(
        {"IN": 7.93, "ZL": 0.29, "OS": np.inf}, 0.3, frozenset({"OS"}), dict(POINTS), threshold=1400.0
    )
    return replace(LandmarkSet.from_mapping(POINTS, "L"), scan_evidence=evidence)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "GP01_L.mrk.json"


def _told(file, capsys) -> tuple[int, str]:
    capsys.readouterr()
    return main(["check", str(file)]), capsys.readouterr().out


def test_distances_come_back_from_a_file(measured, file) -> None:
    write_markups(file, measured, specimen="GP01")
    assert read_landmarks(file).scan_evidence == measured.scan_evidence
    kept = json.loads(file.read_text())["gpLabeler"][0]["boneDistanceMm"]
    assert (kept["limit"], kept["threshold"]) == (0.3, 1400.0)
    assert kept["points"]["IN"] == {"distance": 7.93, "outsideScan": False, "position": [1.0, 2.0, 3.0]}
    assert kept["points"]["OS"]["distance"] is None
    assert pickle.loads(pickle.dumps(measured)).scan_evidence == measured.scan_evidence


def test_check_names_a_point_in_the_air(measured, file, capsys, tmp_path) -> None:
    write_markups(file, measured, specimen="GP01")
    status, told = _told(file, capsys)
    assert status == 1
    assert "! left  IN       IN is 7.9 mm from bone. Place IN on bone, or mark it as checked." in told
    assert "OS is outside the scan" in told
    assert "ZL is" not in told
    assert main(["check", str(file), "--json", str(tmp_path / "found.json")]) == 1
    kinds = {
        tuple(f["landmarks"]): f["kind"] for f in json.loads((tmp_path / "found.json").read_text())["GP01"]
    }
    assert kinds[("IN",)] == "off bone"


def test_a_point_that_moved_is_not_held_against_bone(measured, file, capsys) -> None:
    moved = measured.with_point("IN", (1, 2, 3.5)).with_point("OS", None)
    assert set(moved.scan_evidence.bone_distances) == {"ZL"}
    assert measured.with_point("IN", (1, 2, 3)).scan_evidence == measured.scan_evidence
    write_markups(file, measured.with_point("OS", None), specimen="GP01")
    content = json.loads(file.read_text())
    row = next(p for p in content["markups"][0]["controlPoints"] if p["label"] == "IN")
    row["position"][2] += 0.1  # by another program, which left the distances alone
    file.write_text(json.dumps(content))
    status, told = _told(file, capsys)
    assert (status, "from bone" in told) == (0, False)


def test_the_whole_head_may_move(measured) -> None:
    turn = RigidTransform(
        np.array([[0.0, -1, 0, 5], [1, 0, 0, -7], [0, 0, 1, 2], [0, 0, 0, 1]]), dst="atlas", src="scan"
    )
    assert measured.moved(turn).scan_evidence.bone_distances == measured.scan_evidence.bone_distances


def test_nothing_is_said_of_a_file_without_distances(measured, file, capsys, tmp_path) -> None:
    write_markups(file, measured, specimen="GP01")
    content = json.loads(file.read_text())
    del content["gpLabeler"]  # as 3D Slicer saves it
    file.write_text(json.dumps(content))
    assert _told(file, capsys)[0] == 0
    write_csv(tmp_path / "GP01_L.csv", measured)
    assert _told(tmp_path / "GP01_L.csv", capsys)[0] == 0


@pytest.mark.parametrize(
    "wrong",
    [
        7.9,
        [],
        {"points": {}},
        {"limit": 0.3, "points": []},
        {"limit": 0.3, "points": {"IN": 7.9}},
        {"limit": 0.3, "points": {"IN": {"distance": -1, "position": [1, 2, 3]}}},
        {"limit": 0.3, "points": {"IN": {"distance": 7.9, "position": [1, 2]}}},
        {"limit": "0.3", "points": {}},
    ],
)
def test_damaged_distances_are_refused(measured, file, wrong) -> None:
    write_markups(file, measured, specimen="GP01")
    content = json.loads(file.read_text())
    content["gpLabeler"][0]["boneDistanceMm"] = wrong
    file.write_text(json.dumps(content))
    with pytest.raises(FileFormatError, match="boneDistanceMm"):
        read_landmarks(file)
