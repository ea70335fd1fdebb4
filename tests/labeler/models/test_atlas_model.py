"""The atlas of a workspace: opened, fitted, saved, tried out; what goes wrong is said, with the remedy."""

from __future__ import annotations

import json

import numpy as np
import pytest
from animal_cases import drawn_animals, write_animals, write_side
from test_workspace import QueuedWorkspace

from gp_core.atlas.atlas import Atlas, is_atlas_file
from gp_core.atlas.fitting import fit_atlas
from gp_core.errors import GpError
from gp_core.io import load_specimens
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.study.leave_one_out import leave_one_out
from gp_labeler.document.landmark_import import ImportLandmarks
from gp_labeler.document.specimen_edits import RenameSpecimen
from gp_labeler.document.state import How, Provenance

L = Side.LEFT


@pytest.fixture
def workspace(tmp_path):
    made = QueuedWorkspace(tmp_path / "state")
    yield made
    made.close(discard=True)


@pytest.fixture
def folder(tmp_path):
    return write_animals(tmp_path / "animals", drawn_animals(4))


def label(workspace, animal) -> None:
    workspace.document.do(ImportLandmarks((animal.side(L),), Provenance(How.IMPORTED, "AB", "now")))


def test_an_atlas_fitted_here_is_saved_and_opened_again(workspace, folder, tmp_path) -> None:
    workspace.atlas.fit([folder])
    workspace.wait()
    fitted = workspace.atlas.current
    assert fitted.n_samples == 8
    assert [animal.name for animal in workspace.atlas.specimens] == ["GP01", "GP02", "GP03", "GP04"]
    assert workspace.said[-1] == ("info", "The atlas was fitted to 4 animals, 8 sides")
    file = tmp_path / "own.json"
    workspace.atlas.save(file)
    assert workspace.atlas.file == file
    workspace.atlas.use_published()
    workspace.wait()
    assert workspace.atlas.is_published
    assert (workspace.atlas.file, workspace.atlas.specimens) == (None, ())
    assert is_atlas_file(file)
    workspace.open(file)
    workspace.wait()
    np.testing.assert_array_equal(workspace.atlas.current.mean, fitted.mean)
    assert workspace.atlas.file == file
    assert workspace.atlas.specimens == ()


def test_a_fit_to_an_animal_with_problems_warns_and_names_it(workspace, tmp_path) -> None:
    animals = drawn_animals(5, seed=5)
    right = animals[2].side("R")
    wrong = right.with_point("CA", right["CB"]).with_point("CB", right["CA"])
    animals[2] = Specimen("GP03", {L: animals[2].side(L), Side.RIGHT: wrong})
    workspace.atlas.fit([write_animals(tmp_path / "animals", animals)])
    workspace.wait()
    level, text = workspace.said[-1]
    assert level == "warning"
    assert text == "The atlas was fitted to 5 animals, 10 sides; 1 animal with problems: GP03"


def test_leave_one_out_of_the_animals_by_both_methods(workspace, folder) -> None:
    with pytest.raises(GpError, match=r"needs at least 3 animals, got 0\. Fit an atlas"):
        workspace.atlas.try_out()
    workspace.atlas.fit([folder])
    workspace.wait()
    changes = []
    workspace.atlas.changed.connect(lambda: changes.append("atlas"))
    workspace.atlas.details_changed.connect(lambda: changes.append("details"))
    workspace.atlas.try_out()
    workspace.wait()
    assert changes == ["details"]
    trial = workspace.atlas.trial
    assert (trial.n_animals, trial.n_sides, trial.skipped) == (4, 8, ())
    assert [report.method for report in trial.reports] == ["robust", "jrmpc"]
    for report in trial.reports:
        assert 0 < report.errors.e_co_mm.mean() < 1.5
    workspace.atlas.use(workspace.atlas.current)
    assert workspace.atlas.trial is None


def test_leave_one_out_is_what_the_core_says(workspace, folder) -> None:
    workspace.atlas.fit([folder])
    workspace.wait()
    workspace.atlas.try_out()
    workspace.wait()
    for report in workspace.atlas.trial.reports:
        core = leave_one_out(load_specimens(folder), method=report.method)
        here = {(row.specimen, row.side): row.e_co_mm for row in report.rows}
        assert here == {(row.specimen, row.side): pytest.approx(row.e_co_mm) for row in core.rows}


