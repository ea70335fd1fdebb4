"""The window, off screen, for the files that its dialogs and menus take."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from gp_labeler.scripting.runner import do_step
from gp_labeler.scripting.script import StepError, make_script
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["Window"]


class Window:
    """One window for a whole run, made when it is first used: a process that was forked must make its own."""

    def __init__(self) -> None:
        self._driver: WindowDriver | None = None

    def fault(self, table: dict[str, Any], folder: Path) -> str:
        """Do one step with a bad file; return what is wrong with how it ended."""
        if self._driver is None:
            logging.getLogger("gp_labeler").setLevel(logging.CRITICAL + 1)
            self._driver = WindowDriver(folder, folder)
        driver, since = self._driver, len(self._driver.messages)
        (step,) = make_script([table]).steps
        try:
            do_step(driver, 1, step)
        except StepError as error:
            text = str(error)
            if "failed unexpectedly" in text or "Something went wrong" in text:
                return text
        faults, driver.faults = driver.faults, []
        if faults:
            return f"inside Qt: {faults[0]!r}"
        said = [text for text, _ in driver.messages[since:]]
        return next((f"not one line: {text!r:.200}" for text in said if "\x1b" in text), "")
