"""Certainties, notes and observers of labels, and several labellings of one specimen."""

from __future__ import annotations

import json

import numpy as np
import pytest
from document_cases import MARK, Editing, FakeVolume, shape

from gp_core.errors import GpError
from gp_core.io import load_labellings, read_landmarks
from gp_core.landmarks.features import Side
from gp_core.landmarks.measurements import Measurement
from gp_labeler.document.edit_tables import edit_of, edit_table, script_table
from gp_labeler.document.edits import AnnotatePoint, CheckPoint, LockPoints
from gp_labeler.document.labelling_edits import BeginLabelling, NameObserver, OpenLabelling
from gp_labeler.document.landmark_export import FORMATS, export_landmarks
from gp_labeler.document.landmark_import import ImportLandmarks, import_landmarks
from gp_labeler.document.measurement_edits import AddMeasurements
from gp_labeler.document.observer_memory import ObserverMemory
from gp_labeler.document.opening import open_specimen
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_file import read_specimen
from gp_labeler.document.specimen_json import document_of, state_of
from gp_labeler.document.state import SpecimenState
from gp_labeler.models.workspace import Workspace

L, R = Side.LEFT, Side.RIGHT


@pytest.fixture
def editing():
    editing = Editing(SpecimenState("GP-014"), author="AB", clock=lambda: "2026-01-01T00:00:00+00:00")
    editing.document.attach_volume(FakeVolume())
    editing.document.do(ImportLandmarks((shape(L), shape(R)), MARK))
    return editing


def annotate(editing):
    editing.labels.annotate("fair", "broken bulla; see slice 12", side=L, code="CA")
    editing.labels.annotate("guess", side=R, code="IN")
    editing.labels.mark_unseen(side=L, code="MN")
    editing.labels.annotate(note="outside the field", side=L, code="MN")
    editing.document.do(CheckPoint(L, "CB", by="CD"))


@pytest.mark.parametrize("suffix", FORMATS)
def test_certainty_note_and_check_come_back_from_every_format(editing, tmp_path, suffix):
    annotate(editing)
    report = export_landmarks(editing.document.state, tmp_path, formats=[suffix])
    known = read_landmarks(report.files[0]).provenance
    assert (known["CA"].certainty, known["CA"].note) == ("fair", "broken bulla; see slice 12")
    assert known["CA"].observer == "AB"
    again = Editing(SpecimenState("GP-014"), author="XY")
    again.document.attach_volume(FakeVolume())
    import_landmarks(again.document, report.files)
    for key, mark in editing.document.state.landmarks.items():
        back = again.document.state.landmarks[key]
        for name in ("position", "unseen", "certainty", "note", "checked", "checked_by"):
            assert getattr(back, name) == getattr(mark, name), (key, name)
        assert back.provenance.by == "AB", key


def test_annotations_are_kept_by_files_edits_and_moves(editing, tmp_path):
    annotate(editing)
    state = editing.document.state
    assert state_of(json.loads(json.dumps(document_of(state)))) == state
    editing.labels.nudge([0.1, 0, 0], side=L, code="CA")
    assert editing.document.state.landmark(L, "CA").note == "broken bulla; see slice 12"
    editing.labels.clear(side=L, code="CA")
    assert editing.document.state.landmark(L, "CA").note == ""
    for edit in (AnnotatePoint(L, "CB", "sure", "clear"), BeginLabelling("CD"), OpenLabelling("AB", 1)):
        assert edit_of(edit_table(edit)) == edit
        assert edit_of(script_table(edit)) == edit


def test_what_is_still_to_do_cannot_be_annotated(editing):
    editing.labels.clear(side=L, code="CA")
    with pytest.raises(GpError, match="CA left is still to do"):
        editing.document.do(AnnotatePoint(L, "CA", "sure"))
    with pytest.raises(GpError, match="certainty"):
        AnnotatePoint(L, "CB", "certain")