def test_sides_that_lack_a_needed_feature_do_not_take_part(workspace, folder) -> None:
    animal = drawn_animals(4)[0]
    write_side(folder, animal.name, animal.side(L).with_point("LLI", None))
    workspace.atlas.fit([folder])
    workspace.wait()
    workspace.atlas.try_out()
    workspace.wait()
    assert workspace.atlas.trial.n_sides == 7
    assert [skipped.text for skipped in workspace.atlas.trial.skipped] == ["GP01 left: lacks LLI."]


@pytest.mark.parametrize("text", ["{", '{"gpAtlas": 9}', '{"gpAtlas": 1, "frame": "atlas"}'])
def test_a_damaged_atlas_is_named_and_the_old_one_stays(workspace, tmp_path, text) -> None:
    workspace.atlas.use(Atlas.published())
    file = tmp_path / "broken.json"
    file.write_text(text)
    workspace.atlas.open(file)
    workspace.wait()
    (level, said) = workspace.said[-1]
    assert level == "error"
    assert "broken.json" in said
    assert "Make it with" in said
    assert workspace.atlas.is_published


def test_too_few_animals_are_told_with_what_was_skipped(workspace, tmp_path) -> None:
    animal = drawn_animals(1)[0]
    write_side(tmp_path, "GP01", animal.side(L))
    (tmp_path / "GP02_L.mrk.json").write_text(json.dumps({"markups": []}))
    workspace.atlas.fit([tmp_path])
    workspace.wait()
    (level, said) = workspace.said[-1]
    assert level == "error"
    assert "at least three labelled sides, got 1" in said
    assert "GP02_L.mrk.json: " in said


def test_an_animal_is_held_against_an_atlas_that_does_not_know_it(workspace, folder) -> None:
    animals = drawn_animals(4)
    label(workspace, animals[0])
    workspace.atlas.fit([folder])
    workspace.wait()
    assert not workspace.atlas.is_held_out
    known = {code: found.n_sd for code, found in workspace.labels.deviations(L).items()}
    workspace.document.do(RenameSpecimen("GP01"))
    workspace.atlas.use(workspace.atlas.current, workspace.atlas.specimens)
    workspace.wait()
    assert workspace.atlas.is_held_out
    alone = {code: found.n_sd for code, found in workspace.labels.deviations(L).items()}
    assert alone.keys() == known.keys()
    assert np.mean(list(alone.values())) > np.mean(list(known.values()))


def test_a_damaged_atlas_opened_at_the_start_leaves_the_published_one(workspace, tmp_path) -> None:
    file = tmp_path / "broken.json"
    file.write_text("{")
    workspace.atlas.load()
    workspace.atlas.open(file)
    workspace.wait()
    assert workspace.atlas.is_published


def test_an_atlas_opened_at_the_start_is_not_replaced_by_the_published_one(
    workspace, folder, tmp_path
) -> None:
    fit_atlas(load_specimens(folder)).save(tmp_path / "own.json")
    workspace.atlas.open(tmp_path / "own.json")
    workspace.atlas.load()
    workspace.wait()
    assert workspace.atlas.file == tmp_path / "own.json"
    assert workspace.atlas.current.n_samples == 8


@pytest.fixture
def start(tmp_path):
    """Start the program again, once more each time, and wait until its atlas is there."""
    made = []

    def started(directory=tmp_path / "state"):
        if made:
            made[-1].close(discard=True)
        made.append(QueuedWorkspace(directory))
        made[-1].atlas.load()
        made[-1].wait()
        return made[-1]

    yield started
    made[-1].close(discard=True)


def test_an_atlas_file_is_there_again_at_the_next_start(start, folder, tmp_path) -> None:
    file = tmp_path / "own.json"
    fit_atlas(load_specimens(folder)).save(file)
    start().atlas.open(file)
    workspace = start()
    assert workspace.atlas.is_published, "what was still being read was not chosen yet"
    workspace.atlas.open(file)
    workspace.wait()
    workspace = start()
    assert (workspace.atlas.file, workspace.atlas.current.n_samples) == (file, 8)
    assert workspace.said == [("info", "The atlas of own.json is in use")]
    workspace.atlas.use_published()
    workspace.wait()
    assert start().atlas.is_published


