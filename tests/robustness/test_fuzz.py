"""A short fuzz run; `tools/fuzz` is the long one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

RUN = Path(__file__).with_name("fuzz_run.py")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(__import__("os"), "fork"), reason="the run forks its workers")
def test_bad_files_end_with_a_result_or_a_line() -> None:
    words = [sys.executable, str(RUN), "--n", "300", "--seed", "4"]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert "300 inputs" in done.stdout
    assert "0 faults" in done.stdout
