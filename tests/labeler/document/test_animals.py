"""Labelled animals from many files: what is read, what is skipped and why, what is to be looked at."""

from __future__ import annotations

import numpy as np
import pytest
from animal_cases import drawn_animals, write_animals, write_side

from gp_core.errors import GpError
from gp_core.io import landmark_file_name, write_markups
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.document.animals import read_animals
from gp_labeler.document.landmark_import import ImportLandmarks
from gp_labeler.document.specimen_document import utc_now
from gp_labeler.document.specimen_file import write_specimen
from gp_labeler.document.state import How, Provenance, SpecimenState

L, R = Side.LEFT, Side.RIGHT


def state_of(animal) -> SpecimenState:
    edit = ImportLandmarks((animal.side(L),), Provenance(How.IMPORTED, "AB", utc_now()))
    return edit.apply(SpecimenState(animal.name))


def test_both_sides_of_an_animal_come_together(tmp_path) -> None:
    told = []
    animals = read_animals([write_animals(tmp_path / "a", drawn_animals(3))], told.append)
    assert animals.text == "3 animals, 6 sides"
    assert [animal.name for animal in animals.specimens] == ["GP01", "GP02", "GP03"]
    assert not animals.skipped
    assert not animals.problems
    assert told == sorted(told)
    assert 0 <= told[0] < told[-1] < 1


def test_specimen_files_are_read_and_exports_of_them_are_not_animals_of_their_own(tmp_path) -> None:
    (animal,) = drawn_animals(1)
    write_specimen(tmp_path / "GP01.gpspecimen.json", state_of(animal))
    assert read_animals([tmp_path]).text == "1 animal, 1 side"
    write_side(tmp_path, "GP01", animal.side(L))
    both = read_animals([tmp_path])
    assert both.text == "1 animal, 1 side"
    assert not both.skipped


def test_what_cannot_be_used_is_skipped_with_its_reason(tmp_path) -> None:
    one, two, three = drawn_animals(3)
    few = LandmarkSet.from_mapping({"CA": one.side(L)["CA"], "IN": one.side(L)["IN"]}, L)
    write_side(tmp_path, "few", few)
    write_side(tmp_path, "turned", LandmarkSet(two.side(L).points, R))
    (tmp_path / "torn.mrk.json").write_text('{"markups": [')
    write_side(tmp_path, "GP03", three.side(R))
    other = tmp_path / "other"
    other.mkdir()
    write_side(other, "GP03", LandmarkSet(three.side(R).points + 1, R))
    animals = read_animals([tmp_path, other])
    assert [animal.name for animal in animals.specimens] == ["GP03"]
    reasons = {skipped.what: skipped.why for skipped in animals.skipped}
    assert reasons["few left (few_L.mrk.json)"] == "2 placed, 4 or more are needed"
    assert "left and right are exchanged" in reasons["turned right"]
    assert "torn.mrk.json" in reasons
    assert "in GP03_R.mrk.json too, with other labels" in reasons["GP03 right (GP03_R.mrk.json)"]
    assert len(reasons) == 4


def test_an_animal_of_two_observers_is_one_with_the_mean_of_its_labels(tmp_path) -> None:
    (animal,) = drawn_animals(1)
    truth = animal.side(L)
    for observer, shift in (("AB", 0.0), ("CD", 0.2)):
        marks = LandmarkSet(truth.points + shift, L, observer=observer)
        file = tmp_path / landmark_file_name("GP01", L, observer=observer, round_=1)
        write_markups(file, marks, specimen="GP01")
    animals = read_animals([tmp_path])
    assert (animals.text, animals.skipped) == ("1 animal, 1 side", ())
    np.testing.assert_allclose(animals.specimens[0].side(L)["CA"], truth["CA"] + 0.1, atol=1e-9)
    assert animals.screened is not None
    assert animals.screened.notes == ("GP01 left: the mean of 2 labellings is taken.",)


def test_a_label_far_off_is_read_and_named(tmp_path) -> None:
    (animal,) = drawn_animals(1)
    side = animal.side(L)
    write_side(tmp_path, "GP01", side.with_point("LLI", side["LLI"] + [2.5, 0, 0]))
    animals = read_animals([tmp_path])
    assert animals.text == "1 animal, 1 side"
    assert ("far", ("LLI",)) in [(f.kind, f.landmarks) for f in animals.problems]


def test_folders_of_folders_are_searched_and_empty_ones_named(tmp_path) -> None:
    one, two = drawn_animals(2)
    write_animals(tmp_path / "GP01", [one])
    write_animals(tmp_path / "GP02", [two])
    assert read_animals([tmp_path]).text == "2 animals, 4 sides"
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(GpError, match=r"empty: holds no labelled animals .* Choose another folder"):
        read_animals([empty])


def test_reading_can_be_stopped(tmp_path) -> None:
    class StopError(Exception):
        pass

    def stop(fraction: float) -> None:
        raise StopError

    with pytest.raises(StopError):
        read_animals([write_animals(tmp_path / "a", drawn_animals(1))], stop)
    assert np.isfinite(drawn_animals(1)[0].side(L)["CA"]).all()
