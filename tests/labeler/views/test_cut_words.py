"""One walk over every state: no word is cut, and all can work with what is shown; and the walk finds faults.

``tools/cut-words`` walks the whole matrix of fonts, screens, scales and text sizes.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from accessible import Walk
from cut_words import cut_words
from qtpy.QtCore import Qt
from qtpy.QtGui import QFontDatabase, QPainter, QPaintEvent
from qtpy.QtWidgets import QApplication, QCheckBox, QDialog, QHBoxLayout, QLabel, QPushButton, QWidget
from text_states import OWN, walk_states
from window_cases import Answers, close

from gp_labeler.views import fonts
from gp_labeler.views.application import make_window as new_window
from gp_labeler.views.guide import GuideWindow
from gp_labeler.views.main_window import MainWindow
from gp_labeler.views.panels.parts import ElidedLabel, text_label
from gp_labeler.views.theme import DARK, apply_theme

SMALL, USUAL, LARGE = (853, 512), (1280, 800), (1366, 768)
"""Screens, logical pixels: the first is what 1280 x 800 and 1366 x 768 leave at 150 %."""

FAMILIES = ("DejaVu Sans", "Liberation Sans", "Noto Sans", "Inter")
FULLEST = ("first page", "scan", "label, both sides", "pose, a mistouch", "atlas, tried out", "open a stack")
LARGE_TEXT, LOW_SCREEN = 130, 533
"""From this text size (percent) on, menus are taller than a screen of this height: they scroll there."""
SCROLLS_SIDEWAYS = "DistanceMatrixView paints"
"""A table of all pairs of landmarks is wider than any screen, and may end in the middle of a column."""
WHOLE = "GP_CUT_WORDS" in os.environ
"""Whether the whole matrix is walked, as ``tools/cut-words`` does."""


@pytest.fixture
def family():
    """Set the family, and take it back at the end."""
    yield fonts.use_family
    fonts.use_family(None)


def looks(state: str) -> list[tuple[str | None, int, tuple[int, int], str]]:
    """Return family, text size (percent), screen and theme of each look that is had at a state."""
    installed = [name for name in FAMILIES if name in QFontDatabase.families()]
    if not WHOLE:  # to restyle a window takes its time: other fonts have a look at the fullest states
        others = [(name, 100, SMALL, "dark") for name in installed] if state in FULLEST else []
        large = [(None, 150, SMALL, "dark")] if state in FULLEST else []
        return [(None, 100, SMALL, "dark"), *others, *large]
    scale = QApplication.primaryScreen().devicePixelRatio()
    screens = [(round(w / scale), round(h / scale)) for w, h in ((1280, 800), (1366, 768), (1440, 900))]
    found = [(name, 100, screen, "dark") for name in (None, *installed) for screen in screens]
    large = [(None, size, SMALL, "dark") for size in (115, 130, 150)]
    return found + large + [(None, size, screens[0], "light") for size in (85, 115, 130, 150)]


@pytest.fixture(scope="module")
def found(qapp, tmp_path_factory) -> dict[str, set[str]]:
    """What is wrong in any state of a window, by kind; the window is gone before other tests make theirs."""
    window = new_window(None, atlas=False)
    window.prompts = Answers()
    window.resize(1100, 760)
    window.show()
    walk = Walk(window)

    def look(state: str, root: QWidget) -> None:
        walk.found["cut"] |= set(cut_in_looks(window, state, root))
        if len(looks(state)) > 1:
            show_as_usual(window)
        if not WHOLE:
            walk.look(state, root)

    try:
        walk_states(window, tmp_path_factory.mktemp("states"), look)
    finally:
        fonts.use_family(None)
        close(window)
    return walk.found


def cut_in_looks(window: MainWindow, state: str, root: QWidget) -> Iterator[str]:
    """Yield the words that are cut in a state, in each of its looks."""
    for name, size, screen, theme in looks(state):
        fonts.use_family(name)
        if (window.text_size, window.theme_name) != (size, theme):
            window.theme_name = theme
            window.set_text_size(size)
        else:
            window.set_theme(theme)
        window.resize(*screen)
        if isinstance(root, QDialog | GuideWindow):
            width, height = screen if isinstance(root, GuideWindow) else (root.width(), root.height())
            root.resize(min(width, screen[0]), min(height, screen[1]))
        lines = cut_words(root, own=OWN, screen=screen)
        if lines:  # a job that has just ended may have shown more, which Qt lays out with its next events
            QApplication.processEvents()
            lines = cut_words(root, own=OWN, screen=screen)
        if size >= LARGE_TEXT and screen[1] <= LOW_SCREEN:
            lines = [line for line in lines if not line.startswith("menu ")]
        lines = [line for line in lines if not line.startswith(SCROLLS_SIDEWAYS)]
        yield from (f"{state}, {name}, {size} %, {screen}, {theme}: {line}" for line in lines)


def show_as_usual(window: MainWindow) -> None:
    """Let a window look as it does at first."""
    fonts.use_family(None)
    window.theme_name = "dark"
    window.set_text_size(100)


def test_no_word_is_cut_in_any_state(found) -> None:
    assert found["cut"] == set()


def test_every_control_has_a_name_and_a_role_for_a_screen_reader(found) -> None:
    assert found["names"] == set()
    assert found["roles"] == set()


def test_every_control_shows_that_it_has_the_focus(found) -> None:
    assert found["focus"] == set()


def test_all_words_stand_out_from_what_is_behind_them(found) -> None:
    assert found["words"] == set()


def test_words_of_dialogs_grow_with_the_text_size(found) -> None:
    assert found["size"] == set()


@pytest.mark.parametrize("name", [None, *FAMILIES])
def test_the_window_fits_the_smallest_screen(make_window, family, name) -> None:
    if name is not None and name not in QFontDatabase.families():
        pytest.skip(f"{name} is not installed")
    window = make_window()
    family(name)
    for size in fonts.TEXT_SIZES:
        window.set_text_size(size)
        QApplication.processEvents()
        least = window.minimumSizeHint()
        assert least.width() <= SMALL[0]
        assert least.height() <= SMALL[1]


# The walk itself


@pytest.fixture
def parent(qtbot):
    parent = QWidget()
    apply_theme(parent, DARK)
    qtbot.addWidget(parent)
    QHBoxLayout(parent)
    return parent


def seen(parent: QWidget, widget: QWidget, width: int, height: int = 30) -> list[str]:
    """Return what the walk says of a widget that is given so much room."""
    parent.layout().addWidget(widget)
    widget.setFixedSize(width, height)
    parent.show()
    return cut_words(parent)


@pytest.mark.parametrize(
    ("make", "enough"),
    [
        (lambda: QLabel("Round window anterior"), 170),
        (lambda: text_label("Round window anterior and posterior", wrap=True), 270),
        (lambda: QPushButton("Place at crosshair"), 170),
        (lambda: QCheckBox("Remove parts"), 170),
    ],
    ids=["label", "wrapped", "button", "check box"],
)
def test_the_walk_names_what_is_cut(parent, make, enough) -> None:
    assert seen(parent, make(), enough) == []
    assert any("Round" in line or "Place" in line or "Remove" in line for line in seen(parent, make(), 60))


def test_only_names_of_the_user_may_be_shortened(parent) -> None:
    label = ElidedLabel("a_long_name_of_a_scan.nrrd")
    assert seen(parent, label, 60) != []
    assert cut_words(parent, own=["a_long_name_of_a_scan"]) == []
    label.setToolTip("")
    assert cut_words(parent, own=["a_long_name_of_a_scan"]) != []


def test_painted_words_are_looked_at_too(parent) -> None:
    class Painted(QWidget):
        def paintEvent(self, _: QPaintEvent) -> None:  # noqa: N802 - Qt's name
            QPainter(self).drawText(self.rect(), Qt.AlignmentFlag.AlignLeft, "Round window")

    widget = Painted()
    assert seen(parent, widget, 170) == []
    assert any("paints 'Round window'" in line for line in seen(parent, widget, 30))


def test_painted_words_that_are_shortened_are_named(make_window, family) -> None:
    window = make_window()
    window.resize(*USUAL)
    rail = window.rail
    assert cut_words(rail) == []
    rail.setFixedWidth(30)
    assert any("shortened: '1 Scan'" in line for line in cut_words(rail))
