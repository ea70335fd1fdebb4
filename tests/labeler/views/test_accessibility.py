"""Without a mouse or a screen: the job by keyboard alone, focus that shows, names on all controls."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtCore import Qt
from qtpy.QtGui import QKeySequence
from qtpy.QtTest import QTest
from qtpy.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QHeaderView,
    QLineEdit,
    QPlainTextEdit,
    QScrollBar,
    QTextEdit,
    QWidget,
)
from window_cases import MIDDLE, image_bytes, wait_until_idle, write_ball

from gp_core import Side

_CONTROLS = (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QComboBox,
    QLineEdit,
    QPlainTextEdit,
    QTextEdit,
)
_STEPS = ("scan", "label", "atlas", "pose")


def _controls(window) -> list[QWidget]:
    """Return what can be worked with, as it is shown now; the inside of Qt's own widgets is Qt's."""
    return [
        widget
        for widget in window.findChildren(QWidget)
        if widget.isVisible()
        and (isinstance(widget, _CONTROLS) or widget.focusPolicy() != Qt.FocusPolicy.NoFocus)
        and not isinstance(widget, QHeaderView | QScrollBar)
        and not widget.objectName().startswith("qt_")
    ]


def _spoken(widget: QWidget) -> str:
    """Return the name that a screen reader says; PyQt6 does not give what answers it."""
    QAccessible = pytest.importorskip("PySide6.QtGui").QAccessible
    interface = QAccessible.queryAccessibleInterface(widget)
    return interface.text(QAccessible.Text.Name).strip() if interface else ""


def _press(window, *keys: str) -> None:
    for one in keys:
        QTest.keySequence(QApplication.focusWidget() or window, QKeySequence(one))
        QApplication.processEvents()


@pytest.fixture
def ball_window(make_window, qtbot, tmp_path):
    """A window in which the ball was opened by keyboard."""
    window = make_window()
    qtbot.waitUntil(window.isActiveWindow)
    window.prompts.files = [write_ball(tmp_path / "ball.nrrd")]
    _press(window, "Ctrl+O")
    qtbot.waitUntil(lambda: window.workspace.scan.volume is not None)
    wait_until_idle(qtbot, window)
    return window


def test_every_control_has_a_name_for_a_screen_reader(ball_window) -> None:
    unnamed = set()
    for step in _STEPS:
        ball_window.set_step(step)
        QApplication.processEvents()
        unnamed |= {
            f"{step}: {type(widget).__name__}" for widget in _controls(ball_window) if not _spoken(widget)
        }
    assert unnamed == set()


def test_every_control_shows_that_it_has_the_focus(ball_window) -> None:
    hidden = set()
    for step in _STEPS:
        ball_window.set_step(step)
        for widget in _controls(ball_window):
            if not widget.isEnabled() or not widget.focusPolicy() & Qt.FocusPolicy.TabFocus:
                continue
            ball_window.setFocus()
            QApplication.processEvents()
            before = image_bytes(widget.grab().toImage())
            widget.setFocus(Qt.FocusReason.TabFocusReason)
            QApplication.processEvents()
            after = image_bytes(widget.grab().toImage())
            if before.shape == after.shape and (before == after).all():
                hidden.add(f"{step}: {type(widget).__name__} {_spoken(widget)}")
    assert hidden == set()


def test_the_whole_job_by_keyboard_alone(ball_window, qtbot, tmp_path) -> None:
    window, prompts = ball_window, ball_window.prompts
    document, file = window.workspace.document, tmp_path / "ball.gpspecimen.json"

    def n_placed() -> int:
        return sum(len(document.state.side(side).placed) for side in Side)

    for number in range(3):  # the next feature is chosen by itself
        at = np.add(MIDDLE, [0.0, 0.0, 1.0 + number])
        prompts.answers = [" ".join(f"{value:g}" for value in at)]
        _press(window, "Ctrl+G", "Space")
        assert n_placed() == number + 1
    _press(window, "Ctrl+Z")
    assert n_placed() == 2
    _press(window, "Ctrl+Y")
    assert n_placed() == 3
    side = window.workspace.labels.active.side
    _press(window, "Q")
    assert window.workspace.labels.active.side is side.other
    prompts.files = [file]
    _press(window, "Ctrl+S")
    qtbot.waitUntil(file.is_file)
    qtbot.waitUntil(lambda: not document.dirty)