def test_the_point_placed_last_is_annotated_while_the_next_is_to_do(editing):
    editing.labels.clear(side=L, code="CA")
    editing.labels.clear(side=L, code="CB")
    editing.labels.place([1, 2, 3], side=L, code="CB")
    assert editing.labels.active.code == "CA"
    editing.labels.annotate("guess")
    assert editing.document.state.landmark(L, "CB").certainty == "guess"


def test_notes_of_a_file_reach_points_that_stay(editing, tmp_path):
    annotate(editing)
    files = export_landmarks(editing.document.state, tmp_path).files
    plain = Editing(SpecimenState("GP-014"))
    plain.document.attach_volume(FakeVolume())
    plain.document.do(ImportLandmarks((shape(L), shape(R)), MARK))
    plain.document.do(LockPoints(((L, "CA"), (L, "MN"))))
    with pytest.raises(GpError, match="locked"):  # MN would change
        import_landmarks(plain.document, files)
    plain.document.do(LockPoints(((L, "MN"),), locked=False))
    import_landmarks(plain.document, files)
    assert plain.document.state.landmark(L, "CA").note == ""
    assert plain.document.state.landmark(L, "IN").certainty == "guess"


def test_labelling_again_hides_all_of_the_first(editing):
    editing.document.do(AddMeasurements((Measurement("Ruler 1", ((1, 2, 3), (4, 5, 6))),)))
    first = editing.document.state
    editing.labels.go_to(L, "ZL")
    seen = []
    editing.document.labelling_changed.connect(lambda: seen.append(True))
    editing.document.do(BeginLabelling("CD"))
    state = editing.document.state
    assert seen
    assert not state.landmarks
    assert not state.measurements  # which would show where the points were
    assert state_of(json.loads(json.dumps(document_of(state)))) == state
    assert (state.observer, state.round, state.blind) == ("CD", 1, True)
    assert editing.document.undo_text is None
    assert not editing.document.undo()
    assert editing.document.state is state
    editing.labels.place([1, 2, 3], side=L, code="CA")
    assert editing.document.undo()
    assert not editing.document.undo()
    editing.labels.place([1, 2, 3], side=L, code="CA")
    editing.document.do(OpenLabelling("ab", 1))
    assert editing.document.state.landmarks == first.landmarks
    assert editing.document.state.measurements == first.measurements
    assert editing.document.state.others[0].landmarks == {(L, "CA"): state_mark(editing, "CD")}


def state_mark(editing, observer):
    return next(each for each in editing.document.state.others if each.observer == observer).landmarks[
        L, "CA"
    ]


def test_rounds_follow_each_other_and_empty_ones_are_dropped(editing):
    editing.document.do(BeginLabelling("AB"))
    assert editing.document.state.round == 2
    editing.document.do(BeginLabelling("CD"))  # nothing was placed in round 2
    editing.labels.place([1, 2, 3], side=L, code="CA")
    editing.document.do(BeginLabelling("AB"))
    assert editing.document.state.round == 2
    assert [(each.observer, each.round) for each in editing.document.state.others] == [("AB", 1), ("CD", 1)]
    with pytest.raises(GpError, match="AB, round 1 already exists"):
        editing.document.do(BeginLabelling("AB", 1))
    with pytest.raises(GpError, match="There are: AB, round 1; CD, round 1"):
        editing.document.do(OpenLabelling("EF", 1))


def relabelled(editing, *observers):
    rng = np.random.default_rng(1)
    for observer in observers:
        editing.document.do(BeginLabelling(observer))
        for code in ("CA", "CB", "RWA", "RWP", "OS"):
            editing.labels.place(shape(L)[code] + rng.normal(0, 0.1, 3), side=L, code=code)


