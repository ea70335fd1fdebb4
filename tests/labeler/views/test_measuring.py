"""Rulers and angles by real mouse and key events, and the window that lists them."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest
from window_cases import BALL_MM, MIDDLE, VOXEL_MM, image_bytes, wait_until_idle

from gp_core import GpError, read_measurements
from gp_core.landmarks.features import Side
from gp_core.landmarks.measurements import Measurement
from gp_labeler.document.specimen_file import read_specimen
from gp_labeler.document.state import How
from gp_labeler.scene.planes import Plane
from gp_labeler.views.panels.measure.dialog import MeasureDialog

LEFT = Qt.MouseButton.LeftButton


def at(*offset: float) -> np.ndarray:
    return MIDDLE + np.array(offset)


ONE, OTHER = at(2.0, 1.0, 0.125), at(-1.5, 1.5, 0.125)
FRONT = at(0.0, -BALL_MM, 0.0)


@pytest.fixture
def window(qtbot, one_window, ball):
    one_window.workspace.view.update(layout="four-up")
    one_window.workspace.scan.begin(ball)
    one_window.activateWindow()
    wait_until_idle(qtbot, one_window)
    one_window.workspace.interaction.set_tool("look")
    one_window.workspace.view.set_crosshair(ONE)
    one_window.grid.scene_view.view_from("A")
    return one_window


@pytest.fixture
def axial(window):
    return window.grid.slice_views[Plane.AXIAL]


def measured(window):
    return window.workspace.document.state.measurements


def pixel(view, position) -> QPoint:
    x, y = view.pixel_at(position)
    return QPoint(int(x), int(y))


def click(view, position) -> None:
    QTest.mouseClick(view, LEFT, pos=pixel(view, position))


def drag(view, start, end) -> None:
    QTest.mousePress(view, LEFT, Qt.KeyboardModifier.NoModifier, pixel(view, start))
    for share in (0.5, 1.0):
        QTest.mouseMove(view, pixel(view, start + share * (end - start)))
    QTest.mouseRelease(view, LEFT, Qt.KeyboardModifier.NoModifier, pixel(view, end))


def test_a_ruler_is_armed_placed_by_two_clicks_and_then_put_away(window, axial) -> None:
    axial.setFocus()
    QTest.keyClick(axial, Qt.Key.Key_U)
    assert window.workspace.interaction.tool == "ruler"
    assert "first point" in window.status.next_click.text()
    QTest.mouseMove(axial, pixel(axial, ONE))
    assert axial.cursor().shape() is Qt.CursorShape.CrossCursor
    click(axial, ONE)
    assert "second point" in window.status.next_click.text()
    assert measured(window) == ()
    click(axial, OTHER)
    (ruler,) = measured(window)
    assert ruler.name == "Ruler 1"
    assert abs(ruler.length_mm - np.linalg.norm(ONE - OTHER)) < 2 * VOXEL_MM
    assert window.workspace.interaction.tool == "look"
    assert window.workspace.document.undo_text == "measure Ruler 1"
    window.workspace.document.undo()
    assert measured(window) == ()


def test_an_angle_goes_over_slice_and_bone(window, axial) -> None:
    window.commands.run("tool.angle")
    click(axial, ONE)
    click(axial, at(0.0, 0.0, 0.125))
    click(window.grid.scene_view, FRONT)
    (angle,) = measured(window)
    assert np.linalg.norm(np.array(angle.points[2]) - FRONT) < VOXEL_MM
    arms = np.array(angle.points)[[0, 2]] - angle.points[1]
    expected = np.arccos(arms[0] @ arms[1] / np.prod(np.linalg.norm(arms, axis=1)))
    assert angle.angle == pytest.approx(expected)


def test_escape_takes_back_a_point_then_puts_the_tool_away(window, axial) -> None:
    window.commands.run("tool.ruler")
    click(axial, ONE)
    axial.setFocus()
    QTest.keyClick(axial, Qt.Key.Key_Escape)
    assert window.workspace.interaction.tool == "ruler"
    assert not window.workspace.measure.is_placing
    QTest.keyClick(axial, Qt.Key.Key_Escape)
    assert window.workspace.interaction.tool == "look"
    assert measured(window) == ()


def test_a_double_click_measures_nothing(window, axial) -> None:
    window.commands.run("tool.ruler")
    QTest.mouseClick(axial, LEFT, pos=pixel(axial, ONE))
    QTest.mouseDClick(axial, LEFT, pos=pixel(axial, ONE))
    assert not window.workspace.measure.is_placing
    assert measured(window) == ()
    assert window.workspace.view.state.layout == "axial"


def test_a_click_on_a_landmark_measures_from_exactly_there(window, axial) -> None:
    workspace = window.workspace
    for code, where in (("CA", ONE), ("OS", OTHER)):
        workspace.labels.place(where, How.SLICE, side="L", code=code)
    workspace.view.set_crosshair(ONE)
    window.commands.run("tool.ruler")
    for where in (ONE, OTHER):
        QTest.mouseClick(axial, LEFT, pos=pixel(axial, where) + QPoint(3, 0))
    (ruler,) = measured(window)
    assert np.array_equal(ruler.points, [ONE, OTHER])
    assert np.array_equal(workspace.document.landmarks("L")["CA"], ONE)


@pytest.mark.parametrize("view", ["axial", "3d"])
def test_an_end_is_dragged_as_one_edit_and_escape_lets_it_go_back(window, axial, view) -> None:
    workspace, shown = window.workspace, axial if view == "axial" else window.grid.scene_view
    start = ONE if view == "axial" else FRONT
    end = OTHER if view == "axial" else MIDDLE + BALL_MM * np.array([0.3, -np.sqrt(1 - 0.18), 0.3])
    workspace.measure.add([start, at(0, 4.0, 3.0)])
    drag(shown, start, end)
    (ruler,) = measured(window)
    assert np.linalg.norm(np.array(ruler.points[0]) - end) < 1.5 * VOXEL_MM
    assert ruler.points[1] == tuple(at(0, 4.0, 3.0))
    assert workspace.document.undo_text == "move Ruler 1"
    workspace.document.undo()
    QTest.mousePress(shown, LEFT, Qt.KeyboardModifier.NoModifier, pixel(shown, start))
    QTest.mouseMove(shown, pixel(shown, end))
    assert workspace.measure.dragged == ("Ruler 1", 0)
    shown.setFocus()
    QTest.keyClick(shown, Qt.Key.Key_Escape)
    QTest.mouseRelease(shown, LEFT, Qt.KeyboardModifier.NoModifier, pixel(shown, end))
    assert measured(window)[0].points[0] == tuple(start)


def test_a_landmark_goes_before_an_end_unless_its_ruler_is_selected(window, axial) -> None:
    workspace = window.workspace
    workspace.labels.place(ONE, How.SLICE, side="L", code="CA")
    workspace.measure.add([ONE, at(0, 4.0, 3.0)])
    workspace.view.set_crosshair(ONE)
    drag(axial, ONE, OTHER)
    assert np.array_equal(workspace.document.landmarks("L")["CA"], ONE)
    workspace.document.undo()
    workspace.measure.select(None)
    drag(axial, ONE, OTHER)
    assert measured(window)[0].points[0] == tuple(ONE)
    assert not np.array_equal(workspace.document.landmarks("L")["CA"], ONE)


def test_a_landmark_that_is_to_do_can_be_placed_on_an_end(window, axial) -> None:
    window.workspace.measure.add([ONE, OTHER])
    window.workspace.interaction.set_tool("place")
    click(axial, ONE)
    assert "CA" in window.workspace.document.landmarks("L")


def test_lines_and_names_are_painted_where_they_lie_in_the_slice(window, axial) -> None:
    def coloured() -> int:
        picture = axial.grab().toImage().convertToFormat(axial.grab().toImage().Format.Format_RGB888)
        rows = image_bytes(picture).reshape(picture.height(), -1)[:, : 3 * picture.width()]
        return int((np.abs(rows.reshape(-1, 3).astype(int) - [0xB9, 0xE3, 0x4B]).max(axis=1) < 40).sum())

    few = coloured()
    window.workspace.measure.add([ONE, OTHER])
    assert coloured() > few + 100
    window.workspace.view.set_crosshair(ONE + np.array([0, 0, 3.0]))  # far off the slice
    assert coloured() < 50


def test_they_are_saved_exported_and_imported(window, tmp_path) -> None:
    workspace = window.workspace
    workspace.measure.add([ONE, OTHER], "width")
    workspace.measure.add([ONE, MIDDLE, OTHER])
    saved = workspace.document.save(tmp_path / "ball.gpspecimen.json")
    assert read_specimen(saved).measurements == measured(window)
    window.prompts.files = [tmp_path / "lines"]
    window.commands.run("measure.export")
    files = sorted((tmp_path / "lines").iterdir())
    assert [file.name for file in files] == ["ball_Angle 1.mrk.json", "ball_width.mrk.json"]
    assert read_measurements(files[1]) == (Measurement("width", (tuple(ONE), tuple(OTHER))),)
    window.prompts.files = files
    window.commands.run("measure.import")
    assert [each.name for each in measured(window)][2:] == ["Angle 1 (2)", "width (2)"]
    assert workspace.document.undo_text == "add 2 measurements"


def test_the_list_renames_shows_and_removes(qtbot, window) -> None:
    workspace = window.workspace
    workspace.measure.add([ONE, OTHER])
    workspace.measure.add([OTHER, MIDDLE])
    window.commands.run("measure.show")
    dialog = window.findChild(MeasureDialog)
    table = dialog.measurements
    table.item(0, 0).setText("  bulla   width ")
    assert [each.name for each in measured(window)] == ["bulla width", "Ruler 2"]
    table.item(1, 0).setText("bulla width")  # is taken
    assert [each.name for each in measured(window)] == ["bulla width", "Ruler 2"]
    assert table.item(1, 0).text() == "Ruler 2"
    middle = table.visualItemRect(table.item(1, 2)).center()
    QTest.mouseClick(table.viewport(), LEFT, pos=middle)
    assert workspace.measure.selected == "Ruler 2"
    assert np.allclose(workspace.view.crosshair, OTHER)
    for keys, name in (((Qt.Key.Key_Up,), "bulla width"), ((Qt.Key.Key_Down,), "Ruler 2")):
        for key in (*keys, Qt.Key.Key_Return):  # the same by keys
            QTest.keyClick(table, key)
        assert workspace.measure.selected == name
    QTest.keyClick(table, Qt.Key.Key_Delete)
    assert [each.name for each in measured(window)] == ["bulla width"]
    assert table.rowCount() == 1
    dialog.close()


def test_a_distance_that_disagrees_is_marked_and_a_click_shows_it(window) -> None:
    workspace = window.workspace
    for code, where in (("CB", MIDDLE), ("CA", at(0, 0, 4.7)), ("OS", at(3.0, 0.5, 0))):
        workspace.labels.place(where, How.SLICE, side="L", code=code)
    window.commands.run("measure.show")
    dialog = window.findChild(MeasureDialog)
    check = workspace.measure.distances("L")
    found = {pair.feature_a + pair.feature_b: pair for pair in check.pairs}
    assert not found["CBCA"].disagrees
    assert found["OSCB"].disagrees  # published 6.2 mm
    assert "2 differ" in dialog.summary.text()
    cell = dialog.distances.rows.index_of_pair(found["OSCB"])
    dialog.distances.scrollTo(cell)
    QTest.mouseClick(dialog.distances.viewport(), LEFT, pos=dialog.distances.visualRect(cell).center())
    assert workspace.measure.pair == (Side.LEFT, "OS", "CB")
    assert workspace.labels.active.code == "OS"  # two of its distances disagree, one of CB's
    dialog.close()
    assert workspace.measure.pair is None


def test_the_same_place_twice_is_refused_and_names_stay_their_own(window) -> None:
    measure = window.workspace.measure
    measure.add([ONE, OTHER], "one")
    with pytest.raises(GpError, match="called one already"):
        measure.add([ONE, MIDDLE], "one")
    window.workspace.interaction.set_tool("ruler")
    measure.click(ONE)
    with pytest.raises(GpError, match="two places"):
        measure.click(ONE)
    with pytest.raises(GpError, match="no measurement is called 'two'"):
        measure.remove("two")
