"""The pose's part of a workbench: guided order, the estimate through sessions and atlases, JRMPC."""

from __future__ import annotations

import numpy as np
import pytest

from gp_core import PROBE, Atlas, Side
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import GpError
from gp_core.landmarks.features import EXTERNAL
from gp_labeler.document import touching
from gp_labeler.document.opening import new_session
from gp_labeler.document.touches import TouchHow
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.pose import ORDER
from gp_labeler.models.workspace import Workbench


@pytest.fixture
def dispatcher():
    return QueueDispatcher()


@pytest.fixture
def desk(dispatcher):
    desk = Workbench(dispatcher=dispatcher, atlas=Atlas.published(), author="AB")
    yield desk
    desk.close(discard=True)


@pytest.fixture
def animal():
    return draw_animal(Atlas.published(), rng=np.random.default_rng(1)).side("L")


def test_features_are_asked_for_in_order_each_once(desk, animal):
    asked = []
    desk.pose.target_changed.connect(asked.append)
    while desk.pose.target is not None:
        desk.pose.record(animal[desk.pose.target], TouchHow.TYPED)
    assert asked == [*ORDER[1:], None]
    assert set(ORDER) == set(EXTERNAL)
    assert ORDER[:6] == PROBE
    with pytest.raises(GpError, match="all features are touched"):
        desk.pose.record((0, 0, 0), TouchHow.TYPED)


def test_a_skipped_feature_comes_last_and_a_chosen_one_first(desk, animal):
    first, second = ORDER[:2]
    desk.pose.skip()
    assert desk.pose.target == second
    desk.pose.aim("ZL")
    desk.pose.record(animal["ZL"], TouchHow.TYPED)
    rest = []
    while desk.pose.target is not None:
        rest.append(desk.pose.target)
        desk.pose.record(animal[rest[-1]], TouchHow.TYPED)
    assert rest[-1] == first
    assert len(rest) == len(EXTERNAL) - 1


def test_an_undone_touch_is_asked_for_again_when_all_were_touched(desk, animal):
    while desk.pose.target is not None:
        desk.pose.record(animal[desk.pose.target], TouchHow.TYPED)
    desk.session.undo()
    assert desk.pose.target == ORDER[-1]


def test_what_is_undone_or_cleared_is_asked_for_next(desk, animal):
    for code in ORDER[:3]:
        desk.pose.record(animal[code], TouchHow.TYPED)
    desk.session.undo()
    assert desk.pose.target == ORDER[2]
    desk.session.redo()
    assert desk.pose.target == ORDER[3]
    touching.clear_touches(desk.session, "L")
    assert desk.pose.target == ORDER[0]
    desk.pose.record(animal["ZL"], TouchHow.TYPED, name="ZL")
    assert desk.pose.target == ORDER[0], "what was not asked for changes nothing"


def test_what_a_file_lacks_or_is_named_stays_said(desk, animal, tmp_path):
    rows = [f"{code},{','.join(map(str, animal[code]))}" for code in PROBE]
    file = tmp_path / "GP-7_Right.csv"
    file.write_text("\n".join(["label,x,y,z", *rows]) + "\n", encoding="utf-8")
    said = []
    desk.message.connect(lambda text, level: said.append((text, level)))
    desk.pose.target_changed.connect(lambda _: said.append("next"))
    desk.pose.load(file)
    text = "Took 6 touches from GP-7_Right.csv. By its name it is of the right side: check the side"
    assert said[-1] == (text, "warning"), "nothing is said after it that takes its place"
    assert touching.named_side("Skull_Left_new.dat") is Side.LEFT
    assert touching.named_side("left and right.dat") is None
    assert touching.named_side("Leftover.dat") is None


def test_the_estimate_follows_the_session_and_the_atlas(desk, animal):
    told = []
    desk.pose.changed.connect(lambda: told.append(1))
    for code in PROBE:
        desk.pose.record(animal[code], TouchHow.TYPED)
    assert len(told) == 6
    assert desk.pose.estimate.pose.radius_95 < 1.5
    best = desk.pose.gains()[0]
    assert best.radius_95 <= desk.pose.estimate.pose.radius_95
    desk._replace(new_session(specimen="other"))
    assert desk.pose.estimate is None
    assert desk.pose.target == ORDER[0]
    before = len(told)
    touching.record_touch(desk.session, "L", "MN", (1, 2, 3))
    assert len(told) == before + 1, "it listens to the new session"


def test_the_other_side_begins_anew(desk, animal):
    desk.pose.record(animal[ORDER[0]], TouchHow.TYPED)
    desk.pose.choose(side=Side.RIGHT)
    assert desk.pose.target == ORDER[0]
    desk.pose.choose(side=Side.LEFT)
    assert desk.pose.target == ORDER[1]


def test_both_methods_come_once_jrmpc_is_compiled(desk, dispatcher, animal):
    rng = np.random.default_rng(0)
    animals = [draw_animal(Atlas.published(), rng=rng, name=f"S{n}") for n in range(4)]
    desk.use_atlas(Atlas.published(), animals)
    for code in PROBE:
        desk.pose.record(animal[code], TouchHow.TYPED)
    desk.pose.choose(methods=("robust", "jrmpc"))
    assert set(desk.pose.estimate.poses) == {"robust"}
    dispatcher.deliver_until_idle(desk.jobs, timeout=600)
    assert set(desk.pose.estimate.poses) == {"robust", "jrmpc"}


