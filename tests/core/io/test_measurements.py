"""Rulers and angles: their values, their names, and 3D Slicer's files of them."""

from __future__ import annotations

import json
import math

import jsonschema
import numpy as np
import pytest
from markups_schema import SCHEMA  # type: ignore[import-not-found]

import gp_core
from gp_core import GpError, LandmarkSet, Measurement
from gp_core.io import measurement_file_names
from gp_core.landmarks.measurements import free_name

RULER = Measurement("Ruler 1", [[0.1, -2.25, 3.0], [3.1, 1.75, 3.0]])
ANGLE = Measurement("Angle 1", [[1, 0, 0], [0, 0, 0], [0, 2, 0]])


def test_a_ruler_measures_the_distance_and_an_angle_that_at_its_second_point():
    assert RULER.length_mm == pytest.approx(5.0, abs=1e-12)
    assert (RULER.kind, RULER.angle, RULER.value_text) == ("line", None, "5.00 mm")
    assert ANGLE.angle == pytest.approx(math.pi / 2, abs=1e-12)
    assert (ANGLE.kind, ANGLE.value_text) == ("angle", "90.0°")


@pytest.mark.parametrize("angle", [0.0, 1e-7, 0.3, math.pi - 1e-7, math.pi])
def test_angles_are_exact_where_the_arms_nearly_coincide_or_oppose(angle):
    points = [[5, 0, 0], [0, 0, 0], [math.cos(angle), math.sin(angle), 0]]
    assert Measurement("a", points).angle == pytest.approx(angle, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "points", "words"),
    [
        ("", [[0, 0, 0], [1, 0, 0]], "needs a name"),
        ("x" * 61, [[0, 0, 0], [1, 0, 0]], "needs a name"),
        ("a\x07b", [[0, 0, 0], [1, 0, 0]], "needs a name"),
        ("one", [[0, 0, 0]], "two points .* or three"),
        ("four", [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], "two points .* or three"),
        ("same", [[1, 2, 3], [1, 2, 3]], "at the same place"),
        ("arm", [[0, 0, 0], [1, 2, 3], [1, 2, 3]], "at the same place"),
        ("flat", [[0, 0], [1, 2]], "three finite numbers"),
        ("nan", [[0, 0, math.nan], [1, 2, 3]], "three finite numbers"),
    ],
)
def test_what_is_no_measurement_is_refused_with_its_name(name, points, words):
    with pytest.raises(GpError, match=words):
        Measurement(name, points)


def test_new_ones_get_names_that_are_free():
    assert free_name("line", []) == "Ruler 1"
    assert free_name("line", ["Ruler 1", "Ruler 3", "Angle 2"]) == "Ruler 2"
    assert free_name("angle", ["Ruler 1"]) == "Angle 1"


def test_they_come_back_from_slicers_files_to_the_last_bit(tmp_path):
    names = ("Ruler 1", "Angle 1", "a/b", "A:B")
    points = [RULER.points, ANGLE.points, [[1 / 3, 2 / 7, -math.pi], [0, 0, 0]], [[1, 2, 3], [4, 5, 6]]]
    written = [Measurement(name, each) for name, each in zip(names, points, strict=True)]
    files = gp_core.write_measurements(tmp_path, written, specimen="GP-014")
    assert [file.name for file in files][:2] == ["GP-014_Ruler 1.mrk.json", "GP-014_Angle 1.mrk.json"]
    assert len({file.name.lower() for file in files}) == 4
    assert [gp_core.read_measurements(file) for file in files] == [(each,) for each in written]
    for file in files:
        content = json.loads(file.read_text(encoding="utf-8"))
        jsonschema.validate(content, SCHEMA)
    (markup,) = json.loads(files[1].read_text(encoding="utf-8"))["markups"]
    assert (markup["type"], markup["measurements"][0]["value"]) == ("Angle", 90.0)
    with pytest.raises(GpError, match="already exists"):
        gp_core.write_measurements(tmp_path, written, specimen="GP-014")


def test_no_file_is_called_like_a_landmark_file():
    assert measurement_file_names("GP", ["L", "R"]) == {"L": "GP_L (2).mrk.json", "R": "GP_R (2).mrk.json"}


def _as_slicer(tmp_path, name, kind, points, **keys):
    rows = [{"label": f"{kind[0]}-{n}", "position": list(p)} | keys for n, p in enumerate(points)]
    file = tmp_path / name
    markup = {"type": kind, "coordinateSystem": "RAS", "controlPoints": rows}
    file.write_text(json.dumps({"markups": [markup]}), encoding="utf-8")
    return file


def test_lines_that_slicer_wrote_are_called_after_their_file_and_turned_to_lps(tmp_path):
    file = _as_slicer(tmp_path, "bulla width.mrk.json", "Line", [(1, 2, 3), (4, 5, 6)])
    (read,) = gp_core.read_measurements(file)
    assert read.name == "bulla width"
    assert np.allclose(read.points, [(-1, -2, 3), (-4, -5, 6)])


def test_incomplete_and_other_files_say_what_is_wrong(tmp_path):
    file = _as_slicer(tmp_path, "a.mrk.json", "Angle", [(1, 2, 3), (4, 5, 6)])
    with pytest.raises(GpError, match="a must have 3 placed points, got 2"):
        gp_core.read_measurements(file)
    file = _as_slicer(tmp_path, "l.mrk.json", "Line", [(1, 2, 3), (4, 5, 6)], positionStatus="undefined")
    with pytest.raises(GpError, match="l must have 2 placed points, got 0"):
        gp_core.read_measurements(file)
    file = _as_slicer(tmp_path, "f.mrk.json", "Fiducial", [(1, 2, 3)])
    with pytest.raises(GpError, match="holds no ruler or angle"):
        gp_core.read_measurements(file)


def test_rulers_beside_landmarks_in_a_folder_are_no_landmark_files(tmp_path):
    points = {"CA": [0, 0, 0], "RWP": [3, 0, 0], "OS": [0, 4, 0], "CB": [1, 3, 4]}
    gp_core.write_markups(tmp_path / "GP_L.mrk.json", LandmarkSet.from_mapping(points, "L"), specimen="GP")
    gp_core.write_measurements(tmp_path, [RULER, ANGLE], specimen="GP")
    (specimen,) = gp_core.load_specimens(tmp_path)
    assert specimen.name == "GP"
