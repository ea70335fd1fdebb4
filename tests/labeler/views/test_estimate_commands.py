"""What the menu Estimate asks of the window: insertion paths with their axes, reports that leave no trace."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QApplication, QLabel

from gp_core import PROBE, Atlas, Side
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import GpError
from gp_labeler.document.touches import TouchHow
from gp_labeler.views.window_commands.estimate import ask_path, ask_report

ATLAS = Atlas.published()
ANIMAL = draw_animal(ATLAS, rng=np.random.default_rng(3)).side("L")


def touch(window, animal=ANIMAL, how=TouchHow.TYPED) -> None:
    window.workspace.atlas.use(ATLAS)
    for code in PROBE:
        window.workspace.pose.record(animal[code], how, name=code)


def test_the_authors_path_is_carried_once_its_axes_are_told(make_window, shared_data):
    window = make_window()
    touch(window)
    window.prompts.files = [shared_data / "usevitch2021" / "Curve_Points.csv"]
    window.prompts.answers = ["m", "left", "z,-y,x", "The first 20"]
    ask_path(window.workspace, window.prompts)
    carried = window.workspace.pose.path
    assert len(carried.points) == 20
    assert carried.points[0, 1] > 1.5, "it starts at the round window"
    assert next(iter(carried.readings(carried.source, "L", units="m"))) == "z,-y,x", "likeliest first"
    window.prompts.answers = ["m", "right"]
    with pytest.raises(GpError, match="winds as in a left ear"):
        ask_path(window.workspace, window.prompts)
    window.prompts.answers = ["mm", "left"]
    with pytest.raises(GpError, match="look like m"):
        ask_path(window.workspace, window.prompts)


def test_a_path_in_the_cochlea_frame_asks_for_no_axes(make_window, tmp_path):
    window = make_window()
    touch(window)
    table = tmp_path / "path.csv"
    table.write_text("-0.5,2,0\n0,1.5,0.2\n0.4,1,0.5\n")
    window.prompts.files, window.prompts.answers = [table], ["mm", "left"]
    ask_path(window.workspace, window.prompts)
    assert len(window.workspace.pose.path.points) == 3


def test_a_report_leaves_the_camera_where_it_was(window, tmp_path):
    from window_cases import MIDDLE

    shift = MIDDLE - ANIMAL["CO"]
    touch(window, {code: ANIMAL[code] + shift for code in PROBE}, TouchHow.SCAN)
    camera = window.grid.scene_view.scene.camera
    window.workspace.view.set_crosshair(MIDDLE + 5.0)
    camera.focus_on(MIDDLE - 3.0, across_mm=3.0)
    before = camera.state()
    window.prompts.files = [tmp_path / "report.pdf"]
    ask_report(window)
    assert (tmp_path / "report.pdf").stat().st_size > 10_000
    assert camera.state() == before
    assert QApplication.overrideCursor() is None


def told(panel) -> list[str]:
    labels = panel.result.notices.findChildren(QLabel)
    return [label.text().replace("\u200b", "") for label in labels if label.isVisible()]


def test_a_file_named_for_the_other_side_is_told_and_moved_by_a_click(qtbot, make_window, shared_data):
    window = make_window()
    window.workspace.atlas.use(ATLAS)
    window.set_step("pose")
    panel = window.steps["pose"]
    assert panel.take_file(shared_data / "probe" / "SkullD_Right.dat")
    assert "The name SkullD_Right.dat indicates the right side." in told(panel)
    assert [reason.code for reason in window.workspace.pose.file_warnings] == ["side undecided"]
    qtbot.mouseClick(panel.result.other_side, Qt.MouseButton.LeftButton)
    assert window.workspace.pose.side is Side.RIGHT
    assert not any("indicates the right side" in text for text in told(panel))


def test_a_file_named_for_the_other_side_is_believed_once_the_user_says_which_side_it_is(
    qtbot, make_window, tmp_path
):
    window = make_window()
    window.workspace.atlas.use(ATLAS)
    window.set_step("pose")
    panel, file = window.steps["pose"], tmp_path / "GP7_Right.csv"
    rows = (f"{code},{','.join(map(str, ANIMAL[code]))}" for code in PROBE)
    file.write_text("\n".join(rows) + "\n")
    assert panel.take_file(file)
    assert "The name GP7_Right.csv indicates the right side." in told(panel)
    assert panel.result.this_side.text() == "Keep the left side"
    with pytest.raises(GpError, match=r"the name GP7_Right.csv indicates the right side"):
        window.workspace.pose.export(tmp_path / "pose.tfm")
    qtbot.mouseClick(panel.result.this_side, Qt.MouseButton.LeftButton)
    assert not any("indicates the right side" in text for text in told(panel))
    assert not panel.result.this_side.isVisible()
    window.workspace.pose.export(tmp_path / "pose.tfm")


def test_y_of_the_robot_is_chosen_in_the_menu_and_told_with_the_file(make_window, tmp_path):
    window = make_window()
    rng = np.random.default_rng(4)
    touch(window, {code: ANIMAL[code] + 0.15 * rng.normal(size=3) for code in PROBE})
    file, command = tmp_path / "robot.csv", window.commands.actions["pose.touched_window"]
    matrices, said = [], []
    window.workspace.messages.said.connect(lambda text, level: said.append(text))
    for of in ("touched", "expected"):
        assert command.isChecked() is (of == "touched")
        window.workspace.pose.export(file)
        assert said[-1] == f"Wrote robot.csv, y to the {of} round window"
        matrices.append(np.loadtxt(file, delimiter=","))
        window.commands.run("pose.touched_window")
    np.testing.assert_allclose(matrices[0][:3, [0, 3]], matrices[1][:3, [0, 3]], atol=1e-12)
    assert np.abs(matrices[0] - matrices[1]).max() > 5e-3
