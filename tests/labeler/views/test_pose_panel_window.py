"""The step Pose in the window: dry runs by clicks, drops, no scan at all, verdicts, keys."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtWidgets import QApplication
from window_cases import BALL_MM, MIDDLE, ball_volume, close, drop_file, wait_until_idle

from gp_core import PROBE, Atlas, Side
from gp_core.atlas.sampling import draw_animal
from gp_labeler.document.touches import TouchHow
from gp_labeler.models.pose import ORDER
from gp_labeler.scene.planes import Plane
from gp_labeler.tracker import TrackerAddress

pytestmark = pytest.mark.machine

ATLAS = Atlas.published()
ANIMAL = draw_animal(ATLAS, rng=np.random.default_rng(3)).side("L")
LEFT, CLICK = Side.LEFT, Qt.MouseButton.LeftButton


def touch_file(folder, animal=ANIMAL, name="GP-7_L.csv"):
    path = folder / name
    rows = [f"{code},{','.join(f'{x:.4f}' for x in animal[code])}" for code in PROBE]
    path.write_text("\n".join(["label,x,y,z", *rows]) + "\n")
    return path


def touched(window) -> dict[str, tuple[float, float, float]]:
    return {name: touch.position for (_, name), touch in window.workspace.document.state.touches.items()}


@pytest.fixture
def bare(make_window):
    """A window with nothing open."""
    window = make_window()
    window.workspace.atlas.use(ATLAS)
    return window


def to_step(qtbot, window, step: str) -> None:
    qtbot.mouseClick(window.rail.buttons[step], CLICK)
    QApplication.processEvents()


# Without a scan


def test_the_step_needs_no_scan(qtbot, bare, tmp_path):
    to_step(qtbot, bare, "pose")
    panel = bare.steps["pose"]
    assert panel.isVisible()
    assert not bare.grid.isVisible()
    assert panel.width() > 760, "the panel has the page to itself"
    assert "Touch" in bare.status.next_click.text()
    drop_file(bare, touch_file(tmp_path))
    assert set(touched(bare)) == set(PROBE)
    assert panel.result.one.isVisible()
    to_step(qtbot, bare, "scan")
    assert bare.welcome.isVisible()
    to_step(qtbot, bare, "pose")
    assert panel.isVisible()


@pytest.mark.parametrize("step", ["pose", "atlas"])
def test_views_lose_no_room_to_a_step_that_had_the_page_to_itself(qtbot, bare, step):
    bare.resize(1280, 800)
    usual = bare.panels.sizeHint().width()
    to_step(qtbot, bare, step)
    to_step(qtbot, bare, "scan")
    bare.workspace.scan.begin(ball_volume())
    wait_until_idle(qtbot, bare)
    assert bare.panels.width() == usual
    assert bare.grid.width() > usual


def test_keys_are_commands_and_no_letters_of_the_specimens_name(qtbot, bare):
    name = bare.steps["pose"].head.specimen
    bare.activateWindow()
    to_step(qtbot, bare, "pose")
    for _ in range(2):
        qtbot.waitUntil(lambda: bare.focusWidget() is not None and bare.focusWidget() is not name)
        for key in (Qt.Key.Key_J, Qt.Key.Key_I):
            qtbot.keyClick(bare.focusWidget(), key)
        assert name.text() in ("unnamed", "GP-9")
        name.setFocus()
        name.selectAll()
        qtbot.keyClicks(name, "GP-9")
        qtbot.keyClick(name, Qt.Key.Key_Return)
    assert bare.workspace.document.state.specimen == "GP-9"


def test_the_key_that_records_works_from_the_moment_a_tracker_is_connected(qtbot, bare):
    tracker, record = bare.workspace.tracker, bare.commands.actions["pose.record"]
    assert not record.isEnabled()
    tracker.connect(TrackerAddress(port=1))
    qtbot.waitUntil(record.isEnabled)
    tracker.disconnect()
    qtbot.waitUntil(lambda: not record.isEnabled())


def test_touches_without_a_scan_are_saved_and_opened_again(qtbot, bare, make_window, tmp_path):
    to_step(qtbot, bare, "pose")
    drop_file(bare, touch_file(tmp_path))
    bare.prompts.files = [tmp_path / "touched"]
    bare.commands.flush()
    assert bare.commands.actions["file.save"].isEnabled()
    bare.commands.run("file.save")
    saved = tmp_path / "touched.gpspecimen.json"
    assert saved.exists()
    assert "touched" in bare.windowTitle() or bare.workspace.document.state.specimen in bare.windowTitle()
    close(bare)
    again = make_window()
    again.open_path(saved)
    wait_until_idle(qtbot, again)
    assert again.rail.step == "pose"
    assert again.steps["pose"].isVisible()
    assert set(touched(again)) == set(PROBE)


def test_the_views_come_with_the_scan_and_the_step_stays(qtbot, bare):
    to_step(qtbot, bare, "pose")
    bare.workspace.scan.begin(ball_volume())
    wait_until_idle(qtbot, bare)
    assert bare.rail.step == "pose"
    assert bare.grid.isVisible()
    assert bare.steps["pose"].width() < bare.grid.width()


def test_a_scan_that_is_opened_later_joins_what_was_touched(qtbot, bare, tmp_path):
    to_step(qtbot, bare, "pose")
    drop_file(bare, touch_file(tmp_path))
    bare.workspace.scan.begin(ball_volume())
    wait_until_idle(qtbot, bare)
    assert set(touched(bare)) == set(PROBE)
    assert bare.workspace.scan.volume is not None
    assert bare.workspace.document.state.specimen == "ball"
    bare.workspace.scan.begin(ball_volume())
    wait_until_idle(qtbot, bare)
    assert touched(bare) == {}, "the next scan is another specimen's"


def test_another_specimen_is_begun_without_a_scan(qtbot, bare, tmp_path):
    to_step(qtbot, bare, "pose")
    head = bare.steps["pose"].head
    head.specimen.setFocus()
    head.specimen.selectAll()
    qtbot.keyClicks(head.specimen, "GP-7")
    qtbot.keyClick(head.specimen, Qt.Key.Key_Return)
    drop_file(bare, touch_file(tmp_path))
    assert bare.windowTitle().startswith("GP-7")
    bare.prompts.answers = ["Do not save"]
    qtbot.mouseClick(head.new, CLICK)
    assert bare.prompts.asked == ["Not saved"]
    assert touched(bare) == {}
    assert bare.steps["pose"].isVisible()
    assert head.specimen.text() == bare.workspace.document.state.specimen != "GP-7"


# A dry run


def test_clicks_on_bone_and_slices_touch(qtbot, window):
    window.workspace.atlas.use(ATLAS)
    to_step(qtbot, window, "pose")
    panel, workspace = window.steps["pose"], window.workspace
    assert not panel.touches.ways["scan"].isChecked()
    qtbot.mouseClick(panel.touches.ways["scan"], CLICK)
    assert workspace.interaction.tool == "touch"
    assert window.status.next_click.text() == "Click on bone or a slice where CL left is"
    scene = window.grid.scene_view
    x, y = scene.pixel_at(MIDDLE)
    qtbot.mouseClick(scene, CLICK, pos=QPoint(int(x), int(y)))
    first = np.array(touched(window)["CL"])
    assert np.linalg.norm(first - MIDDLE) == pytest.approx(BALL_MM, abs=0.2), "on the bone"
    axial = window.grid.slice_views[Plane.AXIAL]
    qtbot.mouseClick(axial, CLICK, pos=QPoint(axial.width() // 2, axial.height() // 2))
    assert set(touched(window)) == {"CL", "LLI"}
    assert {t.how for t in workspace.document.state.touches.values()} == {TouchHow.SCAN}
    assert workspace.document.state.landmarks == {}, "nothing was labelled"
    to_step(qtbot, window, "label")
    assert workspace.interaction.tool == "place", "a click labels again"
    to_step(qtbot, window, "pose")
    assert workspace.interaction.tool == "look", "a click that looks at the estimate moves no landmark"


def test_a_dry_run_ends_in_an_estimate_and_its_error(qtbot, window):
    workspace = window.workspace
    workspace.atlas.use(ATLAS)
    shift = MIDDLE - ANIMAL["CO"]
    for code in ("CA", "CB", "RWA", "RWP"):
        workspace.labels.place(ANIMAL[code] + shift, side=LEFT, code=code)
    to_step(qtbot, window, "pose")
    for code in PROBE:
        workspace.pose.record(ANIMAL[code] + shift, TouchHow.SCAN, name=code)
    panel = window.steps["pose"]
    mm, deg = workspace.pose.estimate.errors()
    assert panel.in_scan.facts["From the labels"].text() == f"CO {mm:.2f} mm, axis {deg:.1f}°"
    assert "in the scan" in panel.result.heading.text()
    assert not panel.in_scan.way.isVisible(), "nothing to register"
    panel.touches.table.edit_position("ZL")
    position = ANIMAL["ZL"] + shift
    assert panel.touches.model.record("ZL", " ".join(map(str, position)))
    assert workspace.document.state.touches[LEFT, "ZL"].frame == "scan", "typed beside touches of the scan"


# Commands


def test_keys_and_menu_do_what_the_panel_does(qtbot, window):
    workspace = window.workspace
    workspace.atlas.use(ATLAS)
    to_step(qtbot, window, "pose")
    window.grid.scene_view.setFocus()
    qtbot.keyClick(window, Qt.Key.Key_I)
    assert workspace.interaction.tool == "touch"
    qtbot.keyClick(window, Qt.Key.Key_N, Qt.KeyboardModifier.ShiftModifier)
    assert workspace.pose.target == ORDER[1]
    qtbot.keyClick(window, Qt.Key.Key_Q, Qt.KeyboardModifier.ShiftModifier)
    assert workspace.pose.side is Side.RIGHT
    qtbot.keyClick(window, Qt.Key.Key_Q, Qt.KeyboardModifier.ShiftModifier)
    qtbot.keyClick(window, Qt.Key.Key_Y)
    assert not workspace.pose.overlay.visible
    assert not window.commands.actions["pose.accept"].isEnabled()
    for code in PROBE:
        workspace.pose.record(ANIMAL[code] + MIDDLE, TouchHow.SCAN, name=code)
    window.commands.flush()
    for id in ("pose.accept", "pose.along_axis", "pose.through_window", "pose.clear"):
        assert window.commands.actions[id].isEnabled(), id
    scene = window.grid.scene_view.scene
    qtbot.keyClick(window, Qt.Key.Key_A)
    axis = workspace.pose.estimate.in_scan().axis
    eye = np.array(scene.camera.direction)
    assert abs(eye @ axis) == pytest.approx(1.0, abs=1e-6)
    window.steps["pose"].verdict.initials.setText("XY")
    window.commands.run("pose.reject")
    assert workspace.document.state.pose_checks[-1].by == "XY"
    window.commands.run("pose.clear")
    assert touched(window) == {}


def test_files_are_asked_for(qtbot, window, tmp_path):
    window.workspace.atlas.use(ATLAS)
    window.prompts.files = [touch_file(tmp_path)]
    assert window.commands.run("pose.open_touches")
    assert window.rail.step == "pose"
    assert set(touched(window)) == set(PROBE)
    skull = tmp_path / "skull.csv"
    skull.write_text("label,x,y,z\nS1,1,2,3\n")
    window.prompts.files = [skull]
    qtbot.mouseClick(window.steps["pose"].in_scan.file, CLICK)
    assert window.workspace.document.state.skull == {"S1": (1, 2, 3)}


def test_elsewhere_a_dropped_file_is_opened_as_ever(qtbot, window, tmp_path):
    to_step(qtbot, window, "label")
    drop_file(window, touch_file(tmp_path))
    wait_until_idle(qtbot, window)
    assert touched(window) == {}
