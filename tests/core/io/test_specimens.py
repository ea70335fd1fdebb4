"""Animals from files and folders."""

import pytest
from landmark_makers import SHARED, needs_shared_data, same_landmarks, some_landmarks

from gp_core.errors import FeatureError, FileFormatError, GeometryError
from gp_core.io import load_specimens, read_authors_mat, write_csv, write_fcsv, write_markups
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet


def write(folder, specimen, side, *, seed=0, name=None):
    folder.mkdir(exist_ok=True)
    file = folder / (name or f"{specimen}_{side}.mrk.json")
    write_markups(file, some_landmarks(side, seed=seed), specimen=specimen)
    return file


def test_sides_come_together_and_names_sort_as_numbers(tmp_path):
    for specimen, side in [("GP10", "R"), ("GP2", "R"), ("GP2", "L"), ("GP1", "L")]:
        write(tmp_path, specimen, side)
    write_fcsv(tmp_path / "old 3-right.fcsv", some_landmarks("R"))
    (tmp_path / "notes.txt").write_text("not a landmark file")
    (tmp_path / "GP2.gpspecimen.json").write_text("{}")
    (tmp_path / "._GP2_L.mrk.json").write_bytes(b"\0\5")
    write(tmp_path / "deeper", "GP7", "L")
    specimens = load_specimens([tmp_path])
    assert [s.name for s in specimens] == ["GP1", "GP2", "GP10", "old 3"]
    assert [set(s.sides) for s in specimens] == [
        {Side.LEFT},
        {Side.LEFT, Side.RIGHT},
        {Side.RIGHT},
        {Side.RIGHT},
    ]


def test_files_and_folders_and_tables_may_be_mixed_and_named_twice(tmp_path):
    file = write(tmp_path, "GP1", "L")
    other = tmp_path / "more" / "GP1_R.csv"
    other.parent.mkdir()
    write_csv(other, some_landmarks("R", seed=5))
    (specimen,) = load_specimens([tmp_path, str(file), file, other])
    assert same_landmarks(specimen.side("R"), with_cochlea_origin(some_landmarks("R", seed=5)))
    (again,) = load_specimens(file)
    assert same_landmarks(again.side("L"), specimen.side("L"))


def test_the_header_names_the_specimen(tmp_path):
    write(tmp_path, "Emma", "L", name="export.mrk.json")
    assert [s.name for s in load_specimens(tmp_path)] == ["Emma"]


def test_two_files_for_one_side_are_an_error(tmp_path):
    write(tmp_path, "GP1", "L")
    write(tmp_path, "GP1", "L", name="copy.mrk.json")
    with pytest.raises(
        FeatureError, match=r"copy.*specimen GP1: the left side is in .*GP1_L.* too|GP1_L.*copy"
    ):
        load_specimens(tmp_path)


def test_a_folder_without_landmarks_is_named(tmp_path):
    with pytest.raises(
        FileFormatError, match=r"holds no landmark files \(\*\.mrk\.json, \*\.fcsv\)"
    ) as caught:
        load_specimens(tmp_path)
    assert str(tmp_path) in str(caught.value)


@pytest.mark.parametrize("paths", [[], ()])
def test_nothing_given_is_an_error(paths):
    with pytest.raises(FileFormatError, match="no landmark files were given"):
        load_specimens(paths)


def test_a_broken_file_in_a_folder_is_named(tmp_path):
    write(tmp_path, "GP1", "L")
    (tmp_path / "GP2_L.mrk.json").write_text("{")
    with pytest.raises(FileFormatError, match=r"GP2_L\.mrk\.json: is not JSON"):
        load_specimens(tmp_path)
    with pytest.raises(FileFormatError, match="does not exist"):
        load_specimens([tmp_path / "none"])
    with pytest.raises(FileFormatError, match=r"cannot be searched|does not exist|cannot be read"):
        load_specimens(["x" * 5000])


@needs_shared_data
def test_metres_are_named(tmp_path):
    mats = [
        SHARED / "usevitch2021" / f"combined_coords_method2_morepts_final_co_correct_{s}_CO.mat" for s in "LR"
    ]
    left = read_authors_mat(*mats)[0].side("L")
    small = LandmarkSet(left.points * 1e-3, "L")
    write_markups(tmp_path / "GP1_L.mrk.json", small, specimen="GP1")
    with pytest.raises(GeometryError, match=r"GP1_L\.mrk\.json: .*1000 times smaller.*metres"):
        load_specimens(tmp_path)
