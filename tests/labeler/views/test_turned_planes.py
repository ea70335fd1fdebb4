"""Oblique slices in the window: turned by the crosshair's arms, labelled on, and straight again by a key."""

from __future__ import annotations

import numpy as np
import pytest
from document_cases import head_frame
from qtpy.QtCore import QPoint, QPointF, Qt
from qtpy.QtTest import QTest
from window_cases import BALL_MM, MIDDLE, VOXEL_MM, image_bytes, wait_until_idle

from gp_core.landmarks.features import Side
from gp_labeler.document.head_edits import SetHeadFrame
from gp_labeler.document.state import How
from gp_labeler.imaging.slab import Slab
from gp_labeler.imaging.volume import Volume
from gp_labeler.scene.planes import Plane
from gp_labeler.scripting.events import click, drag, turn_wheel
from gp_labeler.views.painting.slice_painter import reach_of
from gp_labeler.views.panels.label.left_row import LeftRow
from gp_labeler.views.panels.scan.head_card import HeadCard

LEFT, NO_KEYS = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
AXES = np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture
def window(qtbot, one_window, ball):
    one_window.workspace.scan.begin(ball)
    one_window.activateWindow()
    wait_until_idle(qtbot, one_window)
    one_window.workspace.view.set_crosshair(MIDDLE + 0.4)
    yield one_window
    one_window.workspace.interaction.set_tool("place")


@pytest.fixture
def oblique(window):
    window.workspace.view.rotate_planes("axial", np.radians(33))
    window.workspace.view.rotate_planes("sagittal", np.radians(-21))
    return window


def around(view, degrees: float, reach: float) -> tuple[float, float]:
    """Return the logical pixel so far from the crosshair, in a direction from right to down."""
    x, y = view.pixel_at(view.window().workspace.view.crosshair)
    angle = np.radians(degrees)
    return x + reach * np.cos(angle), y + reach * np.sin(angle)


def pixel(view, position) -> QPoint:
    return QPointF(*view.pixel_at(np.asarray(position))).toPoint()


def placed(window) -> np.ndarray:
    return window.workspace.document.landmarks(Side.LEFT)["CA"]


@pytest.mark.parametrize("plane", list(Plane))
def test_dragging_an_arm_turns_the_other_planes_with_it(window, plane) -> None:
    view, model = window.grid.slice_views[plane], window.workspace.view
    own, crosshair = model.planes[plane.value], model.crosshair
    drag(view, around(view, 0, 70), around(view, 25, 70))
    assert model.planes[plane.value] is own
    for name in set(model.planes) - {plane.value}:
        turned = model.planes[name]
        cosine = abs(turned.normal @ model.frame.plane(name).normal)
        assert np.degrees(np.arccos(cosine)) == pytest.approx(25, abs=1.5)
        assert "oblique" in window.grid.frames[name].header.title.text()
    np.testing.assert_array_equal(model.crosshair, crosshair)
    arms = view.turning.arms(view.shown, 1.0)  # an arm lies where the pointer let it go
    assert arms.arm_at(*np.array(around(view, 25, 70))) is not None
    assert "turned" in model.frame_text
    QTest.keyClick(view, Qt.Key.Key_0)
    assert not model.planes_are_turned
    assert window.grid.frames[plane.value].header.title.text() == plane.value.capitalize()


def test_a_slab_is_coarse_while_its_plane_is_turned_and_whole_when_the_hand_pauses(qtbot, window) -> None:
    axial, coronal = (window.grid.slice_views[plane] for plane in (Plane.AXIAL, Plane.CORONAL))
    window.workspace.view.update(slab=Slab("mean", 1.0))
    points = [QPointF(*around(axial, degrees, 70)).toPoint() for degrees in (0, 10, 25)]
    QTest.mousePress(axial, LEFT, NO_KEYS, points[0])
    zoom = coronal.shown.mm_per_pixel
    for point in points[1:]:
        QTest.mouseMove(axial, point)
        turned = image_bytes(coronal.grab().toImage())
    assert coronal.draws_coarsely
    assert coronal.shown.mm_per_pixel == zoom  # the hand turns it, and does not zoom
    qtbot.waitUntil(lambda: not coronal.draws_coarsely)
    whole = image_bytes(coronal.grab().toImage())
    assert not np.array_equal(turned, whole)
    QTest.mouseMove(axial, points[1])
    QTest.mouseMove(axial, points[2])
    assert coronal.draws_coarsely
    QTest.mouseRelease(axial, LEFT, NO_KEYS, points[2])
    assert not coronal.draws_coarsely
    assert np.abs(image_bytes(coronal.grab().toImage()).astype(int) - whole).mean() < 0.1


