"""The atlas of a workbench: opened, fitted, saved, tried out; what goes wrong is said, with the remedy."""

from __future__ import annotations

import json

import numpy as np
import pytest
from animal_cases import drawn_animals, write_animals, write_side
from test_workspace import Desk

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.fitting import fit_atlas
from gp_core.atlas.label_check import Finding, SideCheck
from gp_core.errors import GpError
from gp_core.io import load_specimens
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import Specimen
from gp_core.study.leave_one_out import leave_one_out
from gp_labeler.document.landmark_import import ImportLandmarks
from gp_labeler.document.specimen_edits import RenameSpecimen
from gp_labeler.document.state import How, Provenance
from gp_labeler.models.atlas import is_atlas_file

L = Side.LEFT


@pytest.fixture
def desk(tmp_path):
    made = Desk(tmp_path / "state")
    yield made
    made.close(discard=True)


@pytest.fixture
def folder(tmp_path):
    return write_animals(tmp_path / "animals", drawn_animals(4))


def label(desk, animal) -> None:
    desk.session.do(ImportLandmarks((animal.side(L),), Provenance(How.IMPORTED, "AB", "now")))


def test_an_atlas_fitted_here_is_saved_and_opened_again(desk, folder, tmp_path) -> None:
    desk.fit_atlas([folder])
    desk.wait()
    fitted = desk.atlas
    assert fitted.n_samples == 8
    assert [animal.name for animal in desk.atlas_specimens] == ["GP01", "GP02", "GP03", "GP04"]
    assert desk.said[-1] == ("info", "The atlas was fitted to 4 animals, 8 sides")
    file = tmp_path / "own.json"
    desk.save_atlas(file)
    assert desk.atlas_file == file
    desk.use_published_atlas()
    desk.wait()
    assert desk.is_published_atlas
    assert (desk.atlas_file, desk.atlas_specimens) == (None, ())
    assert is_atlas_file(file)
    desk.open(file)
    desk.wait()
    np.testing.assert_array_equal(desk.atlas.mean, fitted.mean)
    assert desk.atlas_file == file
    assert desk.atlas_specimens == ()


def test_a_fit_to_an_animal_in_doubt_warns_and_names_it(desk, tmp_path) -> None:
    animals = drawn_animals(5, seed=5)
    right = animals[2].side("R")
    wrong = right.with_point("CA", right["CB"]).with_point("CB", right["CA"])
    animals[2] = Specimen("GP03", {L: animals[2].side(L), Side.RIGHT: wrong})
    desk.fit_atlas([write_animals(tmp_path / "animals", animals)])
    desk.wait()
    level, text = desk.said[-1]
    assert level == "warning"
    assert text == "The atlas was fitted to 5 animals, 10 sides; 1 animal in doubt: GP03"


def test_leave_one_out_of_the_animals_by_both_methods(desk, folder) -> None:
    with pytest.raises(GpError, match=r"needs at least 3 animals, got 0\. Fit an atlas"):
        desk.try_atlas()
    desk.fit_atlas([folder])
    desk.wait()
    changes = []
    desk.atlas_changed.connect(lambda: changes.append("atlas"))
    desk.atlas_details_changed.connect(lambda: changes.append("details"))
    desk.try_atlas()
    desk.wait()
    assert changes == ["details"]
    trial = desk.trial
    assert (trial.n_animals, trial.n_sides, trial.skipped) == (4, 8, ())
    assert [report.method for report in trial.reports] == ["robust", "jrmpc"]
    for report in trial.reports:
        assert 0 < report.errors.e_co_mm.mean() < 1.5
    desk.use_atlas(desk.atlas)
    assert desk.trial is None


def test_leave_one_out_is_what_the_core_says(desk, folder) -> None:
    desk.fit_atlas([folder])
    desk.wait()
    desk.try_atlas()
    desk.wait()
    for report in desk.trial.reports:
        core = leave_one_out(load_specimens(folder), method=report.method)
        here = {(row.specimen, row.side): row.e_co_mm for row in report.rows}
        assert here == {(row.specimen, row.side): pytest.approx(row.e_co_mm) for row in core.rows}


