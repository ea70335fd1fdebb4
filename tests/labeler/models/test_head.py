"""The head is straightened in the workspace: the views turn, positions stay, and the file keeps it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from document_cases import head_frame, text_of
from panel_cases import deliver, place, workspace_with_scan
from window_cases import write_ball

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_labeler.document.head_edits import SetHeadFrame
from gp_labeler.document.specimen_file import read_specimen
from gp_labeler.document.specimen_json import document_of, state_of
from gp_labeler.head_pose import (
    LEFT_OF_LANDMARKS,
    Confidence,
    HeadPose,
    HeadPoseError,
    SeveralHeadsError,
)
from gp_labeler.imaging.anatomical_frame import SCAN_FRAME
from gp_labeler.jobs.head import Straighten, StraightenByPoints
from gp_labeler.models.workspace import Workspace

HEAD = head_frame()
POSE = HeadPose(
    HEAD.T_head_scan,
    "symmetry",
    Confidence(0.9, 1.0, 0.3),
    "proposed from the synthetic guinea pig",
    "the file",
)


@pytest.fixture
def workspace():
    made = workspace_with_scan()
    yield made
    made.close(discard=True)


def straightened(workspace: Workspace, monkeypatch, pose: HeadPose = POSE) -> Workspace:
    monkeypatch.setattr(Straighten, "run", lambda job, progress: pose)
    workspace.head.straighten()
    deliver(workspace)
    return workspace


def test_the_views_turn_into_the_head_and_positions_stay_those_of_the_scan(workspace, monkeypatch) -> None:
    place(workspace, "CA", "RWP", "OS")
    before = workspace.document.landmarks("L").as_mapping()
    crosshair = workspace.view.crosshair
    straightened(workspace, monkeypatch)
    view, axes = workspace.view, HEAD.T_head_scan.rotation
    assert view.frame.name == "head"
    for name, row in (("sagittal", 0), ("coronal", 1), ("axial", 2)):
        assert view.planes[name].normal == pytest.approx(axes[row])
        assert view.title(name) == name.capitalize()
        assert view.frame.edge_letters(view.planes[name]) == SCAN_FRAME.edge_letters(SCAN_FRAME.plane(name))
    assert view.planes["sagittal"].position_of([1.0, 2.0, 3.0]) == pytest.approx(0.0)  # the mid-plane is 0
    for code, position in workspace.document.landmarks("L").as_mapping().items():
        np.testing.assert_array_equal(position, before[code])
    np.testing.assert_array_equal(view.crosshair, crosshair)
    assert "proposed" in workspace.head.frame.pitch


def test_one_key_goes_to_and_fro_and_is_no_edit(workspace, monkeypatch, tmp_path) -> None:
    straightened(workspace, monkeypatch)
    file = workspace.document.save(tmp_path / "head.gpspecimen.json")
    workspace.head.show()
    assert workspace.view.frame.name == "scan"
    assert not workspace.document.dirty
    assert workspace.view.planes["axial"].same_as(SCAN_FRAME.plane("axial"))
    workspace.document.save()
    workspace.document.open(file)
    assert workspace.view.frame.name == "scan"  # as it was shown when it was saved
    workspace.head.show()
    assert workspace.view.frame.name == "head"
    assert read_specimen(file).head_frame == workspace.head.frame


def test_the_file_keeps_the_frame_to_the_last_bit_and_files_without_one_open() -> None:
    state = SetHeadFrame(head_frame(confirmed=True)).apply(Workspace().document.state)
    document = document_of(state)
    assert document["headFrame"]["leftConfirmed"] is True
    assert text_of(state_of(document)) == text_of(state)
    del document["headFrame"]
    assert state_of(document).head_frame is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"T_head_scan": [[1, 0, 0, 0]] * 4}, "not rigid"),
        ({"T_head_scan": [[1, 0, 0]] * 4}, r"T_head_scan\[0\] must be a list of length 4"),
        ({"foundBy": "luck"}, "found_by"),
        ({"shown": "yes"}, "headFrame.shown"),
    ],
)
def test_a_frame_that_is_none_is_refused_and_named(change, words) -> None:
    document = document_of(SetHeadFrame(HEAD).apply(Workspace().document.state))
    document["headFrame"] |= change
    with pytest.raises(GpError, match=words):
        state_of(document)


def test_undo_takes_it_back_and_redo_brings_it_again(workspace, monkeypatch) -> None:
    straightened(workspace, monkeypatch)
    workspace.head.show()
    workspace.document.undo()
    assert workspace.head.frame is None
    assert workspace.view.frame.name == "scan"
    workspace.document.redo()
    assert workspace.head.frame.matrix == HEAD.matrix
    workspace.document.undo()
    with pytest.raises(GpError, match="not straightened"):
        workspace.head.show()


def test_refused_it_says_why_and_asks_for_points_and_leaves_all_as_it_was(workspace, monkeypatch) -> None:
    def refuse(job, progress):
        raise HeadPoseError("only 40 % of the bone meets its mirror image")

    monkeypatch.setattr(Straighten, "run", refuse)
    workspace.head.straighten()
    assert workspace.head.is_running
    deliver(workspace)
    assert not workspace.head.is_running
    assert workspace.head.frame is None
    assert "40 %" in workspace.head.refusal
    assert "Place IN and a pair" in workspace.head.refusal
    straightened(workspace, monkeypatch)
    assert workspace.head.refusal == ""


def test_of_several_heads_the_user_says_which_one_is_meant(workspace, monkeypatch) -> None:
    def refuse(job, progress):
        if job.near is None:
            raise SeveralHeadsError([np.array([-20.0, 0.0, 1.0]), np.array([22.0, 3.0, 0.0])])
        return POSE

    monkeypatch.setattr(Straighten, "run", refuse)
    workspace.head.straighten()
    deliver(workspace)
    assert workspace.head.frame is None
    assert workspace.head.heads == ((-20, 0, 1), (22, 3, 0))
    assert workspace.head.head_names == ("Head 1 (towards R)", "Head 2 (towards L)")
    assert "contains 2 heads" in workspace.head.refusal
    workspace.head.straighten(workspace.head.heads[1])
    deliver(workspace)
    assert workspace.head.frame.matrix == HEAD.matrix
    assert workspace.head.heads == ()
    np.testing.assert_allclose(workspace.view.crosshair, [22, 3, 0], atol=workspace.scan.volume.spacing[0])


def test_what_is_to_be_looked_at_is_kept_until_the_frame_is_another(workspace, monkeypatch) -> None:
    straightened(workspace, monkeypatch, replace(POSE, warnings=("the bone looks upside down",)))
    assert workspace.head.warnings == ("the bone looks upside down",)
    workspace.head.show(False)
    workspace.head.confirm_left()
    assert workspace.head.warnings
    workspace.head.turn("roll", np.pi)
    assert workspace.head.warnings == ()


def test_a_cancelled_search_changes_nothing(workspace, monkeypatch) -> None:
    monkeypatch.setattr(Straighten, "run", lambda job, progress: POSE)
    workspace.head.straighten()
    workspace.head.cancel()
    deliver(workspace)
    assert workspace.head.frame is None


def test_landmarks_of_one_side_are_refused_with_what_to_place(workspace) -> None:
    workspace.head.straighten_by_landmarks()
    deliver(workspace)
    assert workspace.head.refusal.startswith("no landmark is placed. Place IN")
    place(workspace, "CA", "RWP", "OS")
    workspace.head.straighten_by_landmarks()
    deliver(workspace)
    assert "one side" in workspace.head.refusal
    assert "IN" in workspace.head.refusal


def test_three_free_points_straighten_once_all_are_marked(workspace, monkeypatch) -> None:
    asked = []
    monkeypatch.setattr(StraightenByPoints, "run", lambda job, progress: asked.append(job) or POSE)
    workspace.view.set_crosshair([0.0, -30.0, 0.0])
    workspace.head.mark_point("midline")
    workspace.head.mark_point("left", [9.0, 0.0, 0.0])
    with pytest.raises(GpError, match="right"):
        workspace.head.straighten_by_points()
    workspace.head.mark_point("right", [-9.0, 0.0, 0.0])
    deliver(workspace)
    assert (asked[0].midline, asked[0].left, asked[0].right) == ((0, -30, 0), (9, 0, 0), (-9, 0, 0))
    assert workspace.head.frame.matrix == HEAD.matrix
    assert not workspace.head.points


def test_left_is_asked_once_and_the_answer_is_kept(workspace, monkeypatch) -> None:
    straightened(workspace, monkeypatch)
    assert workspace.head.asks_left
    assert "nothing in the scan can prove it" in workspace.head.left_text
    said = []
    workspace.messages.said.connect(lambda text, level: said.append(text))
    workspace.head.confirm_left()
    assert said == ["Left is confirmed"]  # and no longer asked for
    assert not workspace.head.asks_left
    straightened(workspace, monkeypatch)  # again: left is no other
    assert not workspace.head.asks_left


@pytest.mark.parametrize(
    ("left", "source"),
    [("the file's orientation (a left-handed grid)", "the file"), (LEFT_OF_LANDMARKS, LEFT_OF_LANDMARKS)],
)
def test_the_question_of_left_names_what_left_was_taken_from(workspace, monkeypatch, left, source) -> None:
    straightened(workspace, monkeypatch, replace(POSE, left=left))
    assert workspace.head.left_text.startswith(f"According to {source}, left is")


def test_a_scan_that_is_read_again_mirrored_is_straightened_again_if_it_was(
    workspace, monkeypatch, tmp_path
) -> None:
    monkeypatch.setattr(Straighten, "run", lambda job, progress: POSE)
    with pytest.raises(GpError, match="only a scan in a file"):
        workspace.head.reopen_mirrored()
    workspace.scan.open(write_ball(tmp_path / "ball.nrrd"))
    deliver(workspace)
    original = workspace.scan.volume
    workspace.head.reopen_mirrored()
    deliver(workspace)
    assert workspace.head.frame is None  # it lay as it was stored
    straightened(workspace, monkeypatch)
    workspace.head.reopen_mirrored()  # and back
    deliver(workspace)
    assert workspace.scan.volume.checksum == original.checksum
    assert workspace.head.frame is not None
    workspace.scan.open(write_ball(tmp_path / "other.nrrd"))
    deliver(workspace)
    assert workspace.head.frame is None


@pytest.mark.parametrize(("name", "row"), [("pitch", 0), ("roll", 1), ("yaw", 2)])
def test_a_hand_turns_the_head_about_its_own_axes_and_the_mid_plane_with_it(
    workspace, monkeypatch, name, row
) -> None:
    straightened(workspace, monkeypatch)
    crosshair = np.array([4.0, -12.0, 5.0])
    workspace.view.set_crosshair(crosshair)
    before = workspace.head.frame
    workspace.head.turn(name, np.radians(8.0))
    after = workspace.head.frame
    turn = after.T_head_scan.rotation.T @ before.T_head_scan.rotation
    axis = before.T_head_scan.rotation[row]
    assert turn @ axis == pytest.approx(axis, abs=1e-12)
    assert np.degrees(np.arccos((np.trace(turn) - 1) / 2)) == pytest.approx(8.0)
    across = np.cross(axis, np.roll(axis, 1))
    assert np.cross(across, turn @ across) @ axis > 0  # right-handed
    assert after.heights(crosshair[None]) == pytest.approx(before.heights(crosshair[None]))
    assert after.found_by == "hand"
    assert not workspace.view.planes_are_turned


def test_planes_turned_by_the_arms_become_those_of_the_head_when_they_are_taken(workspace) -> None:
    workspace.view.set_crosshair([2.0, -15.0, 1.0])
    workspace.view.rotate_planes("axial", np.radians(30))
    turned = dict(workspace.view.planes)
    assert workspace.view.title("sagittal") == "Sagittal, oblique"
    assert workspace.view.title("axial") == "Axial"
    workspace.head.take_planes()
    for name, plane in turned.items():
        assert workspace.view.planes[name].normal == pytest.approx(plane.normal)
    assert workspace.head.frame.heights([[2.0, -15.0, 1.0]]) == pytest.approx(0.0)  # the crosshair is midline
    workspace.view.set_crosshair([7.0, -15.0, 1.0])
    workspace.head.take_mid_plane()
    assert workspace.head.frame.heights([[7.0, -15.0, 1.0]]) == pytest.approx(0.0)


def test_a_point_on_the_other_side_of_the_mid_plane_is_named_when_it_is_placed(workspace) -> None:
    straight = RigidTransform.identity(dst="head", src="scan")
    workspace.document.do(SetHeadFrame(head_frame((0, 0, 0), (0, 0, 0))))
    assert np.array_equal(workspace.head.frame.T_head_scan.matrix, straight.matrix)
    said = []
    workspace.messages.said.connect(lambda text, level: said.append(text))
    workspace.labels.place([5.0, 0.0, 0.0], side=Side.LEFT, code="CA")
    assert not said
    workspace.labels.place([5.0, 0.0, 0.0], side=Side.RIGHT, code="CA")
    assert "CA right lies 5.0 mm on the left of the mid-plane" in said[0]
    assert workspace.head.wrong_sides() == ["CA right lies 5.0 mm on the left of the mid-plane"]
    workspace.labels.place([0.2, -30.0, 0.0], side=Side.RIGHT, code="IN")  # shared: on no side
    assert len(workspace.head.wrong_sides()) == 1


def test_another_specimen_begins_in_its_own_frame(workspace, monkeypatch) -> None:
    straightened(workspace, monkeypatch)
    workspace.document.begin("other")
    assert workspace.view.frame.name == "scan"
    assert workspace.head.frame is None
