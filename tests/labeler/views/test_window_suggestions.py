"""Suggestions and re-placing in the window: real clicks and keys on real views."""

from __future__ import annotations

import json

import numpy as np
import pytest
from qtpy.QtCore import QEvent, QPoint, Qt
from qtpy.QtGui import QKeyEvent
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication
from window_cases import MIDDLE, wait_until_idle

from gp_core.landmarks.features import FEATURES, Side
from gp_labeler.document.state import How
from gp_labeler.models.workflow import PointState
from gp_labeler.scene.planes import Plane
from gp_labeler.views.drawn import drawn_marks
from gp_labeler.views.panels.label.export_dialog import ExportDialog

L = Side.LEFT
INSIDE = MIDDLE + np.array([2.1, -1.7, 0.125])
AWAY = MIDDLE + np.array([-2.0, 2.2, 0.125])


@pytest.fixture
def suggested(window):
    """The ball with MN suggested at `INSIDE`, seen from so far away that nobody can judge it."""
    labels = window.workspace.labels
    labels.suggest(INSIDE, radius_95=0.8, source="atlas", side=L, code="MN")
    window.workspace.labels.go_to(L, "MN")
    for view in window.grid.views:
        view.zoom_to(INSIDE, 100.0)
    return window


def status_of(window, code):
    return window.workspace.labels.point_states(L, wait=False)[code]


def click(view, position) -> None:
    x, y = view.pixel_at(position)
    QTest.mouseClick(view, Qt.MouseButton.LeftButton, pos=QPoint(int(x), int(y)))


def hover(view, position) -> Qt.CursorShape:
    x, y = view.pixel_at(position)
    QTest.mouseMove(view, QPoint(int(x) + 3, int(y)))
    QTest.mouseMove(view, QPoint(int(x), int(y)))
    return view.cursor().shape()


def axial_of(window):
    return window.grid.slice_views[Plane.AXIAL]


# Confirming


def test_enter_from_afar_brings_the_view_there_and_only_then_confirms(qtbot, suggested) -> None:
    axial, voxel = axial_of(suggested), 0.25
    axial.setFocus()
    assert axial.voxel_pixels(INSIDE, voxel) < 2.0
    QTest.keyClick(axial, Qt.Key.Key_Return)
    assert status_of(suggested, "MN") is PointState.SUGGESTED
    assert "Is MN left correct?" in suggested.status.next_click.text()
    assert axial.voxel_pixels(INSIDE, voxel) >= 2.0
    wait_until_idle(qtbot, suggested)
    QTest.keyClick(axial, Qt.Key.Key_Return)
    assert status_of(suggested, "MN") is PointState.PLACED
    assert suggested.workspace.document.state.landmark(L, "MN").provenance.how is How.CONFIRMED
    np.testing.assert_array_equal(suggested.workspace.document.landmarks(L)["MN"], INSIDE)


def test_enter_in_a_text_field_ends_typing_and_letters_are_commands_again(qtbot, suggested) -> None:
    panel, document = suggested.steps["label"], suggested.workspace.document
    name = panel.observer.name
    name.setFocus()
    QTest.keyClicks(name, "AB")
    QTest.keyClick(name, Qt.Key.Key_Return)
    assert document.author == "AB"
    assert "Is MN left correct?" not in suggested.status.next_click.text()
    assert suggested.focusWidget() is panel.table.view
    suggested.workspace.labels.place(AWAY, How.SLICE, side=L, code="CA")
    suggested.workspace.labels.go_to(L, "CA")
    note = panel.card.annotation.note
    note.setFocus()
    QTest.keyClicks(note, "fluid")
    QTest.keyClick(note, Qt.Key.Key_Return)
    assert document.state.landmark(L, "CA").note == "fluid"
    QTest.keyClick(suggested.focusWidget(), Qt.Key.Key_K)
    assert document.state.landmark(L, "CA").checked


def test_enters_without_a_picture_in_between_confirm_nothing(qtbot, suggested) -> None:
    workspace, axial = suggested.workspace, axial_of(suggested)
    workspace.labels.suggest(AWAY, radius_95=0.8, source="atlas", side=L, code="ZL")
    workspace.labels.go_to(L, "MN")
    axial.setFocus()
    for _ in range(4):
        QTest.keyClick(axial, Qt.Key.Key_Return)
    assert {status_of(suggested, code) for code in ("MN", "ZL")} == {PointState.SUGGESTED}
    wait_until_idle(qtbot, suggested)
    for _ in range(4):
        QTest.keyClick(axial, Qt.Key.Key_Return)
    assert status_of(suggested, "MN") is PointState.PLACED
    assert status_of(suggested, "ZL") is PointState.SUGGESTED