def test_sides_that_lack_a_needed_feature_do_not_take_part(desk, folder) -> None:
    animal = drawn_animals(4)[0]
    write_side(folder, animal.name, animal.side(L).with_point("LLI", None))
    desk.fit_atlas([folder])
    desk.wait()
    desk.try_atlas()
    desk.wait()
    assert desk.trial.n_sides == 7
    assert [skipped.text for skipped in desk.trial.skipped] == ["GP01 left: lacks LLI."]


@pytest.mark.parametrize("text", ["{", '{"gpAtlas": 9}', '{"gpAtlas": 1, "frame": "atlas"}'])
def test_a_damaged_atlas_is_named_and_the_old_one_stays(desk, tmp_path, text) -> None:
    desk.use_atlas(Atlas.published())
    file = tmp_path / "broken.json"
    file.write_text(text)
    desk.open_atlas(file)
    desk.wait()
    (level, said) = desk.said[-1]
    assert level == "error"
    assert "broken.json" in said
    assert "Make it with" in said
    assert desk.is_published_atlas


def test_too_few_animals_are_told_with_what_was_skipped(desk, tmp_path) -> None:
    animal = drawn_animals(1)[0]
    write_side(tmp_path, "GP01", animal.side(L))
    (tmp_path / "GP02_L.mrk.json").write_text(json.dumps({"markups": []}))
    desk.fit_atlas([tmp_path])
    desk.wait()
    (level, said) = desk.said[-1]
    assert level == "error"
    assert "at least three labelled sides, got 1" in said
    assert "GP02_L.mrk.json: " in said


def test_an_animal_is_held_against_an_atlas_that_does_not_know_it(desk, folder) -> None:
    animals = drawn_animals(4)
    label(desk, animals[0])
    desk.fit_atlas([folder])
    desk.wait()
    assert not desk.is_held_out
    known = {code: found.n_sd for code, found in desk.departures(L).items()}
    desk.session.do(RenameSpecimen("GP01"))
    desk.use_atlas(desk.atlas, desk.atlas_specimens)
    desk.wait()
    assert desk.is_held_out
    alone = {code: found.n_sd for code, found in desk.departures(L).items()}
    assert alone.keys() == known.keys()
    assert np.mean(list(alone.values())) > np.mean(list(known.values()))


def test_a_damaged_atlas_opened_at_the_start_leaves_the_published_one(desk, tmp_path) -> None:
    file = tmp_path / "broken.json"
    file.write_text("{")
    desk.load_atlas()
    desk.open_atlas(file)
    desk.wait()
    assert desk.is_published_atlas


def test_an_atlas_opened_at_the_start_is_not_replaced_by_the_published_one(desk, folder, tmp_path) -> None:
    fit_atlas(load_specimens(folder)).save(tmp_path / "own.json")
    desk.open_atlas(tmp_path / "own.json")
    desk.load_atlas()
    desk.wait()
    assert desk.atlas_file == tmp_path / "own.json"
    assert desk.atlas.n_samples == 8


@pytest.fixture
def start(tmp_path):
    """Start the program anew, once more each time, and wait until its atlas is there."""
    made = []

    def started(directory=tmp_path / "state"):
        if made:
            made[-1].close(discard=True)
        made.append(Desk(directory))
        made[-1].load_atlas()
        made[-1].wait()
        return made[-1]

    yield started
    made[-1].close(discard=True)


def test_an_atlas_file_is_there_again_at_the_next_start(start, folder, tmp_path) -> None:
    file = tmp_path / "own.json"
    fit_atlas(load_specimens(folder)).save(file)
    start().open_atlas(file)
    desk = start()
    assert desk.is_published_atlas, "what was still being read was not chosen yet"
    desk.open_atlas(file)
    desk.wait()
    desk = start()
    assert (desk.atlas_file, desk.atlas.n_samples) == (file, 8)
    assert desk.said == [("info", "The atlas of own.json is in use")]
    desk.use_published_atlas()
    desk.wait()
    assert start().is_published_atlas


