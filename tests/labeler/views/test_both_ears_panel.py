"""Both ears of a specimen in the step Pose: what the panel says, one axis of both, file and report."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from panel_cases import PANEL_WIDTH, actions_of, cut_words, deliver
from qtpy.QtCore import QPoint, Qt
from scipy.spatial.transform import Rotation

from gp_core import PROBE, Atlas, RigidTransform, Side, read_pose
from gp_core.atlas.sampling import draw_animal
from gp_labeler.document.touch_edits import RecordTouch
from gp_labeler.document.touches import Touch, TouchHow
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.pose_report import PoseReport
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.pose.panel import PosePanel
from gp_labeler.views.panels.pose.touch_table_model import NAME
from gp_labeler.views.theme import DARK, apply_theme

ATLAS = Atlas.published()
HEAD = draw_animal(ATLAS, rng=np.random.default_rng(8))
SKULL = {"S1": [0, -30, 5], "S2": [9, -12, 14], "S3": [-9, -12, 14], "S4": [0, 4, 20]}
L, R = Side


@pytest.fixture
def workspace() -> Iterator[Workspace]:
    workspace = Workspace(None, QueueDispatcher(), atlas=ATLAS, author="AB")
    yield workspace
    workspace.close(discard=True)


@pytest.fixture
def panel(workspace: Workspace, qtbot) -> PosePanel:
    panel = PosePanel(workspace, actions_of(workspace, qtbot))
    apply_theme(panel, DARK)
    qtbot.addWidget(panel)
    panel.resize(PANEL_WIDTH, 900)
    panel.show()
    return panel


def touch(
    workspace: Workspace, side: Side, *, T=None, how=TouchHow.TYPED, skull: bool = False, **moved
) -> None:
    rng = np.random.default_rng(list(Side).index(side))
    points = {code: HEAD.side(side)[code] for code in PROBE} | (SKULL if skull else {})
    for name, point in points.items():
        point = np.asarray(point) + 0.1 * rng.standard_normal(3) + moved.get(name, 0)
        position = tuple((point if T is None else T.apply([point])[0]).tolist())
        workspace.document.do(RecordTouch(side, name, Touch(position, how, "", "AB")))
    deliver(workspace)


def notices(panel: PosePanel) -> str:
    return " ".join(" ".join(notice) for notice in panel.result.notices.shown)


def test_the_panel_says_how_the_ears_agree_and_makes_one_axis_of_both(
    workspace, panel, qtbot, tmp_path
) -> None:
    touch(workspace, L)
    assert workspace.pose.ears is None
    assert not panel.head.ears.isEnabled()
    touch(workspace, R)
    assert "The two ears agree: mirrored, CO is" in notices(panel)
    own = {}
    for side in Side:
        workspace.pose.choose(side=side)
        own[side] = workspace.pose.estimate.pose
    workspace.pose.choose(side=L)
    qtbot.mouseClick(
        panel.head.ears, Qt.MouseButton.LeftButton, pos=QPoint(10, panel.head.ears.height() // 2)
    )
    assert workspace.pose.settings.both_ears
    joined = workspace.pose.estimate.pose
    expected = workspace.pose.ears.comparison.fused(L)
    np.testing.assert_array_equal(joined.transform, expected.transform)
    np.testing.assert_array_equal(joined.origin, own[L].origin)
    assert joined.of_both_ears
    assert not np.allclose(joined.axis, own[L].axis, atol=1e-6)
    assert "The axis is that of both." in notices(panel)
    assert workspace.pose.estimate is workspace.pose.estimate  # made once, however often it is asked for
    assert workspace.pose.gains()
    assert list(cut_words(panel)) == []
    assert read_pose(workspace.pose.export(tmp_path / "pose.json")).of_both_ears
    page = PoseReport(workspace.document.state, workspace.pose.estimate, ears=workspace.pose.ears).html()
    assert "The two ears agree: CO 0." in page
    assert "the axis is that of both ears" in page
    workspace.document.undo()
    assert "The two ears agree" in notices(panel)  # of five pairs


def test_a_mistouch_is_named_and_no_axis_is_made_of_ears_that_disagree(workspace, panel) -> None:
    touch(workspace, L)
    touch(workspace, R, RWP=np.array([0, 0, 2.5]))
    workspace.pose.choose(both_ears=True)
    assert "The two ears disagree" in notices(panel)
    assert "RWP is 2." in notices(panel)
    assert "Touch RWP again on both ears" in notices(panel)
    assert "the axis is that of this ear alone" in notices(panel)
    assert panel.result.verdict.label.text() == "Check first"
    assert workspace.pose.ears.comparison.check.suspects[0] == "RWP"
    assert not workspace.pose.estimate.pose.of_both_ears


def test_a_head_that_moved_between_the_ears_is_brought_back_by_its_skull_features(workspace, panel) -> None:
    turn = Rotation.from_rotvec([0.1, -0.05, 0.2]).as_matrix()
    touch(workspace, L, skull=True)
    touch(
        workspace, R, skull=True, T=RigidTransform.from_parts(turn, [3, -2, 4], dst="tracker", src="tracker")
    )
    assert "The two ears agree" in notices(panel)
    assert "The head moved against its reference between the ears" in notices(panel)
    workspace.pose.choose(midline=("S1", "S4"))
    assert workspace.pose.ears.comparison.check.plane.codes[-2:] == ("S1", "S4")


def test_ears_in_different_frames_are_not_compared(workspace, panel) -> None:
    touch(workspace, L)
    touch(workspace, R, how=TouchHow.SCAN)
    assert workspace.pose.ears is None
    assert "ears" not in notices(panel)


def test_a_row_shows_how_often_a_feature_was_touched_and_the_mean_that_is_used(workspace, panel) -> None:
    touch(workspace, L)
    table, model = panel.touches.table, panel.touches.model
    row = model.row_of("MN")
    once = table.viewport().grab(table.visualRect(model.index(row, NAME))).toImage()
    assert model.rows[row].label == "MN"
    at = np.array(workspace.document.state.touches[L, "MN"].position)
    earlier = tuple(tuple((at + off).tolist()) for off in ([0.1, 0, 0], [-0.1, 0.1, 0]))
    last = Touch(tuple((at + np.array([0, 0, 4])).tolist()), TouchHow.TRACKED, "", "AB", earlier=earlier)
    workspace.document.do(RecordTouch(L, "MN", last))
    shown = model.rows[row]
    assert shown.label == "MN ×3"  # noqa: RUF001 - times
    used = workspace.pose.estimate.pose.repeats["MN"].mean
    assert shown.position == pytest.approx(used.tolist())  # without the outlier, which came last
    several = table.viewport().grab(table.visualRect(model.index(row, NAME))).toImage()
    assert several.copy(once.rect()) != once