def test_the_next_suggestion_comes_up_close_and_one_enter_confirms_it(qtbot, suggested) -> None:
    workspace, axial = suggested.workspace, axial_of(suggested)
    for code in (row.code for row in FEATURES if row.code not in ("CO", "MN")):
        at, radius = (AWAY, 2.0) if code == "ZL" else (INSIDE, 0.5)
        workspace.labels.suggest(at, radius_95=radius, source="atlas", side=L, code=code)
    workspace.labels.go_to(L, "MN")
    axial.setFocus()
    QTest.keyClick(axial, Qt.Key.Key_X)  # cannot be seen: goes on too
    assert workspace.labels.active.code == "ZL"
    assert axial.across_mm <= 12.0 + 1e-9  # whatever the width of the view, which rounds
    np.testing.assert_allclose(axial.pixel_at(AWAY), (axial.width() / 2, axial.height() / 2), atol=1.0)
    wait_until_idle(qtbot, suggested)
    QTest.keyClick(axial, Qt.Key.Key_Return)
    assert status_of(suggested, "ZL") is PointState.PLACED


def test_a_closer_view_stays_as_close(suggested) -> None:
    axial = axial_of(suggested)
    axial.zoom_to(INSIDE, 5.0)
    suggested.grid.bring_close(AWAY)
    assert axial.across_mm == pytest.approx(5.0)


def test_another_point_than_the_one_that_is_chosen_is_shown_first(qtbot, suggested) -> None:
    workspace = suggested.workspace
    workspace.labels.suggest(INSIDE, radius_95=0.8, source="atlas", side=L, code="ZL")
    workspace.labels.go_to(L, "MN")
    suggested.grid.bring_close(INSIDE)
    wait_until_idle(qtbot, suggested)
    assert not workspace.interaction.confirm(L, "ZL")  # of the menu
    wait_until_idle(qtbot, suggested)
    assert workspace.interaction.confirm(L, "ZL")


def test_a_swap_says_which_suggestions_it_drops(suggested) -> None:
    workspace = suggested.workspace
    workspace.labels.suggest(AWAY, radius_95=0.8, source="atlas", side=L, code="ZL")
    workspace.labels.swap(L, "MN", "ZL")
    assert suggested.status.next_click.text() == (
        "Warning: The suggestions of MN and ZL were dropped; undo brings them back"
    )
    workspace.document.undo()
    assert status_of(suggested, "ZL") is PointState.SUGGESTED


def test_a_key_that_is_held_down_confirms_nothing(suggested) -> None:
    axial = axial_of(suggested)
    axial.setFocus()
    QTest.keyPress(axial, Qt.Key.Key_Return)
    no = Qt.KeyboardModifier.NoModifier
    for _ in range(20):
        repeat = QKeyEvent(QEvent.Type.ShortcutOverride, Qt.Key.Key_Return, no, "\r", True)
        QApplication.sendEvent(axial, repeat)
        QApplication.sendEvent(axial, QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Return, no, "\r", True))
    QTest.keyRelease(axial, Qt.Key.Key_Return)
    assert status_of(suggested, "MN") is PointState.SUGGESTED


def test_a_slice_elsewhere_does_not_show_the_point(qtbot, suggested) -> None:
    workspace, axial = suggested.workspace, axial_of(suggested)
    workspace.interaction.confirm(L, "MN")  # brings it close
    workspace.view.set_crosshair(INSIDE + np.array([3.0, 3.0, 2.0]))
    workspace.view.update(layout="axial")
    assert not suggested.grid.can_judge(INSIDE)
    axial.setFocus()
    QTest.keyClick(axial, Qt.Key.Key_Return)
    assert status_of(suggested, "MN") is PointState.SUGGESTED
    assert not suggested.grid.can_judge(INSIDE)  # not before it is painted
    wait_until_idle(qtbot, suggested)
    assert suggested.grid.can_judge(INSIDE)


def test_what_bone_hides_in_the_3d_view_is_judged_on_slices(qtbot, suggested) -> None:
    workspace, scene = suggested.workspace, suggested.grid.scene_view
    workspace.view.update(layout="3d")
    wait_until_idle(qtbot, suggested)
    scene.setFocus()
    for _ in range(3):
        if status_of(suggested, "MN") is PointState.PLACED:
            break
        assert workspace.view.state.layout == "3d" or suggested.grid.can_judge(INSIDE)
        QTest.keyClick(scene, Qt.Key.Key_Return)
        wait_until_idle(qtbot, suggested)
    assert workspace.view.state.layout == "four-up"
    assert status_of(suggested, "MN") is PointState.PLACED


