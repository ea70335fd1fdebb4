"""What comes next, what is expected where, and what clicks mean."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
from document_cases import MARK, PLACEABLE, FakeVolume, check, predict, shape

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.label_check import check_side
from gp_core.atlas.prediction import predict as shape_predict
from gp_core.errors import FeatureError, GeometryError, GpError
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.document.edits import CheckPoint, ClearPoint, PlacePoint, SwapSides
from gp_labeler.document.landmark_import import ImportLandmarks
from gp_labeler.document.state import How, SpecimenState
from gp_labeler.models import labelling
from gp_labeler.models.ghosts import Expectations, mirror_ghosts
from gp_labeler.models.session import Session
from gp_labeler.models.view import View, ViewState
from gp_labeler.models.workflow import Active, PointState, placing_order
from gp_labeler.views.panels.card_content import content_of

L, R = Side.LEFT, Side.RIGHT
BOTH = ImportLandmarks((shape(L), shape(R)), MARK)


def test_auto_advance_visits_everything_once():
    for atlas in (None, predict):
        session = Session(predict=atlas)
        visited = []
        while session.active.code is not None:
            visited.append(session.active)
            labelling.place(session, shape(session.active.side)[session.active.code])
        assert len(visited) == len(set(visited)) == 37  # 19 and 18: IN is shared
        assert {a.side for a in visited[:19]} == {L}
        assert [session.progress(side).text for side in Side] == ["20 of 20", "20 of 20"]
        assert session.click_text == "Everything is placed · drag a point to move it"
        with pytest.raises(GpError, match=r"no feature is chosen. Choose one in the table"):
            labelling.place(session, (0, 0, 0))


def test_what_is_skipped_comes_again_and_what_is_unseen_does_not():
    session = Session()
    seen = []
    for _ in range(19):
        seen.append(session.active)
        labelling.skip(session)
    assert session.active == seen[0]
    assert len(set(seen)) == 19
    labelling.mark_unseen(session)
    assert session.active == seen[1]
    assert session.state.landmark(L, "CA").provenance.how is How.UNSEEN
    assert session.progress(L).text == "0 of 20, 1 not seen"
    while session.active.side is L:
        labelling.mark_unseen(session)
    assert session.active == Active(R, "CA")


def test_skipping_the_last_one_of_a_side_goes_to_the_other_and_comes_back():
    session = Session(ImportLandmarks((shape(L).with_point("ZL", None),), MARK).apply(SpecimenState()))
    assert session.active == Active(L, "ZL")
    labelling.skip(session)
    assert session.active == Active(R, "CA")
    only = Session(ImportLandmarks((shape(L).with_point("ZL", None), shape(R)), MARK).apply(SpecimenState()))
    labelling.skip(only)
    assert only.active == Active(L, "ZL")


def test_the_order_opens_with_three_and_then_follows_sure_ghosts():
    assert placing_order({})[:4] == ("CA", "RWP", "OS", "CB")
    session = Session(predict=predict)
    for code in ("CA", "RWP", "OS"):
        assert session.active.code == code
        labelling.place(session, shape()[code])
    ghosts = session.ghosts(L)
    assert set(ghosts) == set(PLACEABLE) - {"CA", "RWP", "OS"}
    unsure = {"CB", "IN"}
    sure = {c: g for c, g in ghosts.items() if c not in unsure}
    order = placing_order(sure)
    assert order[: len(sure)] == tuple(c for c in PLACEABLE if c in sure)
    assert sorted(order) == sorted(PLACEABLE)
    assert session.active.code == "CB"
    assert np.allclose(session.crosshair, ghosts["CB"].position)  # follows the ghost


def test_moving_a_point_goes_nowhere():
    session = Session()
    labelling.go_to(session, "L", "zl")
    labelling.place(session, (1, 2, 3))
    assert session.active.code == "CA"
    labelling.go_to(session, L, "ZL")
    assert session.crosshair.tolist() == [1, 2, 3]
    labelling.place(session, (4, 5, 6), How.SLICE)
    assert (session.active.code, session.undo_text) == ("ZL", "move ZL left")
    labelling.place(session, (4, 5, 6), side=R, code="MN")  # not the active one
    assert session.active.code == "ZL"
    labelling.clear(session)
    assert (session.active.code, "ZL" in session.landmarks(L)) == ("ZL", False)
    session.view.update(auto_advance=False)
    labelling.place(session, (1, 1, 1))
    assert session.active.code == "ZL"


def test_points_know_where_they_come_from():
    session = Session(author="AB", clock=lambda: "2026-01-02T03:04:05+00:00")
    session.attach_volume(FakeVolume())
    labelling.place(session, (1, 2, 3), How.SLICE)
    found = session.state.landmark(L, "CA").provenance
    assert (found.how, found.time, found.by, found.voxel_mm) == (
        How.SLICE,
        "2026-01-02T03:04:05+00:00",
        "AB",
        (0.1, 0.1, 0.2),
    )


def test_the_next_click_is_told():
    session = Session()
    assert session.click_text == "Click on bone or a slice to place CA left"
    labelling.go_to(session, R, "IN")
    assert session.click_text == "Click on bone or a slice to place IN (both sides)"
    labelling.mark_unseen(session, side=R, code="IN")
    labelling.go_to(session, L, "IN")
    assert session.click_text == "Click on bone or a slice to place IN (both sides) after all"
    session.do(PlacePoint(L, "ZL", (1, 2, 3), MARK))
    labelling.go_to(session, L, "ZL")
    assert session.click_text == (
        "ZL left is placed; a click does not move it. Drag it, use the arrow keys, or Shift+P and click"
    )
    labelling.lock(session)
    assert session.click_text == "ZL left is locked"
    with pytest.raises(GpError, match="ZL left is locked"):
        labelling.place(session, (0, 0, 0))
    session.set_active(Active(L))
    assert session.click_text == "Choose a feature to place"
    with pytest.raises(FeatureError, match="CO is computed"):
        session.set_active(Active(L, "CO"))


def test_locking_all_and_unlocking():
    session = Session(BOTH.apply(SpecimenState()))
    assert labelling.lock_all(session)
    assert session.undo_text == "lock 37 points"
    assert not labelling.lock_all(session)
    assert labelling.lock_all(session, False)
    assert not labelling.lock_all(Session())


def test_states_of_points():
    session = Session(predict=predict, check=check)
    assert set(session.point_states(L).values()) == {PointState.TO_DO}
    session.do(ImportLandmarks((shape(L),), MARK))
    assert session.point_states(L)["CO"] is PointState.COMPUTED
    assert list(session.point_states(L)) == list(CODES)
    labelling.clear(session, side=L, code="ZL")
    labelling.mark_unseen(session, side=L, code="MN")
    off = shape()["FPP"] + [0, 3, 0]
    labelling.place(session, off, side=L, code="FPP")
    states = session.point_states(L)
    assert states["ZL"] is PointState.GHOST
    assert states["MN"] is PointState.UNSEEN
    assert [c for c, s in states.items() if s is PointState.DOUBTFUL] == ["FPP"]
    assert session.doubts(L)["FPP"].departure_of("FPP").distance == pytest.approx(3, abs=0.5)
    session.do(CheckPoint(L, "FPP"))
    assert session.point_states(L)["FPP"] is PointState.CHECKED


def test_ghosts_need_three_points_and_an_atlas():
    session = Session()
    heard = []
    session.ghosts_changed.connect(lambda: heard.append(1))
    session.set_predict(predict)
    assert heard == [1]
    for code in ("CA", "RWP"):
        session.do(PlacePoint(L, code, shape()[code] + [1, 2, 3], MARK))
        assert not session.ghosts(L)
    with pytest.raises(GpError, match=r"nothing says yet where ZL left should be. Place three"):
        labelling.accept_ghost(session, side=L, code="ZL")
    session.do(PlacePoint(L, "OS", shape()["OS"] + [1, 2, 3], MARK))
    ghost = session.ghosts(L)["ZL"]
    assert np.allclose(ghost.position, shape()["ZL"] + [1, 2, 3])
    assert ghost.radius_95 == pytest.approx(np.sqrt(7.815) * 0.2)
    labelling.go_to(session, L, "ZL")
    labelling.accept_ghost(session)
    assert session.state.landmark(L, "ZL").provenance.how is How.GHOST
    assert session.point_states(L)["ZL"] is PointState.SUGGESTED
    assert "ZL" not in session.ghosts(L)


def test_an_edit_of_one_side_asks_the_atlas_for_that_side_alone():
    asked = []

    def counted(landmarks):
        asked.append(landmarks.side)
        return predict(landmarks)

    session = Session(predict=counted)
    for side in (L, R):
        for code in ("CA", "RWP", "OS"):
            session.do(PlacePoint(side, code, shape(side)[code], MARK))
        session.ghosts(side)
    session.ghosts(L)
    asked.clear()
    session.do(PlacePoint(R, "MH", shape(R)["MH"], MARK))
    left, right = session.ghosts(L), session.ghosts(R)
    assert asked == [R]
    assert left["MH"].source == right["FPP"].source == "atlas"


def test_a_side_at_rest_stays_judged_while_the_other_is_labelled():
    session = Session(predict=predict, check=check)
    session.do(ImportLandmarks((shape(L),), MARK))
    session.judging(L).run(lambda _: None)
    for code in set(PLACEABLE) - {"IN"}:  # which is the left side's as well
        labelling.place(session, shape(R)[code], side=R, code=code)
        session.judging(R).run(lambda _: None)
        session.ghosts(L), session.ghosts(R)  # as the views ask
        assert session.judging(L).known is not None


def test_an_atlas_that_cannot_say_expects_nothing():
    def refuse(landmarks):
        raise GeometryError("on a line")

    expectations = Expectations(refuse)
    assert not expectations.ghosts(shape(), LandmarkSet.empty(R))


def test_the_checker_is_asked_once_for_the_same_points():
    asked = []

    def count(landmarks):
        asked.append(landmarks)
        return check(landmarks)

    session = Session(BOTH.apply(SpecimenState()), check=count)
    assert session.point_states(L, wait=False)["ZL"] is PointState.PLACED
    assert asked == []
    assert session.point_states(L) == session.point_states(L)
    assert len(asked) == 1
    session.do(PlacePoint(R, "ZL", (0, 0, 0), MARK))
    session.doubts(L)
    assert len(asked) == 1


def test_nonsense_is_doubted_in_words_not_in_kilometres():
    published = partial(check_side, atlas=Atlas.published())
    rng = np.random.default_rng(0)
    heap = {code: 1e-3 * rng.normal(size=3) for code in CODES if code != "CO"}
    assert not published(LandmarkSet.from_mapping(heap, L)).departures
    off = {code: Atlas.published()[code] for code in heap} | {"ZL": (300.0, 0, 0)}
    doubt = published(LandmarkSet.from_mapping(off, L)).doubts["ZL"]
    assert doubt.word == "far off"
    assert "check names, side and units" in doubt.text


def test_doubts_can_be_found_by_a_job():
    session = Session(BOTH.apply(SpecimenState()), check=check)
    session.do(PlacePoint(L, "FPP", shape()["FPP"] + [0, 3, 0], MARK))
    assert session.point_states(L, wait=False)["FPP"] is PointState.PLACED
    with ThreadPoolExecutor(1) as pool:
        pool.submit(session.judging(L).run, lambda fraction: None).result()
    assert session.point_states(L, wait=False)["FPP"] is PointState.DOUBTFUL


def test_doubts_do_not_blink_while_an_edit_is_judged():
    session = Session(BOTH.apply(SpecimenState()), check=check)
    session.do(PlacePoint(L, "FPP", shape()["FPP"] + [0, 3, 0], MARK))

    def doubted() -> dict[str, float]:
        states = session.point_states(L, wait=False)
        assert set(session.near_doubts(L)) == {c for c, s in states.items() if s is PointState.DOUBTFUL}
        doubts = session.near_doubts(L)
        return {code: round(doubt.departure_of(code).distance, 1) for code, doubt in doubts.items()}

    assert doubted() == {}, "nobody has looked yet"
    session.judging(L).run(lambda fraction: None)
    assert doubted() == {"FPP": 3.0}
    session.do(PlacePoint(L, "OS", shape()["OS"] + 0.01, MARK))
    assert doubted() == {"FPP": 3.0}, "another point was moved"
    session.judging(L).run(lambda fraction: None)
    session.do(PlacePoint(L, "FPP", shape()["FPP"] + [0, 2, 0], MARK))
    assert doubted() == {"FPP": 2.0}, "its own place tells by itself"
    session.do(PlacePoint(L, "FPP", shape()["FPP"], MARK))
    assert doubted() == {}
    session.undo()
    session.do(ClearPoint(L, "FPP"))
    assert doubted() == {}, "what is not placed is not doubted"
    session.undo()
    session.judging(L).run(lambda fraction: None)
    session.do(SwapSides())
    assert doubted() == {}, "all is new"


def test_labels_under_the_name_of_the_other_side_are_called_so():
    atlas, rng = Atlas.published(), np.random.default_rng(3)
    right = {code: (atlas[code] + rng.normal(size=3) * 0.1) * [-1, 1, 1] for code in atlas.codes}
    session = Session(check=partial(check_side, atlas=atlas))

    def judged(side: Side) -> bool:
        session.judging(side).run(lambda fraction: None)
        return session.is_other_side(side)

    session.do(ImportLandmarks((LandmarkSet.from_mapping(right, L),), MARK))
    assert not session.is_other_side(L), "nobody has looked yet"
    assert judged(L)
    session.set_active(Active(L, "CB"))
    card = content_of(session, has_scan=True)
    assert "fit the right side" in card.status
    assert (card.action, card.action_text) == ("swap_sides", "Exchange left and right")
    session.do(SwapSides())
    assert not judged(R)
    assert not judged(L)
    session.do(PlacePoint(R, "CL", right["CL"] + [0, 4, 0], MARK))
    assert not judged(R), "one that is off says nothing of the side"


def test_a_point_far_off_is_doubted_and_its_ghost_comes_where_it_belongs():
    atlas = Atlas.published()
    rng = np.random.default_rng(3)
    points = {code: atlas[code] + rng.normal(size=3) * 0.1 for code in atlas.codes}
    points["MH"] = points["MH"] + [0, 2.5, 0]
    session = Session(predict=partial(shape_predict, atlas), check=partial(check_side, atlas=atlas))
    session.do(ImportLandmarks((LandmarkSet.from_mapping(points, L),), MARK))
    assert set(session.doubts(L)) == {"MH"}
    assert np.linalg.norm(session.doubts(L)["MH"].departure_of("MH").expected - atlas["MH"]) < 0.5
    labelling.clear(session, side=L, code="MH")
    ghost = session.ghosts(L)["MH"]
    assert np.linalg.norm(ghost.position - atlas["MH"]) < ghost.radius_95 < 1.0


def test_one_pair_mirrors_the_other_side():
    some = LandmarkSet.from_mapping({"CA": shape(R)["CA"]}, R)
    assert not mirror_ghosts(LandmarkSet.empty(R), shape(L))
    ghosts = mirror_ghosts(some, shape(L))
    for code in PLACEABLE:
        assert np.allclose(ghosts[code].position, _mirrored_in_bisector(code))
    assert ghosts["CA"].radius_95 < ghosts["ZL"].radius_95
    session = Session(ImportLandmarks((shape(L), some), MARK).apply(SpecimenState()))
    assert session.ghosts(R)["ZL"].source == "mirror"
    assert "IN" not in session.ghosts(R)


def _mirrored_in_bisector(code):
    a, b = shape(L)["CA"], shape(R)["CA"]
    normal = (a - b) / np.linalg.norm(a - b)
    point = shape(L)[code]
    return point - 2 * np.dot(point - (a + b) / 2, normal) * normal


def test_crosshair_and_active_tell_only_changes():
    session = Session()
    heard = []
    session.crosshair_changed.connect(lambda p: heard.append(p.tolist()))
    session.active_changed.connect(heard.append)
    session.set_crosshair((1, 2, 3))
    session.set_crosshair([1, 2, 3])
    session.set_active(Active(L, "ZL"))
    session.set_active(Active(L, "ZL"))
    assert heard == [[1, 2, 3], Active(L, "ZL")]
    with pytest.raises(ValueError, match="read-only"):
        session.crosshair[0] = 5
    with pytest.raises(GpError, match="crosshair: position must be three finite"):
        session.set_crosshair((1, 2))


def test_view():
    view = View()
    heard = []
    view.changed.connect(heard.append)
    view.update(layout="axial", mesh_opacity=1.0)
    assert heard == [frozenset({"layout"})]
    for changes, message in [
        ({"layout": "five-up"}, "layout must be one of four-up"),
        ({"mesh_opacity": 2}, "mesh_opacity must be from 0 to 1, got 2"),
        ({"width": 0}, "width must be above 0"),
        ({"zoom": 1}, "view field must be one of"),
    ]:
        with pytest.raises(GpError, match=message):
            view.update(**changes)
    assert view.state == ViewState(layout="axial")
