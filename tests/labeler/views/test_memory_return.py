"""Memory that was freed goes back to the system, so that a closed scan takes none."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gp_labeler.imaging.memory import return_freed_memory


def anonymous_mb() -> float:
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("RssAnon")) / 1024


@pytest.mark.skipif(sys.platform != "linux", reason="glibc keeps freed memory")
def test_freed_memory_is_returned() -> None:
    begun = anonymous_mb()
    blocks = [np.ones(8_000) for _ in range(1600)]  # 64 kB each: from the heap, unlike large ones
    last = blocks[-1]
    del blocks
    return_freed_memory()
    assert last[0] == 1
    assert anonymous_mb() - begun < 20


def test_it_is_asked_for_once_after_a_scan_has_come_or_gone(qtbot, make_window, ball, monkeypatch) -> None:
    asked: list[None] = []
    monkeypatch.setattr("gp_labeler.views.memory_return.return_freed_memory", lambda: asked.append(None))
    monkeypatch.setattr("gp_labeler.views.memory_return._AFTER_MS", 0)
    window = make_window()
    window.workspace.scan.begin(ball)
    qtbot.waitUntil(lambda: bool(asked))
    asked.clear()
    window.workspace.document.abandon()
    window.workspace.document.begin()
    assert not asked
    qtbot.waitUntil(lambda: bool(asked))


ALLOCATING = """
import ctypes, sys, threading
from gp_labeler.imaging.memory import share_freed_memory
if sys.argv[1] == "shared":
    share_freed_memory()
together, kept = threading.Barrier(4), []
def allocate():
    together.wait()
    kept.append(ctypes.create_string_buffer(50_000))
    together.wait()
threads = [threading.Thread(target=allocate) for _ in range(4)]
for thread in threads: thread.start()
for thread in threads: thread.join()
ctypes.CDLL(None).malloc_stats()
"""


@pytest.mark.skipif(
    sys.platform != "linux" or not hasattr(ctypes.CDLL(None), "malloc_stats"), reason="only glibc has it"
)
def test_all_threads_allocate_in_one_place() -> None:
    places = {}
    for how in ("shared", "apart"):
        command = [sys.executable, "-c", ALLOCATING, how]
        places[how] = subprocess.run(command, capture_output=True, text=True, check=True).stderr.count(
            "Arena "
        )
    assert places["shared"] == 1
    assert places["apart"] > 1