def test_the_button_of_the_card_confirms_as_enter_does(qtbot, suggested) -> None:
    card = suggested.steps["label"].card
    assert card.content.state == "suggested"
    assert card.content.action_text == "Confirm"
    assert "atlas, 95 % within 0.80 mm" in card.content.status
    qtbot.mouseClick(card.primary, Qt.MouseButton.LeftButton)
    assert status_of(suggested, "MN") is PointState.SUGGESTED
    wait_until_idle(qtbot, suggested)
    qtbot.mouseClick(card.primary, Qt.MouseButton.LeftButton)
    assert status_of(suggested, "MN") is PointState.PLACED


# Correcting


def test_a_dragged_suggestion_is_placed_and_escape_leaves_it_suggested(suggested) -> None:
    axial = axial_of(suggested)
    axial.zoom_to(INSIDE, 10.0)
    x, y = (int(n) for n in axial.pixel_at(INSIDE))
    QTest.mousePress(axial, Qt.MouseButton.LeftButton, pos=QPoint(x, y))
    QTest.mouseMove(axial, QPoint(x + 20, y))
    axial.setFocus()
    QTest.keyClick(axial, Qt.Key.Key_Escape)
    QTest.mouseRelease(axial, Qt.MouseButton.LeftButton, pos=QPoint(x + 20, y))
    assert status_of(suggested, "MN") is PointState.SUGGESTED
    np.testing.assert_allclose(suggested.workspace.view.crosshair, INSIDE)
    QTest.mousePress(axial, Qt.MouseButton.LeftButton, pos=QPoint(x, y))
    QTest.mouseMove(axial, QPoint(x + 20, y))
    QTest.mouseRelease(axial, Qt.MouseButton.LeftButton, pos=QPoint(x + 20, y))
    assert status_of(suggested, "MN") is PointState.PLACED
    assert suggested.workspace.document.state.landmark(L, "MN").provenance.how is How.SLICE


def test_a_nudge_and_re_placing_place_it_and_a_mere_click_or_space_does_not(qtbot, suggested) -> None:
    workspace, axial = suggested.workspace, axial_of(suggested)
    axial.zoom_to(INSIDE, 10.0)
    click(axial, INSIDE)
    assert status_of(suggested, "MN") is PointState.SUGGESTED
    wait_until_idle(qtbot, suggested)
    axial.setFocus()
    QTest.keyClick(axial, Qt.Key.Key_Up)
    assert status_of(suggested, "MN") is PointState.PLACED
    assert workspace.document.undo()
    elsewhere = INSIDE + np.array([1.0, 1.0, 0.0])
    click(axial, elsewhere)
    QTest.keyClick(axial, Qt.Key.Key_Space)
    assert status_of(suggested, "MN") is PointState.SUGGESTED
    QTest.keyClick(suggested, Qt.Key.Key_P, Qt.KeyboardModifier.ShiftModifier)
    click(axial, elsewhere)
    assert status_of(suggested, "MN") is PointState.PLACED
    np.testing.assert_allclose(workspace.document.landmarks(L)["MN"], elsewhere, atol=0.1)


def test_ctrl_and_click_corrects_a_suggestion_and_looks_in_another_step(qtbot, suggested) -> None:
    workspace, axial = suggested.workspace, axial_of(suggested)
    axial.zoom_to(INSIDE, 10.0)
    elsewhere = INSIDE + np.array([1.0, 1.0, 0.0])
    x, y = (int(n) for n in axial.pixel_at(elsewhere))
    ctrl = Qt.KeyboardModifier.ControlModifier
    suggested.set_step("scan")
    QTest.mouseClick(axial, Qt.MouseButton.LeftButton, ctrl, QPoint(x, y))
    assert status_of(suggested, "MN") is PointState.SUGGESTED
    suggested.set_step("label")
    QTest.mouseClick(axial, Qt.MouseButton.LeftButton, ctrl, QPoint(x, y))
    assert status_of(suggested, "MN") is PointState.PLACED
    np.testing.assert_allclose(workspace.document.landmarks(L)["MN"], elsewhere, atol=0.1)
    assert workspace.document.state.landmark(L, "MN").provenance.how is How.SLICE
    workspace.labels.go_to(L, "MN")
    workspace.labels.lock(side=L, code="MN")
    x, y = (int(n) for n in axial.pixel_at(AWAY))
    QTest.mouseClick(axial, Qt.MouseButton.LeftButton, ctrl, QPoint(x, y))
    assert "locked" in suggested.status.next_click.text()
    np.testing.assert_allclose(workspace.document.landmarks(L)["MN"], elsewhere, atol=0.1)