def test_a_tilted_head_opens_as_large_as_a_straight_one(qtbot, one_window) -> None:
    z, y, x = np.indices((40, 60, 60)) - np.array([20, 30, 30])[:, None, None, None]
    values = np.where(np.sqrt(x**2 + y**2 + z**2) < 12, 1400, 600).astype(np.float32)
    one_window.workspace.scan.begin(Volume.from_parts(values, [0.5] * 3, [0, 0, 0]))
    wait_until_idle(qtbot, one_window)
    views = one_window.grid.slice_views.values()
    straight = [view.shown.mm_per_pixel for view in views]
    one_window.workspace.document.do(SetHeadFrame(head_frame((40, 30, -35), (15, 15, 10))))
    bone = one_window.workspace.bone.some_points
    for view, before in zip(views, straight, strict=True):
        flat = view.shown.scan_to_pixel(bone)
        assert flat.min() > 0
        assert (flat.max(axis=0) < view.shown.size).all()
        across = np.ptp(flat, axis=0) / view.shown.size
        assert across.max() > 0.75
        assert view.shown.mm_per_pixel < before  # though the slices of the tilted scan are larger
    one_window.workspace.head.show(False)
    assert [view.shown.mm_per_pixel for view in views] == pytest.approx(straight)


def test_a_click_on_an_arm_still_places(window) -> None:
    view = window.grid.slice_views[Plane.AXIAL]
    window.workspace.labels.go_to(Side.LEFT, "CA")
    click(view, *around(view, 0, 60))
    assert not window.workspace.view.planes_are_turned
    assert placed(window) == pytest.approx(view.shown.pixel_to_scan([around(view, 0, 0)])[0], abs=2.0)


@pytest.mark.parametrize("plane", list(Plane))
def test_a_point_is_placed_where_it_is_clicked_on_an_oblique_slice(oblique, plane) -> None:
    view, labels = oblique.grid.slice_views[plane], oblique.workspace.labels
    labels.go_to(Side.LEFT, "CA")
    here = around(view, 47, 40)
    where = view.shown.pixel_to_scan([np.floor(here)])[0]
    click(view, *here)
    assert placed(oblique) == pytest.approx(where, abs=1e-9)
    shown = oblique.workspace.view.planes[plane.value]
    assert shown.position_of(placed(oblique)) == pytest.approx(view.shown.position, abs=1e-9)
    assert oblique.workspace.document.state.landmark(Side.LEFT, "CA").provenance.how is How.SLICE
    assert view.pixel_at(placed(oblique)) == pytest.approx(np.floor(here), abs=0.6)


@pytest.mark.parametrize("plane", list(Plane))
@pytest.mark.parametrize(("key", "right", "down"), [(Qt.Key.Key_Right, 1, 0), (Qt.Key.Key_Up, 0, -1)])
def test_a_nudge_is_a_voxel_along_the_slice_that_is_shown(oblique, plane, key, right, down) -> None:
    oblique.workspace.labels.place(MIDDLE + 0.4, side=Side.LEFT, code="CA")
    oblique.workspace.labels.choose(Side.LEFT, "CA")
    before, view = placed(oblique), oblique.grid.slice_views[plane]
    view.setFocus()
    QTest.keyClick(view, key)
    shown = oblique.workspace.view.planes[plane.value]
    assert placed(oblique) - before == pytest.approx(VOXEL_MM * (right * shown.right + down * shown.down))


@pytest.mark.parametrize("plane", list(Plane))
def test_a_point_on_bone_stays_on_it_when_dragged_on_an_oblique_slice(oblique, plane) -> None:
    view, shown = oblique.grid.slice_views[plane], oblique.workspace.view.planes[plane.value]
    start = MIDDLE + BALL_MM * (0.6 * shown.right + 0.8 * shown.down)
    oblique.workspace.labels.place(start, How.MESH, side=Side.LEFT, code="CA")
    oblique.workspace.view.set_crosshair(start)
    beside = MIDDLE + 1.15 * BALL_MM * shown.right - 0.2 * shown.down
    drag(view, view.pixel_at(start), view.pixel_at(beside))
    assert abs(np.linalg.norm(placed(oblique) - MIDDLE) - BALL_MM) < VOXEL_MM / 4
    assert (placed(oblique) - MIDDLE) @ shown.right > 0.98 * BALL_MM
    assert abs((placed(oblique) - start) @ shown.normal) < 1e-6  # in the slice that is shown


def test_the_wheel_goes_by_voxels_across_and_points_show_near_their_slice(oblique) -> None:
    view, model = oblique.grid.slice_views[Plane.CORONAL], oblique.workspace.view
    before, shown = model.crosshair, model.planes["coronal"]
    turn_wheel(view, 60, 60, 3)
    assert model.crosshair - before == pytest.approx(3 * VOXEL_MM * shown.normal)
    reach = reach_of(view.source, shown)
    near, far = (model.crosshair + part * reach * shown.normal for part in (0.9, 1.1))
    oblique.workspace.labels.place(near, side=Side.LEFT, code="CA")
    model.set_crosshair(near - 0.9 * reach * shown.normal)
    assert view.mark_at(*view.shown.scan_to_pixel(near[None])[0]) == "L:CA"
    oblique.workspace.labels.place(far, side=Side.LEFT, code="CA")
    model.set_crosshair(far - 1.1 * reach * shown.normal)
    assert view.mark_at(*view.shown.scan_to_pixel(far[None])[0]) is None


