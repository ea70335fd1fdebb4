"""A window without a display, a scan whose surface is known, and a check that nothing is left behind."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import qtpy

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from pytestqt.qtbot import QtBot
from window_cases import PATIENCE_MS, Answers, ball_volume, close, left_behind, wait_until_idle

from gp_labeler.imaging.volume import Volume

if os.environ.get("GP_LABELER_CANVAS") == "native":  # before the application is made, as the program does
    from gp_labeler.views.canvas_choice import share_contexts

    share_contexts()


_DRAWN = ("views", "scene", "scripting")
"""Folders of tests that show or draw something; `scripting/test_leaks.py` looks at whole scripts. Elsewhere
tests that do so ask for the application."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """After the tests of a file, nothing that they showed or drew is alive: no widget, no scene of VTK."""
    yield
    if (nextitem is None or nextitem.path != item.path) and _is_checked(item):
        getattr(item, "funcargs", {}).clear()  # pytest keeps what the last test was given a little longer
        left = left_behind()
        assert not left, f"left behind by the tests of {item.path.name}"


def _is_checked(item: pytest.Item) -> bool:
    """Whether what a file leaves is looked for: with the usual binding and canvas, if nothing failed."""
    usual = qtpy.PYSIDE6 and os.environ.get("GP_LABELER_CANVAS") != "native"
    any_failed = bool(item.session.testsfailed)  # its traceback keeps what it showed
    draws = item.path.parent.name in _DRAWN or "qapp" in getattr(item, "fixturenames", ())
    return usual and not any_failed and draws and "qtpy.QtWidgets" in sys.modules


class PatientBot(QtBot):
    """pytest-qt's own, which waits for what must come true however busy the machine is."""

    def waitUntil(self, callback, *, timeout=PATIENCE_MS):  # noqa: N802
        return super().waitUntil(callback, timeout=timeout)

    def waitSignal(self, signal, *, timeout=PATIENCE_MS, **options):  # noqa: N802
        return super().waitSignal(signal, timeout=timeout, **options)


@pytest.fixture
def qtbot(qapp, request) -> QtBot:
    return PatientBot(request)


@pytest.fixture
def ball() -> Volume:
    return ball_volume()


@pytest.fixture
def make_window(qtbot, tmp_path) -> Iterator[Callable[..., object]]:
    """Make windows on one state directory; whatever is left of them afterwards is a leak."""
    from qtpy.QtWidgets import QApplication

    from gp_labeler.views.application import make_window as make

    windows = []

    def made(directory: Path | None = None, *, atlas: bool = False):
        window = make(directory or tmp_path / "state", atlas=atlas)
        window.prompts = Answers()
        window.resize(1100, 760)
        window.show()
        qtbot.waitExposed(window)
        window.activateWindow()
        windows.append(window)
        return window

    yield made
    for window in windows:
        close(window)
    windows.clear()
    left = [w for w in QApplication.topLevelWidgets() if w.isVisible()]
    assert left == []


@pytest.fixture(scope="module")
def one_window(qapp) -> Iterator[object]:
    """One window for all tests of a file: to open a scan again is quicker than to make a window."""
    from gp_labeler.views.application import make_window as make

    made = make(None, atlas=False)
    made.prompts = Answers()
    made.resize(1100, 760)
    made.show()
    yield made
    close(made)


@pytest.fixture
def window(qtbot, make_window, ball):
    """A window with the ball open and meshed."""
    window = make_window()
    window.workspace.scan.begin(ball)
    wait_until_idle(qtbot, window)
    return window