def test_from_afar_an_arrow_key_brings_a_suggestion_close_and_moves_nothing(qtbot, suggested) -> None:
    axial = axial_of(suggested)
    axial.setFocus()
    QTest.keyClick(axial, Qt.Key.Key_Up)
    assert status_of(suggested, "MN") is PointState.SUGGESTED
    wait_until_idle(qtbot, suggested)
    QTest.keyClick(axial, Qt.Key.Key_Up)
    assert status_of(suggested, "MN") is PointState.PLACED


def test_an_arrow_key_after_a_correction_moves_the_point_that_was_corrected(suggested) -> None:
    workspace, axial = suggested.workspace, axial_of(suggested)
    workspace.labels.suggest(AWAY, radius_95=5.0, source="atlas", side=L, code="IN")
    workspace.labels.go_to(L, "MN")
    axial.zoom_to(INSIDE, 10.0)
    QTest.keyClick(suggested, Qt.Key.Key_P, Qt.KeyboardModifier.ShiftModifier)
    click(axial, INSIDE + np.array([1.0, 1.0, 0.0]))
    before = workspace.document.landmarks(L)["MN"]
    axial.setFocus()
    QTest.keyClick(axial, Qt.Key.Key_Up)
    assert status_of(suggested, "IN") is PointState.SUGGESTED
    assert np.linalg.norm(workspace.document.landmarks(L)["MN"] - before) > 0


# Files of earlier versions


def test_the_window_says_once_that_accepted_ghosts_are_suggestions_now(qtbot, window, tmp_path) -> None:
    provenance = {"how": "accepted ghost"}
    marks = {"CA": {"position": [1, 2, 3], "provenance": provenance}, "OS": {"position": [4, 5, 6]}}
    content = {"format": "gp-labeler specimen", "version": 2, "specimen": "old", "landmarks": {"L": marks}}
    file = tmp_path / "old.gpspecimen.json"
    file.write_text(json.dumps(content))
    said = []
    window.workspace.messages.said.connect(lambda text, level: said.append((text, level)))
    window.workspace.open_specimen(file)
    wait_until_idle(qtbot, window)
    assert [text for text, level in said if "accepted ghost" in text and level == "warning"] == [
        "1 point was an accepted ghost that nobody had confirmed: it counts as a suggestion now (CA L). "
        "Confirm or correct each in the table."
    ]
    assert window.workspace.labels.progress(L).text == "1 placed, 1 suggested"
    window.workspace.document.save()
    window.workspace.document.begin()
    window.workspace.open_specimen(file)
    assert sum("accepted ghost" in text for text, _ in said) == 1


# SliceViewport


def test_it_has_a_shape_of_its_own_everywhere(suggested) -> None:
    (mark,) = drawn_marks(suggested.workspace)
    assert (mark.key, mark.state) == ("L:MN", "suggested")
    table = suggested.steps["label"].table
    row = [table.model.index(n, 1) for n in range(table.model.rowCount())]
    assert "suggested" in [index.data() for index in row]
    assert table.model.headerData(1, Qt.Orientation.Horizontal) == "Left 0/20"
    tip = table.model.headerData(1, Qt.Orientation.Horizontal, Qt.ItemDataRole.ToolTipRole)
    assert tip == "Left: 0 placed, 1 suggested"
    axial = axial_of(suggested)
    axial.zoom_to(INSIDE, 10.0)
    x, y = (int(n) for n in axial.pixel_at(INSIDE))
    suggested.workspace.labels.choose(L, "CA")  # without the ring of the chosen one
    before = axial.grab().toImage().copy(x - 8, y - 8, 17, 17)
    suggested.workspace.labels.confirm(side=L, code="MN")
    after = axial.grab().toImage().copy(x - 8, y - 8, 17, 17)
    assert before.pixelColor(8, 8) != after.pixelColor(8, 8)  # open, then full


def test_the_export_dialog_leaves_suggestions_out_unless_ticked(suggested, tmp_path) -> None:
    workspace = suggested.workspace
    workspace.labels.place(AWAY, How.SLICE, side=L, code="CA")
    dialog = ExportDialog(workspace, tmp_path)
    assert not dialog.suggested.isChecked()
    assert "_suggested" not in dialog.files.text()
    dialog.suggested.setChecked(True)
    assert "_L_suggested.mrk.json" in dialog.files.text().replace("\u200b", "")
    dialog.export.click()
    assert sorted(path.name for path in tmp_path.glob("*.json")) == [
        "ball_L.mrk.json",
        "ball_L_suggested.mrk.json",
    ]


