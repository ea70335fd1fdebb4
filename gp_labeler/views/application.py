"""Qt set up for this program, and a window on a scan."""

from __future__ import annotations

import atexit
import importlib
import logging
import os
import sys
import traceback
from pathlib import Path

from qtpy.QtCore import QLocale, QMessageLogContext, Qt, QTimer, QtMsgType, qInstallMessageHandler
from qtpy.QtGui import QIcon
from qtpy.QtWidgets import QApplication

from gp_core.errors import GpError
from gp_core.resources import resource_path
from gp_labeler.document.paths import default_directory
from gp_labeler.document.recovery import find_recoveries, unreadable_journals
from gp_labeler.imaging.memory import share_freed_memory
from gp_labeler.models.workspace import Workspace
from gp_labeler.system.installation import check_display
from gp_labeler.system.plain_numbers import use_plain_numbers
from gp_labeler.views.canvas_choice import choose_canvas, share_contexts
from gp_labeler.views.canvas_question import offer_measurement
from gp_labeler.views.dispatch import QtDispatcher
from gp_labeler.views.garbage_collection import collect_on_this_thread
from gp_labeler.views.main_window import MainWindow
from gp_labeler.views.panels.table import panel_at_fault
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.questions import offer_recoveries
from gp_labeler.views.screen_reader import describe_widgets
from gp_labeler.views.state_question import directory_to_use
from gp_labeler.views.window_commands.file import open_demo, open_path
from gp_labeler.views.window_state import WindowState

__all__ = ["make_application", "make_window", "report_fault", "run_window"]

_log = logging.getLogger(__name__)
_applications: list[QApplication] = []
"""Keeps the application alive: PyQt deletes one that nothing refers to."""


def make_application() -> QApplication:
    """Return the one Qt application, made if need be; without a display, off screen.

    Raises
    ------
    GpError
        Qt cannot draw on the display, or the platform, that the environment names.
    """
    use_plain_numbers()
    QLocale.setDefault(QLocale.c())
    existing = QApplication.instance()
    if isinstance(existing, QApplication):
        return existing
    if not _has_display():
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    check_display()
    QApplication.setHighDpiScaleFactorRoundingPolicy(Qt.HighDpiScaleFactorRoundingPolicy.PassThrough)
    if _has_display():
        share_contexts()
    app = QApplication(["gp-labeler"])
    _applications.append(app)
    use_plain_numbers()  # Qt has just taken the locale from the environment
    app.setApplicationName("gp-labeler")
    app.setApplicationDisplayName("gp-labeler")
    app.setDesktopFileName("gp-labeler")
    app.setWindowIcon(QIcon(str(resource_path("icons/gp-labeler.svg"))))
    app.setStyle("Fusion")
    if app.platformName() == "offscreen":
        qInstallMessageHandler(_tell)
        atexit.register(qInstallMessageHandler, None)  # no Python may be called once it has ended
    return app


def make_window(directory: Path | None = None, *, atlas: bool = True) -> MainWindow:
    """Return a window with nothing open.

    Parameters
    ----------
    directory : Path, optional
        State directory; None keeps nothing on disk.
    atlas : bool
        Whether to load the atlas chosen last, else the published one, for ghosts.
    """
    share_freed_memory()
    collect_on_this_thread(make_application())
    describe_widgets()
    importlib.import_module("scipy.ndimage")  # the scene needs it; no job may be importing SciPy meanwhile
    dispatcher = QtDispatcher()
    workspace = Workspace(directory, dispatcher)
    memory = WindowState(None if directory is None else directory / "window.json")
    choose_canvas(memory)
    window = MainWindow(workspace, memory)
    dispatcher.setParent(window)
    if atlas:
        workspace.atlas.load()
    return window


def run_window(
    path: Path | None = None,
    *,
    demo: bool = False,
    directory: Path | None = None,
    observer: str | None = None,
) -> int:
    """Open the window and stay until it is closed.

    Parameters
    ----------
    path : Path, optional
        Scan or specimen to open.
    demo : bool
        Whether to open the phantom.
    directory : Path, optional
        State directory; the user's by default.
    observer : str, optional
        Who labels; remembered.

    Returns
    -------
    int
        Exit status.

    Raises
    ------
    GpError
        There is no display that Qt can draw on.
    """
    if not _has_display():
        raise GpError(
            "there is no display to open a window on",
            remedy="Use gp-labeler --offscreen SCRIPT|demo --output DIR, or run it under xvfb-run.",
        )
    app = make_application()
    wanted = directory or default_directory()
    directory = directory_to_use(wanted, Prompts())
    window = make_window(directory)
    if observer is not None:
        window.workspace.set_observer(observer)
    sys.excepthook = lambda kind, error, trace: report_fault(window, error)
    window.show()

    def begin() -> None:
        places = list(dict.fromkeys(place for place in (wanted, directory) if place is not None))
        for words in (words for place in places for words in unreadable_journals(place)):
            window.workspace.say(words, "warning")
        recoveries = [found for place in places for found in find_recoveries(place)]
        offer_recoveries(window.workspace, window.prompts, recoveries, window)
        if demo:
            open_demo(window.workspace, window.prompts)
        elif path is not None:
            open_path(window.workspace, window.prompts, path)
        offer_measurement(window, window.prompts)

    QTimer.singleShot(0, begin)
    return int(app.exec())


def _has_display() -> bool:
    """Whether a window can be seen, or somebody said which platform Qt shall draw on."""
    named = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
    return not sys.platform.startswith("linux") or any(os.environ.get(name) for name in named)


def _tell(_: QtMsgType, __: QMessageLogContext, text: str) -> None:
    """Pass on Qt's messages, but for what its offscreen platform says of windows with a smallest size."""
    if "propagateSizeHints" not in text:
        sys.stderr.write(f"{text}\n")


def report_fault(window: MainWindow, error: BaseException) -> None:
    """Tell of a fault of the program; the work goes on, every edit is in the journal.

    A panel of an installed package that is at fault is named, and taken away.
    """
    _log.error("%s", "".join(traceback.format_exception(error)))
    panel = panel_at_fault(error)
    if panel is not None:
        window.leave_out_panel(panel, error)
        return
    window.workspace.say(
        f"Something went wrong in the program ({type(error).__name__}: {error}). Save your work.", "error"
    )
