"""Meshes of other programs: from the menu, Python and a script, over the scan that they were added to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from qtpy.QtGui import QImage
from window_cases import BALL_MM, MIDDLE, image_bytes, wait_until_idle

from gp_core.errors import GpError
from gp_labeler.imaging.surface_files import write_mesh
from gp_labeler.scripting.step import make_step
from gp_labeler.scripting.steps import STEPS
from gp_labeler.views.recorder import Recorder


@pytest.fixture
def window(qtbot, one_window, ball):
    one_window.workspace.view.update(layout="3d")
    one_window.workspace.scan.begin(ball)
    wait_until_idle(qtbot, one_window)
    yield one_window
    one_window.workspace.meshes.clear()


@pytest.fixture
def file(tmp_path) -> Path:
    path = tmp_path / "implant.stl"
    write_mesh(pv.Sphere(radius=1.5, center=MIDDLE - [BALL_MM, 0, 0]), path)
    return path


def _pixels(window) -> np.ndarray:
    image = window.grid.scene_view.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    return image_bytes(image).reshape(image.height(), image.width(), 4)[..., :3].astype(int)


def test_the_menu_adds_it_and_takes_it_away(qtbot, window, file) -> None:
    before, actions = _pixels(window), window.commands.actions
    assert not actions["file.remove_meshes"].isEnabled()
    window.prompts.files = [file]
    assert window.commands.run("file.add_mesh")
    wait_until_idle(qtbot, window)
    assert [mesh.name for mesh in window.workspace.meshes.meshes] == ["implant"]
    assert 500 < (_pixels(window) != before).any(axis=-1).sum() < before.size / 9
    assert window.commands.run("file.remove_meshes")
    wait_until_idle(qtbot, window)
    np.testing.assert_array_equal(_pixels(window), before)


def test_python_adds_any_dataset(qtbot, window) -> None:
    meshes = window.workspace.meshes
    names = [meshes.add(pv.Cube(center=MIDDLE), color="red", opacity=0.5) for _ in range(2)]
    assert names == ["mesh", "mesh 2"]
    with pytest.raises(GpError, match="the mesh cannot be drawn"):
        meshes.add(pv.Cube(), colour="red")
    with pytest.raises(GpError, match=r"no mesh is called 'bone'.*mesh, mesh 2"):
        meshes.remove("bone")
    meshes.remove("mesh")
    assert window.grid.scene_view.scene.added.names == ("mesh 2",)


def test_another_scan_takes_them_away(qtbot, window, file, ball) -> None:
    window.workspace.meshes.add(file)
    window.workspace.scan.begin(ball)
    wait_until_idle(qtbot, window)
    assert window.workspace.meshes.meshes == ()
    assert window.grid.scene_view.scene.added.names == ()


def test_a_damaged_file_is_told_and_nothing_is_shown(qtbot, window, file) -> None:
    file.write_bytes(file.read_bytes()[:-7])
    told = []
    window.workspace.messages.said.connect(lambda text, kind: told.append((text, kind)))
    window.prompts.files = [file]
    window.commands.run("file.add_mesh")
    wait_until_idle(qtbot, window)
    assert [(kind, "implant.stl" in text, "cut off" in text) for text, kind in told] == [
        ("error", True, True)
    ]
    assert window.workspace.meshes.meshes == ()


def test_what_is_added_is_recorded_as_steps(qtbot, window, file) -> None:
    recorder = Recorder(window)
    recorder.tables.clear()
    window.workspace.meshes.add(file, color="red")
    window.workspace.meshes.clear()
    assert recorder.tables == [
        {"do": "add_mesh", "file": str(file), "name": "implant", "options": {"color": "red"}},
        {"do": "remove_mesh", "name": "implant"},
    ]
    assert [make_step(STEPS, table).do for table in recorder.tables] == ["add_mesh", "remove_mesh"]
    recorder.deleteLater()
