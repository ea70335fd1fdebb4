"""A real process is killed while it edits; the next start offers exactly what it had confirmed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from session_cases import text_of

from gp_labeler.session.opening import open_session, recover_session
from gp_labeler.session.recovery import find_recoveries
from gp_labeler.session.specimen_edits import SetNotes

HERE = Path(__file__).parent
ROOT = HERE.parents[2]


def killed_after(folder: Path, seed: int, seconds: float) -> tuple[list[str], list[str]]:
    """Let a process edit, kill it, and return the states it printed; a torn last one is not one."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, str(HERE / "editing_process.py"), str(folder), str(seed)],
        stdout=subprocess.PIPE,
        env=environment,
    )
    assert process.stdout is not None
    first = process.stdout.readline()
    drained = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        drained.append(process.stdout.readline())
    process.send_signal(signal.SIGKILL)
    rest = process.stdout.read()
    process.stdout.close()
    process.wait()
    lines = b"".join([first, *drained, rest]).decode().split("\n")
    return lines[:-1], lines[-1:]


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system cannot kill -9")
@pytest.mark.parametrize("seed", range(10))
def test_killed_at_any_moment_nothing_confirmed_is_lost(tmp_path, seed):
    seconds = float(np.random.default_rng(seed).uniform(0.0, 0.3))
    confirmed, _ = killed_after(tmp_path, seed, seconds)
    found = find_recoveries(tmp_path / "state")
    file = tmp_path / "GP-014.gpspecimen.json"
    if found:
        (recovery,) = found
        session = recover_session(recovery, tmp_path / "state")
    else:  # it was saved just then
        session = open_session(file, tmp_path / "state")
    assert len(confirmed) > 5
    assert text_of(session.state) in _at_most_one_later(confirmed, session)
    session.do(SetNotes(session.state.notes + "!"))  # and the journal can go on
    session.close(discard=True)


def _at_most_one_later(confirmed: list[str], session) -> set[str]:
    """The last confirmed state, or what one more edit made of it (killed between journal and print)."""
    accepted = {confirmed[-1]}
    history = session._history
    before = history.to_undo or history.to_redo
    neighbours = [step.state for step in (history.to_undo, history.to_redo) if step is not None]
    if before is not None and confirmed[-1] in {text_of(state) for state in neighbours}:
        accepted.add(text_of(session.state))
    return accepted


def test_the_lock_of_a_killed_process_is_free(tmp_path):
    killed_after(tmp_path, 0, 0.05)
    locks = list((tmp_path / "state" / "journals").glob("*.lock"))
    assert any(lock.read_text() for lock in locks)  # it was left behind
    find_recoveries(tmp_path / "state")