def test_the_animals_of_an_atlas_are_fitted_to_again_at_the_next_start(start, folder, tmp_path) -> None:
    desk = start()
    desk.fit_atlas([folder])
    desk.wait()
    fitted = desk.atlas
    desk.save_atlas(tmp_path / "copy.json")
    desk = start()
    np.testing.assert_array_equal(desk.atlas.mean, fitted.mean)
    assert len(desk.atlas_specimens) == 4, "so leave-one-out and JRMPC can go on"
    desk.open_atlas(tmp_path / "copy.json")
    desk.wait()
    desk.save_atlas(tmp_path / "third.json")
    assert start().atlas_file == tmp_path / "third.json"


@pytest.mark.parametrize("harm", ["gone", "damaged"])
@pytest.mark.parametrize("what", ["file", "animals"])
def test_an_atlas_that_is_gone_gives_way_to_the_published_one(start, folder, tmp_path, what, harm) -> None:
    file, desk = tmp_path / "own.json", start()
    fit_atlas(load_specimens(folder)).save(file)
    desk.open_atlas(file) if what == "file" else desk.fit_atlas([folder])
    desk.wait()
    for each in (file, *folder.iterdir()):
        each.unlink() if harm == "gone" else each.write_text("{")
    if harm == "gone":
        folder.rmdir()
    desk = start()
    assert desk.is_published_atlas
    (level, said) = desk.said[-1]
    assert level == "warning"
    name = "own.json" if what == "file" else "animals"
    assert said.startswith(f"The atlas of {name} cannot be had any more: ")
    assert said.endswith("The published one is in use.")
    assert desk.atlas_problem in said
    desk = start()
    assert desk.said, "it may have been on a drive that was not there"
    desk.use_published_atlas()
    desk.wait()
    assert desk.atlas_problem == ""
    assert start().said == []


def test_nothing_is_remembered_without_a_state_directory(start, folder, tmp_path) -> None:
    desk = start(None)
    desk.fit_atlas([folder])
    desk.wait()
    assert start(None).is_published_atlas
    (tmp_path / "state").mkdir()
    for text in ("{", "[]", '{"file": 3}', '{"animals": [""]}', '{"animals": []}'):
        (tmp_path / "state" / "atlas.json").write_text(text)
        assert start().is_published_atlas
        assert start().said == []


def test_an_atlas_chosen_while_the_last_one_is_read_stays(start, folder, tmp_path) -> None:
    desk = start()
    desk.fit_atlas([folder])
    desk.wait()
    desk.close(discard=True)
    again = Desk(tmp_path / "state")
    try:
        again.load_atlas()
        again.use_published_atlas()
        again.wait()
        assert again.is_published_atlas
    finally:
        again.close(discard=True)


def test_stopping_the_atlas_of_the_last_time_leaves_the_published_one(start, folder, tmp_path) -> None:
    desk = start()
    desk.fit_atlas([folder])
    desk.wait()
    desk.close(discard=True)
    again = Desk(tmp_path / "state")
    again.load_atlas()
    again.jobs.cancel_all()
    again.wait()
    assert again.is_published_atlas
    again.close(discard=True)


def test_views_are_told_of_a_judgement_that_changes_what_they_show(desk) -> None:
    told = []
    desk.doubts_changed.connect(lambda: told.append(1))
    fine = SideCheck((Finding("", L, "missing", ("CB",), "not placed"),))
    doubtful = SideCheck((Finding("", L, "exchanged", ("CA", "CB"), "CA and CB look exchanged"),))
    desk._take_judged(False, fine)
    assert told == [], "no point looks otherwise than before"
    desk._take_judged(True, fine)
    assert told == [1], "a doubt shown until now is gone"
    desk._take_judged(False, doubtful)
    assert told == [1, 1]
