"""Touches of the probe."""

import numpy as np
import pytest
from landmark_makers import SHARED, control_point, markup, needs_shared_data, write_json

from gp_core.errors import FeatureError, FileFormatError, GeometryError, GpError
from gp_core.io import read_landmarks, read_touches, skull_feature_names
from gp_core.landmarks.features import PROBE, named_set
from gp_core.landmarks.sets import Status

ROWS = [[float(i), 10.0 + i * i, 20.0 - i] for i in range(1, 17)]


def write(path, rows, separator="\t"):
    path.write_text("\n".join(separator.join(str(x) for x in row) for row in rows))
    return path


@pytest.fixture
def file(tmp_path):
    return tmp_path / "touches.dat"


@needs_shared_data
def test_the_six_rows_are_the_same_touches_as_in_the_sixteen():
    six = read_touches(SHARED / "usevitch2021" / "sample_data_file.dat", "R")
    sixteen = read_touches(SHARED / "probe" / "SkullE_Right.dat", "R")
    assert set(six.placed) == set(PROBE)
    assert np.array_equal(six.points, sixteen.points, equal_nan=True)
    assert tuple(sixteen.extra) == skull_feature_names()
    assert sixteen.extra["S1"].tolist() == [-154.175, 40.7797, -88.366]
    assert sixteen.extra["S8"].tolist() == [-163.725, 66.8205, -86.7033]
    assert not six.extra
    assert six.frame == "tracker"


@pytest.mark.parametrize("separator", ["\t", " ", "  ", ",", ", ", ";"])
def test_rows_by_their_number(file, separator):
    names = named_set("probe_dat")
    six = read_touches(write(file, ROWS[:6], separator), "L")
    assert [six[name].tolist() for name in names] == ROWS[:6]
    fourteen = read_touches(write(file, ROWS[:14], separator), "L")
    assert [fourteen[name].tolist() for name in names] == ROWS[:6]
    assert [fourteen.extra[name].tolist() for name in skull_feature_names()] == ROWS[6:14]
    sixteen = read_touches(write(file, ROWS, separator), "L")
    assert [sixteen[name].tolist() for name in names] == ROWS[:3] + ROWS[4:7]
    assert [sixteen.extra[name].tolist() for name in skull_feature_names()] == ROWS[8:]


def test_numbers_in_an_unused_row_are_reported(file, caplog):
    read_touches(write(file, ROWS), "L")
    assert "line 4" in caplog.text
    assert "line 8" in caplog.text


@pytest.mark.parametrize("sentinel", [[-1000, -1000, -1000], ["0.0", "0", "-0.000"], ["-1000.00"] * 3])
def test_what_the_tracker_did_not_see(file, sentinel):
    touches = read_touches(write(file, [ROWS[0], sentinel, *ROWS[2:6]]), "L")
    assert touches.placed == ("CL", "LLI", "OS", "RWA", "RWP")
    assert touches.status("MN") is Status.UNSEEN


def test_a_coordinate_of_a_sentinel_alone_is_a_number(file):
    touches = read_touches(write(file, [[0, 0, 5], *ROWS[1:6]]), "L")
    assert touches["CL"].tolist() == [0, 0, 5]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (ROWS[:10], "has 10 rows; touches have 6, 14, 16 rows.*csv"),
        ([[1, 2], *ROWS[:5]], "line 1 has 2 columns"),
        ([*ROWS[:5], [1, 2, 3, 4]], "line 6 has 4 columns"),
        ([["NaN"] * 3, *ROWS[:5]], "landmark CL: .*three finite numbers"),
        ([[1, 2, "inf"], *ROWS[:5]], "landmark CL: .*three finite numbers"),
        ([["CL", 2, 3], *ROWS[:5]], "landmark CL: .*three finite numbers"),
    ],
)
def test_wrong_content_is_named(file, rows, message):
    with pytest.raises(FileFormatError, match=message):
        read_touches(write(file, rows), "L")


def test_all_points_at_one_place(file):
    with pytest.raises(GeometryError, match=r"touches\.dat: all 6 points are at the same place"):
        read_touches(write(file, [ROWS[0]] * 6), "L")


@needs_shared_data
@pytest.mark.parametrize(("factor", "remedy"), [(1e-3, r"metres\. .*multiply them by 1000"), (1e3, "divide")])
def test_touches_that_are_not_in_millimetres(file, factor, remedy):
    rows = np.loadtxt(SHARED / "usevitch2021" / "sample_data_file.dat") * factor
    with pytest.raises(GeometryError, match=remedy):
        read_touches(write(file, rows.tolist()), "R")


def test_touches_of_other_files_internal_features_included(tmp_path):
    csv = tmp_path / "t.csv"
    csv.write_text("RWA,1,2,3\nCA,4,5,6\nZL,-1000,-1000,-1000\n")
    touches = read_touches(csv, "L")
    assert touches.placed == ("CA", "RWA")
    assert touches.unseen == {"ZL"}
    assert touches.frame == "tracker"


def test_a_file_that_says_the_other_side_is_refused(tmp_path):
    file = write_json(tmp_path / "t.mrk.json", markup(control_point("RWA")), gpLabeler={"side": "R"})
    with pytest.raises(FeatureError, match="is the right side, but was asked for as the left"):
        read_touches(file, "L")
    assert read_touches(file, "right").side.value == "R"


def test_an_unknown_side_is_refused(file):
    with pytest.raises(GpError, match="side must be L or R, got 'X'"):
        read_touches(write(file, ROWS[:6]), "X")


def test_touches_read_as_landmarks_are_in_the_tracker_frame(file):
    assert read_landmarks(write(file, ROWS[:6]), side="L").frame == "tracker"


def test_touches_keep_the_extra_points_that_the_file_declares(tmp_path):
    points = markup(control_point("RWA"), control_point("tip", (4.0, 5.0, 6.0)))
    file = write_json(tmp_path / "t.mrk.json", points, gpLabeler={"extra": ["tip"]})
    assert read_touches(file, "L").extra["tip"].tolist() == [4, 5, 6]
