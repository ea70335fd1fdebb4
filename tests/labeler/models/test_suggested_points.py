"""Accepted ghosts are suggestions: shown and counted apart, and no fact for anything until confirmed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from document_cases import MARK, PLACEABLE, Editing, FakeVolume, predict, shape, text_of

from gp_core import PROBE, Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import GpError
from gp_core.io import load_specimens, read_landmarks
from gp_core.landmarks.features import Side
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.document import touching
from gp_labeler.document.edits import CheckPoint, LockPoints, PlacePoint, SuggestPoints, SwapPoints
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.document.landmark_import import import_landmarks
from gp_labeler.document.opening import open_specimen, recover_specimen
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.document.specimen_file import read_specimen
from gp_labeler.document.specimen_json import document_of
from gp_labeler.document.state import How
from gp_labeler.models.pose_report import PoseReport
from gp_labeler.models.workflow import Active, PointState, next_point

L, R = Side.LEFT, Side.RIGHT
OPENING = ("CA", "RWP", "OS")


def opened(**options) -> Editing:
    """A editing on the left side with the three points that ghosts need."""
    editing = Editing(predict=predict, author="AB", clock=lambda: "2026-01-01T00:00:00+00:00", **options)
    editing.document.attach_volume(FakeVolume())
    for code in OPENING:
        editing.labels.place(shape()[code], side=L, code=code)
    return editing


def test_a_hasty_student_places_three_points_and_no_more() -> None:
    editing = opened()
    alone = {code: (ghost.position, ghost.covariance) for code, ghost in editing.labels.ghosts(L).items()}
    for n in range(16):
        assert editing.labels.active.side is L
        editing.labels.accept_ghost()
        for code, ghost in editing.labels.ghosts(L).items():  # no new fact, so nothing is known better
            np.testing.assert_array_equal(ghost.position, alone[code][0])
            np.testing.assert_array_equal(ghost.covariance, alone[code][1])
        assert editing.labels.progress(L).text == f"3 placed, {n + 1} suggested"
    assert set(editing.document.landmarks(L).placed) == set(OPENING)
    assert "CO" not in editing.document.landmarks(L)
    assert not editing.labels.problems(L)
    assert not editing.labels.ghosts(R)  # the other side, mirrored, is expected from facts alone
    assert {s for c, s in editing.labels.point_states(L).items() if c not in (*OPENING, "CO")} == {
        PointState.SUGGESTED
    }


def test_all_ghosts_are_accepted_in_one_step() -> None:
    editing = opened()
    editing.labels.accept_all_ghosts()
    assert editing.labels.progress(L).n_suggested == 16
    assert editing.document.undo_text == "suggest 16 points left"
    editing.document.undo()
    assert editing.labels.progress(L).n_suggested == 0
    editing.document.redo()
    assert editing.labels.progress(L).n_suggested == 16
    with pytest.raises(GpError, match="no feature of the left side has a ghost"):
        editing.labels.accept_all_ghosts(side=L)


@pytest.mark.parametrize(
    ("act", "how"),
    [
        (lambda s: s.labels.confirm(side=L, code="ZL"), How.CONFIRMED),
        (lambda s: s.labels.nudge((0.1, 0, 0), side=L, code="ZL"), How.NUDGED),
        (lambda s: s.labels.place((1, 2, 3), How.SLICE, side=L, code="ZL"), How.SLICE),
    ],
)
def test_confirming_and_correcting_make_an_observation(act, how) -> None:
    editing = opened()
    editing.labels.accept_ghost(side=L, code="ZL")
    suggested = editing.document.landmarks(L).suggested["ZL"]
    assert suggested.source == "atlas"
    assert suggested.radius_95 == pytest.approx(editing.labels.ghosts(L)["CB"].radius_95)
    act(editing)
    assert "ZL" in editing.document.landmarks(L)
    assert "ZL" not in editing.document.landmarks(L).suggested
    assert editing.document.state.landmark(L, "ZL").provenance.how is how
    editing.document.undo()
    assert editing.document.landmarks(L).suggested["ZL"] == suggested


def test_only_a_suggestion_is_confirmed_and_none_is_checked_or_locked() -> None:
    editing = opened()
    with pytest.raises(GpError, match="ZL left is not suggested, so there is nothing to confirm"):
        editing.labels.confirm(side=L, code="ZL")
    editing.labels.accept_ghost(side=L, code="ZL")
    with pytest.raises(GpError, match=r"ZL left is only suggested, so it cannot be checked\. Confirm"):
        editing.document.do(CheckPoint(L, "ZL"))
    with pytest.raises(GpError, match="ZL left is still to do"):
        editing.document.do(LockPoints(((L, "ZL"),)))
    editing.labels.lock_all()
    assert not editing.document.state.landmark(L, "ZL").locked
    assert editing.document.state.landmark(L, "CA").locked


def test_a_suggestion_belongs_to_its_own_feature() -> None:
    editing = opened()
    editing.labels.accept_ghost(side=L, code="RWA")
    editing.document.do(SwapPoints(L, "RWP", "RWA"))
    assert "RWP" not in editing.document.landmarks(L)
    assert not editing.document.landmarks(L).suggested
    np.testing.assert_array_equal(editing.document.landmarks(L)["RWA"], shape()["RWP"])


def test_what_is_suggested_comes_after_what_is_to_do_the_least_certain_first() -> None:
    editing = Editing()
    radii = {"CB": 0.5, "ZL": 2.0, "MN": None, "IN": 1.0}
    for code in PLACEABLE:
        if code in radii:
            editing.labels.suggest(shape()[code], radius_95=radii[code], side=L, code=code)
        elif code != "OS":
            editing.labels.place(shape()[code], side=L, code=code)
    editing.labels.set_active(Active(L, "CB"))
    editing.labels.skip()
    assert editing.labels.active == Active(L, "OS")
    editing.labels.place(shape()["OS"])
    visited = []
    while editing.labels.active.side is L and editing.document.landmarks(L).suggested:
        visited.append(editing.labels.active.code)
        editing.labels.confirm()
    assert visited == ["MN", "ZL", "IN", "CB"]


def test_a_suggestion_with_which_the_atlas_disagrees_comes_first_and_is_saved(tmp_path: Path) -> None:
    editing = Editing(directory=tmp_path / "state")
    x, y, z = (float(value) for value in shape()["CB"])
    told = {"CB": (0.5, None), "ZL": (0.4, 1.5), "MN": (1.0, None)}
    found = {code: Suggestion((x, y, z), r, "5 labelled scans", away) for code, (r, away) in told.items()}
    for code in PLACEABLE:
        if code not in found:
            editing.labels.place(shape()[code], side=L, code=code)
    editing.document.do(SuggestPoints(L, found, MARK))
    file = editing.document.save(tmp_path / "GP1.gpspecimen.json")
    assert dict(read_specimen(file).side(L).suggested) == found
    visited = [next_point(editing.document.state, Active(L, "OS"), editing.labels.ghosts).code]
    editing.labels.set_active(Active(L, "ZL"))
    for _ in range(2):
        editing.labels.confirm()
        visited.append(editing.labels.active.code)
    assert visited == ["ZL", "MN", "CB"]
    editing.document.close()
    (recovery,) = find_recoveries(tmp_path / "state")
    again = Editing(recover_specimen(recovery, tmp_path / "state"))
    assert text_of(again.document.state) == text_of(editing.document.state)


def test_a_suggestion_is_saved_journalled_and_recovered_as_one(tmp_path: Path) -> None:
    editing = opened(directory=tmp_path / "state")
    editing.labels.accept_all_ghosts()
    editing.labels.confirm(side=L, code="ZL")
    file = editing.document.save(tmp_path / "GP-014.gpspecimen.json")
    assert text_of(read_specimen(file)) == text_of(editing.document.state)
    editing.labels.confirm(side=L, code="CB")
    editing.document.close()
    (recovery,) = find_recoveries(tmp_path / "state")
    again = Editing(recover_specimen(recovery, tmp_path / "state"))
    assert text_of(again.document.state) == text_of(editing.document.state)
    again.document.undo()
    assert again.document.landmarks(L).status("CB").name == "SUGGESTED"
    assert not again.notices
    again.document.close()


def _older(document: dict) -> dict:
    """Return a document as an earlier version kept it: accepted ghosts have positions."""
    for marks in document["landmarks"].values():
        for mark in marks.values():
            if "suggestion" in mark:
                mark["position"] = mark.pop("suggestion")["position"]
    return document


def test_accepted_ghosts_of_older_files_become_suggestions_and_it_is_said_once(tmp_path: Path) -> None:
    editing = opened()
    for code in ("ZL", "IN"):
        editing.labels.accept_ghost(side=L, code=code)
    file = tmp_path / "old.gpspecimen.json"
    content = {"format": "gp-labeler specimen", "version": 2, **_older(document_of(editing.document.state))}
    file.write_text(json.dumps(content))
    old = Editing(open_specimen(file, tmp_path / "state"))
    assert set(old.document.landmarks(L).placed) == set(OPENING)
    assert old.document.landmarks(L).suggested["ZL"].position == tuple(shape()["ZL"])
    assert old.document.landmarks(R).suggested.keys() == {"IN"}
    (notice,) = old.notices
    assert notice.startswith("2 points were accepted ghosts that nobody had confirmed")
    assert not old.document.dirty
    old.labels.confirm(side=L, code="ZL")
    old.document.close()
    (recovery,) = find_recoveries(tmp_path / "state")  # the journal begins with the suggestions
    again = Editing(recover_specimen(recovery, tmp_path / "state"))
    assert again.document.landmarks(L).placed == old.document.landmarks(L).placed
    again.document.close()


def test_a_script_that_places_a_ghost_as_before_only_suggests_it() -> None:
    editing = opened()
    editing.labels.place((1, 2, 3), How.GHOST, side=L, code="ZL")
    assert editing.document.landmarks(L).suggested["ZL"].position == (1, 2, 3)
    editing.document.do(PlacePoint(L, "CB", (1, 2, 4), MARK))
    assert "CB" in editing.document.landmarks(L)


def test_suggestions_are_exported_only_on_request_and_apart(tmp_path: Path) -> None:
    editing = opened()
    editing.labels.accept_all_ghosts()
    report = export_landmarks(editing.document.state, tmp_path / "plain")
    assert len(report.files) == 1
    assert set(read_landmarks(report.files[0]).placed) == set(OPENING)
    assert not report.is_complete
    assert "suggested, not confirmed: CB CC CL" in report.text
    report = export_landmarks(editing.document.state, tmp_path / "both", suggested=True)
    plain, apart, right = report.files
    assert set(read_landmarks(right).suggested) == {"IN"}  # both sides share it
    assert "The right side is not labelled; only its suggestions were written." in report.text
    assert apart.name == plain.name.replace("_L.", "_L_suggested.")
    assert not read_landmarks(apart).placed
    (animal,) = load_specimens(tmp_path / "both")
    assert set(animal.side("L").placed) == set(OPENING)
    assert dict(animal.side("L").suggested).keys() == dict(editing.document.landmarks(L).suggested).keys()


def test_suggestions_alone_are_exported_only_as_such(tmp_path: Path) -> None:
    editing = Editing()
    editing.labels.suggest((1, 2, 3), side=R, code="ZL", radius_95=0.5, source="someone")
    with pytest.raises(GpError, match="nothing is placed yet, 1 point is only suggested"):
        export_landmarks(editing.document.state, tmp_path)
    (file,) = export_landmarks(editing.document.state, tmp_path, suggested=True).files
    assert file.name == "unnamed_R_suggested.mrk.json"


def test_imported_suggestions_stay_suggestions_and_replace_no_observation(tmp_path: Path) -> None:
    source = opened()
    source.labels.accept_all_ghosts()
    files = export_landmarks(source.document.state, tmp_path, suggested=True).files
    editing = Editing(specimen=source.document.state.specimen)
    editing.labels.place((1, 2, 3), side=L, code="ZL")
    notes = import_landmarks(editing.document, files)
    assert any("only suggestions: confirm or correct each" in note for note in notes)
    assert editing.document.undo_text == "import 3 points, 16 suggestions"
    np.testing.assert_array_equal(editing.document.landmarks(L)["ZL"], (1, 2, 3))
    found, suggested = (
        editing.document.landmarks(L).suggested["CB"],
        source.document.landmarks(L).suggested["CB"],
    )
    assert (found.position, found.source) == (suggested.position, suggested.source)
    assert found.radius_95 == pytest.approx(suggested.radius_95, abs=1e-3)


def test_suggestions_outside_the_scan_are_refused_like_observations(tmp_path: Path) -> None:
    source = Editing()
    source.labels.suggest((300, 2, 3), side=L, code="ZL")
    files = export_landmarks(source.document.state, tmp_path, suggested=True).files
    editing = opened()
    with pytest.raises(GpError, match=r"ZL left.* lie outside the scan"):
        import_landmarks(editing.document, files)


def test_suggestions_register_no_touches_and_measure_no_error() -> None:
    atlas, editing = Atlas.published(), opened()
    animal = draw_animal(atlas, rng=np.random.default_rng(3)).side(L)
    for code in PLACEABLE:
        editing.labels.clear(side=L, code=code)
        editing.labels.suggest(animal[code], side=L, code=code)
    for code in PROBE:
        touching.record_touch(editing.document, L, code, animal[code] + [5.0, 6.0, 7.0])
    editing.atlas.use(atlas)
    found = editing.pose.estimate
    assert found.pose is not None
    assert (found.registered, found.truth) == (None, None)
    for code in PLACEABLE:
        editing.labels.confirm(side=L, code=code)
    found = editing.pose.estimate
    assert found.registered.way == "features"
    np.testing.assert_allclose(found.truth.translation, animal["CO"], atol=1e-9)
    page = PoseReport(editing.document.state, found).html()
    assert "only suggested" not in page
    editing.document.undo()
    assert "1 label is only suggested and not used" in PoseReport(editing.document.state, found).html()
