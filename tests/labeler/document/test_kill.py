"""A real process is killed while it edits; the next start offers exactly what it had confirmed."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from document_cases import text_of

from gp_labeler.document.lock import FileLock
from gp_labeler.document.opening import new_specimen, open_specimen, recover_specimen
from gp_labeler.document.paths import lock_path
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_edits import SetNotes

HERE = Path(__file__).parent
ROOT = HERE.parents[2]


def killed_after(folder: Path, seed: int, n_lines: int, seconds: float) -> list[str]:
    """Let a process edit, kill it `seconds` after its n-th print; return all states it printed whole."""
    process = subprocess.Popen(
        [sys.executable, str(HERE / "editing_process.py"), str(folder), str(seed)],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
    )
    assert process.stdout is not None
    lines = [process.stdout.readline() for _ in range(n_lines)]
    time.sleep(seconds)
    process.send_signal(signal.SIGKILL)
    lines += process.stdout.read().splitlines(keepends=True)
    process.stdout.close()
    assert process.wait() == -signal.SIGKILL
    return [line.decode().rstrip("\n") for line in lines if line.endswith(b"\n")]


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system cannot kill -9")
@pytest.mark.parametrize("seed", range(10))
def test_killed_at_any_moment_nothing_confirmed_is_lost(tmp_path, seed):
    rng = np.random.default_rng(seed)
    confirmed = killed_after(tmp_path, seed, int(rng.integers(1, 100)), float(rng.uniform(0, 0.02)))
    found = find_recoveries(tmp_path / "state")
    if found:
        (recovery,) = found
        document = SpecimenDocument(recover_specimen(recovery, tmp_path / "state"))
    elif (file := tmp_path / "GP-014.gpspecimen.json").exists():  # it was saved just then
        document = SpecimenDocument(open_specimen(file, tmp_path / "state"))
    else:  # it came to no edit
        document = SpecimenDocument(new_specimen(tmp_path / "state", specimen="GP-014"))
    with contextlib.ExitStack() as stack:
        stack.callback(document.close, discard=True)
        assert text_of(document.state) in _accepted(confirmed, document)
        document.do(SetNotes(document.state.notes + "!"))  # and the journal can go on


def _accepted(confirmed: list[str], document) -> set[str]:
    """The last confirmed state, or what one more step made of it: killed between journal and print."""
    history = document.history
    neighbours = {text_of(step.state) for step in (history.to_undo, history.to_redo) if step is not None}
    one_more = {text_of(document.state)} if confirmed[-1] in neighbours else set()
    return {confirmed[-1], *one_more}


def test_the_lock_of_a_killed_process_is_free(tmp_path):
    killed_after(tmp_path, 0, 30, 0.0)
    locks = list((tmp_path / "state" / "journals").glob("*.lock"))
    assert any(lock.read_text() for lock in locks)  # it was left behind
    for journal in (tmp_path / "state" / "journals").glob("*.jsonl"):
        FileLock(lock_path(journal), "it").release()
