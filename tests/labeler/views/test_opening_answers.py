"""While a scan is opened the window answers: what takes long is done before, later, or bit by bit."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtWidgets import QApplication
from window_cases import MIDDLE, wait_until_idle

from gp_core.landmarks.features import Side
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.mesh import QUICK_TRIANGLES, MeshFirst
from gp_labeler.jobs.runner import Progress
from gp_labeler.scene.planes import Plane


def test_the_first_3d_frame_is_drawn_in_an_event_of_its_own(qtbot, make_window, ball) -> None:
    window = make_window()
    view, drawn = window.grid.scene_view, []
    view.frame_drawn.connect(lambda: drawn.append(view.is_stale))
    window.workspace.scan.begin(ball)
    view.repaint()
    assert view.is_stale
    assert not drawn
    assert not view.is_up_to_date
    wait_until_idle(qtbot, window)
    assert drawn
    assert view.is_up_to_date


def test_opengl_is_ready_before_anything_is_opened(qtbot, make_window) -> None:
    window = make_window()
    scene = window.grid.scene_view.scene
    qtbot.waitUntil(lambda: scene.n_bone_frames == 1)
    assert window.pages.currentWidget() is window.welcome


def test_a_picture_of_a_view_that_was_never_drawn_shows_the_scene(make_window, ball) -> None:
    window = make_window()
    window.workspace.scan.begin(ball)
    view = window.grid.scene_view
    picture = view.grab().toImage()
    assert not view.is_stale
    QApplication.processEvents()
    colours = {
        picture.pixel(x, y) for x in range(0, picture.width(), 7) for y in range(0, picture.height(), 7)
    }
    assert len(colours) > 20


@pytest.mark.parametrize("n", [24, 72])
def test_a_first_look_of_many_triangles_has_few_to_turn(n) -> None:
    noise = np.random.default_rng(0).normal(0, 1, (n, n, n)).astype(np.float32)
    volume = Volume.from_parts(noise, (0.3,) * 3, (0, 0, 0), name="noise")
    meshes = MeshFirst(volume, 0.5, 0.0).run(Progress(lambda *_: None))
    n_fine, n_quick = (sum(each.n_triangles for each in some) for some in (meshes.parts, meshes.quick))
    assert (n_fine > QUICK_TRIANGLES) is (n == 72)
    assert n_quick <= QUICK_TRIANGLES
    assert (n_quick > 0) is (n == 72)


def test_a_drag_of_the_grey_window_paints_slices_again_and_asks_for_nothing_else(qtbot, window) -> None:
    workspace, view = window.workspace, window.grid.slice_views[Plane.AXIAL]
    workspace.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    wait_until_idle(qtbot, window)
    points, before, refreshed = view.slice_painter.points, view.grab().toImage(), []
    window.commands.refresh = lambda: refreshed.append(True)
    workspace.view.update(level=1200.0, width=300.0)
    window.commands.flush()
    qtbot.waitUntil(lambda: view.is_up_to_date)
    assert view.grab().toImage() != before
    assert view.slice_painter.points is points
    assert not refreshed
    workspace.view.update(glyph_mm=2.0)
    qtbot.waitUntil(lambda: view.is_up_to_date)
    assert view.slice_painter.points is not points
