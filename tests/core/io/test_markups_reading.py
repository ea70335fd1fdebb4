"""Markups files as Slicer, SlicerMorph and SlicerMorphR leave them, and broken ones."""

import json
import os

import numpy as np
import pytest
from landmark_makers import SHARED, control_point, markup, needs_shared_data, write_json

from gp_core.errors import FeatureError, FileFormatError
from gp_core.io import read_landmarks, read_points
from gp_core.io.markups import has_point_list
from gp_core.io.measurement_markups import read_measurements
from gp_core.landmarks.sets import Status


@pytest.fixture
def file(tmp_path):
    return tmp_path / "GP01_L.mrk.json"


@needs_shared_data
@pytest.mark.parametrize("name", ["BALB_CJ_", "C57BL6_J_", "DBA_2J_"])
def test_the_real_mouse_files_load(name):
    points = read_points(SHARED / "mouse_ct" / f"{name}.mrk.json")
    assert len(points) == 45
    assert points.labels[0] == "1"
    assert points.labels[-1] == "51"
    assert "23" not in points.labels
    assert set(points.statuses) == {Status.PLACED}
    raw = json.loads((SHARED / "mouse_ct" / f"{name}.mrk.json").read_text())
    assert points.positions.tolist() == [p["position"] for p in raw["markups"][0]["controlPoints"]]


@pytest.mark.parametrize("empty", ["", None, [None] * 3, ["NA"] * 3, [], {}, "absent"])
@pytest.mark.parametrize("status", ["undefined", "missing"])
def test_every_way_of_writing_no_position_is_understood(file, empty, status):
    point = control_point("CB", empty, positionStatus=status)
    if empty == "absent":
        del point["position"]
    write_json(file, markup(control_point("CA"), point))
    landmarks = read_landmarks(file)
    assert landmarks.placed == ("CA",)
    assert landmarks.status("CB") is Status(status)


@pytest.mark.parametrize("word", ["defined", None])
def test_a_placed_point_without_position_is_to_do_with_a_warning(file, word, caplog):
    write_json(file, markup(control_point("CA"), control_point("CB", "", positionStatus=word)))
    assert read_landmarks(file).status("CB") is Status.TO_DO
    assert "landmark CB" in caplog.text


@pytest.mark.parametrize("word", ["undefined", "preview", "missing"])
def test_a_leftover_position_of_a_point_that_is_not_placed_is_not_taken(file, word):
    write_json(file, markup(control_point("CA"), control_point("CB", (0.0, 0.0, 0.0), positionStatus=word)))
    assert read_landmarks(file).placed == ("CA",)


def test_absent_status_means_placed_and_absent_system_means_lps(file):
    write_json(file, {"type": "Fiducial", "controlPoints": [control_point("CA")]})
    assert read_landmarks(file)["CA"].tolist() == [1, 2, 3]


def test_labels_out_of_order_in_small_letters_and_with_integer_ids(file):
    write_json(file, markup(control_point(" rwp ", (4.0, 5.0, 6.0), id=7), control_point("CA", id=2)))
    landmarks = read_landmarks(file)
    assert landmarks["RWP"].tolist() == [4, 5, 6]
    assert landmarks["CA"].tolist() == [1, 2, 3]


def test_stray_carriage_returns_and_crlf_and_a_byte_order_mark(file):
    point = control_point("CA\r", associatedNodeID="vtkMRMLScalarVolumeNode1\r", description="Fixed\r\n")
    content = json.dumps({"markups": [markup(point)]}, indent=1)
    file.write_bytes(b"\xef\xbb\xbf" + content.replace("\n", "\r\n").encode())
    points = read_points(file)
    assert [(point.label, point.description) for point in points.points] == [("CA", "Fixed")]


def test_utf16_with_its_mark_is_read(file):
    file.write_text(json.dumps({"markups": [markup(control_point("CA"))]}), encoding="utf-16")
    assert read_landmarks(file).placed == ("CA",)


