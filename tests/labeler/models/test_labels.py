"""What comes next, what is expected where, and what clicks mean."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
from document_cases import MARK, PLACEABLE, Editing, FakeVolume, check, predict, shape

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.label_check import check_side
from gp_core.atlas.prediction import predict as shape_predict
from gp_core.errors import FeatureError, GeometryError, GpError
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.document.edits import CheckPoint, ClearPoint, PlacePoint, SwapSides
from gp_labeler.document.landmark_import import ImportLandmarks
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import How, SpecimenState
from gp_labeler.models.ghosts import Expectations, mirror_ghosts
from gp_labeler.models.view import ViewModel, ViewState
from gp_labeler.models.workflow import Active, PointState, placing_order
from gp_labeler.views.panels.label.card_content import content_of

L, R = Side.LEFT, Side.RIGHT
BOTH = ImportLandmarks((shape(L), shape(R)), MARK)


def test_auto_advance_visits_everything_once():
    for atlas in (None, predict):
        editing = Editing(predict=atlas)
        visited = []
        while editing.labels.active.code is not None:
            visited.append(editing.labels.active)
            editing.labels.place(shape(editing.labels.active.side)[editing.labels.active.code])
        assert len(visited) == len(set(visited)) == 37  # 19 and 18: IN is shared
        assert {a.side for a in visited[:19]} == {L}
        assert [editing.labels.progress(side).text for side in Side] == ["20 of 20", "20 of 20"]
        assert editing.labels.click_text == "All features are placed · drag a point to move it"
        with pytest.raises(GpError, match=r"no feature is chosen. Choose one in the table"):
            editing.labels.place((0, 0, 0))


def test_what_is_skipped_comes_again_and_what_is_unseen_does_not():
    editing = Editing()
    seen = []
    for _ in range(19):
        seen.append(editing.labels.active)
        editing.labels.skip()
    assert editing.labels.active == seen[0]
    assert len(set(seen)) == 19
    editing.labels.mark_unseen()
    assert editing.labels.active == seen[1]
    assert editing.document.state.landmark(L, "CA").provenance.how is How.UNSEEN
    assert editing.labels.progress(L).text == "0 of 20, 1 not seen"
    while editing.labels.active.side is L:
        editing.labels.mark_unseen()
    assert editing.labels.active == Active(R, "CA")


def test_skipping_the_last_one_of_a_side_goes_to_the_other_and_comes_back():
    editing = Editing(ImportLandmarks((shape(L).with_point("ZL", None),), MARK).apply(SpecimenState()))
    assert editing.labels.active == Active(L, "ZL")
    editing.labels.skip()
    assert editing.labels.active == Active(R, "CA")
    only = Editing(ImportLandmarks((shape(L).with_point("ZL", None), shape(R)), MARK).apply(SpecimenState()))
    only.labels.skip()
    assert only.labels.active == Active(L, "ZL")


def test_the_order_opens_with_three_and_then_follows_sure_ghosts():
    assert placing_order({})[:4] == ("CA", "RWP", "OS", "CB")
    editing = Editing(predict=predict)
    for code in ("CA", "RWP", "OS"):
        assert editing.labels.active.code == code
        editing.labels.place(shape()[code])
    ghosts = editing.labels.ghosts(L)
    assert set(ghosts) == set(PLACEABLE) - {"CA", "RWP", "OS"}
    unsure = {"CB", "IN"}
    sure = {c: g for c, g in ghosts.items() if c not in unsure}
    order = placing_order(sure)
    assert order[: len(sure)] == tuple(c for c in PLACEABLE if c in sure)
    assert sorted(order) == sorted(PLACEABLE)
    assert editing.labels.active.code == "CB"
    assert np.allclose(editing.view.crosshair, ghosts["CB"].position)  # follows the ghost


def test_moving_a_point_goes_nowhere():
    editing = Editing()
    editing.labels.choose("L", "zl")
    editing.labels.place((1, 2, 3))
    assert editing.labels.active.code == "CA"
    editing.labels.choose(L, "ZL")
    assert editing.view.crosshair.tolist() == [1, 2, 3]
    editing.labels.place((4, 5, 6), How.SLICE)
    assert (editing.labels.active.code, editing.document.undo_text) == ("ZL", "move ZL left")
    editing.labels.place((4, 5, 6), side=R, code="MN")  # not the active one
    assert editing.labels.active.code == "ZL"
    editing.labels.clear()
    assert (editing.labels.active.code, "ZL" in editing.document.landmarks(L)) == ("ZL", False)
    editing.view.update(auto_advance=False)
    editing.labels.place((1, 1, 1))
    assert editing.labels.active.code == "ZL"


def test_points_know_where_they_come_from():
    editing = Editing(author="AB", clock=lambda: "2026-01-02T03:04:05+00:00")
    editing.document.attach_volume(FakeVolume())
    editing.labels.place((1, 2, 3), How.SLICE)
    found = editing.document.state.landmark(L, "CA").provenance
    assert (found.how, found.time, found.by, found.voxel_mm) == (
        How.SLICE,
        "2026-01-02T03:04:05+00:00",
        "AB",
        (0.1, 0.1, 0.2),
    )


def test_the_next_click_is_told():
    editing = Editing()
    assert editing.labels.click_text == "Click on bone or a slice to place CA left"
    editing.labels.choose(R, "IN")
    assert editing.labels.click_text == "Click on bone or a slice to place IN (both sides)"
    editing.labels.mark_unseen(side=R, code="IN")
    editing.labels.choose(L, "IN")
    assert editing.labels.click_text == "Click on bone or a slice to place IN (both sides) after all"
    editing.document.do(PlacePoint(L, "ZL", (1, 2, 3), MARK))
    editing.labels.choose(L, "ZL")
    assert editing.labels.click_text == (
        "ZL left is placed; a click does not move it. Drag it, use the arrow keys, or Shift+P and click"
    )
    editing.labels.lock()
    assert editing.labels.click_text == "ZL left is locked"
    with pytest.raises(GpError, match="ZL left is locked"):
        editing.labels.place((0, 0, 0))
    editing.labels.set_active(Active(L))
    assert editing.labels.click_text == "Choose a feature to place"
    with pytest.raises(FeatureError, match="CO is computed"):
        editing.labels.set_active(Active(L, "CO"))


def test_locking_all_and_unlocking():
    editing = Editing(BOTH.apply(SpecimenState()))
    assert editing.labels.lock_all()
    assert editing.document.undo_text == "lock 37 points"
    assert not editing.labels.lock_all()
    assert editing.labels.lock_all(False)
    assert not Editing().labels.lock_all()


def test_states_of_points():
    editing = Editing(predict=predict, check=check)
    assert set(editing.labels.point_states(L).values()) == {PointState.TO_DO}
    editing.document.do(ImportLandmarks((shape(L),), MARK))
    assert editing.labels.point_states(L)["CO"] is PointState.COMPUTED
    assert list(editing.labels.point_states(L)) == list(CODES)
    editing.labels.clear(side=L, code="ZL")
    editing.labels.mark_unseen(side=L, code="MN")
    off = shape()["FPP"] + [0, 3, 0]
    editing.labels.place(off, side=L, code="FPP")
    states = editing.labels.point_states(L)
    assert states["ZL"] is PointState.GHOST
    assert states["MN"] is PointState.UNSEEN
    assert [c for c, s in states.items() if s is PointState.DOUBTFUL] == ["FPP"]
    assert editing.labels.problems(L)["FPP"].deviation_of("FPP").distance == pytest.approx(3, abs=0.5)
    editing.document.do(CheckPoint(L, "FPP"))
    assert editing.labels.point_states(L)["FPP"] is PointState.CHECKED


def test_ghosts_need_three_points_and_an_atlas():
    editing = Editing()
    heard = []
    editing.labels.ghosts_changed.connect(lambda: heard.append(1))
    editing.labels.expect(predict)
    assert heard == [1]
    for code in ("CA", "RWP"):
        editing.document.do(PlacePoint(L, code, shape()[code] + [1, 2, 3], MARK))
        assert not editing.labels.ghosts(L)
    with pytest.raises(GpError, match=r"the position of ZL left cannot be predicted yet. Place three"):
        editing.labels.accept_ghost(side=L, code="ZL")
    editing.document.do(PlacePoint(L, "OS", shape()["OS"] + [1, 2, 3], MARK))
    ghost = editing.labels.ghosts(L)["ZL"]
    assert np.allclose(ghost.position, shape()["ZL"] + [1, 2, 3])
    assert ghost.radius_95 == pytest.approx(np.sqrt(7.8147279) * 0.2)
    editing.labels.choose(L, "ZL")
    editing.labels.accept_ghost()
    assert editing.document.state.landmark(L, "ZL").provenance.how is How.GHOST
    assert editing.labels.point_states(L)["ZL"] is PointState.SUGGESTED
    assert "ZL" not in editing.labels.ghosts(L)


def test_an_edit_of_one_side_asks_the_atlas_for_that_side_alone():
    asked = []

    def counted(landmarks):
        asked.append(landmarks.side)
        return predict(landmarks)

    editing = Editing(predict=counted)
    for side in (L, R):
        for code in ("CA", "RWP", "OS"):
            editing.document.do(PlacePoint(side, code, shape(side)[code], MARK))
        editing.labels.ghosts(side)
    editing.labels.ghosts(L)
    asked.clear()
    editing.document.do(PlacePoint(R, "MH", shape(R)["MH"], MARK))
    left, right = editing.labels.ghosts(L), editing.labels.ghosts(R)
    assert asked == [R]
    assert left["MH"].source == right["FPP"].source == "atlas"


def test_a_side_at_rest_stays_judged_while_the_other_is_labelled():
    editing = Editing(predict=predict, check=check)
    editing.document.do(ImportLandmarks((shape(L),), MARK))
    editing.labels.checking(L).run(lambda _: None)
    for code in set(PLACEABLE) - {"IN"}:  # which is the left side's as well
        editing.labels.place(shape(R)[code], side=R, code=code)
        editing.labels.checking(R).run(lambda _: None)
        editing.labels.ghosts(L), editing.labels.ghosts(R)  # as the views ask
        assert editing.labels.checking(L).known is not None


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

    editing = Editing(BOTH.apply(SpecimenState()), check=count)
    assert editing.labels.point_states(L, wait=False)["ZL"] is PointState.PLACED
    assert asked == []
    assert editing.labels.point_states(L) == editing.labels.point_states(L)
    assert len(asked) == 1
    editing.document.do(PlacePoint(R, "ZL", (0, 0, 0), MARK))
    editing.labels.problems(L)
    assert len(asked) == 1


def test_nonsense_is_described_in_words_not_in_kilometres():
    published = partial(check_side, atlas=Atlas.published())
    rng = np.random.default_rng(0)
    heap = {code: 1e-3 * rng.normal(size=3) for code in CODES if code != "CO"}
    assert not published(LandmarkSet.from_mapping(heap, L)).deviations
    off = {code: Atlas.published()[code] for code in heap} | {"ZL": (300.0, 0, 0)}
    problem = published(LandmarkSet.from_mapping(off, L)).problems["ZL"]
    assert problem.word == "far off"
    assert "check names, side and units" in problem.text


def test_problems_can_be_found_by_a_job():
    editing = Editing(BOTH.apply(SpecimenState()), check=check)
    editing.document.do(PlacePoint(L, "FPP", shape()["FPP"] + [0, 3, 0], MARK))
    assert editing.labels.point_states(L, wait=False)["FPP"] is PointState.PLACED
    with ThreadPoolExecutor(1) as pool:
        pool.submit(editing.labels.checking(L).run, lambda fraction: None).result()
    assert editing.labels.point_states(L, wait=False)["FPP"] is PointState.DOUBTFUL


def test_problems_do_not_blink_while_an_edit_is_judged():
    editing = Editing(BOTH.apply(SpecimenState()), check=check)
    editing.document.do(PlacePoint(L, "FPP", shape()["FPP"] + [0, 3, 0], MARK))

    def distances() -> dict[str, float]:
        states = editing.labels.point_states(L, wait=False)
        assert set(editing.labels.known_problems(L)) == {
            c for c, s in states.items() if s is PointState.DOUBTFUL
        }
        problems = editing.labels.known_problems(L)
        return {code: round(problem.deviation_of(code).distance, 1) for code, problem in problems.items()}

    assert distances() == {}, "nobody has looked yet"
    editing.labels.checking(L).run(lambda fraction: None)
    assert distances() == {"FPP": 3.0}
    editing.document.do(PlacePoint(L, "OS", shape()["OS"] + 0.01, MARK))
    assert distances() == {"FPP": 3.0}, "another point was moved"
    editing.labels.checking(L).run(lambda fraction: None)
    editing.document.do(PlacePoint(L, "FPP", shape()["FPP"] + [0, 2, 0], MARK))
    assert distances() == {"FPP": 2.0}, "its own place tells by itself"
    editing.document.do(PlacePoint(L, "FPP", shape()["FPP"], MARK))
    assert distances() == {}
    editing.document.undo()
    editing.document.do(ClearPoint(L, "FPP"))
    assert distances() == {}, "what is not placed has no problem"
    editing.document.undo()
    editing.labels.checking(L).run(lambda fraction: None)
    editing.document.do(SwapSides())
    assert distances() == {}, "all is new"


def test_labels_under_the_name_of_the_other_side_are_called_so():
    atlas, rng = Atlas.published(), np.random.default_rng(3)
    right = {code: (atlas[code] + rng.normal(size=3) * 0.1) * [-1, 1, 1] for code in atlas.codes}
    editing = Editing(check=partial(check_side, atlas=atlas))

    def judged(side: Side) -> bool:
        editing.labels.checking(side).run(lambda fraction: None)
        return editing.labels.is_other_side(side)

    editing.document.do(ImportLandmarks((LandmarkSet.from_mapping(right, L),), MARK))
    assert not editing.labels.is_other_side(L), "nobody has looked yet"
    assert judged(L)
    editing.labels.set_active(Active(L, "CB"))
    card = content_of(editing.labels, has_scan=True)
    assert "fit the right side" in card.status
    assert (card.action, card.action_text) == ("swap_sides", "Exchange left and right")
    editing.document.do(SwapSides())
    assert not judged(R)
    assert not judged(L)
    editing.document.do(PlacePoint(R, "CL", right["CL"] + [0, 4, 0], MARK))
    assert not judged(R), "one that is off says nothing of the side"


def test_a_point_far_off_is_doubtful_and_its_ghost_comes_where_it_belongs():
    atlas = Atlas.published()
    rng = np.random.default_rng(3)
    points = {code: atlas[code] + rng.normal(size=3) * 0.1 for code in atlas.codes}
    points["MH"] = points["MH"] + [0, 2.5, 0]
    editing = Editing(predict=partial(shape_predict, atlas), check=partial(check_side, atlas=atlas))
    editing.document.do(ImportLandmarks((LandmarkSet.from_mapping(points, L),), MARK))
    assert set(editing.labels.problems(L)) == {"MH"}
    assert np.linalg.norm(editing.labels.problems(L)["MH"].deviation_of("MH").expected - atlas["MH"]) < 0.5
    editing.labels.clear(side=L, code="MH")
    ghost = editing.labels.ghosts(L)["MH"]
    assert np.linalg.norm(ghost.position - atlas["MH"]) < ghost.radius_95 < 1.0


def test_one_pair_mirrors_the_other_side():
    some = LandmarkSet.from_mapping({"CA": shape(R)["CA"]}, R)
    assert not mirror_ghosts(LandmarkSet.empty(R), shape(L))
    ghosts = mirror_ghosts(some, shape(L))
    for code in PLACEABLE:
        assert np.allclose(ghosts[code].position, _mirrored_in_bisector(code))
    assert ghosts["CA"].radius_95 < ghosts["ZL"].radius_95
    editing = Editing(ImportLandmarks((shape(L), some), MARK).apply(SpecimenState()))
    assert editing.labels.ghosts(R)["ZL"].source == "mirror"
    assert "IN" not in editing.labels.ghosts(R)


def _mirrored_in_bisector(code):
    a, b = shape(L)["CA"], shape(R)["CA"]
    normal = (a - b) / np.linalg.norm(a - b)
    point = shape(L)[code]
    return point - 2 * np.dot(point - (a + b) / 2, normal) * normal


def test_crosshair_and_active_tell_only_changes():
    editing = Editing()
    heard = []
    editing.view.crosshair_changed.connect(lambda p: heard.append(p.tolist()))
    editing.labels.active_changed.connect(heard.append)
    editing.view.set_crosshair((1, 2, 3))
    editing.view.set_crosshair([1, 2, 3])
    editing.labels.set_active(Active(L, "ZL"))
    editing.labels.set_active(Active(L, "ZL"))
    assert heard == [[1, 2, 3], Active(L, "ZL")]
    with pytest.raises(ValueError, match="read-only"):
        editing.view.crosshair[0] = 5
    with pytest.raises(GpError, match="crosshair: position must be three finite"):
        editing.view.set_crosshair((1, 2))


def test_view():
    view = ViewModel(SpecimenDocument())
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
