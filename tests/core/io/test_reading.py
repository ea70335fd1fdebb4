"""Which file is read how; the side; the disk's refusals."""

import os

import numpy as np
import pytest
from landmark_makers import control_point, markup, write_json

from gp_core.errors import FeatureError, FileFormatError, GeometryError, GpError
from gp_core.io import natural_key, read_landmarks, read_points, read_touches


@pytest.mark.parametrize(
    ("stem", "side"),
    [
        ("GP01_L", "L"),
        ("GP01_R", "R"),
        ("GP01-left", "L"),
        ("GP01 right", "R"),
        ("GP01 - Right", "R"),
        ("SWR.J_.R", "R"),
        ("LG.J_7_l", "L"),
    ],
)
@pytest.mark.parametrize("suffix", [".mrk.json", ".json", ".MRK.JSON"])
def test_the_side_is_in_the_name(tmp_path, stem, side, suffix):
    file = write_json(tmp_path / f"{stem}{suffix}", markup(control_point("CA")))
    assert read_landmarks(file).side.value == side


@pytest.mark.parametrize("stem", ["GP01", "DBA_2J_", "GP01L", "rat of L and R"])
def test_a_file_without_a_side_needs_the_argument(tmp_path, stem):
    file = write_json(tmp_path / f"{stem}.mrk.json", markup(control_point("CA")))
    with pytest.raises(FeatureError, match=r"does not say which side.*Give the side \(L or R\)"):
        read_landmarks(file)
    assert read_landmarks(file, side="R").side.value == "R"


def test_a_specimen_file_is_distinguished_from_a_landmark_file(tmp_path):
    file = tmp_path / "GP01.gpspecimen.json"
    file.write_text('{"format": "gp-labeler specimen", "version": 3}')
    with pytest.raises(FileFormatError, match=r"gp-labeler export GP01\.gpspecimen\.json -o labelled"):
        read_points(file)


def test_the_header_counts_more_than_the_name(tmp_path):
    file = write_json(tmp_path / "GP01_L.mrk.json", markup(control_point("CA")), gpLabeler={"side": "right"})
    assert read_landmarks(file).side.value == "R"


def test_a_contradicted_side_is_an_error(tmp_path):
    file = write_json(tmp_path / "GP01_L.mrk.json", markup(control_point("CA")))
    with pytest.raises(FeatureError, match=r"GP01_L.*is the left side, but was asked for as the right"):
        read_landmarks(file, side="R")


@pytest.mark.parametrize("reader", [read_points, read_landmarks, lambda p: read_touches(p, "L")])
def test_what_is_no_file_to_read(tmp_path, reader):
    (tmp_path / "folder.mrk.json").mkdir()
    (tmp_path / "scan.nrrd").write_text("NRRD0004")
    (tmp_path / "notes.doc").write_text("x")
    for name, message in [
        ("folder.mrk.json", "is a folder"),
        ("", "is a folder"),
        ("none_L.mrk.json", "does not exist"),
        ("none.xyz", "does not exist"),
        ("scan.nrrd", r"an image, or a recording of a tracker.*gp-core touches"),
        ("notes.doc", r"not a known kind of landmark file.*\.mrk\.json, .*\.dat"),
        ("x\0.dat", "does not exist|cannot be read"),
        ("x" * 5000 + ".dat", "does not exist|cannot be read"),
    ]:
        with pytest.raises(FileFormatError, match=message):
            reader(tmp_path / name)


@pytest.mark.parametrize(
    "text",
    [
        "name,x,y,z\nCA,1,2,3\nCB,-1000,-1e3,-1000\nCL,0,0,0\n",
        "label,r,a,s\nCA,-1,-2,3\nCB,-1000,-1000,-1000\nCL,0,0,0\n",
    ],
)
def test_the_mark_of_what_was_not_seen_is_no_position(text, tmp_path, caplog):
    (tmp_path / "GP01_L.csv").write_text(text)
    landmarks = read_landmarks(tmp_path / "GP01_L.csv")
    assert landmarks.placed == ("CA", "CL")  # 0 0 0 may be a position of a scan
    assert "CB" in landmarks.unseen
    assert "at -1000, -1000, -1000, so not seen: CB" in caplog.text


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may read everything")
def test_a_file_without_permission(tmp_path):
    file = write_json(tmp_path / "GP01_L.mrk.json", markup(control_point("CA")))
    file.chmod(0)
    with pytest.raises(FileFormatError, match=r"cannot be read .*[Pp]ermission"):
        read_landmarks(file)


def test_a_disk_that_refuses(tmp_path, monkeypatch):
    file = write_json(tmp_path / "GP01_L.mrk.json", markup(control_point("CA")))

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(FileFormatError, match=r"GP01_L.*cannot be read \(Permission denied\)"):
        read_landmarks(file)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "x.dat")
    with pytest.raises(FileFormatError, match="a device or a pipe"):
        read_landmarks(tmp_path / "x.dat")


def test_a_file_too_large_is_not_read(tmp_path):
    with (tmp_path / "x.dat").open("wb") as stream:
        stream.truncate(60_000_000)
    with pytest.raises(FileFormatError, match="too large"):
        read_landmarks(tmp_path / "x.dat")


def test_all_points_at_one_place_is_an_error_of_three(tmp_path):
    file = tmp_path / "GP01_L.mrk.json"
    write_json(file, markup(control_point("CA"), control_point("OS")))
    assert len(read_landmarks(file).placed) == 2
    write_json(file, markup(control_point("CA"), control_point("CB"), control_point("CL")))
    with pytest.raises(GeometryError, match="all 3 points are at the same place"):
        read_landmarks(file)


def test_what_to_do_with_unknown_labels_must_be_known(tmp_path):
    file = write_json(tmp_path / "GP01_L.mrk.json", markup(control_point("CA")))
    with pytest.raises(GpError, match="unknown must be one of error, extra"):
        read_landmarks(file, unknown="ignore")


def test_points_keep_what_the_file_says(tmp_path):
    file = write_json(
        tmp_path / "x.json", markup(control_point(4), control_point(None, ""), control_point("x"))
    )
    points = read_points(file)
    assert points.labels == ("4", "", "x")
    assert points.source == file
    assert np.isnan(points.positions[1]).all()


def test_numbers_in_names_sort_as_numbers():
    names = ["GP10", "gp2", "GP1", "GP02b", "A", "", "GP1.5", "9" * 6000]
    assert sorted(names, key=natural_key) == ["", "9" * 6000, "A", "GP1", "GP1.5", "gp2", "GP02b", "GP10"]
