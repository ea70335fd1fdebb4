"""Animals from files and folders."""

import json

import numpy as np
import pytest
from landmark_makers import SHARED, needs_shared_data, same_landmarks, some_landmarks

from gp_core.errors import FeatureError, FileFormatError, GeometryError
from gp_core.io import (
    landmark_file_name,
    load_labellings,
    load_specimens,
    read_authors_mat,
    read_landmarks,
    write_csv,
    write_fcsv,
    write_markups,
    write_suggestions,
)
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.landmarks.suggestion import Suggestion


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


def test_tables_of_a_side_in_a_folder_are_not_left_out_in_silence(tmp_path, caplog):
    write_markups(tmp_path / "GP01_L.mrk.json", some_landmarks(side="L"), specimen="GP01")
    write_csv(tmp_path / "GP01_L.csv", some_landmarks(side="L"))  # the same in another format
    (tmp_path / "touches.csv").write_text("CL,1,2,3\nMN,4,5,6\n")
    (tmp_path / "notes_R.csv").write_text("day,weight\n1,2\n")
    load_specimens(tmp_path)
    assert caplog.text == ""
    write_csv(tmp_path / "GP01_R.csv", some_landmarks(side="R"))
    load_specimens(tmp_path)
    assert "its tables of landmarks are left out: GP01_R.csv. Name the files" in caplog.text


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


def _labelled(folder, observer, round_, *, side="L", name="GP1", seed=0, shift=0.0):
    folder.mkdir(exist_ok=True)
    marks = some_landmarks(side, seed=seed)
    marks = LandmarkSet(marks.points + shift, side, observer=observer, round=round_)
    file = folder / landmark_file_name(name, marks.side, observer=observer, round_=round_)
    write_markups(file, marks, specimen=name)
    return marks


def test_observers_and_rounds_of_an_animal_are_kept_apart(tmp_path):
    for observer, round_, shift in (("AB", 1, 0.0), ("AB", 2, 0.3), ("CD", 1, 0.6)):
        for side in "LR":
            _labelled(tmp_path, observer, round_, side=side, shift=shift)
    _labelled(tmp_path, "CD", 1, name="GP2")
    found = load_labellings(tmp_path)
    assert [(e.specimen.name, e.observer, e.round, len(e.specimen.sides)) for e in found] == [
        ("GP1", "AB", 1, 2),
        ("GP1", "AB", 2, 2),
        ("GP1", "CD", 1, 2),
        ("GP2", "CD", 1, 1),
    ]
    for file in tmp_path.iterdir():  # as after 3D Slicer, which keeps descriptions and the name
        content = json.loads(file.read_text())
        del content["gpLabeler"]
        file.write_text(json.dumps(content))
    again = load_labellings(tmp_path)
    assert [(e.specimen.name, e.who) for e in again] == [(e.specimen.name, e.who) for e in found]


def test_an_animal_that_was_labelled_three_times_is_one_animal(tmp_path, caplog):
    sets = [_labelled(tmp_path, *who) for who in (("AB", 1), ("AB", 2))]
    sets.append(_labelled(tmp_path, "CD", 1, shift=0.3))
    (animal,) = load_specimens(tmp_path)
    assert "GP1: labelled 3 times, the mean is taken (AB, round 1; AB, round 2; CD, round 1)" in caplog.text
    np.testing.assert_allclose(animal.side("L")["CA"], np.mean([s["CA"] for s in sets], axis=0), atol=1e-12)
    (one,) = load_specimens(tmp_path, observer="cd")
    np.testing.assert_array_equal(one.side("L")["CA"], sets[2]["CA"])
    (first,) = load_specimens(tmp_path, round=2)
    np.testing.assert_array_equal(first.side("L")["CA"], sets[1]["CA"])
    with pytest.raises(FeatureError, match=r"no labels by EF .* AB, round 1; AB, round 2; CD, round 1"):
        load_specimens(tmp_path, observer="EF")


def test_two_files_of_one_round_give_a_remedy_for_their_names(tmp_path):
    _labelled(tmp_path, "AB", 1)
    _labelled(tmp_path / "other", "AB", 1, shift=0.2)
    with pytest.raises(FeatureError, match=r"too.*GP1_AB_r2_L\.mrk\.json"):
        load_specimens([tmp_path, tmp_path / "other"])


def test_one_export_in_several_formats_is_one(tmp_path):
    marks = some_landmarks("L")
    write_markups(tmp_path / "GP1_L.mrk.json", marks, specimen="GP1")
    write_fcsv(tmp_path / "GP1_L.fcsv", marks)
    write_csv(tmp_path / "GP1_L.csv", marks)
    for paths in (tmp_path, sorted(tmp_path.iterdir()), sorted(tmp_path.iterdir(), reverse=True)):
        (animal,) = load_specimens(paths)
        assert same_landmarks(animal.side("L"), with_cochlea_origin(marks))
    write_fcsv(tmp_path / "GP1_L.fcsv", some_landmarks("L", seed=3))
    with pytest.raises(FeatureError, match=r"GP1_L\.fcsv.*the left side is in .*GP1_L\.mrk\.json too"):
        load_specimens(tmp_path)


@pytest.mark.parametrize("side", ["L", "R"])
def test_the_shared_point_of_one_side_counts_for_both(side, tmp_path):
    of = {name: some_landmarks(name, seed=2) for name in "LR"}
    rows = [
        f"{code}_{name},{x},{y},{z}"
        for name in "LR"
        for code, (x, y, z) in of[name].as_mapping().items()
        if code not in ("IN", "CO")
    ]
    text = "name,x,y,z\n" + "\n".join([*rows, f"IN_{side},1,2,3"])
    (tmp_path / "GP1.csv").write_text(text)
    (animal,) = load_specimens(tmp_path / "GP1.csv")
    for landmarks in animal.sides.values():
        np.testing.assert_array_equal(landmarks["IN"], [1, 2, 3])
    other = tmp_path / f"GP1_{'R' if side == 'L' else 'L'}.csv"
    other.write_text(f"name,x,y,z\nCA,0,1,2\nCB,1,3,5\nIN_{side},1,2,3")
    alone = read_landmarks(other)
    np.testing.assert_array_equal(alone["IN"], [1, 2, 3])


def test_the_shared_point_in_one_of_two_files_counts_for_both(tmp_path):
    left, right = some_landmarks("L", seed=2).with_point("IN", None), some_landmarks("R", seed=2)
    write_markups(tmp_path / "GP1_L.mrk.json", left, specimen="GP1")
    write_markups(tmp_path / "GP1_R.mrk.json", right, specimen="GP1")
    (animal,) = load_specimens(tmp_path)
    np.testing.assert_array_equal(animal.side("L")["IN"], right["IN"])


def test_suggestions_stay_with_the_round_that_they_were_made_in(tmp_path):
    for round_ in (1, 2):
        marks = _labelled(tmp_path, "AB", round_, shift=0.1 * round_)
        if round_ == 2:
            marks = marks.with_point("MN", None).with_suggestions({"MN": Suggestion((1.0, 2.0, 3.0))})
            for suggested, write in ((False, write_markups), (True, write_suggestions)):
                name = landmark_file_name("GP1", marks.side, suggested=suggested, observer="AB", round_=2)
                write(tmp_path / name, marks, specimen="GP1")
    first, second = (each.specimen.side("L") for each in load_labellings(tmp_path))
    assert (set(first.suggested), set(second.suggested)) == (set(), {"MN"})
    assert "MN" in first
    assert "MN" not in second
