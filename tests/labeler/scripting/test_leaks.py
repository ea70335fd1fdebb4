"""Windows that come and go leave nothing behind."""

from __future__ import annotations

import gc
import threading
from pathlib import Path

import numpy as np
import pytest
from qtpy.QtWidgets import QApplication
from script_cases import place, run
from vtkmodules.vtkCommonCore import vtkObjectBase
from window_cases import MIDDLE

CYCLES = 20


def left_over() -> tuple[int, int, int]:
    """Count widgets, VTK objects that Python knows, and threads."""
    gc.unfreeze()  # what the program leaves out until it rests
    for _ in range(2):
        gc.collect()
    things = [thing for thing in gc.get_objects() if isinstance(thing, vtkObjectBase)]
    return len(QApplication.allWidgets()), len(things), threading.active_count()


def resident_mb() -> float:
    statm = Path("/proc/self/statm")  # other systems have other ways; there the rest is tested
    return int(statm.read_text().split()[1]) * 4096 / 1e6 if statm.exists() else 0.0


@pytest.mark.slow
def test_twenty_windows_leave_nothing_behind(qapp, tmp_path) -> None:
    steps = (
        place("CA", MIDDLE + 1.0, view="axial"),
        {"do": "screenshot", "path": "a.png"},
        {"do": "undo"},
    )
    counted, memory = [], []
    for _ in range(CYCLES):
        report = run(tmp_path, *steps)
        assert report.ok, report.error
        counted.append(left_over())
        memory.append(resident_mb())
    widgets, objects, threads = np.array(counted).T
    assert widgets[-1] == widgets[2]
    assert objects[-1] <= objects[2]
    assert threads[-1] <= threads[2]
    assert memory[-1] - memory[CYCLES // 2] < 20, memory