# No accident


@pytest.fixture
def placed(window):
    """The ball with CA placed at `INSIDE` and its row chosen, in the step Label."""
    window.workspace.view.update(auto_advance=False)
    window.workspace.labels.place(INSIDE, How.SLICE, side=L, code="CA")
    window.workspace.labels.go_to(L, "CA")
    return window


def position_of(window):
    return window.workspace.document.landmarks(L)["CA"]


@pytest.mark.parametrize("name", ["axial", "3d"])
def test_a_click_elsewhere_leaves_a_placed_point_where_it_is(placed, name) -> None:
    view = placed.grid.scene_view if name == "3d" else axial_of(placed)
    assert hover(view, AWAY) is Qt.CursorShape.ArrowCursor
    click(view, AWAY)
    np.testing.assert_array_equal(position_of(placed), INSIDE)
    assert not np.allclose(placed.workspace.view.crosshair, INSIDE)  # it looks there
    assert "CA left is placed" in placed.status.next_click.text()


def test_a_point_is_re_placed_by_one_click_on_purpose(placed) -> None:
    axial = axial_of(placed)
    assert hover(axial, AWAY) is Qt.CursorShape.ArrowCursor
    QTest.keyClick(placed, Qt.Key.Key_P, Qt.KeyboardModifier.ShiftModifier)
    assert axial.cursor().shape() is Qt.CursorShape.CrossCursor  # at once, under a pointer that rests
    assert placed.status.next_click.text().startswith("Click the new position of CA left")
    click(axial, AWAY)
    np.testing.assert_allclose(position_of(placed), AWAY, atol=0.1)
    click(axial, INSIDE + np.array([0.0, 3.0, 0.0]))
    np.testing.assert_allclose(position_of(placed), AWAY, atol=0.1)  # one click, no more
    placed.workspace.document.undo()
    np.testing.assert_array_equal(position_of(placed), INSIDE)


@pytest.mark.parametrize("think_better", ["escape", "again", "other row", "other step"])
def test_re_placing_can_be_thought_better_of(placed, think_better) -> None:
    axial = axial_of(placed)
    placed.commands.run("point.replace")
    assert placed.workspace.interaction.replacing
    if think_better == "escape":
        axial.setFocus()
        QTest.keyClick(axial, Qt.Key.Key_Escape)
    elif think_better == "again":
        placed.commands.run("point.replace")
    elif think_better == "other row":
        placed.workspace.labels.go_to(L, "CB")
    else:
        placed.set_step("pose")
    assert not placed.workspace.interaction.replacing
    click(axial, AWAY)
    np.testing.assert_array_equal(position_of(placed), INSIDE)


def test_a_locked_point_is_not_re_placed(placed) -> None:
    placed.workspace.labels.lock()
    assert not placed.commands.run("point.replace")
    assert not placed.commands.actions["point.place"].isEnabled()


@pytest.mark.parametrize("step", ["scan", "atlas", "pose"])
@pytest.mark.parametrize("name", ["axial", "3d"])
def test_a_click_outside_the_step_label_looks_and_places_nothing(window, step, name) -> None:
    view = window.grid.scene_view if name == "3d" else axial_of(window)
    window.set_step(step)
    before = window.workspace.document.state
    where = MIDDLE - [0, 6.0, 0] if name == "3d" else INSIDE
    window.grid.scene_view.view_from("A")
    assert hover(view, where) is Qt.CursorShape.ArrowCursor
    click(view, where)
    assert window.workspace.document.state is before
    np.testing.assert_allclose(window.workspace.view.crosshair, where, atol=0.3)


def test_p_goes_back_to_the_step_where_clicks_place(window) -> None:
    window.set_step("scan")
    QTest.keyClick(window, Qt.Key.Key_P)
    assert window.rail.step == "label"
    assert window.workspace.interaction.tool == "place"
    click(axial_of(window), INSIDE)
    assert window.workspace.labels.progress(L).n_placed == 1


def test_on_the_scan_is_off_again_in_another_step(window) -> None:
    window.set_step("pose")
    window.commands.run("pose.touch")
    assert hover(axial_of(window), INSIDE) is Qt.CursorShape.CrossCursor
    assert window.status.next_click.text().startswith("Click on bone or a slice where")
    window.set_step("atlas")
    click(axial_of(window), INSIDE)
    assert not window.workspace.document.state.touches
    assert not window.workspace.document.state.landmarks
