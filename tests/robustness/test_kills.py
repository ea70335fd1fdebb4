"""A short kill run; `tools/kills` is the long one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

RUN = Path(__file__).with_name("kill_run.py")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="the run forks, and counts processes in /proc")
def test_killed_programs_lose_nothing() -> None:
    words = [sys.executable, str(RUN), "--n", "24", "--seed", "4", "--kinds"]
    words += ["document", "saving", "export", "mesh", "full disk", "read only"]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert "24 kills" in done.stdout
    assert "0 faults" in done.stdout
