"""One script over many specimens; and the command, in a process that has no display."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from script_cases import content, place, write_ball
from window_cases import MIDDLE

from gp_core.errors import GpError
from gp_labeler.scripting.batch import run_batch, summary_lines
from gp_labeler.scripting.script import make_script

ROOT = Path(__file__).resolve().parents[3]
STEPS = (
    {"do": "open", "path": "{specimen}.nrrd"},
    place("CA", MIDDLE, view="axial"),
    {"do": "export"},
    {"do": "save"},
)


@pytest.fixture
def folder(tmp_path):
    for name in ("GP-01", "GP-03"):
        write_ball(tmp_path / f"{name}.nrrd")
    return tmp_path


def test_a_failed_specimen_does_not_stop_the_others(folder) -> None:
    script, heard = make_script(STEPS, folder=folder), []
    reports = run_batch(script, ["GP-01", "GP-02", "GP-03"], folder / "out", tell=heard.append)
    assert [report.ok for report in reports.values()] == [True, False, True]
    assert "GP-02.nrrd: does not exist" in reports["GP-02"].error
    assert (folder / "out" / "GP-03" / "GP-03_L.mrk.json").exists()
    assert content(folder / "out" / "GP-02" / "report.json")["ok"] is False
    rows = list(csv.DictReader((folder / "out" / "summary.csv").read_text().splitlines()))
    assert [(row["specimen"], row["ok"], row["placed"]) for row in rows] == [
        ("GP-01", "yes", "1"),
        ("GP-02", "no", "0"),
        ("GP-03", "yes", "1"),
    ]
    lines = summary_lines(reports)
    assert lines[-1] == "2 of 3 done"
    assert "does not exist" in lines[2]
    assert heard[0] == "GP-01:"


def test_a_folder_that_cannot_be_made_stops_no_other(folder) -> None:
    (folder / "out").mkdir()
    (folder / "out" / "GP-01").write_text("in the way")
    reports = run_batch(make_script(STEPS, folder=folder), ["GP-01", "GP-03"], folder / "out")
    assert [report.ok for report in reports.values()] == [False, True]
    assert "cannot be made" in reports["GP-01"].error


@pytest.mark.parametrize(
    ("steps", "names", "text"),
    [
        (STEPS, [], "no specimens"),
        (STEPS, ["a", "b", "a"], "share the folder name of a"),
        ([{"do": "save"}], ["a"], r"Write \{specimen\}"),
    ],
)
def test_a_batch_that_makes_no_sense_is_refused(tmp_path, steps, names, text) -> None:
    with pytest.raises(GpError, match=text):
        run_batch(make_script(steps), names, tmp_path)


def command(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the program as on a server: no display, nothing said about Qt."""
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM", "XDG_RUNTIME_DIR")
    env = {name: value for name, value in os.environ.items() if name not in hidden}
    return subprocess.run(
        [sys.executable, "-m", "gp_labeler", *arguments],
        cwd=folder,
        env=env | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=600,
    )


def test_the_command_runs_where_there_is_no_display(folder) -> None:
    steps = [{**STEPS[0], "path": "GP-01.nrrd"}, *STEPS[1:], {"do": "expect", "placed": 2}]
    (folder / "label.json").write_text(json.dumps(steps))
    done = command(folder, "--offscreen", "label.json", "--output", "out")
    assert done.returncode == 1
    assert done.stderr.strip() == "gp-labeler: step 5: expect: 1 points are placed, expected were 2"
    assert "place CA left: axial" in done.stdout
    assert done.stdout.endswith("is in out: GP-01_L.mrk.json, GP-01.gpspecimen.json\n")
    assert (folder / "out" / "GP-01_L.mrk.json").exists()


@pytest.mark.parametrize(
    ("arguments", "status", "text"),
    [
        (("--offscreen", "demo"), 2, "needs --output"),
        (("--offscreen", "none.toml", "--output", "out"), 2, "none.toml: does not exist"),
        (("--offscreen", "bad.json", "--output", "out"), 1, "bad.json: step 1: unknown step 'jump'"),
    ],
)
def test_the_command_says_what_is_wrong(folder, arguments, status, text) -> None:
    (folder / "bad.json").write_text('[{"do": "jump"}]')
    done = command(folder, *arguments)
    assert (done.returncode, done.stdout) == (status, "")
    assert text in done.stderr
    assert "Traceback" not in done.stderr
