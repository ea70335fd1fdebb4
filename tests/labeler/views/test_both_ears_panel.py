"""Both ears of a specimen in the step Pose: what the panel says, one axis of both, file and report."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from panel_cases import PANEL_WIDTH, actions_of, cut_words, deliver
from qtpy.QtCore import QPoint, Qt
from scipy.spatial.transform import Rotation

from gp_core import PROBE, Atlas, GpError, RigidTransform, Side, estimate_again, read_pose
from gp_core.atlas.sampling import draw_animal
from gp_labeler.document.touch_edits import RecordTouch
from gp_labeler.document.touches import Touch, TouchHow
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.estimate import verdict_on
from gp_labeler.models.pose_report import PoseReport
from gp_labeler.models.pose_sending import PoseSending
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
    best = workspace.pose.gains()[0]
    cone = f"{np.degrees(joined.cone_95):.1f}"
    assert f"cone {cone}°" in panel.result.one.region.text()
    assert f" {best.radius_95_now:.2f} →" in panel.result.next.text()
    assert f" {cone} →" in panel.result.next.text()  # the same number in both places
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
    assert panel.result.verdict.label.text() == "Ears disagree"
    assert workspace.pose.ears.comparison.check.suspects[0] == "RWP"
    assert not workspace.pose.estimate.pose.of_both_ears
    assert "nothing is sent to a robot" in notices(panel)


def test_ears_that_disagree_hold_the_pose_back_from_files_and_robots(workspace, panel, tmp_path) -> None:
    touch(workspace, L)
    workspace.pose.choose(side=L)
    workspace.pose.record_verdict("accept", by="AB")
    touch(workspace, R, RWP=np.array([0, 0, 2.5]))
    assert verdict_on(workspace.pose.estimate, workspace.document.state) == ""  # it was not known then
    with pytest.raises(GpError, match="the two ears DISAGREE"):
        workspace.pose.export(tmp_path / "pose.tfm")
    read = read_pose(workspace.pose.export(tmp_path / "pose.json"))
    assert read.ears_disagree
    page = PoseReport(workspace.document.state, workspace.pose.estimate, ears=workspace.pose.ears).html()
    assert "The two ears DISAGREE" in page
    assert "Touch RWP again on both ears. Until they agree, nothing is sent to a robot" in page
    assert estimate_again(read).as_dict() == read.as_dict()
    workspace.pose.record_verdict("accept", by="AB")
    sending, held = PoseSending(), []
    sending.held_back.connect(held.append)
    sending.start(0, None, "T")
    try:
        sending.update(workspace.pose.estimate, workspace.document.state, (), None)
    finally:
        sending.stop()
    assert held[0].startswith("the two ears DISAGREE")
    touch(workspace, R)  # corrected
    assert not workspace.pose.estimate.pose.ears_disagree
    workspace.pose.record_verdict("accept", by="AB")
    assert workspace.pose.export(tmp_path / "pose.tfm").exists()


def test_ears_that_cannot_be_compared_hold_the_pose_back_too(workspace, panel, tmp_path) -> None:
    touch(workspace, L)
    for name, point in workspace.document.state.touched(L).as_mapping().items():
        workspace.document.do(RecordTouch(R, name, Touch(tuple(point.tolist()), TouchHow.TYPED, "", "AB")))
    deliver(workspace)
    assert "The two ears cannot be compared: The touches of the two ears do not lie" in notices(panel)
    assert workspace.pose.estimate.pose.ears_disagree
    read = read_pose(workspace.pose.export(tmp_path / "pose.json"))
    assert estimate_again(read).as_dict() == read.as_dict()


def test_skull_features_of_the_mid_plane_are_typed_in_the_card(workspace, panel, qtbot) -> None:
    field = panel.head.midline
    assert not field.isVisible()
    touch(workspace, L, skull=True)
    touch(workspace, R, skull=True)
    assert field.isVisible()
    qtbot.keyClicks(field, "s1, S4")
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert workspace.pose.settings.midline == ("S1", "S4")
    assert field.text() == "S1, S4"
    assert workspace.pose.ears.comparison.check.plane.codes[-2:] == ("S1", "S4")
    field.selectAll()
    qtbot.keyClicks(field, "OS")
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert workspace.pose.settings.midline == ("S1", "S4")
    assert field.text() == "S1, S4"
    field.clear()
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert workspace.pose.settings.midline == ()
    assert list(cut_words(panel)) == []


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
