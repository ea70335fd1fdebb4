"""Memory that was freed goes back to the system, so that a closed scan takes none."""

from __future__ import annotations

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
