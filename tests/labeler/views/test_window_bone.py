"""Bone in the window: cut open, drawn behind what is shown, and holding on to points placed on it."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtCore import QPoint, QPointF, Qt
from qtpy.QtGui import QWheelEvent
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication
from window_cases import BALL_MM, MIDDLE, VOXEL_MM, wait_until_idle

from gp_core.landmarks.features import Side
from gp_labeler.document.state import How
from gp_labeler.models.view import CUTS
from gp_labeler.scene.planes import Plane
from gp_labeler.views.panels.scan.mesh_card import MeshCard

LEFT_BUTTON, NO_KEYS = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier


@pytest.fixture
def window(qtbot, one_window, ball):
    one_window.workspace.scan.begin(ball)
    one_window.activateWindow()
    wait_until_idle(qtbot, one_window)
    view = one_window.grid.scene_view
    view.view_from("A")
    view.reset()
    yield one_window
    one_window.workspace.view.update(cut=None, slices_visible=False)


def pixel(view, position) -> QPoint:
    return QPointF(*view.pixel_at(np.asarray(position))).toPoint()


def placed(window) -> np.ndarray | None:
    return window.workspace.document.landmarks(Side.LEFT).as_mapping().get("CA")


def drag(view, start: QPoint, end: QPoint, modifiers=NO_KEYS) -> None:
    """Press on a point, then hold keys, if any, and drag."""
    QTest.mousePress(view, LEFT_BUTTON, NO_KEYS, start)
    for part in (0.3, 0.7, 1.0):
        at = QPointF(start + (end - start) * part)
        event = _moved(view, at, modifiers)
        QApplication.sendEvent(view, event)
    QTest.mouseRelease(view, LEFT_BUTTON, modifiers, end)


def _moved(view, at: QPointF, modifiers):
    from qtpy.QtCore import QEvent
    from qtpy.QtGui import QMouseEvent

    return QMouseEvent(
        QEvent.Type.MouseMove, at, view.mapToGlobal(at), Qt.MouseButton.NoButton, LEFT_BUTTON, modifiers
    )


def colour_at(view, position) -> np.ndarray:
    colour = view.grab().toImage().pixelColor(pixel(view, position))
    return np.array([colour.red(), colour.green(), colour.blue()])


@pytest.mark.parametrize("id", [f"view.cut_{plane}" for plane in CUTS])
def test_the_nearer_half_goes_and_what_lies_inside_is_clicked(window, id) -> None:
    view, workspace = window.grid.scene_view, window.workspace
    letter = {"view.cut_axial": "S", "view.cut_sagittal": "L"}.get(id, "A")
    view.view_from(letter)
    into, up = view.scene.camera.direction, view.scene.camera.up
    workspace.view.set_crosshair(MIDDLE)
    whole = colour_at(view, MIDDLE + 4.5 * up)
    assert window.commands.run(id)
    cut_face = colour_at(view, MIDDLE + 4.5 * up)
    assert np.abs(cut_face - whole).max() > 30  # bone that is cut through looks otherwise than its surface
    QTest.mouseClick(view, LEFT_BUTTON, pos=pixel(view, MIDDLE + 4.5 * up))
    assert placed(window) is None  # and is not a surface
    QTest.mouseClick(view, LEFT_BUTTON, pos=pixel(view, MIDDLE))
    assert np.linalg.norm(placed(window) - (MIDDLE + 3.0 * into)) < VOXEL_MM  # the far wall of the hollow
    assert window.commands.run(id)  # once more leaves it whole
    assert workspace.view.state.cut is None
    assert np.abs(colour_at(view, MIDDLE + 4.5 * up) - whole).max() < 4


def test_a_cut_is_turned_moved_and_forgotten_with_the_specimen(qtbot, window, ball) -> None:
    view, workspace = window.grid.scene_view, window.workspace
    workspace.view.set_crosshair(MIDDLE)
    window.commands.run("view.cut_coronal")
    first = workspace.view.state.cut
    assert first.normal == (0, 1, 0)  # looking from the front, what lies behind stays
    window.commands.run("view.cut_flip")
    assert workspace.view.state.cut.normal == (0, -1, 0)
    scene = view.scene
    assert scene.pick(*scene.display_of(MIDDLE[None])[0]).point[1] == pytest.approx(MIDDLE[1] - 6, abs=0.1)
    window.commands.run("view.cut_flip")
    at = QPointF(pixel(view, MIDDLE))
    wheel = QWheelEvent(at, view.mapToGlobal(at), QPoint(), QPoint(240, 0), Qt.MouseButton.NoButton,
                        Qt.KeyboardModifier.AltModifier, Qt.ScrollPhase.NoScrollPhase, False)  # fmt: skip
    before = view.scene.camera.state()
    QApplication.sendEvent(view, wheel)
    assert workspace.view.state.cut.origin[1] == pytest.approx(MIDDLE[1] + 2 * VOXEL_MM)
    assert view.scene.camera.state() == before  # Alt+wheel moves the cut and zooms nothing
    window.commands.run("view.cut_here")
    assert workspace.view.state.cut == first
    window.commands.run("view.cut_deeper")
    assert workspace.view.state.cut.origin[1] == pytest.approx(MIDDLE[1] + 0.5)
    workspace.scan.begin(ball)
    wait_until_idle(qtbot, window)
    assert workspace.view.state.cut is None
    assert view.scene.bone.cut is None


def test_what_a_cut_lays_open_is_seen_no_more_through_bone(window) -> None:
    scene = window.grid.scene_view.scene
    inside, behind = MIDDLE + np.array([0.0, 0.5, 0]), MIDDLE + np.array([0, 5.0, 0])
    assert scene.hidden([inside, behind]).tolist() == [True, True]
    window.workspace.view.set_crosshair(MIDDLE)
    window.commands.run("view.cut_coronal")
    assert scene.hidden([inside, behind]).tolist() == [False, True]


def test_the_mesh_card_cuts_and_shows_the_cut(window) -> None:
    card = window.findChild(MeshCard)
    assert not any(button.isChecked() for button in card.cut.planes.values())
    card.cut.planes["axial"].click()
    assert window.workspace.view.state.cut.plane == "axial"
    assert card.cut.planes["axial"].isChecked()
    assert "axial" in card.cut.where.text()
    card.cut.flip.click()
    card.cut.planes["sagittal"].click()
    assert [p for p, button in card.cut.planes.items() if button.isChecked()] == ["sagittal"]
    card.cut.planes["sagittal"].click()
    assert window.workspace.view.state.cut is None
    card.checks["slices_visible"].click()
    assert window.workspace.view.state.slices_visible


def test_a_click_on_a_slice_in_3d_places_on_it_and_slices_hide_bone(window) -> None:
    view, workspace = window.grid.scene_view, window.workspace
    view.scene.camera.rotate(100, 60)
    workspace.view.set_crosshair(MIDDLE - np.array([0, 7.0, 0]))  # before the ball
    window.commands.run("view.slices_visible")
    view.grab()
    assert len(view.scene.slices.images) == 3
    on_slice = MIDDLE + np.array([4.0, -7.0, 4.0])
    x, y = view.scene.display_of(on_slice[None])[0]
    coronal = view.scene.slices.images[2].position
    assert abs(coronal - on_slice[1]) < VOXEL_MM
    assert view.scene.pick(x, y) is None
    point = view.scene.pick_slice(x, y)
    assert point is not None
    assert min(abs(p.plane.position_of(point) - p.position) for p in view.scene.slices.images) < 1e-6
    window.commands.run("view.slices_visible")
    view.grab()
    assert view.scene.slices.images == ()


def test_a_click_draws_no_bone_and_a_turn_draws_it_finely_once_it_rests(qtbot, window) -> None:
    view = window.grid.scene_view
    view.grab()
    scene = view.scene
    drawn = scene.n_bone_frames
    for x in (0.0, 1.5, -1.5):
        QTest.mouseClick(view, LEFT_BUTTON, pos=pixel(view, MIDDLE + np.array([x, -5.5, 0.3])))
        qtbot.waitUntil(lambda: not view.is_stale)
    assert len(scene.marks.marks) == 3
    assert view.grab() is not None
    assert scene.n_bone_frames == drawn
    scene.bone.show(scene.bone.surfaces, quick=scene.bone.surfaces)  # as with a mesh so large as to need one
    view.redraw()
    qtbot.waitUntil(lambda: scene.is_fine)
    fine = []
    view.frame_drawn.connect(lambda: fine.append(scene.is_fine))
    QTest.keyClick(view, Qt.Key.Key_Left)
    qtbot.waitUntil(lambda: len(fine) > 1 and fine[-1])
    assert not fine[0], "the preview mesh first"
    QTest.keyClick(view, Qt.Key.Key_Left)
    view.grab()  # a picture is finished, however little time there was
    assert scene.is_fine


@pytest.mark.parametrize("plane", list(Plane))
def test_a_point_placed_on_bone_stays_on_it_when_dragged_on_a_slice(window, plane) -> None:
    view, document, labels = (
        window.grid.slice_views[plane],
        window.workspace.document,
        window.workspace.labels,
    )
    plane = plane.in_scan
    away = 0.6 * BALL_MM * plane.right + 0.8 * BALL_MM * plane.down
    start = MIDDLE + away
    labels.place(start, How.MESH, side=Side.LEFT, code="CA")
    window.workspace.view.set_crosshair(start)
    beside = MIDDLE + 1.15 * BALL_MM * plane.right - 0.2 * plane.down
    drag(view, pixel(view, start), pixel(view, beside))
    there = placed(window)
    assert abs(np.linalg.norm(there - MIDDLE) - BALL_MM) < VOXEL_MM / 4
    assert (there - MIDDLE) @ plane.right > 0.98 * BALL_MM
    assert abs((there - start) @ plane.normal) <= VOXEL_MM / 2 + 1e-9
    assert document.state.landmark(Side.LEFT, "CA").provenance.how is How.MESH
    document.undo()
    np.testing.assert_array_equal(placed(window), start)  # one edit
    drag(view, pixel(view, start), pixel(view, MIDDLE + 0.1 * plane.right))  # into the hollow: on its wall
    assert np.linalg.norm(placed(window) - MIDDLE) == pytest.approx(3.0, abs=VOXEL_MM / 2)


@pytest.mark.parametrize("key", [Qt.KeyboardModifier.AltModifier, Qt.KeyboardModifier.ShiftModifier])
def test_alt_or_shift_lets_a_dragged_point_leave_the_bone(window, key) -> None:
    view, document, labels = (
        window.grid.slice_views[Plane.AXIAL],
        window.workspace.document,
        window.workspace.labels,
    )
    start, free = MIDDLE + np.array([0, BALL_MM, 0]), MIDDLE + np.array([4.5, 0.5, 0])
    labels.place(start, How.MESH, side=Side.LEFT, code="CA")
    window.workspace.view.set_crosshair(start)
    drag(view, pixel(view, start), pixel(view, free), key)
    assert np.abs(placed(window) - free)[:2].max() < VOXEL_MM
    assert document.state.landmark(Side.LEFT, "CA").provenance.how is How.SLICE
