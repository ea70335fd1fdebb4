"""What all commands share: messages on the terminal and in a log, and completion in a shell."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

_TOUCHES = str(Path(__file__).resolve().parents[2] / "docs" / "example" / "touches.csv")


def _estimate(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gp_core.cli", "estimate", _TOUCHES, "--side", "L", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd)


def test_verbose_says_what_is_read_and_written(tmp_path: Path) -> None:
    quiet = _estimate("--json", "pose.json", cwd=tmp_path)
    told = _estimate("--json", "pose.json", "--verbose", cwd=tmp_path)
    assert quiet.stderr == ""
    assert quiet.stdout == told.stdout
    assert f"gp-core: read {_TOUCHES}" in told.stderr
    assert f"gp-core: wrote {tmp_path / 'pose.json'}" in told.stderr


def test_what_libraries_say_is_not_for_the_terminal(tmp_path: Path) -> None:
    code = """if True:
        import logging
        from gp_core.command_line import start_messages
        start_messages("gp-core check", [], None, None)
        logging.getLogger("tifffile").error("invalid page offset")
        logging.getLogger("gp_core.io").warning("%s: taken as LPS", chr(10) + "A.csv")
    """
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.stderr == "gp-core: \\nA.csv: taken as LPS\n"


def test_a_log_holds_everything_and_grows(tmp_path: Path) -> None:
    for _ in range(2):
        done = _estimate("--log-file", "run.log", cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, "")
    lines = (tmp_path / "run.log").read_text().splitlines()
    assert sum("gp-core estimate" in line or "--side L" in line for line in lines) == 2
    assert sum(f"read {_TOUCHES}" in line for line in lines) == 2


@pytest.mark.parametrize("name", ["touches.csv", "nowhere/run.log"])
def test_a_log_is_never_appended_to_data(tmp_path: Path, name: str) -> None:
    (tmp_path / "touches.csv").write_text("CL,1,2,3\n")
    done = _estimate("--log-file", name, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert (tmp_path / "touches.csv").read_text() == "CL,1,2,3\n"


@pytest.mark.skipif(sys.platform == "win32", reason="other systems have no such files")
def test_a_log_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.log")
    refused = _estimate("--log-file", "pipe.log", cwd=tmp_path)
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    scanner = b"\xff\xfe[\0S\0y\0s\0t\0e\0m\0]\0"
    (tmp_path / "head_rec.log").write_bytes(scanner)
    assert "is no log of this program" in _estimate("--log-file", "head_rec.log", cwd=tmp_path).stderr
    assert (tmp_path / "head_rec.log").read_bytes() == scanner
    if Path("/dev/full").exists():
        full = _estimate("--log-file", "/dev/full", "--json", "pose.json", cwd=tmp_path)
        assert full.stderr == "/dev/full: the log is cut off here (No space left on device)\n"
        assert (full.returncode, (tmp_path / "pose.json").exists()) == (0, True)