@pytest.mark.parametrize(
    ("system", "expected"),
    [("LPS", [1, 2, 3]), ("1", [1, 2, 3]), (1, [1, 2, 3]), ("RAS", [-1, -2, 3]), ("0", [-1, -2, 3])],
)
def test_coordinate_systems_old_and_new(file, system, expected):
    write_json(file, markup(control_point("CA"), coordinateSystem=system))
    assert read_landmarks(file)["CA"].tolist() == expected


@pytest.mark.parametrize("unit", ["mm", None, ["mm", "UCUM", "millimeter"]])
def test_millimetres_in_every_spelling(file, unit):
    write_json(file, markup(control_point("CA"), coordinateUnits=unit))
    assert read_landmarks(file).placed == ("CA",)


@pytest.mark.parametrize("unit", ["um", ["um", "UCUM", "micrometer"], ["mm", "SCT", "millimeter"], 3, "cm"])
def test_other_units_are_refused_with_the_remedy(file, unit):
    write_json(file, markup(control_point("CA")), markup(control_point("CB"), coordinateUnits=unit))
    with pytest.raises(FileFormatError, match=r"GP01_L.*must be in mm.*Slicer ignores.*divide by 1000"):
        read_landmarks(file)


def test_several_point_lists_are_one_and_other_markups_are_passed_over(file, caplog):
    line = {"type": "Line", "controlPoints": [control_point("CL")]}
    ras = markup(control_point("CB"), coordinateSystem="RAS")
    write_json(file, line, markup(control_point("CA")), ras)
    landmarks = read_landmarks(file)
    assert landmarks.placed == ("CA", "CB")
    assert landmarks["CB"].tolist() == [-1, -2, 3]
    assert "type 'Line'" in caplog.text


@pytest.mark.parametrize("kind", [["Line"], {"Line": 1}, None, 3])
def test_a_type_that_is_no_word_is_another_kind_of_markup(file, caplog, kind):
    odd = {"type": kind, "controlPoints": [control_point("CL")]}
    write_json(file, odd, markup(control_point("CA")))
    assert read_landmarks(file).placed == ("CA",)
    assert has_point_list(file)
    write_json(file, odd)
    assert has_point_list(file), "so that reading it says why it cannot be read"
    with pytest.raises(FileFormatError, match="no ruler or angle"):
        read_measurements(file)


def test_a_slicermorphr_file(file):
    points = [
        control_point("CA", (1.5, -2.0, 3.0), id=1, positionStatus="defined", description="Fixed"),
        control_point("CB", ["NA", "NA", "NA"], id=2, positionStatus="missing", description="Semi"),
    ]
    write_json(file, markup(*points))
    landmarks = read_landmarks(file)
    assert landmarks.placed == ("CA",)
    assert landmarks.unseen == {"CB"}


