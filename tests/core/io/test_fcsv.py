"""Slicer's old point lists in their layouts."""

import pytest
from landmark_makers import SHARED, needs_shared_data, same_landmarks, some_landmarks

from gp_core.errors import FileFormatError
from gp_core.io import read_landmarks, read_points, write_fcsv
from gp_core.landmarks.sets import Status

VERSION = "# Markups fiducial file version = 4.11\n"
COLUMNS = "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n"


def row(label="CA", xyz="1.5,2,3", tail=""):
    return f"vtkMRML_1,{xyz},0,0,0,1,1,1,0,{label},NA,vtkMRMLScalarVolumeNode1{tail}\n"


@pytest.fixture
def file(tmp_path):
    return tmp_path / "GP01_R.fcsv"


@needs_shared_data
def test_the_real_file_loads():
    points = read_points(SHARED / "mouse_ct" / "template_skull.fcsv")
    assert len(points) == 51
    assert points.labels == tuple(str(i) for i in range(1, 52))
    assert points.positions[0].tolist() == [-9.23677, -24.8342, 10.068]


@pytest.mark.parametrize(
    ("system", "expected"),
    [("LPS", [1.5, 2, 3]), ("1", [1.5, 2, 3]), ("RAS", [-1.5, -2, 3]), ("0", [-1.5, -2, 3])],
)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_fourteen_columns_in_each_system(file, system, expected, newline):
    text = f"{VERSION}# CoordinateSystem = {system}\n{COLUMNS}{row()}"
    file.write_text(text.replace("\n", newline), newline="")
    landmarks = read_landmarks(file)
    assert landmarks["CA"].tolist() == expected
    assert (landmarks.side.value, landmarks.frame) == ("R", "scan")


@pytest.mark.parametrize(
    ("code", "status"), [(0, Status.TO_DO), (1, Status.TO_DO), (2, Status.PLACED), (3, Status.UNSEEN)]
)
def test_the_fifteenth_column_is_the_status(file, code, status):
    file.write_text(
        f"{VERSION}# CoordinateSystem = LPS\n{COLUMNS}{row('CA')}{row('CB', '0,0,0', f',{code},0')}"
    )
    landmarks = read_landmarks(file)
    assert landmarks.status("CB") is status
    assert landmarks.status("CA") is Status.PLACED


def test_a_missing_system_is_lps_with_a_warning(file, caplog):
    file.write_text(VERSION + row())
    assert read_landmarks(file)["CA"].tolist() == [1.5, 2, 3]
    assert "taken as LPS" in caplog.text
    file.write_text(row())  # no header lines at all
    assert read_landmarks(file)["CA"].tolist() == [1.5, 2, 3]


def test_two_systems_in_one_file_are_refused(file):
    file.write_text(f"{VERSION}# CoordinateSystem = RAS\n{row('CA')}# CoordinateSystem = 1\n{row('CB')}")
    with pytest.raises(FileFormatError, match=r"several coordinate systems: RAS, 1\. Export each"):
        read_landmarks(file)


def test_slicer_3_is_ras(file):
    file.write_text(
        "# Fiducial List file /a.fcsv\n# columns = label,x,y,z,sel,vis\nCA,1.5,2,3,1,1\nCB,4,5,6,1,1\n"
    )
    landmarks = read_landmarks(file)
    assert landmarks["CA"].tolist() == [-1.5, -2, 3]
    assert landmarks.placed == ("CA", "CB")


def test_quoted_labels(file):
    quoted = row('"tip, ""upper"""')
    file.write_text(f"{VERSION}# CoordinateSystem = LPS\n{COLUMNS}{quoted}")
    assert read_points(file).labels == ('tip, "upper"',)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (VERSION + COLUMNS, "holds no points"),
        (VERSION + "CA,1,2\n", "line 2 has 3 columns"),
        (VERSION + row(tail=",2,0,9"), "line 2 has 17 columns"),
        (VERSION + row() + "CB,1,2,3,1,1\n", "line 3 has 6 columns"),
        (VERSION + row(tail=",7"), "landmark CA: position status .* 0 to 3, got '7' in line 2"),
        (VERSION + row(xyz="1,nan,3"), "landmark CA: .*three finite numbers.*'nan'"),
        (VERSION + row(xyz="1,1e999,3"), "landmark CA: .*three finite numbers"),
        (VERSION + row(xyz="1_0,2,3"), "landmark CA: .*three finite numbers"),
        (VERSION + row(label='"CA'), "line 2 cannot be split"),
        ("# CoordinateSystem = IJK\n" + row(), "must be LPS or RAS, got 'IJK'"),
    ],
)
def test_wrong_content_is_named(file, content, message):
    file.write_text(content)
    with pytest.raises(FileFormatError, match=message):
        read_landmarks(file)


def test_sixteen_columns_are_written_and_states_are_distinguished(file):
    landmarks = some_landmarks("R", n_placed=9).with_unseen("ZL")
    write_fcsv(file, landmarks)
    rows = [line.split(",") for line in file.read_text().splitlines() if not line.startswith("#")]
    assert {len(row) for row in rows if "CO" not in row} == {16}
    assert same_landmarks(read_landmarks(file), landmarks)
