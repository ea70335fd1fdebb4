"""``gp-labeler --offscreen``: a script, or the demo, for one specimen or many."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from gp_core.disk import protected_inputs
from gp_core.errors import GpError
from gp_core.standard_streams import standard_streams
from gp_labeler.scripting.window_driver import use_no_display

__all__ = ["run_offscreen"]


def run_offscreen(script: str, output: Path | None, specimens: Sequence[str] = ()) -> int:
    """Run a script without a display.

    Parameters
    ----------
    script : str
        A script file, or ``demo``.
    output : Path, optional
        Folder for what is written.
    specimens : sequence of str
        For a batch; by default those that the script names.

    Returns
    -------
    int
        0; 1 where a step failed, or one of the specimens.
    """
    if output is None:
        raise GpError("--offscreen needs --output DIR")
    use_no_display()  # before anything of Qt is made
    given = argparse.Namespace(script=script)
    with standard_streams(given, {}, ("script",)), protected_inputs([given.script]):
        return _run(given.script, output, specimens, is_stream=given.script != script)


def _run(script: str, output: Path, specimens: Sequence[str], *, is_stream: bool) -> int:
    from gp_labeler.scripting.batch import run_batch, summary_lines
    from gp_labeler.scripting.demo import demo_script
    from gp_labeler.scripting.runner import run_script
    from gp_labeler.scripting.script import StepError, read_script

    try:
        shown_as = "standard input" if is_stream else None
        content = demo_script() if script == "demo" else read_script(script, shown_as=shown_as)
    except StepError as error:
        sys.stderr.write(f"gp-labeler: {error}\n")
        return 1
    if is_stream:  # what it names lies where the command was given
        content = replace(content, folder=Path.cwd())
    names = list(specimens) or list(content.specimens)
    if names:
        reports = run_batch(content, names, output, tell=_say)
        for line in summary_lines(reports):
            _say(line)
        return int(not all(report.ok for report in reports.values()))
    report = run_script(content, output, tell=_say)
    if not report.ok:
        if report.files:
            _say(f"What was written before is in {output}: {', '.join(report.files)}")
        sys.stderr.write(f"gp-labeler: {report.error}\n")
        return 1
    _say(f"{len(report.steps)} steps in {report.seconds:.1f} s: {output}")
    return 0


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()
