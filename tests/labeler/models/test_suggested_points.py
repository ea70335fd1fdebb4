"""Accepted ghosts are suggestions: shown and counted apart, and no fact for anything until confirmed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from document_cases import MARK, PLACEABLE, FakeVolume, predict, shape, text_of

from gp_core import PROBE, Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import GpError
from gp_core.io import load_specimens, read_landmarks
from gp_core.landmarks.features import Side
from gp_labeler.document import touching
from gp_labeler.document.edits import CheckPoint, LockPoints, PlacePoint, SwapPoints
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.document.landmark_import import import_landmarks
from gp_labeler.document.opening import new_session, open_session, recover_session
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.document.specimen_file import read_specimen
from gp_labeler.document.specimen_json import document_of
from gp_labeler.document.state import How
from gp_labeler.models import labelling
from gp_labeler.models.estimating import Estimating
from gp_labeler.models.pose_report import PoseReport
from gp_labeler.models.session import Session
from gp_labeler.models.workflow import Active, PointState

L, R = Side.LEFT, Side.RIGHT
OPENING = ("CA", "RWP", "OS")


def opened(**options) -> Session:
    """A session on the left side with the three points that ghosts need."""
    session = new_session(predict=predict, author="AB", clock=lambda: "2026-01-01T00:00:00+00:00", **options)
    session.attach_volume(FakeVolume())
    for code in OPENING:
        labelling.place(session, shape()[code], side=L, code=code)
    return session


def test_a_hasty_student_places_three_points_and_no_more() -> None:
    session = opened()
    alone = {code: (ghost.position, ghost.covariance) for code, ghost in session.ghosts(L).items()}
    for n in range(16):
        assert session.active.side is L
        labelling.accept_ghost(session)
        for code, ghost in session.ghosts(L).items():  # no new fact, so nothing is known better
            np.testing.assert_array_equal(ghost.position, alone[code][0])
            np.testing.assert_array_equal(ghost.covariance, alone[code][1])
        assert session.progress(L).text == f"3 placed, {n + 1} suggested"
    assert set(session.landmarks(L).placed) == set(OPENING)
    assert "CO" not in session.landmarks(L)
    assert not session.doubts(L)
    assert not session.ghosts(R)  # the other side, mirrored, is expected from facts alone
    assert {s for c, s in session.point_states(L).items() if c not in (*OPENING, "CO")} == {
        PointState.SUGGESTED
    }


def test_all_ghosts_are_accepted_in_one_step() -> None:
    session = opened()
    labelling.accept_all_ghosts(session)
    assert session.progress(L).n_suggested == 16
    assert session.undo_text == "suggest 16 points left"
    session.undo()
    assert session.progress(L).n_suggested == 0
    session.redo()
    assert session.progress(L).n_suggested == 16
    with pytest.raises(GpError, match="nothing of the left side is to do and expected"):
        labelling.accept_all_ghosts(session, side=L)


@pytest.mark.parametrize(
    ("act", "how"),
    [
        (lambda s: labelling.confirm(s, side=L, code="ZL"), How.CONFIRMED),
        (lambda s: labelling.nudge(s, (0.1, 0, 0), side=L, code="ZL"), How.NUDGED),
        (lambda s: labelling.place(s, (1, 2, 3), How.SLICE, side=L, code="ZL"), How.SLICE),
    ],
)
def test_confirming_and_correcting_make_an_observation(act, how) -> None:
    session = opened()
    labelling.accept_ghost(session, side=L, code="ZL")
    suggested = session.landmarks(L).suggested["ZL"]
    assert suggested.source == "atlas"
    assert suggested.radius_95 == pytest.approx(session.ghosts(L)["CB"].radius_95)
    act(session)
    assert "ZL" in session.landmarks(L)
    assert "ZL" not in session.landmarks(L).suggested
    assert session.state.landmark(L, "ZL").provenance.how is how
    session.undo()
    assert session.landmarks(L).suggested["ZL"] == suggested


def test_only_a_suggestion_is_confirmed_and_none_is_checked_or_locked() -> None:
    session = opened()
    with pytest.raises(GpError, match="ZL left is not suggested, so there is nothing to confirm"):
        labelling.confirm(session, side=L, code="ZL")
    labelling.accept_ghost(session, side=L, code="ZL")
    with pytest.raises(GpError, match=r"ZL left is only suggested, so it cannot be checked\. Confirm"):
        session.do(CheckPoint(L, "ZL"))
    with pytest.raises(GpError, match="ZL left is still to do"):
        session.do(LockPoints(((L, "ZL"),)))
    labelling.lock_all(session)
    assert not session.state.landmark(L, "ZL").locked
    assert session.state.landmark(L, "CA").locked


def test_a_suggestion_belongs_to_its_own_feature() -> None:
    session = opened()
    labelling.accept_ghost(session, side=L, code="RWA")
    session.do(SwapPoints(L, "RWP", "RWA"))
    assert "RWP" not in session.landmarks(L)
    assert not session.landmarks(L).suggested
    np.testing.assert_array_equal(session.landmarks(L)["RWA"], shape()["RWP"])


def test_what_is_suggested_comes_after_what_is_to_do_the_least_certain_first() -> None:
    session = Session()
    radii = {"CB": 0.5, "ZL": 2.0, "MN": None, "IN": 1.0}
    for code in PLACEABLE:
        if code in radii:
            labelling.suggest(session, shape()[code], radius_95=radii[code], side=L, code=code)
        elif code != "OS":
            labelling.place(session, shape()[code], side=L, code=code)
    session.set_active(Active(L, "CB"))
    labelling.skip(session)
    assert session.active == Active(L, "OS")
    labelling.place(session, shape()["OS"])
    visited = []
    while session.active.side is L and session.landmarks(L).suggested:
        visited.append(session.active.code)
        labelling.confirm(session)
    assert visited == ["MN", "ZL", "IN", "CB"]


def test_a_suggestion_is_saved_journalled_and_recovered_as_one(tmp_path: Path) -> None:
    session = opened(directory=tmp_path / "state")
    labelling.accept_all_ghosts(session)
    labelling.confirm(session, side=L, code="ZL")
    file = session.save(tmp_path / "GP-014.gpspecimen.json")
    assert text_of(read_specimen(file)) == text_of(session.state)
    labelling.confirm(session, side=L, code="CB")
    session.close()
    (recovery,) = find_recoveries(tmp_path / "state")
    again = recover_session(recovery, tmp_path / "state")
    assert text_of(again.state) == text_of(session.state)
    again.undo()
    assert again.landmarks(L).status("CB").name == "SUGGESTED"
    assert not again.notices
    again.close()


def _older(document: dict) -> dict:
    """Return a document as an earlier version kept it: accepted ghosts have positions."""
    for marks in document["landmarks"].values():
        for mark in marks.values():
            if "suggestion" in mark:
                mark["position"] = mark.pop("suggestion")["position"]
    return document


def test_accepted_ghosts_of_older_files_become_suggestions_and_it_is_said_once(tmp_path: Path) -> None:
    session = opened()
    for code in ("ZL", "IN"):
        labelling.accept_ghost(session, side=L, code=code)
    file = tmp_path / "old.gpspecimen.json"
    content = {"format": "gp-labeler specimen", "version": 2, **_older(document_of(session.state))}
    file.write_text(json.dumps(content))
    old = open_session(file, tmp_path / "state")
    assert set(old.landmarks(L).placed) == set(OPENING)
    assert old.landmarks(L).suggested["ZL"].position == tuple(shape()["ZL"])
    assert old.landmarks(R).suggested.keys() == {"IN"}
    (notice,) = old.notices
    assert notice.startswith("2 points were accepted ghosts that nobody had confirmed")
    assert not old.dirty
    labelling.confirm(old, side=L, code="ZL")
    old.close()
    (recovery,) = find_recoveries(tmp_path / "state")  # the journal begins with the suggestions
    again = recover_session(recovery, tmp_path / "state")
    assert again.landmarks(L).placed == old.landmarks(L).placed
    again.close()


def test_a_script_that_places_a_ghost_as_before_only_suggests_it() -> None:
    session = opened()
    labelling.place(session, (1, 2, 3), How.GHOST, side=L, code="ZL")
    assert session.landmarks(L).suggested["ZL"].position == (1, 2, 3)
    session.do(PlacePoint(L, "CB", (1, 2, 4), MARK))
    assert "CB" in session.landmarks(L)


def test_suggestions_are_exported_only_on_request_and_apart(tmp_path: Path) -> None:
    session = opened()
    labelling.accept_all_ghosts(session)
    report = export_landmarks(session.state, tmp_path / "plain")
    assert len(report.files) == 1
    assert set(read_landmarks(report.files[0]).placed) == set(OPENING)
    assert not report.is_complete
    assert "suggested, not confirmed: CB CC CL" in report.text
    report = export_landmarks(session.state, tmp_path / "both", suggested=True)
    plain, apart, right = report.files
    assert set(read_landmarks(right).suggested) == {"IN"}  # both sides share it
    assert "The right side is not labelled; only its suggestions were written." in report.text
    assert apart.name == plain.name.replace("_L.", "_L_suggested.")
    assert not read_landmarks(apart).placed
    (animal,) = load_specimens(tmp_path / "both")
    assert set(animal.side("L").placed) == set(OPENING)
    assert dict(animal.side("L").suggested).keys() == dict(session.landmarks(L).suggested).keys()


def test_suggestions_alone_are_exported_only_as_such(tmp_path: Path) -> None:
    session = Session()
    labelling.suggest(session, (1, 2, 3), side=R, code="ZL", radius_95=0.5, source="someone")
    with pytest.raises(GpError, match="nothing is placed yet, 1 point is only suggested"):
        export_landmarks(session.state, tmp_path)
    (file,) = export_landmarks(session.state, tmp_path, suggested=True).files
    assert file.name == "unnamed_R_suggested.mrk.json"


def test_imported_suggestions_stay_suggestions_and_replace_no_observation(tmp_path: Path) -> None:
    source = opened()
    labelling.accept_all_ghosts(source)
    files = export_landmarks(source.state, tmp_path, suggested=True).files
    session = new_session(specimen=source.state.specimen)
    labelling.place(session, (1, 2, 3), side=L, code="ZL")
    notes = import_landmarks(session, files)
    assert any("only suggestions: confirm or correct each" in note for note in notes)
    assert session.undo_text == "import 3 points, 16 suggestions"
    np.testing.assert_array_equal(session.landmarks(L)["ZL"], (1, 2, 3))
    found, suggested = session.landmarks(L).suggested["CB"], source.landmarks(L).suggested["CB"]
    assert (found.position, found.source) == (suggested.position, suggested.source)
    assert found.radius_95 == pytest.approx(suggested.radius_95, abs=1e-3)


def test_suggestions_outside_the_scan_are_refused_like_observations(tmp_path: Path) -> None:
    source = Session()
    labelling.suggest(source, (300, 2, 3), side=L, code="ZL")
    files = export_landmarks(source.state, tmp_path, suggested=True).files
    session = opened()
    with pytest.raises(GpError, match=r"ZL left.* lie outside the scan"):
        import_landmarks(session, files)


def test_suggestions_register_no_touches_and_measure_no_error() -> None:
    atlas, session = Atlas.published(), opened()
    animal = draw_animal(atlas, rng=np.random.default_rng(3)).side(L)
    for code in PLACEABLE:
        labelling.clear(session, side=L, code=code)
        labelling.suggest(session, animal[code], side=L, code=code)
    for code in PROBE:
        touching.record_touch(session, L, code, animal[code] + [5.0, 6.0, 7.0])
    estimating = Estimating(session)
    estimating.use_atlas(atlas)
    found = estimating.current
    assert found.pose is not None
    assert (found.registered, found.truth) == (None, None)
    for code in PLACEABLE:
        labelling.confirm(session, side=L, code=code)
    found = estimating.current
    assert found.registered.way == "features"
    np.testing.assert_allclose(found.truth.translation, animal["CO"], atol=1e-9)
    page = PoseReport(session.state, found).html()
    assert "only suggested" not in page
    session.undo()
    assert "1 label is only suggested and not used" in PoseReport(session.state, found).html()
    estimating.close()
