"""The window, off screen, for the files that its dialogs and menus take."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gp_core.errors import GpError
from gp_labeler.document import touching
from gp_labeler.document.landmark_import import import_landmarks
from gp_labeler.scripting.runner import do_step
from gp_labeler.scripting.script import StepError, make_script
from gp_labeler.scripting.window_driver import WindowDriver
from gp_labeler.views.panels.pose.physical_dialog import PhysicalDialog
from gp_labeler.views.panels.tracker.dialog import TrackerDialog
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.window_state import WindowState

__all__ = ["Window"]


class Window:
    """One window for a whole run, made when it is first used: a process that was forked must make its own."""

    def __init__(self) -> None:
        self._driver: WindowDriver | None = None

    def fault(self, table: dict[str, Any], folder: Path) -> str:
        """Do one step with a bad file; return what is wrong with how it ended."""

        def do(driver: WindowDriver) -> None:
            (step,) = make_script([table]).steps
            do_step(driver, 1, step)

        return self._fault_of(do, folder)

    def tracker_fault(self, memory: Path, folder: Path) -> str:
        """Open and close the dialog of the tracked probe with what was remembered of it."""

        def do(driver: WindowDriver) -> None:
            dialog = TrackerDialog(driver.workspace, WindowState(memory), driver.window)
            dialog.show()
            dialog.done(0)
            driver.wait_until_idle()

        return self._fault_of(do, folder)

    def physical_fault(self, skull: Path, touches: Path, labels: Path, folder: Path) -> str:
        """Open the dialog of the physical test with what was touched and labelled, and wait for it."""

        def do(driver: WindowDriver) -> None:
            document = driver.workspace.document
            document.begin()
            import_landmarks(document, [labels], side="L")
            touching.load_touches(document, touches, "L")
            touching.load_skull(document, skull)
            driver.wait_until_idle()
            dialog = PhysicalDialog(driver.workspace, Prompts(driver.window), driver.window)
            driver.wait_until_idle()
            dialog.done(0)

        return self._fault_of(do, folder)

    def _fault_of(self, do: Callable[[WindowDriver], None], folder: Path) -> str:
        if self._driver is None:
            logging.getLogger("gp_labeler").setLevel(logging.CRITICAL + 1)
            self._driver = WindowDriver(folder, folder)
        driver, since = self._driver, len(self._driver.messages)
        try:
            do(driver)
        except StepError as error:
            text = str(error)
            if "failed unexpectedly" in text or "Something went wrong" in text:
                return text
        except GpError:
            pass
        faults, driver.faults = driver.faults, []
        if faults:
            return f"inside Qt: {faults[0]!r}"
        said = [text for text, _ in driver.messages[since:]]
        return next((f"not one line: {text!r:.200}" for text in said if "\x1b" in text), "")
