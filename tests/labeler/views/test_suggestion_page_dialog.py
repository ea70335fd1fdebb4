"""Checking suggestions in pages: real clicks and keys on the real window."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtCore import QEvent, Qt
from qtpy.QtGui import QKeyEvent
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication
from window_cases import MIDDLE, wait_until_idle

from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.document.edits import SuggestPoints
from gp_labeler.document.state import How
from gp_labeler.scripting.events import click, turn_wheel
from gp_labeler.views.panels.label.suggest_row import SuggestRow
from gp_labeler.views.panels.label.suggestion_page_dialog import SuggestionPageDialog

L = Side.LEFT
LEFT = Qt.MouseButton.LeftButton
CODES = [row.code for row in FEATURES if not row.computed]


@pytest.fixture
def dialog(qtbot, window):
    """The first of three pages: 19 suggestions of the left side, ZL doubtful."""
    window.set_step("label")
    found = {
        code: Suggestion(tuple(MIDDLE + 0.1 * n), 0.2 + 0.01 * n, "5 labelled scans", doubtful=code == "ZL")
        for n, code in enumerate(CODES)
    }
    workspace = window.workspace
    workspace.document.do(SuggestPoints(L, found, workspace.document.provenance(How.GHOST)))
    check = window.findChild(SuggestRow).check
    qtbot.waitUntil(check.isEnabled)
    QTest.mouseClick(check, LEFT)
    (dialog,) = window.findChildren(SuggestionPageDialog)
    show_all(qtbot, window, dialog)
    return dialog


def show_all(qtbot, window, dialog) -> None:
    """Wait until the page is drawn, and look at all of it, scrolling where it does not fit."""
    wait_until_idle(qtbot, window)
    for tile in dialog.shown_tiles:
        dialog.area.ensureWidgetVisible(tile)
        qtbot.wait(10)


def landmarks(window):
    return window.workspace.document.landmarks(L)


def test_clicked_ones_stay_and_enter_confirms_the_others(qtbot, window, dialog) -> None:
    first = dialog.shown_tiles
    doubtful = next(tile for tile in first if tile.entry.code == "ZL").entry.code
    clicked = next(tile for tile in first if tile.entry.is_offered)
    marked = clicked.entry.code
    QTest.mouseClick(clicked, LEFT)
    assert clicked.isChecked()
    codes = [tile.entry.code for tile in first]
    QTest.keyClick(clicked, Qt.Key.Key_Return)
    assert set(landmarks(window).placed) - {"CO"} == set(codes) - {doubtful, marked}
    assert window.workspace.pages.number == 1
    about = window.workspace.document.state.landmark(L, codes[-1]).provenance
    assert (about.how, about.source) == (How.PAGE, "5 labelled scans")
    QTest.keyClick(dialog.confirm, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert landmarks(window).placed == ()
    assert window.workspace.pages.number == 0


@pytest.mark.parametrize(("doubtful", "number"), [(False, 0), (False, 1), (True, 0)])
def test_a_click_with_ctrl_places_the_feature_where_it_is_seen(
    qtbot, window, dialog, doubtful, number
) -> None:
    """To half a pixel of the picture; it is drawn again around the label, which Ctrl+Z takes back."""
    tile = next(
        each
        for each in dialog.shown_tiles
        if bool(each.entry.refusal) is doubtful and each.entry.pictures[number].depths is None
    )
    code, before, picture = tile.entry.code, tile.entry.suggestion, tile.entry.pictures[number]
    x, y = (round(each) for each in tile.pixel_of_place(number, 0.62, 0.41))
    click(tile, x, y, ctrl=True)
    mark = window.workspace.document.state.landmark(L, code)
    assert (mark.provenance.how, mark.provenance.source) == (How.CORRECTED, "5 labelled scans")
    seen_at = np.array(tile.pixel_of_place(number, *picture.place_of(mark.position)))
    assert np.abs(seen_at - (x + 0.5, y + 0.5)).max() < 0.5
    assert picture.depth_of(mark.position) == pytest.approx(0, abs=1e-9)
    assert "placed by you" in tile.accessibleName()
    wait_until_idle(qtbot, window)
    assert tile.entry.shows_its_place
    QTest.keyClick(tile, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert tile.entry.suggestion == before
    assert landmarks(window).placed == ()


def test_what_was_corrected_stays_when_enter_confirms_the_others(qtbot, window, dialog) -> None:
    tile = next(each for each in dialog.shown_tiles if each.entry.is_offered)
    code = tile.entry.code
    click(tile, *tile.pixel_of_place(0, 0.3, 0.3), ctrl=True)
    wait_until_idle(qtbot, window)
    assert dialog.confirm.text() == f"Confirm {len(dialog.shown_tiles) - 2} and go on"  # ZL is doubtful
    QTest.keyClick(tile, Qt.Key.Key_Return)
    state = window.workspace.document.state
    hows = {state.landmark(L, each).provenance.how for each in landmarks(window).placed if each != code}
    assert hows == {How.PAGE}
    assert state.landmark(L, code).provenance.how is How.CORRECTED


def test_the_wheel_turns_one_picture_to_the_next_slice_and_a_click_there_places_it(
    qtbot, window, dialog
) -> None:
    tile = next(each for each in dialog.shown_tiles if each.entry.is_offered)
    entry, code = tile.entry, tile.entry.code
    pixel = tile.pixel_of_place(0, 0.5, 0.5)
    turn_wheel(tile, *pixel, 1)
    wait_until_idle(qtbot, window)
    assert not tile.entry.shows_its_place
    spacing = window.workspace.scan.volume.spacing[0]
    assert tile.entry.mm_off_slice(0) == pytest.approx(spacing)
    assert tile.entry.mm_off_slice(1) == 0
    click(tile, *pixel, ctrl=True)
    placed = np.array(window.workspace.document.state.landmark(L, code).position)
    assert abs(entry.pictures[0].depth_of(placed)) == pytest.approx(spacing)


def test_the_wheel_over_bone_and_beside_the_pictures_scrolls_the_page(qtbot, window, dialog) -> None:
    tile = next(each for each in dialog.shown_tiles if each.entry.pictures[1].depths is not None)
    for pixel in (tile.pixel_of_place(1, 0.5, 0.5), (tile.width() / 2, 4)):
        turn_wheel(tile, *pixel, 1)
        assert tile.entry.shows_its_place


def test_a_click_on_nothing_says_so_in_the_dialog_until_something_is_done(qtbot, window, dialog) -> None:
    tile = next(each for each in dialog.shown_tiles if each.entry.pictures[1].depths is not None)
    empty = np.argwhere(np.isnan(tile.entry.pictures[1].depths))[0]
    down, across = (empty + 0.5) / len(tile.entry.pictures[1].depths)
    explained = dialog.hint.text()
    click(tile, *tile.pixel_of_place(1, across, down), ctrl=True)
    assert landmarks(window).placed == ()
    assert tile.entry.name in dialog.hint.text()
    click(tile, *tile.pixel_of_place(0, 0.5, 0.4), ctrl=True)
    assert dialog.hint.text() == explained


def test_ctrl_beside_the_pictures_marks_as_ever(qtbot, window, dialog) -> None:
    tile = next(each for each in dialog.shown_tiles if each.entry.is_offered)
    click(tile, tile.width() / 2, 8, ctrl=True)
    assert tile.entry.is_marked
    assert landmarks(window).placed == ()


def test_enter_before_the_page_is_drawn_confirms_nothing(qtbot, window, dialog) -> None:
    QTest.keyClick(dialog.tiles[0], Qt.Key.Key_Return)
    n = len(landmarks(window).placed)
    for _ in range(5):  # faster than anybody can look: the second page has not been painted
        QTest.keyClick(dialog.tiles[0], Qt.Key.Key_Return)
    assert len(landmarks(window).placed) == n
    assert window.workspace.pages.number == 1


def test_a_key_that_is_held_down_confirms_nothing(qtbot, window, dialog) -> None:
    for kind in (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress):
        held = QKeyEvent(kind, Qt.Key.Key_Return, Qt.KeyboardModifier.NoModifier, "\r", True)
        QApplication.sendEvent(dialog.tiles[0], held)
    assert landmarks(window).placed == ()


def test_pages_are_left_without_confirming_and_come_back(qtbot, window, dialog) -> None:
    assert not dialog.back.isEnabled()
    QTest.mouseClick(dialog.leave, LEFT)
    assert window.workspace.pages.number == 1
    QTest.mouseClick(dialog.back, LEFT)
    assert window.workspace.pages.number == 0
    assert landmarks(window).placed == ()


def test_after_the_last_page_what_is_left_comes_up_closely(qtbot, window, dialog) -> None:
    for _ in range(window.workspace.pages.n_pages):
        show_all(qtbot, window, dialog)
        QTest.keyClick(dialog.shown_tiles[0], Qt.Key.Key_Enter)
    assert not window.workspace.pages.is_open
    assert set(landmarks(window).suggested) == {"ZL"}
    assert window.workspace.labels.active.code == "ZL"
    wait_until_idle(qtbot, window)
    assert window.grid.can_judge(np.array(landmarks(window).suggested["ZL"].position))
    assert not window.findChild(SuggestRow).check.isVisible()


def test_a_tile_is_marked_by_the_keyboard_too_and_says_so(qtbot, window, dialog) -> None:
    tile = next(tile for tile in dialog.shown_tiles if tile.entry.is_offered)
    tile.setFocus()
    QTest.keyClick(tile, Qt.Key.Key_Space)
    assert tile.entry.is_marked
    assert "marked" in tile.accessibleName()
    QTest.keyClick(tile, Qt.Key.Key_Space)
    assert tile.entry.is_offered
