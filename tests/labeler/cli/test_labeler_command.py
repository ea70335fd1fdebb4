"""The command line of the window."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from window_cases import BALL_MM, MIDDLE, write_ball

from gp_labeler.cli.entry import main

pytestmark = pytest.mark.machine


@pytest.fixture
def ball_file(tmp_path) -> Path:
    return write_ball(tmp_path / "ball.nrrd")


def test_mesh_writes_the_surface_in_lps(ball_file, tmp_path, capsys) -> None:
    assert main(["mesh", str(ball_file), "-o", str(tmp_path / "ball.ply"), "--threshold", "1000"]) == 0
    assert "triangles" in capsys.readouterr().out
    from vtkmodules.vtkIOPLY import vtkPLYReader

    reader = vtkPLYReader()
    reader.SetFileName(str(tmp_path / "ball.ply"))
    reader.Update()
    bounds = np.array(reader.GetOutput().GetBounds()).reshape(3, 2)
    np.testing.assert_allclose(bounds.mean(axis=1), MIDDLE, atol=0.05)
    np.testing.assert_allclose(np.ptp(bounds, axis=1), 2 * BALL_MM, atol=0.1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.nrrd"], "nowhere.nrrd: does not exist"),
        (["mesh", "nowhere.nrrd", "-o", "x.ply"], "nowhere.nrrd"),
        (["mesh", "{ball}", "-o", "x.abc", "--threshold", "1000"], ".ply"),
        (["mesh", "{ball}", "-o", "x.ply", "--threshold", "1e9"], "no surface"),
        (["mesh", "{ball}", "-o", "x.ply", "--spacing", "1", "2"], "one number or three"),
        (["mesh", "{ball}", "-o", "x.ply", "--spacing", "-1"], "spacing must be positive"),
    ],
)
def test_wrong_input_is_one_line_and_status_2(ball_file, arguments, words, capsys) -> None:
    assert main([argument.format(ball=ball_file) for argument in arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_without_a_display_it_says_what_to_do_instead() -> None:
    bare = {k: v for k, v in os.environ.items() if "DISPLAY" not in k and k != "QT_QPA_PLATFORM"}
    command = [sys.executable, "-m", "gp_labeler"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=bare)
    assert done.returncode == 2
    assert "--offscreen" in done.stderr
    assert done.stderr.count("\n") == 1


def test_help_needs_neither_qt_nor_vtk() -> None:
    code = (
        "import sys; from gp_labeler.cli.entry import make_parser; make_parser().format_help();"
        "heavy = ('PySide6', 'PyQt6', 'qtpy', 'vtkmodules', 'SimpleITK');"
        "print([m for m in sys.modules if m.split('.')[0] in heavy])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_the_window_opens_from_the_command_line_and_says_what_is_wrong(ball_file, tmp_path) -> None:
    code = (
        "import pathlib, sys; from qtpy.QtCore import QTimer\n"
        "from gp_labeler.views import application as a\n"
        "path, state = map(pathlib.Path, sys.argv[1:]); old = a.MainWindow.show\n"
        "def close_once_open(self):\n"
        "    there = (state / 'recent.json').exists()\n"
        "    self.close() if there else QTimer.singleShot(200, lambda: close_once_open(self))\n"
        "def show(self):\n"
        "    old(self); close_once_open(self)\n"
        "a.MainWindow.show = show\n"
        "sys.exit(a.run_window(path, directory=state))"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, str(ball_file), str(tmp_path / "state")],
        capture_output=True,
        text=True,
        timeout=600,
        env=dict(os.environ, QT_QPA_PLATFORM="offscreen"),
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "state" / "window.json").exists()
    assert (tmp_path / "state" / "recent.json").read_text().count("ball.nrrd") == 1


def test_a_script_says_nothing_but_its_steps(ball_file, tmp_path) -> None:
    script = tmp_path / "look.json"
    steps = [{"do": "open", "path": str(ball_file)}, {"do": "screenshot", "path": "w.png"}]
    script.write_text(json.dumps(steps))
    command = [
        sys.executable,
        "-m",
        "gp_labeler",
        "--offscreen",
        str(script),
        "--output",
        str(tmp_path / "out"),
    ]
    env = dict(os.environ, QT_QPA_PLATFORM="offscreen")
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, env=env, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) == 3, done.stdout


def test_a_simulated_tracker_is_one_command_away(capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["simulate-tracker", "--help"])
    assert ended.value.code == 0
    assert "gp-labeler simulate-tracker" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words",
    [
        ["--output", "out"],
        ["--specimens", "a"],
        ["head.nrrd", "--demo"],
        ["--offscreen", "demo", "--output", "out", "--demo"],
        ["head.nrrd", "--offscreen", "demo", "--output", "out"],
    ],
    ids=" ".join,
)
def test_no_word_is_passed_over(words, capsys) -> None:
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.startswith("gp-labeler: ")
    assert error.count("\n") == 1
