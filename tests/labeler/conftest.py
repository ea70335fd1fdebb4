"""A window without a display, a scan whose surface is known, and a check that nothing is left behind."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import qtpy

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from pytestqt.qtbot import QtBot
from window_cases import (
    PATIENCE_MS,
    Answers,
    ball_volume,
    close,
    left_behind,
    left_by_test,
    top_level_widgets,
    wait_until_idle,
)

from gp_labeler.imaging.volume import Volume

if os.environ.get("GP_LABELER_CANVAS") == "native":  # before the application is made, as the program does
    from gp_labeler.views.canvas_choice import share_contexts

    share_contexts()


_DRAWN = ("views", "scene", "scripting")
"""Folders of tests that show or draw something; `scripting/test_leaks.py` looks at whole scripts. Elsewhere
tests that do so ask for the application."""


_BEFORE = pytest.StashKey[list[object]]()
"""The windows that were there before a test."""


@pytest.fixture(autouse=True)
def _set_aside(request: pytest.FixtureRequest) -> None:
    """Set aside from the collector what is there before a test: what is found afterwards is the test's own.

    Looking for it takes milliseconds. It is done once the test is torn down: until then, pytest keeps the
    frames of a fixture that skipped it.
    """
    gc.disable()  # as the window does: no background job may destroy what a test showed
    if _is_checked(request.node):
        request.node.stash[_BEFORE] = top_level_widgets()
        gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """After a test, and after a file, nothing that it showed or drew is alive: no window, no scene of VTK.

    A window of the whole file keeps what a test drew in it. Beside one, only other windows are looked for
    after each test, and the rest at the end of the file.
    """
    try:
        yield
        getattr(item, "funcargs", {}).clear()  # pytest keeps what the test was given a little longer
        if _BEFORE in item.stash and _is_checked(item):
            left = left_by_test(item.stash[_BEFORE])
            assert not left, "left behind by the test"
    finally:
        gc.unfreeze()
        if _BEFORE in item.stash:
            del item.stash[_BEFORE]
    if (nextitem is None or nextitem.path != item.path) and _is_checked(item):
        left = left_behind()
        assert not left, f"left behind by the tests of {item.path.name}"


@pytest.fixture(scope="module", autouse=True)
def _collect_after_each_file() -> Iterator[None]:
    yield
    gc.collect()
    gc.enable()


def _is_checked(item: pytest.Item) -> bool:
    """Whether what a file leaves is looked for: with the usual binding and canvas, if nothing failed."""
    usual = qtpy.PYSIDE6 and os.environ.get("GP_LABELER_CANVAS") != "native"
    any_failed = bool(item.session.testsfailed)  # its traceback keeps what it showed
    draws = item.path.parent.name in _DRAWN or "qapp" in getattr(item, "fixturenames", ())
    return usual and not any_failed and draws


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
