"""Labelling by real mouse and key events, on a ball whose surface is known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from document_cases import head_frame
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest
from window_cases import BALL_MM, MIDDLE, VOXEL_MM, on_ball, one_turn, wait_until_idle

from gp_core.landmarks.features import Side
from gp_labeler.document.head_edits import SetHeadFrame
from gp_labeler.document.state import How
from gp_labeler.models.workflow import Active
from gp_labeler.scene.planes import Plane

THREE_LEFT = np.array([3, 0, 0])
LEFT_BUTTON = Qt.MouseButton.LeftButton


def pixel(view, position) -> QPoint:
    x, y = view.pixel_at(position)
    return QPoint(int(x), int(y))


def drag(view, start: QPoint, end: QPoint, button=LEFT_BUTTON, modifiers=Qt.KeyboardModifier.NoModifier):
    QTest.mousePress(view, button, modifiers, start)
    for part in (0.2, 0.6, 1.0):
        QTest.mouseMove(view, start + (end - start) * part)
    QTest.mouseRelease(view, button, modifiers, end)


@pytest.fixture
def window(qtbot, one_window, ball):
    one_window.workspace.interaction.set_tool("place")
    one_window.workspace.view.update(layout="four-up")
    one_window.workspace.scan.begin(ball)
    one_window.activateWindow()
    wait_until_idle(qtbot, one_window)
    return one_window


@pytest.fixture
def scene(window):
    view = window.grid.scene_view
    view.view_from("A")
    return view


def placed(window, code="CA", side=Side.LEFT):
    landmarks = window.workspace.document.landmarks(side)
    return landmarks.as_mapping().get(code)


def test_a_click_where_a_landmark_is_seen_places_it_there(window, scene) -> None:
    for code, direction in (("CA", (0, -1, 0)), ("RWP", (0.5, -1, 0.3)), ("OS", (-0.4, -1, -0.5))):
        assert window.workspace.labels.active.code == code
        known = on_ball(*direction)
        QTest.mouseClick(scene, LEFT_BUTTON, pos=pixel(scene, known))
        assert np.linalg.norm(placed(window, code) - known) < VOXEL_MM
    assert window.workspace.document.state.landmark(Side.LEFT, "CA").provenance.how is How.MESH


@pytest.mark.parametrize("plane", list(Plane))
def test_a_click_on_a_slice_places_on_it(window, plane) -> None:
    view = window.grid.slice_views[plane]
    known = MIDDLE + np.array([2.1, -1.7, 1.3])
    window.workspace.view.set_crosshair(known)
    QTest.mouseClick(view, LEFT_BUTTON, pos=pixel(view, known))
    assert np.abs(placed(window) - known).max() < VOXEL_MM
    assert window.workspace.document.state.landmark(Side.LEFT, "CA").provenance.how is How.SLICE


def test_a_warning_of_the_wrong_side_is_read_though_the_next_feature_is_asked_for(window) -> None:
    view, says = window.grid.slice_views[Plane.AXIAL], window.status.next_click
    window.workspace.view.set_crosshair(MIDDLE)
    window.workspace.document.do(SetHeadFrame(head_frame((0, 0, 0), MIDDLE)))
    one_turn()
    QTest.mouseClick(view, LEFT_BUTTON, pos=pixel(view, MIDDLE - THREE_LEFT))
    assert window.workspace.labels.active.code != "CA"
    assert "on the right of the mid-plane" in says.text()
    one_turn()
    assert "on the right of the mid-plane" in says.text()
    QTest.mouseClick(view, LEFT_BUTTON, pos=pixel(view, MIDDLE + THREE_LEFT))
    one_turn()
    assert says.text().startswith("Click on bone or a slice to place")


def test_left_is_on_the_right_of_the_screen(window) -> None:
    for plane in (Plane.AXIAL, Plane.CORONAL):
        view = window.grid.slice_views[plane]
        assert view.pixel_at(MIDDLE + THREE_LEFT)[0] > view.pixel_at(MIDDLE)[0]
    sagittal = window.grid.slice_views[Plane.SAGITTAL]
    assert (
        sagittal.pixel_at(MIDDLE - np.array([0, 3, 0]))[0] < sagittal.pixel_at(MIDDLE)[0]
    )  # the nose to the left


def test_a_drag_rotates_and_places_nothing(window, scene) -> None:
    before = scene.scene.camera.direction
    middle = pixel(scene, MIDDLE)
    drag(scene, middle, middle + QPoint(60, 20))
    assert placed(window) is None
    assert np.degrees(np.arccos(before @ scene.scene.camera.direction)) > 5


def test_a_trembling_hand_clicks(window, scene) -> None:
    before = scene.scene.camera.direction
    middle = pixel(scene, MIDDLE)
    drag(scene, middle, middle + QPoint(2, 1))
    assert placed(window) is not None
    np.testing.assert_allclose(scene.scene.camera.direction, before)


def test_a_miss_places_nothing(window, scene) -> None:
    QTest.mouseClick(scene, LEFT_BUTTON, pos=QPoint(4, 4))
    axial = window.grid.slice_views[Plane.AXIAL]
    QTest.mouseClick(axial, LEFT_BUTTON, pos=QPoint(2, 2))  # beside the scan
    assert placed(window) is None
    assert window.workspace.document.undo_text is None
    assert window.status.next_click.text() == "Click on bone or a slice to place CA left"  # and nobody scolds


def test_shift_drag_pans_and_right_drag_zooms(window, scene) -> None:
    before = np.array(scene.pixel_at(MIDDLE))
    start = pixel(scene, MIDDLE)
    drag(scene, start, start + QPoint(30, 10), modifiers=Qt.KeyboardModifier.ShiftModifier)
    np.testing.assert_allclose(np.array(scene.pixel_at(MIDDLE)) - before, [30, 10], atol=1.5)
    wide = scene.pixel_at(MIDDLE + THREE_LEFT)[0] - scene.pixel_at(MIDDLE)[0]
    drag(scene, start, start - QPoint(0, 60), button=Qt.MouseButton.RightButton)
    assert scene.pixel_at(MIDDLE + THREE_LEFT)[0] - scene.pixel_at(MIDDLE)[0] > 1.2 * wide
    assert placed(window) is None


def test_undo_and_redo_by_keys(qtbot, window, scene) -> None:
    QTest.mouseClick(scene, LEFT_BUTTON, pos=pixel(scene, on_ball(0, -1, 0)))
    where = placed(window)
    scene.setFocus()
    QTest.keyClick(scene, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert placed(window) is None
    assert window.workspace.labels.active == Active(Side.LEFT, "CA")
    QTest.keyClick(scene, Qt.Key.Key_Y, Qt.KeyboardModifier.ControlModifier)
    np.testing.assert_array_equal(placed(window), where)


def test_a_dragged_point_stays_on_the_bone_and_is_one_edit(window, scene) -> None:
    start, end = on_ball(0, -1, 0), on_ball(0.6, -1, 0.3)
    QTest.mouseClick(scene, LEFT_BUTTON, pos=pixel(scene, start))
    before = scene.scene.camera.direction
    drag(scene, pixel(scene, start), pixel(scene, end))
    assert np.linalg.norm(placed(window) - end) < VOXEL_MM
    assert abs(np.linalg.norm(placed(window) - MIDDLE) - BALL_MM) < VOXEL_MM / 4
    np.testing.assert_array_equal(scene.scene.camera.direction, before)
    window.workspace.document.undo()
    assert np.linalg.norm(placed(window) - start) < VOXEL_MM


def test_a_point_dragged_past_the_edge_stops_there(window, scene) -> None:
    start = on_ball(0, -1, 0)
    QTest.mouseClick(scene, LEFT_BUTTON, pos=pixel(scene, start))
    drag(scene, pixel(scene, start), QPoint(3, 3))
    assert abs(np.linalg.norm(placed(window) - MIDDLE) - BALL_MM) < VOXEL_MM / 4


def test_escape_lets_a_dragged_point_go_back(window, scene) -> None:
    start = on_ball(0, -1, 0)
    QTest.mouseClick(scene, LEFT_BUTTON, pos=pixel(scene, start))
    before = placed(window)
    where = pixel(scene, start)
    QTest.mousePress(scene, LEFT_BUTTON, pos=where)
    QTest.mouseMove(scene, where + QPoint(30, 0))
    assert window.workspace.interaction.drag is not None
    QTest.keyClick(scene, Qt.Key.Key_Escape)
    QTest.mouseRelease(scene, LEFT_BUTTON, pos=where + QPoint(30, 0))
    np.testing.assert_array_equal(placed(window), before)
    np.testing.assert_array_equal(window.workspace.view.crosshair, before)


def test_a_point_dragged_on_a_slice_keeps_its_depth(window) -> None:
    view, labels = window.grid.slice_views[Plane.AXIAL], window.workspace.labels
    start = MIDDLE + np.array([1.0, 1.0, 0.1])
    labels.place(start, How.SLICE, side=Side.LEFT, code="CA")
    window.workspace.view.set_crosshair(MIDDLE)
    to = MIDDLE + np.array([3.0, -1.0, 0.1])
    drag(view, pixel(view, start), pixel(view, to))
    assert np.abs(placed(window) - to).max() < VOXEL_MM
    assert placed(window)[2] == pytest.approx(start[2])


def test_locked_points_cannot_be_dragged(window, scene) -> None:
    start = on_ball(0, -1, 0)
    window.workspace.labels.place(start, side=Side.LEFT, code="CA")
    window.workspace.labels.lock(side=Side.LEFT, code="CA")
    drag(scene, pixel(scene, start), pixel(scene, on_ball(0.6, -1, 0.3)))
    np.testing.assert_array_equal(placed(window), start)


def test_arrow_keys_nudge_a_voxel_at_a_time(window) -> None:
    view, document, labels = (
        window.grid.slice_views[Plane.CORONAL],
        window.workspace.document,
        window.workspace.labels,
    )
    labels.place(MIDDLE, How.SLICE, side=Side.LEFT, code="CA")
    view.setFocus()
    for key in (Qt.Key.Key_Right, Qt.Key.Key_Right, Qt.Key.Key_Up):
        QTest.keyClick(view, key)
    np.testing.assert_allclose(placed(window) - MIDDLE, [2 * VOXEL_MM, 0, VOXEL_MM], atol=1e-9)
    document.undo()
    np.testing.assert_allclose(placed(window), MIDDLE)  # nudges in a row are one edit


def test_arrow_keys_move_the_crosshair_where_nothing_is_placed(window) -> None:
    view = window.grid.slice_views[Plane.AXIAL]
    window.workspace.view.set_crosshair(MIDDLE)
    view.setFocus()
    QTest.keyClick(view, Qt.Key.Key_Left)
    np.testing.assert_allclose(window.workspace.view.crosshair - MIDDLE, [-VOXEL_MM, 0, 0], atol=1e-9)


def test_a_double_click_maximises_and_takes_its_point_back(window, scene) -> None:
    where = pixel(scene, on_ball(0, -1, 0))
    QTest.mouseClick(scene, LEFT_BUTTON, pos=where)
    QTest.mouseDClick(scene, LEFT_BUTTON, pos=where)
    assert window.workspace.view.state.layout == "3d"
    assert placed(window) is None
    assert not window.grid.frames["axial"].isVisible()
    QTest.mouseDClick(window.grid.frames["3d"].header, LEFT_BUTTON)
    assert window.workspace.view.state.layout == "four-up"
    assert window.grid.frames["axial"].isVisible()


def test_a_click_on_a_point_chooses_it_once_nothing_waits_to_be_placed_there(window, scene) -> None:
    labels = window.workspace.labels
    labels.place(on_ball(0, -1, 0), side=Side.LEFT, code="CA")
    labels.place(on_ball(0.7, -1, 0), side=Side.LEFT, code="CB")
    window.workspace.labels.go_to(Side.LEFT, "CB")
    QTest.mouseClick(scene, LEFT_BUTTON, pos=pixel(scene, on_ball(0, -1, 0)))
    assert labels.active == Active(Side.LEFT, "CA")


def test_letters_do_what_the_sheet_says(window, scene) -> None:
    mesh, document, labels = (
        window.workspace.bone.surfaces,
        window.workspace.document,
        window.workspace.labels,
    )
    scene.setFocus()
    for key in (Qt.Key.Key_W, Qt.Key.Key_J, Qt.Key.Key_E):  # VTK's own letters change nothing in 3D
        QTest.keyClick(scene, key)
    assert window.workspace.interaction.tool == "grey"
    assert window.workspace.bone.surfaces is mesh
    QTest.keyClick(scene, Qt.Key.Key_P)
    assert window.workspace.interaction.tool == "place"
    QTest.keyClick(scene, Qt.Key.Key_X)
    assert "CA" in document.landmarks(Side.LEFT).unseen
    before = labels.active
    QTest.keyClick(scene, Qt.Key.Key_N)
    assert labels.active != before
    QTest.keyClick(scene, Qt.Key.Key_Z)
    assert window.workspace.view.state.layout == "axial"
    QTest.keyClick(window.grid.slice_views[Plane.AXIAL], Qt.Key.Key_V)
    assert window.workspace.view.state.layout == "four-up"


def test_enter_suggests_the_ghost(qtbot, window) -> None:
    window.workspace.atlas.load()
    wait_until_idle(qtbot, window)
    scene, document, labels = window.grid.scene_view, window.workspace.document, window.workspace.labels
    from gp_core.atlas.atlas import Atlas

    atlas = Atlas.published()
    for code in ("CA", "RWP", "OS"):
        where = atlas.mean[atlas.codes.index(code)] + MIDDLE
        labels.place(where, side=Side.LEFT, code=code)
    code = labels.active.code
    ghost = labels.ghosts(Side.LEFT)[code].position
    np.testing.assert_allclose(window.workspace.view.crosshair, ghost)  # the views went there
    scene.setFocus()
    QTest.keyClick(scene, Qt.Key.Key_Return)
    assert placed(window, code) is None  # nobody has looked at it
    np.testing.assert_allclose(document.landmarks(Side.LEFT).suggested[code].position, ghost)
    code = labels.active.code
    table = window.steps["label"].table.view
    table.setFocus()
    QTest.keyClick(table, Qt.Key.Key_Return)
    assert code in document.landmarks(Side.LEFT).suggested


def test_the_wheel_scrolls_slices_that_are_linked(qtbot, window) -> None:
    from qtpy.QtCore import QPointF
    from qtpy.QtGui import QWheelEvent
    from qtpy.QtWidgets import QApplication

    view = window.grid.slice_views[Plane.AXIAL]
    window.workspace.view.set_crosshair(MIDDLE)
    before = window.workspace.view.crosshair
    event = QWheelEvent(
        QPointF(50, 50),
        QPointF(50, 50),
        QPoint(),
        QPoint(0, 120),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(view, event)
    assert window.workspace.view.crosshair[2] - before[2] == pytest.approx(VOXEL_MM, abs=0.6 * VOXEL_MM)
    coronal = window.grid.slice_views[Plane.CORONAL]
    assert coronal.pixel_at(window.workspace.view.crosshair)[1] < coronal.pixel_at(before)[1]


def test_contrast_tool_changes_window_and_level_and_places_nothing(window) -> None:
    view = window.grid.slice_views[Plane.AXIAL]
    window.workspace.interaction.set_tool("grey")
    before = view.window_level()
    middle = pixel(view, MIDDLE)
    drag(view, middle, middle + QPoint(40, 30))
    after = view.window_level()
    assert after.width > before.width
    assert after.level < before.level
    assert placed(window) is None


def test_crosshair_tool_and_shift_move_the_crosshair(window, scene) -> None:
    view = window.grid.slice_views[Plane.AXIAL]
    window.workspace.view.set_crosshair(MIDDLE)
    window.workspace.interaction.set_tool("look")
    there = MIDDLE + np.array([2.0, 1.0, 0.0])
    QTest.mousePress(view, LEFT_BUTTON, pos=pixel(view, there))
    QTest.mouseRelease(view, LEFT_BUTTON, pos=pixel(view, there))
    assert np.abs(window.workspace.view.crosshair - there).max() < VOXEL_MM
    assert placed(window) is None
    QTest.mouseClick(scene, LEFT_BUTTON, pos=pixel(scene, on_ball(0.2, -1, 0)))
    assert np.linalg.norm(window.workspace.view.crosshair - on_ball(0.2, -1, 0)) < VOXEL_MM
    assert placed(window) is None


def test_hovering_tells_position_voxel_and_value(window) -> None:
    view = window.grid.slice_views[Plane.AXIAL]
    there = MIDDLE + np.array([4.0, 1.0, 0.0])
    window.workspace.view.set_crosshair(there)
    QTest.mouseMove(view, pixel(view, there))
    assert "voxel" in window.status.where.text()
    assert window.status.where.text().endswith("1400")
    QTest.mouseMove(view, QPoint(1, 1))
    assert window.status.where.text().endswith("outside the scan")


def test_a_resting_pointer_tells_what_comes_to_lie_under_it(window, scene, qtbot) -> None:
    told = window.status.where
    view = window.grid.slice_views[Plane.AXIAL]
    window.workspace.view.set_crosshair(MIDDLE)
    QTest.mouseMove(view, pixel(view, MIDDLE + np.array([4.0, 1.0, 0.0])))
    before = told.text()
    assert before.endswith("1400")
    window.workspace.view.set_crosshair(MIDDLE + np.array([0.0, 0.0, 5.5]))
    assert told.text() != before
    assert told.text().endswith("600"), "beside the ball"
    view.zoom_to(MIDDLE + np.array([0.0, 0.0, 5.5]), 0.5)
    assert told.text().endswith("1400"), "in the bone of the middle"
    QTest.mouseMove(scene, pixel(scene, on_ball(0.3, -1, 0.2)))
    before = told.text()
    scene.view_from("L")
    qtbot.waitUntil(lambda: not scene.is_stale)
    assert told.text() not in (before, ""), "it is on another part of the ball now"
    scene.zoom_to(MIDDLE + np.array([0.0, 40.0, 0.0]), 10)
    qtbot.waitUntil(lambda: not scene.is_stale)
    assert told.text() == "", "and here on none"


def test_a_table_row_brings_the_point_into_view(window, scene) -> None:
    labels = window.workspace.labels
    where = on_ball(1, 0.2, 0.4)
    labels.place(where, side=Side.RIGHT, code="FPA")
    window.workspace.view.set_crosshair(MIDDLE)
    view = window.grid.slice_views[Plane.CORONAL]
    view.shown = view.shown.zoomed(6)
    table = window.steps["label"].table
    rows = (table.model.index(row, 2) for row in range(20))
    row = next(index for index in rows if table.target_of(index)[1] == "FPA")
    QTest.mouseClick(table.view.viewport(), LEFT_BUTTON, pos=table.view.visualRect(row).center())
    assert labels.active == Active(Side.RIGHT, "FPA")
    np.testing.assert_allclose(window.workspace.view.crosshair, where)
    x, y = view.pixel_at(where)
    assert 0 < x < view.width()
    assert 0 < y < view.height()
    x, y = scene.pixel_at(where)
    assert 0 < x < scene.width()
    assert 0 < y < scene.height()


def test_a_right_click_on_a_point_offers_its_menu(window, scene) -> None:
    from qtpy.QtWidgets import QApplication, QMenu

    where = on_ball(0, -1, 0)
    window.workspace.labels.place(where, side=Side.LEFT, code="CA")
    for view in (scene, window.grid.slice_views[Plane.CORONAL]):
        window.workspace.view.set_crosshair(where)
        QTest.mouseClick(view, Qt.MouseButton.RightButton, pos=pixel(view, where))
        menu = QApplication.activePopupWidget()
        assert isinstance(menu, QMenu)
        assert any("Lock" in action.text() for action in menu.actions())
        menu.close()


def test_points_can_grow_with_the_zoom(window) -> None:
    window.commands.run("view.glyph_mm")
    assert window.grid.scene_view.scene.marks.size.unit == "mm"
    window.commands.run("view.glyph_mm")
    assert window.grid.scene_view.scene.marks.size.unit == "px"


def test_looking_closely_brings_the_point_near_in_every_view(window, scene) -> None:
    where = on_ball(0.3, -1, 0.2)
    window.workspace.labels.place(where, side=Side.LEFT, code="CA")
    window.workspace.labels.go_to(Side.LEFT, "CA")
    window.commands.run("view.zoom_to_point")
    for view in window.grid.views:
        x, y = view.pixel_at(where)
        assert abs(x - view.width() / 2) < 3
        assert abs(y - view.height() / 2) < 3


def test_the_slider_goes_through_the_slices(window) -> None:
    from gp_labeler.views.slice_slider import SliceSlider

    frame = window.grid.frames["axial"]
    slider = frame.header.findChild(SliceSlider)
    assert slider.maximum() == 63
    window.workspace.view.set_crosshair(MIDDLE)
    before = slider.value()
    slider.setValue(before + 8)
    assert window.workspace.view.crosshair[2] - MIDDLE[2] == pytest.approx(8 * VOXEL_MM, abs=VOXEL_MM)
    np.testing.assert_allclose(window.workspace.view.crosshair[:2], MIDDLE[:2])
    frame.view.step(-8)
    assert slider.value() == before


def test_the_axis_is_drawn_on_slices_where_it_passes() -> None:
    from gp_labeler.views.painting.slice_lines import near_part

    start, end = np.array([0.0, 0, -4]), np.array([4.0, 0, 4])
    np.testing.assert_allclose(near_part(start, end, (-4, 4), 1.0), [[1.5, 0, -1], [2.5, 0, 1]])
    np.testing.assert_allclose(near_part(end, start, (4, -4), 1.0), [[2.5, 0, 1], [1.5, 0, -1]])
    np.testing.assert_allclose(near_part(start, end, (0.5, 0.5), 1.0), [start, end])
    assert near_part(start, end, (2.0, 9.0), 1.0) is None
    assert near_part(start, end, (2.0, 2.0), 1.0) is None
