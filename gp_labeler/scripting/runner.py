"""Running a script: a window, its steps in turn, a report; what was done is kept where one fails."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from gp_core.disk import make_folder
from gp_core.errors import GpError
from gp_labeler.document.specimen_file import SUFFIX
from gp_labeler.scripting.report import RunReport, StepRecord
from gp_labeler.scripting.script import Script, StepError
from gp_labeler.scripting.step import Step
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["REPORT", "Tell", "do_step", "run_script"]

_log = logging.getLogger(__name__)

REPORT = "report.json"

Tell = Callable[[str], None]


def run_script(script: Script, output: Path, *, tell: Tell | None = None) -> RunReport:
    """Open a window, do all steps, close it, and write ``report.json``.

    Parameters
    ----------
    script : Script
        What to do.
    output : Path
        Folder for everything that is written; made if need be.
    tell : callable, optional
        Takes a line for each step that is done.

    Returns
    -------
    RunReport
        With `error` where a step failed: the rest was not done, and what had been labelled is saved.
    """
    make_folder(output)
    report = RunReport(script.name)
    driver = WindowDriver(output, script.folder)
    try:
        with driver.watching():
            for number, step in enumerate(script.steps, start=1):
                report.steps.append(do_step(driver, number, step))
                (tell or _nobody)(_line(report.steps[-1]))
    except StepError as error:
        report.error = str(error)
        report.steps.append(StepRecord(error.number, script.steps[error.number - 1].title, report.error))
        _rescue(driver)
    finally:
        report.take_stock(driver)
        driver.close()
    report.save(output / REPORT)
    return report


def do_step(driver: WindowDriver, number: int, step: Step) -> StepRecord:
    """Do one step.

    Raises
    ------
    StepError
        It could not be done, or the window told of an error, or asked what the step does not answer.
    """
    since, start = len(driver.messages), time.perf_counter()
    driver.prompts.prepare()
    try:
        text = step.run(driver) or ""
    except GpError as error:
        trouble = driver.trouble(since)
        more = f" {trouble}" if trouble and trouble not in str(error) else ""
        raise StepError(number, f"{step.title}: {error}{more}") from None
    except Exception as error:
        _log.exception("step %d failed", number)
        raise StepError(
            number, f"{step.title}: failed unexpectedly ({type(error).__name__}: {error})"
        ) from error
    trouble = driver.trouble(since)
    if trouble:
        raise StepError(number, f"{step.title}: {trouble}")
    seconds = time.perf_counter() - start
    return StepRecord(number, step.title, text, seconds, tuple(driver.warnings(since)))


def _rescue(driver: WindowDriver) -> None:
    """Save what was labelled before a step failed."""
    document = driver.workspace.document
    if document.dirty:
        with suppress(GpError):
            driver.wrote(document.save(driver.output / f"{document.state.specimen}{SUFFIX}", overwrite=True))


def _line(record: StepRecord) -> str:
    text = f"{record.number:4}  {record.seconds:6.2f} s  {record.title}"
    lines = [f"{text}: {record.text}" if record.text else text]
    return "\n".join(lines + [f"{'':16}! {warning}" for warning in record.warnings])


def _nobody(_: str) -> None:
    """Hear nothing."""