@pytest.mark.parametrize(
    ("markups", "message"),
    [
        (
            [markup(control_point(positionStatus="done"))],
            "landmark CA: positionStatus must be .*missing.*'done'",
        ),
        ([markup(control_point(), coordinateSystem="IJK")], "must be LPS or RAS, got 'IJK'"),
        ([{"type": "ClosedCurve"}], "no point list .*'ClosedCurve'"),
        ([], "no point list .*none"),
        ([7, None], "no point list .*7, None"),
        (["Fiducial"], "no point list .*'Fiducial'"),
        ([markup()], "no points"),
        ([markup(*[7])], "list of objects"),
        ([{"type": "Fiducial", "controlPoints": {}}], "list of objects"),
        ([markup(control_point(position=[1.0, 2.0]))], r"landmark CA: .*three finite numbers.*\[1.0, 2.0\]"),
        ([markup(control_point(position=[1, 2, 3, 4]))], "three finite numbers"),
        ([markup(control_point(position=[1, None, 3]))], "clear all three"),
        ([markup(control_point(position=[1, True, 3]))], "three finite numbers"),
        ([markup(control_point(position=["x", "y", "z"]))], "three finite numbers"),
        ([markup(control_point(position="far"))], "three finite numbers"),
        ([markup(control_point(position={"x": 1}))], "three finite numbers"),
        ([markup(control_point(position=[float("nan")] * 3))], "landmark CA: .*nan"),
        ([markup(control_point(position=[1, float("-inf"), 3]))], "landmark CA: .*inf"),
        ([markup(control_point(position=[1, 10**400, 3]))], "three finite numbers"),
        ([markup(control_point(position=[1, 1e30, 3]))], "three finite numbers"),
    ],
)
def test_wrong_content_is_named(file, markups, message):
    write_json(file, *markups)
    with pytest.raises(FileFormatError, match=message) as caught:
        read_landmarks(file)
    assert os.fspath(file) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b" \r\n", "is empty"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "is binary"),
        (b"\xff\xfe\x00", "is binary"),
        (b"\xe9t\xe9", "not UTF-8"),
        (b'{"markups": [{"type": "Fidu', "damaged or cut off at line 1"),
        (b"[1, 2]", "no list 'markups'"),
        (b'{"markups": 3}', "no list 'markups'"),
        (b"9" * 5000, "not JSON|no list"),
        (b"[" * 100_000, "not JSON"),
    ],
)
def test_what_is_not_a_markups_file_is_named(file, content, message):
    file.write_bytes(content)
    with pytest.raises(FileFormatError, match=message):
        read_landmarks(file)


def test_unknown_labels_are_refused_with_near_matches(file):
    write_json(file, markup(control_point("RWAA")))
    with pytest.raises(FeatureError, match=r"GP01_L.*unknown feature 'RWAA' \(did you mean RWA"):
        read_landmarks(file)


def test_unknown_labels_are_kept_where_asked_and_skull_features_always(file):
    write_json(file, markup(control_point("CA"), control_point("s3", (7.0, 8.0, 9.0)), control_point("tip")))
    assert list(read_landmarks(file, unknown="extra").extra) == ["S3", "tip"]
    write_json(file, markup(control_point("CA"), control_point("s3", (7.0, 8.0, 9.0))))
    assert read_landmarks(file).extra["S3"].tolist() == [7, 8, 9]


def test_doubled_labels_are_refused(file):
    write_json(file, markup(control_point("CA"), control_point("CB"), control_point("ca ")))
    with pytest.raises(FeatureError, match=r"landmark CA: is in the file twice"):
        read_landmarks(file)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (7, "wrong specimen"),
        ({"specimen": " "}, "wrong specimen"),
        ({"side": "middle"}, "wrong side, 'middle'"),
        ({"frame": "moon"}, "wrong frame, 'moon'"),
        ({"frame": []}, "wrong frame"),
        ({"volume": "scan.nrrd"}, "wrong volume"),
        ({"provenance": [1]}, "wrong provenance"),
        ({"extra": [1]}, "wrong extra"),
        ({"round": 10**70}, "wrong round"),
        ({"schemaVersion": 2}, "Update gp-labeler"),
    ],
)
def test_a_damaged_header_is_named(file, header, message):
    write_json(file, markup(control_point("CA")), gpLabeler=header)
    with pytest.raises(FileFormatError, match=message):
        read_landmarks(file)


def test_a_header_says_specimen_side_frame_and_extra_labels(tmp_path):
    header = {"specimen": "A 7", "side": "R", "frame": "cochlea", "extra": ["tip"]}
    file = write_json(
        tmp_path / "x.mrk.json", markup(control_point("CA"), control_point("tip")), gpLabeler=header
    )
    landmarks = read_landmarks(file)
    assert (landmarks.side.value, landmarks.frame, list(landmarks.extra)) == ("R", "cochlea", ["tip"])
    assert np.isfinite(landmarks["CA"]).all()
