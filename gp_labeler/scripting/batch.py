"""One script over many specimens, each in its own window and folder; one that fails stops no other."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.io.text import as_csv_cell
from gp_labeler.document.opening import tidy_name
from gp_labeler.scripting.report import RunReport
from gp_labeler.scripting.runner import Tell, run_script
from gp_labeler.scripting.script import Script

__all__ = ["SUMMARY", "run_batch", "summary_lines"]

SUMMARY = "summary.csv"

_COLUMNS = ("specimen", "ok", "steps", "placed", "suggested", "seconds", "largest error mm", "error")


def run_batch(
    script: Script, specimens: Sequence[str], output: Path, *, tell: Tell | None = None
) -> Mapping[str, RunReport]:
    """Run a script once for each specimen, and write ``summary.csv``.

    Parameters
    ----------
    script : Script
        With ``{specimen}`` in its paths.
    specimens : sequence of str
        What to put there.
    output : Path
        Each specimen gets a folder of its name in here.
    tell : callable, optional
        Takes lines for the terminal.

    Returns
    -------
    mapping of str to RunReport
        By specimen, also of those that failed.

    Raises
    ------
    GpError
        No specimens, or one twice, or the script has no place for them.
    """
    _check(script, specimens)
    reports = {}
    for name in specimens:
        if tell is not None:
            tell(f"{name}:")
        reports[name] = _run_one(script, name, output / tidy_name(name), tell)
        if tell is not None and not reports[name].ok:
            tell(f"   ! {reports[name].error}")
    write_text(output / SUMMARY, _table(reports))
    return reports


def summary_lines(reports: Mapping[str, RunReport]) -> list[str]:
    """Return a table for the terminal."""
    width = max(len(name) for name in reports)
    lines = [f"{'specimen':<{max(width, 8)}}  steps  placed  suggested  seconds"]
    for name, report in reports.items():
        row = _row(name, report)
        counts = f"{row['steps']:>5}  {row['placed']:>6}  {row['suggested']:>9}  {row['seconds']:>7}"
        lines.append(f"{name:<{max(width, 8)}}  {counts}  {report.error or 'done'}")
    failed = sum(not report.ok for report in reports.values())
    return [*lines, f"{len(reports) - failed} of {len(reports)} done"]


def _run_one(script: Script, name: str, output: Path, tell: Tell | None) -> RunReport:
    try:
        return run_script(script.for_specimen(name), output, tell=tell)
    except GpError as error:
        return RunReport(script.name, name, str(error))


def _check(script: Script, specimens: Sequence[str]) -> None:
    if not specimens:
        raise GpError("no specimens were given")
    twice = {name for name in specimens if [tidy_name(each) for each in specimens].count(tidy_name(name)) > 1}
    if twice:
        raise GpError(f"specimens share the folder name of {', '.join(sorted(twice))}")
    if not script.has_slots:
        raise GpError(
            "the script does the same for every specimen",
            file=script.file,
            remedy="Write {specimen} where its name belongs, such as path = 'scans/{specimen}.nrrd'.",
        )


def _table(reports: Mapping[str, RunReport]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    for name, report in reports.items():
        row = _row(as_csv_cell(name), report)
        writer.writerow(row | {"error": as_csv_cell(row["error"])})
    return text.getvalue()


def _row(name: str, report: RunReport) -> dict[str, Any]:
    content = report.as_dict()
    largest = content["largest_error_mm"]
    return {
        "specimen": name,
        "ok": "yes" if report.ok else "no",
        "steps": len(report.steps) - (not report.ok and bool(report.steps)),
        "placed": content["n_placed"],
        "suggested": content["n_suggested"],
        "seconds": f"{report.seconds:.1f}",
        "largest error mm": "" if largest is None else f"{largest:.3f}",
        "error": report.error,
    }
