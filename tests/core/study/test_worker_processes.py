"""Processes of a study: Ctrl-C is one line, and none outlives the program that started it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(not Path("/proc/self").exists(), reason="processes are counted in /proc")

STUDY = ["env", "--default-signal=INT"]  # for a background shell has its programs ignore Ctrl-C
STUDY += [sys.executable, "-m", "gp_core.cli", "compare", "--repeats", "200", "--workers", "2"]
DEADLINE_SECONDS = 300.0


def children(pid: int) -> set[int]:
    """Return all processes that a process started, and theirs."""
    found: set[int] = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = stat.read_text().rpartition(")")
        except OSError:
            continue
        if int(rest.split()[1]) == pid:
            child = int(name.split()[0])
            found |= {child, *children(child)}
    return found


def alive(pids: set[int]) -> set[int]:
    return {pid for pid in pids if Path(f"/proc/{pid}/stat").exists() and _state(pid) not in ("Z", "")}


def _state(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return ""


def cpu_seconds(pids: set[int]) -> float:
    """Return the CPU time of processes: how far they came, however busy the machine is."""
    return sum(map(_cpu_seconds, pids))


def _cpu_seconds(pid: int) -> float:
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def wait_for(condition, seconds: float = DEADLINE_SECONDS) -> bool:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return bool(condition())


@pytest.fixture
def study():
    process = subprocess.Popen(
        STUDY, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True, text=True
    )
    yield process
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


@pytest.mark.parametrize(("number", "worked_s"), [(signal.SIGKILL, 0.0), (signal.SIGTERM, 3.0)])
def test_workers_end_with_the_study(number: signal.Signals, worked_s: float, study: subprocess.Popen) -> None:
    assert wait_for(lambda: len(children(study.pid)) >= 3), "two workers and the tracker of their resources"
    assert wait_for(lambda: cpu_seconds(children(study.pid)) >= worked_s), "the workers do nothing"
    workers = children(study.pid)
    study.send_signal(number)
    assert wait_for(lambda: not alive(workers)), "somebody still works"
    out, _ = study.communicate(timeout=DEADLINE_SECONDS)  # ends where nobody holds the pipe open
    assert out == ""


@pytest.mark.parametrize(("n_processes", "worked_s"), [(1, 0.0), (2, 0.0), (3, 0.0), (3, 0.4)])
def test_ctrl_c_is_one_line(n_processes: int, worked_s: float, study: subprocess.Popen) -> None:
    """As a terminal does it: the whole group is told, workers that begin just now too."""
    assert wait_for(lambda: len(children(study.pid)) >= n_processes)
    assert wait_for(lambda: cpu_seconds(children(study.pid)) >= worked_s), "the workers do nothing"
    os.killpg(study.pid, signal.SIGINT)
    _, err = study.communicate(timeout=DEADLINE_SECONDS)
    assert (study.returncode, err) == (130, "gp-core: stopped\n")
