"""Without a mouse, sharp eyes or a screen: names, a focus that shows, contrast and size, in every state."""

from __future__ import annotations

from collections import defaultdict
from types import SimpleNamespace

import numpy as np
import pytest
from accessible import controls, focus_contrast, menu_words, painted_words, spoken, words_of
from qtpy.QtCore import QPoint, Qt
from qtpy.QtGui import QFontInfo
from qtpy.QtWidgets import QApplication, QFileDialog, QLabel, QMenu, QToolTip, QWidget
from text_states import walk_states

from gp_labeler.models.workflow import PointState
from gp_labeler.scene.marks import LOOKED_AT, Mark, growth_of
from gp_labeler.views.chips import SHAPES
from gp_labeler.views.painting.marks import shape_of
from gp_labeler.views.theme import THEMES

pytest.importorskip("PySide6")  # PyQt6 does not say what a screen reader is told

FOCUS_CONTRAST, WORD_CONTRAST = 3.0, 4.5
"""Web Content Accessibility Guidelines 2.2, criteria 2.4.13 and 1.4.3, level AA for words of any size."""

LARGE = 150
"""A text size, percent, that a dialog has to follow."""


class Walk:
    """Looks at each state of a window once, at what is new in it in each theme, and keeps what it finds."""

    def __init__(self, window) -> None:
        self.window = window
        self.found: dict[str, set[str]] = defaultdict(set)
        self.seen: set[tuple[object, ...]] = set()

    def look(self, state: str, root: QWidget) -> None:
        if not root.isActiveWindow():
            root.activateWindow()
            QApplication.processEvents()
        for widget in controls(root):
            name = spoken(widget)
            if sum(letter.isalpha() for letter in name) < 2:
                self.found["names"].add(f"{state}: {type(widget).__name__} {name!r}")
        focusable = [each for each in self._focusable(root) if self._is_new(self._kind(each))]
        words = [each for each in (*words_of(root), *painted_words(root)) if self._is_new(each.kind)]
        if focusable or words:
            for theme in THEMES:
                self._look_in(theme, state, root, focusable, words)
            self.window.set_theme("dark")
        if root is not self.window and root.window() is root:
            self._enlarge(state, root)

    def _look_in(self, theme: str, state: str, root: QWidget, focusable: list, words: list) -> None:
        if self.window.theme_name != theme:
            self.window.set_theme(theme)
            QApplication.processEvents()
        for each in words:
            ratio = each.contrast(root)
            if ratio < WORD_CONTRAST:
                self.found["words"].add(f"{state}, {theme}: {each.words!r} {each.kind} {ratio:.1f}")
        for widget in focusable:
            ratio = focus_contrast(widget, root)
            if ratio < FOCUS_CONTRAST:
                self.found["focus"].add(f"{state}, {theme}: {self._kind(widget)} {ratio:.1f}")

    def _enlarge(self, state: str, root: QWidget) -> None:
        """Find words of a dialog that do not grow with the text size of the window."""
        before = {each.widget: QFontInfo(each.widget.font()).pixelSize() for each in words_of(root)}
        self.window.set_text_size(LARGE)
        QApplication.processEvents()
        for widget, size in before.items():
            if QFontInfo(widget.font()).pixelSize() < 0.9 * LARGE / 100 * size:
                self.found["size"].add(f"{state}: {type(widget).__name__} {widget.property('role')}")
        self.window.set_text_size(100)

    def _focusable(self, root: QWidget) -> list[QWidget]:
        policy = Qt.FocusPolicy.TabFocus
        return [each for each in controls(root) if each.isEnabled() and each.focusPolicy() & policy]

    def _kind(self, widget: QWidget) -> tuple[object, ...]:
        roles = [widget.property("role"), widget.property("checked"), widget.styleSheet()]
        is_qt = type(widget).__module__.startswith("PySide6")
        return ("focus", type(widget).__name__, *roles, "" if is_qt else spoken(widget))

    def _is_new(self, kind: tuple[object, ...]) -> bool:
        is_new = kind not in self.seen
        self.seen.add(kind)
        return is_new


@pytest.fixture(scope="module")
def found(one_window, tmp_path_factory) -> dict[str, set[str]]:
    """What is wrong in any state of a window, by kind."""
    walk = Walk(one_window)
    walk_states(one_window, tmp_path_factory.mktemp("states"), walk.look)
    return walk.found


def test_every_control_has_a_name_for_a_screen_reader(found) -> None:
    assert found["names"] == set()


def test_every_control_shows_that_it_has_the_focus(found) -> None:
    assert found["focus"] == set()


def test_all_words_stand_out_from_what_is_behind_them(found) -> None:
    assert found["words"] == set()


def test_words_of_dialogs_grow_with_the_text_size(found) -> None:
    assert found["size"] == set()


@pytest.mark.parametrize("theme", THEMES)
def test_menus_tool_tips_and_file_dialogs_stand_out_too(one_window, qtbot, theme) -> None:
    window = one_window
    window.set_theme(theme)
    menus = window.menuBar().findChildren(QMenu)
    faint = {f"{words}: {ratio:.1f}" for menu in menus for words, ratio in menu_words(menu) if ratio < 4.5}
    QToolTip.showText(QPoint(50, 50), "Only labels that you have placed count", window.panels)
    (tip,) = [each for each in QApplication.topLevelWidgets() if each.inherits("QTipLabel")]
    dialog = QFileDialog(window, "Open")
    dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
    dialog.show()
    holder = SimpleNamespace(found=[])
    for words in (*words_of(dialog), *painted_words(dialog)):
        if (ratio := words.contrast(dialog)) < WORD_CONTRAST:
            holder.found.append(f"{words.words!r} {ratio:.1f}")
    assert isinstance(tip, QLabel)
    dialog.deleteLater()
    tip.close()
    tip.deleteLater()
    window.set_theme("dark")
    assert (faint, holder.found) == (set(), [])


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
