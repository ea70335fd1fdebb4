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
