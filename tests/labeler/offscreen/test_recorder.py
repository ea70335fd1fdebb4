"""What a person does in the window becomes a script that does it again."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from script_cases import content, write_ball
from window_cases import BALL_MM, MIDDLE, VOXEL_MM, settle

from gp_core.landmarks.features import Side
from gp_labeler.offscreen.runner import run_script
from gp_labeler.offscreen.script import read_script
from gp_labeler.scene.planes import Plane
from gp_labeler.views.recorder import Recorder, script_text
from gp_labeler.workbench import Workbench

INSIDE = MIDDLE + np.array([2.1, -1.7, 0.125])
ON_BONE = MIDDLE + np.array([0.0, -BALL_MM, 0.0])


def click(view, position) -> None:
    x, y = view.pixel_at(position)
    QTest.mouseClick(view, Qt.MouseButton.LeftButton, pos=QPoint(int(x), int(y)))


def work(qtbot, window) -> None:
    """Do a little of everything."""
    desk, scene = window.workbench, window.grid.scene_view
    axial = window.grid.slice_views[Plane.AXIAL]
    scene.view_from("A")
    desk.session.set_crosshair(INSIDE)
    axial.setFocus()
    click(axial, INSIDE)  # CA
    for _ in range(3):
        QTest.keyClick(axial, Qt.Key.Key_Left)
    click(scene, ON_BONE)  # RWP
    desk.go_to(Side.LEFT, "CB")
    window.commands.run("point.unseen")
    desk.go_to(Side.LEFT, "CA")
    window.commands.run("point.lock")
    click(scene, ON_BONE + np.array([1.0, 0.2, 1.0]))  # CA is locked: nothing
    desk.go_to(Side.RIGHT, "OS")
    click(scene, ON_BONE + np.array([1.0, 0.1, 1.0]))
    window.commands.actions["edit.undo"].trigger()
    window.commands.actions["view.3d"].trigger()
    settle(qtbot, window)


@pytest.mark.parametrize("name", ["script.toml", "script.json"])
def test_a_recorded_script_does_it_again(qtbot, make_window, tmp_path, name) -> None:
    if name.endswith("toml"):
        pytest.importorskip("tomllib", reason="TOML needs Python 3.11")
    window = make_window()
    window.workbench.open_scan(write_ball(tmp_path / "ball.nrrd"))
    settle(qtbot, window)
    window.commands.run("help.record")
    work(qtbot, window)
    window.workbench.session.save(tmp_path / "ball.gpspecimen.json")
    window.ui.prompts.files = [tmp_path / name]
    window.commands.run("help.record")
    assert window.findChild(Recorder) is None

    script = read_script(tmp_path / name)
    does = [step.do for step in script.steps]
    assert does[0] == "open"
    assert [do for do in does if do in ("place", "drag", "undo", "save")] == [
        *("place", "drag", "place", "place", "undo", "save")
    ]
    report = run_script(script, tmp_path / "out")
    assert report.ok, report.error
    first, again = (
        content(folder / "ball.gpspecimen.json")["landmarks"] for folder in (tmp_path, tmp_path / "out")
    )
    assert first.keys() == again.keys() == {"L"}
    assert first["L"].keys() == again["L"].keys() == {"CA", "CB", "RWP"}
    for code in ("CA", "RWP"):
        off = np.subtract(first["L"][code]["position"], again["L"][code]["position"])
        assert np.linalg.norm(off) < VOXEL_MM
    assert again["L"]["CB"]["unseen"]
    assert again["L"]["CA"]["locked"]


def test_the_text_is_toml(tmp_path) -> None:
    toml = pytest.importorskip("tomllib")
    tables = [{"do": "open", "path": 'C:\\scans\\"a".nrrd', "spacing": [0.1, 0.1, 0.2]}, {"do": "undo"}]
    assert toml.loads(script_text(tables)) == {"step": tables}


def test_a_recorder_lets_go_of_its_window(make_window) -> None:
    window = make_window()
    recorder = Recorder(window)
    desk: Workbench = window.workbench
    listening = len(desk.saved)
    recorder.deleteLater()
    from PySide6.QtCore import QCoreApplication, QEvent

    QCoreApplication.sendPostedEvents(recorder, QEvent.Type.DeferredDelete)
    assert len(desk.saved) == listening - 1
