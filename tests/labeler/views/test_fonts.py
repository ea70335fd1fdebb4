"""One font on every machine, with all the signs in use; text as large as the user and the desktop want it."""

from __future__ import annotations

import ast
import unicodedata
from pathlib import Path

import pytest
from fontTools.ttLib import TTFont
from qtpy.QtGui import QFont, QFontDatabase, QFontInfo
from qtpy.QtWidgets import QAbstractButton, QApplication, QLabel
from window_cases import ball_volume, wait_until_idle

from gp_core.landmarks.features import Side
from gp_labeler.document.state import How
from gp_labeler.scene.colours import DARK, LIGHT, contrast
from gp_labeler.views import fonts
from gp_labeler.views.painting.word_pictures import word_picture
from gp_labeler.views.typeface import FAMILY, font_file, font_files

pytestmark = pytest.mark.any_binding

_INVISIBLE = {"\N{ZERO WIDTH SPACE}", "\x7f"}


def signs_in_use() -> set[str]:
    """Return every sign beyond ASCII in a text of the program."""
    package = Path(fonts.__file__).parents[1]
    trees = [ast.parse(path.read_text()) for path in package.rglob("*.py")]
    texts = [n.value for tree in trees for n in ast.walk(tree) if isinstance(n, ast.Constant)]
    signs = {sign for text in texts if isinstance(text, str) for sign in text if ord(sign) > 126}
    return {sign for sign in signs - _INVISIBLE if unicodedata.category(sign) != "Cs"}


@pytest.mark.parametrize("style", ["Regular", "Semibold", "Bold"])
def test_the_font_has_every_sign_in_use(style) -> None:
    known = TTFont(font_file(style)).getBestCmap()
    assert {sign for sign in signs_in_use() if ord(sign) not in known} == set()


def test_digits_are_equally_wide(qapp) -> None:
    assert len({fonts.text_width(None, digit * 40) for digit in "0123456789"}) == 1


def test_the_window_is_drawn_in_the_font_of_the_dependency(make_window) -> None:
    window = make_window()
    assert len(font_files()) == 4
    assert FAMILY in QFontDatabase.families()
    shown = [label for label in window.findChildren(QLabel) if label.isVisible() and label.text()]
    assert {QFontInfo(label.font()).family() for label in shown} == {FAMILY}


def test_words_in_the_views_are_letters_of_that_font(qapp, monkeypatch) -> None:
    ours = word_picture("RWA", 40, "#FFFFFF", 1.0).image
    monkeypatch.setattr("gp_labeler.views.painting.word_pictures.base_font", QFont)
    monkeypatch.setattr("gp_labeler.views.painting.word_pictures.family", lambda: "another")
    assert word_picture("RWA", 40, "#FFFFFF", 1.0).image != ours


def test_text_size_is_chosen_and_remembered(make_window) -> None:
    window = make_window()
    title = window.welcome.findChild(QLabel)
    before = title.fontInfo().pixelSize()
    window.commands.run("view.text_larger")
    assert window.text_size == 115
    assert title.fontInfo().pixelSize() == pytest.approx(1.15 * before, abs=1)
    window.close()
    again = make_window()
    assert again.text_size == 115
    again.commands.run("view.text_normal")
    again.commands.run("view.text_smaller")
    assert again.text_size == 85


def test_a_file_of_nonsense_leaves_the_text_size_at_one_that_is_offered(make_window, tmp_path) -> None:
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "window.json").write_text('{"text_size": 100000}')
    assert make_window().text_size == max(fonts.TEXT_SIZES)


def test_the_larger_text_of_the_desktop_is_followed(make_window, monkeypatch) -> None:
    window = make_window()
    before = window.status.next_click.fontInfo().pixelSize()
    usual = QApplication.font()
    larger = QFontDatabase.systemFont(QFontDatabase.SystemFont.GeneralFont)
    larger.setPixelSize(20)
    monkeypatch.setattr(QFontDatabase, "systemFont", lambda _: larger)
    QApplication.setFont(larger)  # as a desktop does while the program runs
    QApplication.processEvents()
    try:
        assert window.status.next_click.fontInfo().pixelSize() == pytest.approx(1.5 * before, abs=1)
    finally:
        QApplication.setFont(usual)


def test_slices_and_3d_follow_the_text_size(qtbot, window) -> None:
    window.workspace.labels.place([10.0, -20.0, 36.0], How.MESH, side=Side.LEFT, code="CA")
    wait_until_idle(qtbot, window)
    overlay = window.grid.scene_view.overlay
    assert overlay.text_size == pytest.approx(fonts.TEXT * fonts.desktop_scale())
    small, large = (word_picture("CA", size, "#FFFFFF", 1.0).box.height() for size in (13, 26))
    assert large == pytest.approx(2 * small, abs=2)
    window.set_text_size(200)
    wait_until_idle(qtbot, window)
    assert overlay.text_size == pytest.approx(2 * fonts.TEXT * fonts.desktop_scale())


def test_nothing_in_the_bar_moves_with_what_can_be_undone(qtbot, window) -> None:
    labels = window.workspace.labels
    bar = window.findChild(type(window.centralWidget().layout().itemAt(0).widget()))

    def places() -> list[tuple[int, int]]:
        QApplication.processEvents()
        return [(b.x(), b.width()) for b in bar.findChildren(QAbstractButton) if b.isVisible()]

    labels.place([10.0, -20.0, 36.0], How.MESH, side=Side.LEFT, code="CA")
    one = places()
    labels.place([10.0, -20.0, 36.0], How.MESH, side=Side.RIGHT, code="RWM")
    labels.mark_unseen(side=Side.LEFT, code="DTL")
    assert places() == one
    assert "DTL" in window.commands.actions["edit.undo"].text()


@pytest.mark.parametrize("colours", [DARK, LIGHT], ids=["dark", "light"])
def test_words_in_the_views_are_legible_in_both_themes(colours) -> None:
    grounds = (colours.halo, colours.top, colours.bottom)
    faint = {
        (state, ground): contrast(colours.word(state), ground)
        for state in colours.states
        for ground in grounds
        if contrast(colours.word(state), ground) < 4.5
    }
    assert faint == {}
    assert min(contrast(DARK.word(state), "#000000") for state in DARK.states) >= 4.5  # slices are black


def test_the_instruction_is_always_whole(qtbot, window) -> None:
    volume = ball_volume()
    window.workspace.scan.begin(volume)
    wait_until_idle(qtbot, window)
    for width in (1400, 1000, 853, 640):
        for size in (100, 150, 200):
            window.set_text_size(size)
            window.resize(width, 512)
            window.grid.hovered.emit(volume.origin)
            for tool in ("place", "look", "grey"):
                window.workspace.interaction.set_tool(tool)
                QApplication.processEvents()
                text = window.status.next_click
                need = text.heightForWidth(text.width()) if text.wordWrap() else text.sizeHint().height()
                words = 0 if text.wordWrap() else fonts.text_width(text, text.text())
                assert text.height() >= need
                assert text.width() >= words - 1
                assert window.status.geometry().bottom() < window.height()