def test_the_3d_view_shows_and_picks_oblique_slices(qtbot, oblique) -> None:
    view, model = oblique.grid.scene_view, oblique.workspace.view
    model.update(slices_visible=True, mesh_opacity=0.05)
    wait_until_idle(qtbot, oblique)
    view.grab()
    for image, plane in zip(view.scene.slices.images, model.planes.values(), strict=True):
        assert image.plane is plane
        assert image.position == pytest.approx(plane.position_of(model.crosshair))
    away = model.crosshair + 1.2 * model.planes["axial"].right + 7.5 * model.planes["axial"].down
    x, y = view.scene.display_of(away[None])[0]
    hit = view.scene.pick_slice(x, y)
    if hit is not None:
        assert min(abs(p.position_of(hit - model.crosshair + p.origin)) for p in model.planes.values()) < 1e-6
    model.update(slices_visible=False, mesh_opacity=1.0)


def test_the_tool_turns_the_head_in_one_edit_a_drag(window) -> None:
    workspace, view = window.workspace, window.grid.slice_views[Plane.SAGITTAL]
    workspace.document.do(SetHeadFrame(head_frame((0, 0, 0), tuple(MIDDLE))))
    workspace.view.set_crosshair(MIDDLE)
    window.commands.run("head.by_hand")
    before = workspace.head.frame.T_head_scan.rotation
    drag(view, around(view, 40, 60), around(view, 52, 60))
    frame = workspace.head.frame
    assert frame.found_by == "hand"
    assert workspace.view.frame.name == "head"
    assert not workspace.view.planes_are_turned
    assert frame.T_head_scan.rotation[0] == pytest.approx(before[0])  # a sagittal slice turns the pitch
    assert frame.T_head_scan.rotation[1] @ before[1] == pytest.approx(np.cos(np.radians(12)), abs=0.01)
    workspace.document.undo()
    assert workspace.head.frame.T_head_scan.rotation == pytest.approx(before)
    QTest.keyClick(view, Qt.Key.Key_Escape)
    assert workspace.interaction.tool != "turn"
    window.commands.run("head.by_hand")
    QTest.keyClick(window.grid.scene_view, Qt.Key.Key_Escape)  # in the 3D view as in a slice
    assert workspace.interaction.tool != "turn"


def test_keys_letters_cube_and_headers_follow_the_frame_and_the_line_says_it(window) -> None:
    workspace, scene = window.workspace, window.grid.scene_view.scene
    window.commands.run("view.from_left")
    head = head_frame((20, -10, 160), tuple(MIDDLE + 2))
    workspace.document.do(SetHeadFrame(head))
    axes = head.T_head_scan.rotation
    assert scene.camera.direction == pytest.approx(-axes[0])  # still from the left: of the head, now
    assert scene.cube.axes == pytest.approx(axes.T)
    window.commands.run("view.from_anterior")
    assert scene.camera.direction == pytest.approx(axes[1])
    assert window.status.frame.text() == "Head frame"
    assert "in the head" in window.grid.frames["axial"].header.where.text()
    view = window.grid.slice_views[Plane.AXIAL]
    QTest.keyClick(view, Qt.Key.Key_F, Qt.KeyboardModifier.ShiftModifier)
    assert workspace.view.frame.name == "scan"
    assert window.status.frame.text() == "Scan frame"
    assert scene.cube.axes == pytest.approx(np.eye(3))


def test_who_labels_is_asked_which_side_is_left_until_it_is_answered(window) -> None:
    window.set_step("label")
    row = window.findChild(LeftRow)
    assert not row.isVisible()
    window.workspace.document.do(SetHeadFrame(head_frame()))
    assert row.isVisible()
    window.commands.flush()
    row.confirm.click()
    assert not row.isVisible()
    assert window.workspace.head.frame.left_confirmed


def test_the_card_waits_with_its_question_until_the_head_is_turned(window) -> None:
    window.set_step("scan")
    card = window.findChild(HeadCard)
    window.workspace.document.do(SetHeadFrame(head_frame()))
    window.commands.run("head.by_hand")
    assert not card.confirm.isVisible()
    assert not card.take_planes.isVisible()  # each drag is taken by itself
    assert card.mid_plane.isVisible()
    window.commands.run("head.by_hand")
    assert card.confirm.isVisible()
    assert not card.mid_plane.isVisible()


def test_the_card_says_how_the_head_lies_and_asks_which_side_is_left(window) -> None:
    window.set_step("scan")
    card = window.findChild(HeadCard)
    assert card.straighten.isVisible()
    assert not card.confirm.isVisible()
    window.workspace.document.do(SetHeadFrame(head_frame()))
    assert card.confirm.isVisible()
    window.commands.flush()  # what can be done is brought up to date in the next turn of the event loop
    card.confirm.click()
    assert not card.confirm.isVisible()
    assert "symmetry" in card.state.text()
    assert card.shown.isChecked()
    window.commands.flush()
    card.shown.click()
    assert window.workspace.view.frame.name == "scan"
    assert not card.shown.isChecked()
