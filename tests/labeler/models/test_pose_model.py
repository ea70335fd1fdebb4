"""The pose's part of a workspace: guided order, the estimate through sessions and atlases, JRMPC."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gp_core import PROBE, Atlas, Side
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import GpError
from gp_core.landmarks.features import EXTERNAL
from gp_labeler.document import touching
from gp_labeler.document.state import SpecimenState
from gp_labeler.document.touches import TouchHow
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.pose import ORDER
from gp_labeler.models.pose_exports import InsertionPath
from gp_labeler.models.workspace import Workspace


@pytest.fixture
def dispatcher():
    return QueueDispatcher()


@pytest.fixture
def workspace(dispatcher):
    workspace = Workspace(dispatcher=dispatcher, atlas=Atlas.published(), author="AB")
    yield workspace
    workspace.close(discard=True)


@pytest.fixture
def animal():
    return draw_animal(Atlas.published(), rng=np.random.default_rng(1)).side("L")


def test_features_are_asked_for_in_order_each_once(workspace, animal):
    asked = []
    workspace.pose.target_changed.connect(asked.append)
    while workspace.pose.target is not None:
        workspace.pose.record(animal[workspace.pose.target], TouchHow.TYPED)
    assert asked == [*ORDER[1:], None]
    assert set(ORDER) == set(EXTERNAL)
    assert ORDER[:6] == PROBE
    with pytest.raises(GpError, match="all features are touched"):
        workspace.pose.record((0, 0, 0), TouchHow.TYPED)


def test_a_skipped_feature_comes_last_and_a_chosen_one_first(workspace, animal):
    first, second = ORDER[:2]
    workspace.pose.skip()
    assert workspace.pose.target == second
    workspace.pose.set_target("ZL")
    workspace.pose.record(animal["ZL"], TouchHow.TYPED)
    rest = []
    while workspace.pose.target is not None:
        rest.append(workspace.pose.target)
        workspace.pose.record(animal[rest[-1]], TouchHow.TYPED)
    assert rest[-1] == first
    assert len(rest) == len(EXTERNAL) - 1


def test_an_undone_touch_is_asked_for_again_when_all_were_touched(workspace, animal):
    while workspace.pose.target is not None:
        workspace.pose.record(animal[workspace.pose.target], TouchHow.TYPED)
    workspace.document.undo()
    assert workspace.pose.target == ORDER[-1]


def test_what_is_undone_or_cleared_is_asked_for_next(workspace, animal):
    for code in ORDER[:3]:
        workspace.pose.record(animal[code], TouchHow.TYPED)
    workspace.document.undo()
    assert workspace.pose.target == ORDER[2]
    workspace.document.redo()
    assert workspace.pose.target == ORDER[3]
    touching.clear_touches(workspace.document, "L")
    assert workspace.pose.target == ORDER[0]
    workspace.pose.record(animal["ZL"], TouchHow.TYPED, name="ZL")
    assert workspace.pose.target == ORDER[0], "what was not asked for changes nothing"


def test_what_a_file_lacks_or_is_named_stays_said(workspace, animal, tmp_path):
    rows = [f"{code},{','.join(map(str, animal[code]))}" for code in PROBE]
    file = tmp_path / "GP-7_Right.csv"
    file.write_text("\n".join(["label,x,y,z", *rows]) + "\n", encoding="utf-8")
    said = []
    workspace.messages.said.connect(lambda text, level: said.append((text, level)))
    workspace.pose.target_changed.connect(lambda _: said.append("next"))
    workspace.pose.load(file)
    text = "Read 6 touches from GP-7_Right.csv. Its name indicates the right side: check the side"
    assert said[-1] == (text, "warning"), "nothing is said after it that takes its place"
    assert touching.named_side("Skull_Left_new.dat") is Side.LEFT
    assert touching.named_side("left and right.dat") is None
    assert touching.named_side("Leftover.dat") is None


def test_the_estimate_follows_the_session_and_the_atlas(workspace, animal):
    told = []
    workspace.pose.changed.connect(lambda: told.append(1))
    for code in PROBE:
        workspace.pose.record(animal[code], TouchHow.TYPED)
    assert len(told) == 6
    assert workspace.pose.estimate.pose.radius_95 < 1.5
    best = workspace.pose.gains()[0]
    assert best.radius_95 <= workspace.pose.estimate.pose.radius_95
    workspace.document.load(SpecimenState("other"))
    assert workspace.pose.estimate is None
    assert workspace.pose.target == ORDER[0]
    before = len(told)
    touching.record_touch(workspace.document, "L", "MN", (1, 2, 3))
    assert len(told) == before + 1, "it listens to the new specimen"


def test_the_other_side_begins_again(workspace, animal):
    workspace.pose.record(animal[ORDER[0]], TouchHow.TYPED)
    workspace.pose.choose(side=Side.RIGHT)
    assert workspace.pose.target == ORDER[0]
    workspace.pose.choose(side=Side.LEFT)
    assert workspace.pose.target == ORDER[1]


def test_both_methods_come_once_jrmpc_is_compiled(workspace, dispatcher, animal):
    rng = np.random.default_rng(0)
    animals = [draw_animal(Atlas.published(), rng=rng, name=f"S{n}") for n in range(4)]
    workspace.atlas.use(Atlas.published(), animals)
    for code in PROBE:
        workspace.pose.record(animal[code], TouchHow.TYPED)
    workspace.pose.choose(methods=("robust", "jrmpc"))
    assert set(workspace.pose.estimate.poses) == {"robust"}
    dispatcher.deliver_until_idle(workspace.jobs, timeout=600)
    assert set(workspace.pose.estimate.poses) == {"robust", "jrmpc"}


def test_what_is_drawn_can_be_chosen(workspace):
    seen = []
    workspace.pose.overlay_changed.connect(seen.append)
    workspace.pose.draw(vectors=True, opacity=0.5)
    workspace.pose.draw(vectors=True)
    assert [(options.vectors, options.opacity) for options in seen] == [(True, 0.5)]


def test_nothing_is_exported_before_there_is_an_estimate(workspace, animal, tmp_path):
    assert workspace.pose.path is None
    with pytest.raises(GpError, match=r"there is no estimate yet.*3 more touches"):
        workspace.pose.export(tmp_path / "pose.json")
    for code in PROBE:
        workspace.pose.record(animal[code], TouchHow.TYPED)
    assert workspace.pose.export(tmp_path / "pose.json").exists()


def test_skull_features_stand_after_the_features_in_their_order(workspace, animal):
    assert workspace.pose.names == ORDER
    assert workspace.pose.next_skull == "S1"
    touching.mark_skull(workspace.document, "S10", (1, 2, 3))
    workspace.pose.set_target("S1")
    workspace.pose.record((4, 5, 6), TouchHow.TYPED)
    touching.record_touch(workspace.document, "L", "S2", (7, 8, 9))
    assert workspace.pose.names == (*ORDER, "S1", "S2", "S10")
    assert workspace.pose.next_skull == "S3"


def test_a_touch_is_shown_where_it_lies_in_the_scan(workspace, animal):
    shown = []
    workspace.view.point_shown.connect(shown.append)
    workspace.pose.record(animal["CL"], TouchHow.SCAN, name="CL")
    workspace.pose.show("CL")
    np.testing.assert_allclose(shown[-1], animal["CL"])
    touching.clear_touches(workspace.document, "L")
    workspace.pose.record(animal["CL"], TouchHow.TYPED, name="CL")
    workspace.pose.show("CL")
    workspace.pose.show("MN")
    assert len(shown) == 1, "a tracker's position is nowhere in the scan before it is registered"


def test_touches_of_the_wrong_side_change_sides(workspace, animal):
    for code in PROBE:
        workspace.pose.record(animal[code], TouchHow.TYPED)
    workspace.pose.choose(side=Side.RIGHT)
    workspace.pose.record(animal["MN"], TouchHow.TYPED, name="MN")
    with pytest.raises(GpError, match=r"left side was touched too\. Clear its touches first"):
        workspace.pose.change_side()
    workspace.document.undo()
    workspace.pose.choose(side=Side.LEFT)
    workspace.pose.change_side()
    assert workspace.pose.side is Side.RIGHT
    assert {side for side, _ in workspace.document.state.touches} == {Side.RIGHT}
    assert len(workspace.document.state.touches) == 6
    workspace.document.undo()
    assert {side for side, _ in workspace.document.state.touches} == {Side.LEFT}, "in one step"


def test_the_side_in_work_follows_an_undone_change_of_sides(workspace, animal):
    for code in PROBE:
        workspace.pose.record(animal[code], TouchHow.TYPED)
    workspace.pose.change_side()
    for side, step in ((Side.LEFT, workspace.document.undo), (Side.RIGHT, workspace.document.redo)):
        step()
        assert workspace.pose.side is side
        assert workspace.pose.estimate.side is side, "what is seen is what was touched"
        assert workspace.pose.target == ORDER[6]
    touching.clear_touches(workspace.document, Side.RIGHT)
    assert workspace.pose.side is Side.RIGHT, "cleared is not moved"


def test_two_touches_exchange_their_names_in_one_step(workspace, animal):
    for code in ("MN", "OS"):
        workspace.pose.record(animal[code], TouchHow.TYPED, name=code)
    touching.leave_out(workspace.document, "L", "OS")
    before = dict(workspace.document.state.touches)
    touching.swap_touches(workspace.document, "L", "mn", "OS")
    after, (mn, os) = workspace.document.state.touches, ((Side.LEFT, "MN"), (Side.LEFT, "OS"))
    assert (after[mn], after[os]) == (before[os], before[mn])
    assert workspace.document.undo_text == "exchange MN and OS left"
    workspace.document.undo()
    assert workspace.document.state.touches == before
    with pytest.raises(GpError, match="RWA left is not touched yet"):
        touching.swap_touches(workspace.document, "L", "MN", "RWA")
    with pytest.raises(GpError, match="MN cannot be exchanged with itself"):
        touching.swap_touches(workspace.document, "L", "MN", "MN")


def test_in_the_step_pose_no_click_moves_a_landmark(workspace, ball):
    workspace.scan.begin(ball)
    workspace.begin_labelling()
    assert (workspace.interaction.tool, workspace.pose.overlay.visible) == ("place", False)
    workspace.begin_judging()
    assert (workspace.interaction.tool, workspace.pose.overlay.visible) == ("look", True)
    workspace.interaction.set_tool("touch")
    workspace.begin_judging()
    assert workspace.interaction.tool == "touch"
    workspace.begin_labelling()
    assert workspace.interaction.tool == "place"


def test_a_feature_that_is_touched_again_is_done_again(workspace, animal):
    first = ORDER[0]
    for code in ORDER[:3]:
        workspace.pose.record(animal[code], TouchHow.TYPED)
    workspace.pose.set_target(first)
    workspace.pose.record(animal[first] + 0.1, TouchHow.TYPED)
    assert workspace.pose.target == ORDER[3], "it goes on with what is untouched"


def test_a_path_that_winds_the_other_way_is_refused_before_any_touch(workspace):
    turn = np.linspace(0, 2 * np.pi, 20)
    points = np.stack([turn, 2 * np.cos(turn), -2 * np.sin(turn)], axis=1)
    left = InsertionPath(points, Side.LEFT, Path("path.csv"))
    workspace.pose.carry(left)
    with pytest.raises(GpError, match="declared as that of a right ear, but winds as in a left ear"):
        workspace.pose.carry(replace(left, side=Side.RIGHT))
    assert workspace.pose.path is left