def test_the_animals_of_an_atlas_are_fitted_to_again_at_the_next_start(start, folder, tmp_path) -> None:
    workspace = start()
    workspace.atlas.fit([folder])
    workspace.wait()
    fitted = workspace.atlas.current
    workspace.atlas.save(tmp_path / "copy.json")
    workspace = start()
    np.testing.assert_array_equal(workspace.atlas.current.mean, fitted.mean)
    assert len(workspace.atlas.specimens) == 4, "so leave-one-out and JRMPC can go on"
    workspace.atlas.open(tmp_path / "copy.json")
    workspace.wait()
    workspace.atlas.save(tmp_path / "third.json")
    assert start().atlas.file == tmp_path / "third.json"


@pytest.mark.parametrize("harm", ["gone", "damaged"])
@pytest.mark.parametrize("what", ["file", "animals"])
def test_an_atlas_that_is_gone_gives_way_to_the_published_one(start, folder, tmp_path, what, harm) -> None:
    file, workspace = tmp_path / "own.json", start()
    fit_atlas(load_specimens(folder)).save(file)
    workspace.atlas.open(file) if what == "file" else workspace.atlas.fit([folder])
    workspace.wait()
    for each in (file, *folder.iterdir()):
        each.unlink() if harm == "gone" else each.write_text("{")
    if harm == "gone":
        folder.rmdir()
    workspace = start()
    assert workspace.atlas.is_published
    (level, said) = workspace.said[-1]
    assert level == "warning"
    name = "own.json" if what == "file" else "animals"
    assert said.startswith(f"The atlas of {name} is no longer available: ")
    assert said.endswith("The published atlas is used.")
    assert workspace.atlas.problem in said
    workspace = start()
    assert workspace.said, "it may have been on a drive that was not there"
    workspace.atlas.use_published()
    workspace.wait()
    assert workspace.atlas.problem == ""
    assert start().said == []


def test_nothing_is_remembered_without_a_state_directory(start, folder, tmp_path) -> None:
    workspace = start(None)
    workspace.atlas.fit([folder])
    workspace.wait()
    assert start(None).atlas.is_published
    (tmp_path / "state").mkdir()
    for text in ("{", "[]", '{"file": 3}', '{"animals": [""]}', '{"animals": []}'):
        (tmp_path / "state" / "atlas.json").write_text(text)
        assert start().atlas.is_published
        assert start().said == []


def test_an_atlas_chosen_while_the_last_one_is_read_stays(start, folder, tmp_path) -> None:
    workspace = start()
    workspace.atlas.fit([folder])
    workspace.wait()
    workspace.close(discard=True)
    again = QueuedWorkspace(tmp_path / "state")
    try:
        again.atlas.load()
        again.atlas.use_published()
        again.wait()
        assert again.atlas.is_published
    finally:
        again.close(discard=True)


def test_stopping_the_atlas_of_the_last_time_leaves_the_published_one(start, folder, tmp_path) -> None:
    workspace = start()
    workspace.atlas.fit([folder])
    workspace.wait()
    workspace.close(discard=True)
    again = QueuedWorkspace(tmp_path / "state")
    again.atlas.load()
    again.jobs.cancel_all()
    again.wait()
    assert again.atlas.is_published
    again.close(discard=True)


def test_views_are_told_of_a_check_that_changes_what_they_show(workspace) -> None:
    told, atlas = [], Atlas.published()
    workspace.atlas.use(atlas)
    workspace.labels.problems_changed.connect(lambda: told.append(1))
    mean = {code: atlas[code] for code in atlas.codes if code != "CO"}
    workspace.document.do(ImportLandmarks((LandmarkSet.from_mapping(mean, L),), Provenance(How.TYPED)))
    workspace.wait()
    assert told == [], "no point looks otherwise than before"
    workspace.labels.place(mean["MH"] + [0, 3, 0], side=L, code="MH")
    workspace.wait()
    assert told == [1], "a problem was found"
    workspace.labels.place(mean["OS"] + 0.01, side=L, code="OS")
    workspace.wait()
    assert told == [1, 1], "the problem that is shown was looked at again"