def test_labellings_are_exported_apart_and_read_back(editing, tmp_path):
    relabelled(editing, "AB", "C D", "C-D")
    state = editing.document.state
    report = export_landmarks(state, tmp_path)
    assert [path.name for path in report.files] == [
        "GP-014_AB_r1_L.mrk.json",
        "GP-014_AB_r1_R.mrk.json",
        "GP-014_AB_r2_L.mrk.json",
        "GP-014_C-D_r1_L.mrk.json",
        "GP-014_C-D-2_r1_L.mrk.json",
    ]
    found = {(each.observer, each.round): each.specimen.side(L) for each in load_labellings(tmp_path)}
    assert set(found) == {("AB", 1), ("AB", 2), ("C D", 1), ("C-D", 1)}
    assert np.array_equal(found["C D", 1]["CA"], labelling(state, "C D").side(L)["CA"])
    again = Editing(SpecimenState("GP-014"))
    again.document.attach_volume(FakeVolume())
    import_landmarks(again.document, [tmp_path / "GP-014_AB_r2_L.mrk.json"])
    assert (again.document.state.observer, again.document.state.round) == ("AB", 2)


def labelling(state, observer):
    return next(each for each in state.labellings if each.observer == observer)


def test_labellings_survive_saving_and_a_kill(editing, tmp_path):
    relabelled(editing, "AB", "CD")
    file = tmp_path / "GP-014.gpspecimen.json"
    editing.document.save(file)
    assert read_specimen(file) == editing.document.state
    document = SpecimenDocument(open_specimen(file, tmp_path / "state"), author="AB")
    document.do(OpenLabelling("AB", 2))
    expected = document.state
    document.close()
    (recovery,) = find_recoveries(tmp_path / "state")
    document.recover(recovery)
    assert document.state == expected
    document.close(discard=True)


def test_a_plain_file_is_still_read_by_earlier_programs(editing, tmp_path):
    file = editing.document.save(tmp_path / "plain")
    assert json.loads(file.read_text())["version"] == 3
    editing.labels.annotate("sure", side=L, code="CA")
    assert json.loads(editing.document.save().read_text())["version"] == 4


def test_damaged_labellings_are_refused_by_name(editing):
    document = document_of(editing.document.state)
    with pytest.raises(GpError, match=r"other_labellings\[0\].round must be a whole number"):
        state_of({**document, "other_labellings": [{"round": 0}]})
    with pytest.raises(GpError, match="certainty is unknown: 'maybe'"):
        state_of({"landmarks": {"L": {"CA": {"position": [1, 2, 3], "certainty": "maybe"}}}})


def test_the_observer_is_asked_once_and_never_the_login_name(tmp_path):
    workspace = Workspace(tmp_path)
    assert workspace.document.author == ""
    workspace.set_observer("  A   B ")
    workspace.close()
    again = Workspace(tmp_path)
    assert again.document.author == "A B"
    again.close()
    (tmp_path / "observer.json").write_text("[1")
    assert ObserverMemory(tmp_path).recall() == ""
    with pytest.raises(GpError, match="needs a name"):
        again.set_observer(" ")


def test_an_unnamed_labelling_gets_the_observer_who_answers_later(tmp_path):
    workspace = Workspace()
    workspace.labels.place([1, 2, 3], side=L, code="CA")
    workspace.set_observer("AB")
    assert workspace.document.state.labeller == "AB"
    workspace.label_again("CD")
    workspace.labels.place([1, 2, 4], side=L, code="CA")
    assert workspace.document.author == "CD"
    with pytest.raises(GpError, match="AB, round 1 already exists"):
        workspace.document.do(NameObserver("AB"))
    workspace.open_labelling("AB", 1)
    assert tuple(workspace.document.landmarks(L)["CA"]) == (1, 2, 3)
    workspace.close()


def test_labels_of_another_observer_are_not_mixed_in_unsaid(editing, tmp_path):
    relabelled(editing, "CD")
    files = export_landmarks(editing.document.state, tmp_path).files
    theirs = next(file for file in files if "_CD_" in file.name)
    editing.document.do(OpenLabelling("AB", 1))
    (said,) = import_landmarks(editing.document, [theirs])
    assert said.startswith(
        "GP-014_CD_r1_L.mrk.json is by CD, round 1, and is now part of the labelling by AB"
    )
    own = next(file for file in files if "_AB_r1_L" in file.name)
    assert import_landmarks(editing.document, [own]) == ()
