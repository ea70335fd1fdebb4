"""Menus, tool tips and file dialogs stand out, and no state is told by its colour alone.

What the states of the window show is looked at by test_cut_words.
"""

from __future__ import annotations

import numpy as np
import pytest
import qtpy
from accessible import WORD_CONTRAST, contrast_of, menu_words, painted_words, role_of, words_of
from qtpy.QtCore import QPoint
from qtpy.QtWidgets import (
    QApplication,
    QComboBox,
    QFileDialog,
    QInputDialog,
    QMenu,
    QMessageBox,
    QToolTip,
    QWidget,
)

from gp_labeler.models.workflow import PointState
from gp_labeler.scene.marks import LOOKED_AT, Mark, growth_of
from gp_labeler.views.chips import SHAPES
from gp_labeler.views.painting.marks import shape_of
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.theme import THEMES, contrast


@pytest.fixture(params=THEMES)
def window(request, one_window):
    one_window.set_theme(request.param)
    yield one_window
    one_window.set_theme("dark")


def test_entries_of_menus_stand_out_also_where_they_are_disabled_or_chosen(window) -> None:
    measured = [entry for menu in window.menuBar().findChildren(QMenu) for entry in menu_words(menu)]
    assert len(measured) > 100
    assert [entry for entry in measured if entry[1] < WORD_CONTRAST] == []


def test_tool_tips_stand_out(window) -> None:
    QToolTip.showText(QPoint(50, 50), "Only labels that you have placed count", window.panels)
    (tip,) = [each for each in QApplication.topLevelWidgets() if each.inherits("QTipLabel")]
    ratio = contrast_of(tip)
    tip.close()
    tip.deleteLater()
    assert WORD_CONTRAST <= ratio < 21


def test_file_dialogs_stand_out(window) -> None:
    dialog = QFileDialog(window, "Open")
    dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
    dialog.show()
    measured = [(each.words, each.contrast(dialog)) for each in (*words_of(dialog), *painted_words(dialog))]
    dialog.close()
    dialog.deleteLater()
    assert len(measured) > 3
    assert [each for each in measured if each[1] < WORD_CONTRAST] == []


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
def test_every_colour_of_words_stands_out_on_every_ground_also_under_the_pointer(theme) -> None:
    words = {name: getattr(theme, name) for name in _INKS} | theme.states
    ratios = {
        (ink, ground): contrast(colour, getattr(theme, ground))
        for ink, colour in words.items()
        for ground in _GROUNDS
    }
    assert {pair: ratio for pair, ratio in ratios.items() if ratio < WORD_CONTRAST} == {}


_INKS = ("text", "muted", "faint", "accent_text", "warning", "danger", "good")
_GROUNDS = ("window", "panel", "card", "raised", "hover", "field", "selected")


def test_the_button_that_enter_means_looks_like_it_and_stands_last(window) -> None:
    """In questions as in the program's own dialogs."""
    box = QMessageBox(window)
    save = box.addButton("Save", QMessageBox.ButtonRole.AcceptRole)
    leave = box.addButton(QMessageBox.StandardButton.Cancel)
    box.setDefaultButton(save)
    box.show()
    ground, theme = save.grab().toImage().pixelColor(save.width() // 2, 4), THEMES[window.theme_name]
    box.close()
    box.deleteLater()
    assert save.x() > leave.x()
    assert ground.name().upper() == theme.accent


# Never by colour alone


def test_each_state_of_a_point_has_a_shape_or_a_size_of_its_own() -> None:
    assert {state.value for state in PointState} <= SHAPES.keys()
    assert len(set(SHAPES.values())) == len(SHAPES)
    drawn = ("placed", "other", "computed", "doubtful", "suggested", *sorted(LOOKED_AT))
    shapes = {
        (shape_of(state), state in LOOKED_AT, growth_of(Mark("L:CA", np.zeros(3), "", state)))
        for state in drawn
    }
    assert len(shapes) == len(drawn)


def test_a_message_says_by_a_word_what_its_colour_says_and_screen_readers_are_told(
    one_window, monkeypatch
) -> None:
    QtGui = pytest.importorskip("PySide6.QtGui")
    told = []
    monkeypatch.setattr(
        QtGui.QAccessible, "updateAccessibility", lambda e: told.append((e.message(), e.politeness().name))
    )
    texts = ["The scan has no bone", "Warning: the scan has no bone", "Error: the scan has no bone"]
    for level, text in zip(("info", "warning", "error"), texts, strict=True):
        one_window.workspace.say("the scan has no bone", level)
        assert one_window.status.next_click.text() == text
    assert told == list(zip(texts, ("Polite", "Assertive", "Assertive"), strict=True))


# Screen readers


@pytest.mark.skipif(not qtpy.PYSIDE6, reason="PyQt6 says nothing of roles")
def test_painted_widgets_and_exclusive_buttons_have_roles(one_window) -> None:
    found = one_window.findChildren(QWidget)
    roles = {type(each).__name__: role_of(each) for each in found if each is not one_window.rail.keys_button}
    wanted = dict.fromkeys(("FeaturePicture", "SceneView", "SliceView"), "Graphic")
    wanted |= {"HistogramSlider": "Slider", "Scrolled": "Grouping", "_RailButton": "RadioButton"}
    assert {name: roles[name] for name in wanted} == wanted


def test_a_list_of_choices_says_what_it_is_for(one_window) -> None:
    """On Linux its name is the choice, so that its description has to say it."""
    boxes = one_window.panels.findChildren(QComboBox)
    assert len(boxes) > 1
    assert [box.currentText() for box in boxes if not box.accessibleDescription()] == []


def test_a_number_is_asked_for_in_plain_digits_until_it_is_one(monkeypatch) -> None:
    given = iter([("abc", True), ("0", True), ("-1", True), ("nan", True), ("0,035", True), ("", False)])
    shown = []

    def answer(*_: object, text: str) -> tuple[str, bool]:
        shown.append(text)
        return next(given)

    monkeypatch.setattr(QInputDialog, "getText", answer)
    assert Prompts().number("Voxel size", "Voxel size, mm:", 0.05) == 0.035
    assert Prompts().number("Voxel size", "Voxel size, mm:", 0.05) is None
    assert set(shown) == {"0.05"}
