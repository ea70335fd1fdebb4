"""The step Label offers first labels before anything is placed, and asks what no scan can tell."""

import numpy as np
from small_heads import TURN, save_markups, save_volume, small_head
from window_cases import Answers, wait_until_idle

from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_labeler.head_pose import HeadPose
from gp_labeler.views.panels.label.suggest_row import SuggestRow
from gp_labeler.views.window_commands.landmarks import ask_suggest_like


def labelled_head(folder):
    volume, points = small_head(0)
    save_volume(folder / "small-0.nrrd", volume)
    for side in "LR":
        own = {name.removesuffix(f"_{side}"): xyz for name, xyz in points.items() if name[-1] in (side, "N")}
        save_markups(folder / f"small-0_{side}.mrk.json", own)
    return folder


def test_a_new_scan_gets_suggestions_from_a_folder(qtbot, make_window, tmp_path, monkeypatch):
    lies = RigidTransform.from_parts(TURN.T, np.zeros(3), dst="head", src="scan")
    found = HeadPose(lies, "symmetry", None, "the teeth", "the file")
    monkeypatch.setattr("gp_labeler.head_pose.straighten", lambda volume, **options: found)
    window = make_window()
    window.workspace.scan.begin(small_head(7, turn=TURN)[0])
    wait_until_idle(qtbot, window)
    window.set_step("label")
    button = window.findChild(SuggestRow).button
    assert button.isVisible()
    answers = window.prompts = Answers()
    answers.files = [labelled_head(tmp_path)]
    answers.answers = ["From a folder…", "Left is correct"]
    button.click()
    assert answers.asked == ["Suggest from my scans", "Left and right"]
    assert button.text() == "Stop"
    wait_until_idle(qtbot, window)
    suggested = [window.workspace.document.landmarks(side).suggested for side in Side]
    assert [len(each) for each in suggested] == [4, 5]
    assert not button.isVisible()
    np.testing.assert_allclose(window.workspace.view.frame.axes, TURN, atol=1e-9)  # columns: the head's axes
    assert window.workspace.head.frame.left_confirmed  # it was asked
    active = window.workspace.labels.active
    where = window.workspace.labels.place_of(active.side, active.code)
    assert window.grid.can_judge(where)  # the least certain is shown closely


def test_the_next_head_is_offered_the_labelled_scans_of_the_one_before(make_window, tmp_path, monkeypatch):
    window, given = make_window(), []
    model = window.workspace.first_labels
    monkeypatch.setattr(model, "suggest", lambda labelled, **_: given.append(labelled))
    answers, same = Answers(), "The same as for the head before"
    for model.labelled, wanted in (((), []), ((tmp_path,), [[tmp_path]])):
        answers.answers = [same, "Left is correct"]
        ask_suggest_like(window.workspace, answers)
        assert given == wanted