def test_what_is_drawn_can_be_chosen(desk):
    seen = []
    desk.pose.overlay_changed.connect(seen.append)
    desk.pose.draw(vectors=True, opacity=0.5)
    desk.pose.draw(vectors=True)
    assert [(options.vectors, options.opacity) for options in seen] == [(True, 0.5)]


def test_nothing_is_exported_before_there_is_an_estimate(desk, animal, tmp_path):
    assert desk.pose.path is None
    with pytest.raises(GpError, match=r"there is no estimate yet.*3 more touches"):
        desk.pose.export(tmp_path / "pose.json")
    for code in PROBE:
        desk.pose.record(animal[code], TouchHow.TYPED)
    assert desk.pose.export(tmp_path / "pose.json").exists()


def test_skull_features_stand_after_the_features_in_their_order(desk, animal):
    assert desk.pose.names == ORDER
    assert desk.pose.next_skull == "S1"
    touching.mark_skull(desk.session, "S10", (1, 2, 3))
    desk.pose.aim("S1")
    desk.pose.record((4, 5, 6), TouchHow.TYPED)
    touching.record_touch(desk.session, "L", "S2", (7, 8, 9))
    assert desk.pose.names == (*ORDER, "S1", "S2", "S10")
    assert desk.pose.next_skull == "S3"


def test_a_touch_is_shown_where_it_lies_in_the_scan(desk, animal):
    shown = []
    desk.point_shown.connect(shown.append)
    desk.pose.record(animal["CL"], TouchHow.SCAN, name="CL")
    desk.pose.show("CL")
    np.testing.assert_allclose(shown[-1], animal["CL"])
    touching.clear_touches(desk.session, "L")
    desk.pose.record(animal["CL"], TouchHow.TYPED, name="CL")
    desk.pose.show("CL")
    desk.pose.show("MN")
    assert len(shown) == 1, "a tracker's position is nowhere in the scan before it is registered"


def test_touches_of_the_wrong_side_change_sides(desk, animal):
    for code in PROBE:
        desk.pose.record(animal[code], TouchHow.TYPED)
    desk.pose.choose(side=Side.RIGHT)
    desk.pose.record(animal["MN"], TouchHow.TYPED, name="MN")
    with pytest.raises(GpError, match=r"left side was touched too\. Clear its touches first"):
        desk.pose.change_side()
    desk.session.undo()
    desk.pose.choose(side=Side.LEFT)
    desk.pose.change_side()
    assert desk.pose.side is Side.RIGHT
    assert {side for side, _ in desk.session.state.touches} == {Side.RIGHT}
    assert len(desk.session.state.touches) == 6
    desk.session.undo()
    assert {side for side, _ in desk.session.state.touches} == {Side.LEFT}, "in one step"


def test_the_side_in_work_follows_an_undone_change_of_sides(desk, animal):
    for code in PROBE:
        desk.pose.record(animal[code], TouchHow.TYPED)
    desk.pose.change_side()
    for side, step in ((Side.LEFT, desk.session.undo), (Side.RIGHT, desk.session.redo)):
        step()
        assert desk.pose.side is side
        assert desk.pose.estimate.side is side, "what is seen is what was touched"
        assert desk.pose.target == ORDER[6]
    touching.clear_touches(desk.session, Side.RIGHT)
    assert desk.pose.side is Side.RIGHT, "cleared is not moved"


def test_two_touches_exchange_their_names_in_one_step(desk, animal):
    for code in ("MN", "OS"):
        desk.pose.record(animal[code], TouchHow.TYPED, name=code)
    touching.leave_out(desk.session, "L", "OS")
    before = dict(desk.session.state.touches)
    touching.swap_touches(desk.session, "L", "mn", "OS")
    after, (mn, os) = desk.session.state.touches, ((Side.LEFT, "MN"), (Side.LEFT, "OS"))
    assert (after[mn], after[os]) == (before[os], before[mn])
    assert desk.session.undo_text == "exchange MN and OS left"
    desk.session.undo()
    assert desk.session.state.touches == before
    with pytest.raises(GpError, match="RWA left is not touched yet"):
        touching.swap_touches(desk.session, "L", "MN", "RWA")
    with pytest.raises(GpError, match="MN cannot be exchanged with itself"):
        touching.swap_touches(desk.session, "L", "MN", "MN")


def test_in_the_step_pose_no_click_moves_a_landmark(desk, ball):
    desk.open_volume(ball)
    desk.begin_labelling()
    assert (desk.tool, desk.pose.overlay.visible) == ("place", False)
    desk.begin_judging()
    assert (desk.tool, desk.pose.overlay.visible) == ("look", True)
    desk.set_tool("touch")
    desk.begin_judging()
    assert desk.tool == "touch"
    desk.begin_labelling()
    assert desk.tool == "place"


def test_a_feature_that_is_touched_again_is_done_again(desk, animal):
    first = ORDER[0]
    for code in ORDER[:3]:
        desk.pose.record(animal[code], TouchHow.TYPED)
    desk.pose.aim(first)
    desk.pose.record(animal[first] + 0.1, TouchHow.TYPED)
    assert desk.pose.target == ORDER[3], "it goes on with what is untouched"
