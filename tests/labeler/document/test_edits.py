"""Laws of edits and undo, over random sequences of edits."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from document_cases import MARK, PLACEABLE, Editing, edits, names, positions, predict, quick, shape, text_of
from hypothesis import given
from hypothesis import strategies as st

from gp_core.errors import FeatureError, GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.sets import Status
from gp_labeler.document.edits import (
    CheckPoint,
    ClearPoint,
    LockPoints,
    MarkUnseen,
    PlacePoint,
    SwapPoints,
    SwapSides,
)
from gp_labeler.document.history import History
from gp_labeler.document.labelling_edits import BeginLabelling, OpenLabelling
from gp_labeler.document.landmark_import import ImportLandmarks
from gp_labeler.document.specimen_edits import RenameSpecimen, SetThreshold
from gp_labeler.document.state import TO_DO, How, Landmark, SpecimenState, point_key
from gp_labeler.document.touch_edits import RecordTouch
from gp_labeler.document.touches import Touch

L, R = Side.LEFT, Side.RIGHT


def done(editing, sequence):
    """Do what can be done; return the states, and check that what cannot leaves nothing behind."""
    states = [editing.document.state]
    for edit in sequence:
        before, undo = editing.document.state, editing.document.undo_text
        try:
            changed = editing.document.do(edit)
        except GpError:
            assert editing.document.state is before
            assert editing.document.undo_text == undo
        else:
            assert changed == (editing.document.state != before)
            if changed:
                assert editing.document.undo_text == edit.text
                states.append(editing.document.state)
    return states


def placed(*sides):
    return ImportLandmarks(tuple(shape(side) for side in sides), MARK)


@quick
@given(st.lists(edits, max_size=12))
def test_undo_of_everything_is_where_it_began_and_redo_where_it_ended(sequence):
    editing = Editing()
    states = done(editing, sequence)
    for state in reversed(states[:-1]):
        assert editing.document.undo()
        assert editing.document.state is state
    assert not editing.document.undo()
    for state in states[1:]:
        assert editing.document.redo()
        assert editing.document.state is state
    assert not editing.document.redo()


@quick
@given(st.lists(edits, max_size=8), st.data())
def test_an_edit_after_undo_forgets_what_was_undone(sequence, data):
    editing = Editing()
    states = done(editing, sequence)
    n = data.draw(st.integers(0, len(states) - 1))
    for _ in range(n):
        editing.document.undo()
    editing.document.do(SetThreshold(123456.5))
    assert editing.document.redo_text is None
    assert editing.document.undo()
    assert editing.document.state is states[len(states) - 1 - n]


@quick
@given(st.lists(edits, max_size=10))
def test_no_state_is_ever_changed_in_place(sequence):
    editing = Editing()
    texts = []
    for edit in sequence:
        texts.append((editing.document.state, text_of(editing.document.state)))
        done(editing, [edit])
    assert all(text_of(state) == text for state, text in texts)


@quick
@given(st.lists(edits, max_size=12))
def test_the_sets_are_those_of_the_points_however_the_state_came_about(sequence):
    states = done(Editing(), sequence)
    for before, state in zip(states[:1] + states, states, strict=False):
        fresh = SpecimenState(landmarks=state.landmarks, scan_evidence=state.scan_evidence)
        for side in Side:
            made, kept = fresh.side(side), state.side(side)
            assert np.array_equal(made.points, kept.points, equal_nan=True)
            assert (made.unseen, made.suggested, made.scan_evidence) == (
                kept.unseen,
                kept.suggested,
                kept.scan_evidence,
            )
        if state.landmarks is before.landmarks:  # nothing is made again that did not change
            assert all(state.side(side) is before.side(side) for side in Side)


@quick
@given(st.lists(edits, max_size=12))
def test_in_is_one_point_and_co_follows(sequence):
    for state in done(Editing(), sequence):
        left, right = state.side(L), state.side(R)
        assert np.array_equal(left["IN"], right["IN"], equal_nan=True)
        assert left.status("IN") is right.status("IN")
        for landmarks in (left, right):
            without = landmarks.with_point("CO", None)
            assert np.array_equal(with_cochlea_origin(without)["CO"], landmarks["CO"], equal_nan=True)


@quick
@given(st.lists(edits, max_size=8), st.lists(edits, max_size=8))
def test_locked_points_stay_whatever_is_done(before, after):
    editing = Editing()
    done(editing, before)
    editing.labels.lock_all()
    locked = {key: mark for key, mark in editing.document.state.landmarks.items() if mark.decided}
    assert all(mark.locked for mark in locked.values())  # but nothing that is only suggested
    allowed = (LockPoints, CheckPoint, BeginLabelling, OpenLabelling)  # the last two put them aside
    unlocking = [edit for edit in after if not isinstance(edit, allowed)]
    for state in done(editing, unlocking):
        assert {key: state.landmarks[key] for key in locked} == locked


@quick
@given(
    st.lists(edits, max_size=8), st.sampled_from(Side), st.sampled_from(PLACEABLE), st.sampled_from(PLACEABLE)
)
def test_swapping_twice_changes_nothing(sequence, side, code, other):
    editing = Editing()
    done(editing, sequence)
    editing.labels.lock_all(locked=False)
    state = editing.document.state
    swap = SwapPoints(side, code, other)
    keys = (point_key(side, code), point_key(side, other))
    dropped = {key: TO_DO for key in keys if state.landmarks.get(key, TO_DO).suggestion}
    assert swap.apply(swap.apply(state)) == state.with_landmarks(dropped)  # they were made for their names
    assert SwapSides().apply(SwapSides().apply(state)) == state


@quick
@given(positions, names)
def test_edits_of_one_thing_leave_the_rest(position, name):
    state = placed(L, R).apply(SpecimenState())
    moved = PlacePoint(L, "ZL", position, MARK).apply(state)
    assert [c for c in CODES if not np.array_equal(moved.side(L)[c], state.side(L)[c], equal_nan=True)] == [
        "ZL"
    ]
    assert moved.side(R) is not None
    assert np.array_equal(moved.side(R).points, state.side(R).points)
    assert RenameSpecimen(name).apply(state).landmarks == state.landmarks


def test_co_is_computed_and_cleared_live():
    editing = Editing()
    for code in ("CA", "CB", "RWA"):
        editing.document.do(PlacePoint(L, code, shape()[code], MARK))
        assert "CO" not in editing.document.landmarks(L)
    changed = []
    editing.document.landmarks_changed.connect(changed.append)
    editing.document.do(PlacePoint(L, "RWP", shape()["RWP"], MARK))
    editing.document.do(ClearPoint(L, "CB"))
    assert changed == [frozenset({(L, "RWP"), (L, "CO")}), frozenset({(L, "CB"), (L, "CO")})]
    assert editing.document.undo()
    assert editing.labels.progress(L).text == "5 of 20"


def test_a_touch_leaves_the_sets_of_both_sides_as_they_are():
    state = SpecimenState(landmarks={point_key(L, "CA"): Landmark((1.0, 2.0, 3.0))})
    touched = RecordTouch(L, "ZL", Touch((4.0, 5.0, 6.0))).apply(state)
    assert touched.touched(L).placed == ("ZL",)
    assert all(touched.side(side) is state.side(side) for side in Side)


def test_in_tells_both_sides():
    editing = Editing()
    changed = []
    editing.document.landmarks_changed.connect(changed.append)
    editing.document.do(PlacePoint(R, "IN", (1, 2, 3), MARK))
    assert changed == [frozenset({(L, "IN"), (R, "IN")})]
    assert editing.document.undo_text == "place IN"
    editing.document.do(MarkUnseen(L, "IN"))
    assert editing.document.landmarks(R).status("IN") is Status.UNSEEN


def test_what_cannot_be_done_says_why():
    state = placed(L).apply(SpecimenState())
    locked = LockPoints(((L, "FPP"), (L, "IN"))).apply(state)
    with pytest.raises(GpError, match=r"specimen unnamed, landmark FPP: FPP left is locked. Unlock first"):
        PlacePoint(L, "FPP", (0, 0, 0), MARK).apply(locked)
    with pytest.raises(GpError, match="FPP left, IN are locked"):
        ImportLandmarks((shape().moved(_shift()),), MARK).apply(locked)
    with pytest.raises(GpError, match="IN is locked"):
        ClearPoint(R, "IN").apply(locked)
    with pytest.raises(FeatureError, match="CO is computed, not placed"):
        PlacePoint(L, "CO", (0, 0, 0), MARK).apply(state)
    with pytest.raises(GpError, match="CB: position must be three finite numbers in mm"):
        PlacePoint(L, "CB", (0, np.nan, 0), MARK)
    with pytest.raises(GpError, match=r"CB: .*within ±10000 mm.*millimetres"):
        PlacePoint(L, "CB", (0, 1e5, 0), MARK).apply(state)
    with pytest.raises(GpError, match="CA and CB are at the same place"):
        PlacePoint(L, "CB", state.side(L)["CA"], MARK).apply(state)
    with pytest.raises(GpError, match="CC right is still to do"):
        LockPoints(((R, "CC"),)).apply(state)
    with pytest.raises(GpError, match="CC right is not placed"):
        CheckPoint(R, "CC").apply(state)
    with pytest.raises(GpError, match="must be a valid file name, got 'a/b'"):
        RenameSpecimen("a/b").apply(state)
    with pytest.raises(GpError, match="threshold must be finite"):
        SetThreshold(float("nan")).apply(state)


def _shift():
    return RigidTransform.from_parts(np.eye(3), [1, 0, 0], dst="scan", src="scan")


def test_importing_fills_or_replaces():
    state = PlacePoint(L, "CA", (0, 0, 0), MARK).apply(SpecimenState())
    filled = ImportLandmarks((shape(),), MARK, replace_placed=False).apply(state)
    assert filled.side(L)["CA"].tolist() == [0, 0, 0]
    assert len(filled.side(L).placed) == 20
    replaced = ImportLandmarks((shape(),), MARK).apply(state)
    assert np.array_equal(replaced.side(L)["CA"], shape()["CA"])
    assert ImportLandmarks((shape(),), MARK).text == "import 19 points"
    with pytest.raises(GpError, match="scan frame, got 'tracker'"):
        ImportLandmarks((shape().moved(_to_tracker()),), MARK).apply(state)
    with pytest.raises(GpError, match="the sides share IN, but have it at"):
        ImportLandmarks((shape(L), shape(R).moved(_shift())), MARK).apply(state)


def _to_tracker():
    return RigidTransform.identity(dst="tracker", src="scan")


def test_moving_a_point_makes_it_unchecked():
    state = CheckPoint(L, "ZL").apply(placed(L).apply(SpecimenState()))
    assert state.landmark(L, "ZL").checked
    assert not PlacePoint(L, "ZL", (1, 1, 1), MARK).apply(state).landmark(L, "ZL").checked


def test_nudges_in_a_row_are_one_undo():
    editing = Editing(placed(L).apply(SpecimenState()), predict=predict)
    start = editing.document.state
    for _ in range(5):
        editing.labels.nudge((0.1, 0, 0), side=L, code="ZL")
    assert editing.document.landmarks(L)["ZL"][0] == pytest.approx(shape()["ZL"][0] + 0.5)
    editing.labels.nudge((0.1, 0, 0), side=L, code="CA")
    assert editing.document.state.landmark(L, "CA").provenance.how is How.MESH
    editing.document.undo()
    assert editing.document.undo_text == "nudge ZL left"
    editing.document.undo()
    assert editing.document.state is start
    with pytest.raises(GpError, match="ZL right is not placed yet"):
        editing.labels.nudge((0.1, 0, 0), side=R, code="ZL")


def test_history_is_bounded():
    history = History(0, limit=3)
    for i in range(1, 6):
        history.push(str(i), i)
    taken = []
    while history.to_undo:
        taken.append(history.undo().text)
    assert taken == ["5", "4", "3"]
    assert history.state == 2
    with pytest.raises(LookupError):
        history.undo()


def test_undo_brings_the_user_back_to_the_feature():
    editing = Editing()
    first = editing.labels.active
    editing.labels.place((1, 2, 3))
    assert editing.labels.active != first
    editing.document.undo()
    assert editing.labels.active == first


def test_signals_tell_only_what_changed_and_after_it_holds():
    editing = Editing()
    heard = []
    editing.document.threshold_changed.connect(
        lambda value: heard.append(("threshold", value, editing.document.state.threshold))
    )
    editing.document.details_changed.connect(lambda: heard.append("details"))
    editing.document.landmarks_changed.connect(lambda points: heard.append(points))
    editing.document.history_changed.connect(lambda: heard.append(editing.document.undo_text))
    editing.document.dirty_changed.connect(lambda dirty: heard.append(dirty))
    editing.document.do(SetThreshold(5))
    editing.document.do(SetThreshold(5))
    editing.document.undo()
    assert heard == [
        ("threshold", 5.0, 5.0),
        "set threshold to 5",
        True,
        ("threshold", None, None),
        None,
        False,
    ]


def test_a_session_refuses_other_threads():
    editing = Editing()
    with ThreadPoolExecutor(1) as pool, pytest.raises(RuntimeError, match="own thread"):
        pool.submit(editing.document.do, SetThreshold(1)).result()
    assert editing.document.state.threshold is None
