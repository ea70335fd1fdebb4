"""Measure the start, and how long the window waits while a scan is opened and meshed.

Run from the top of a checkout: ``python benchmarks/opening.py [voxels on an edge]``. It needs no display. The
start is CPU seconds of new processes, ours and the peers' in turn. While a scan is opened, a timer asks every
few milliseconds whether the window answers: what counts is the CPU of the main thread between two answers,
which other work on the machine does not lengthen; the seconds that pass are shown beside it.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import numpy as np  # noqa: E402
from big_scans import SPACING, THRESHOLD, scan_file  # noqa: E402
from event_loop import wait  # noqa: E402
from hands import rest  # noqa: E402
from qtpy.QtCore import Qt, QTimer  # noqa: E402
from qtpy.QtTest import QTest  # noqa: E402

from gp_labeler.imaging import readers  # noqa: E402
from gp_labeler.views.application import make_window  # noqa: E402
from gp_labeler.views.main_window import MainWindow  # noqa: E402

ROUNDS = 3
GOAL_MS = 50.0
LEAST_MM = 10.0
"""A scan that is shorter than a head could be is asked about."""

FIRST_PAINT = """
from gp_labeler.cli.start import collect_seldom
collect_seldom()
from gp_labeler.views.application import make_window
window = make_window()
window.show()
window.grab()
window.workspace.document.abandon()
"""
TOUCHES = str(ROOT / "docs" / "example" / "touches.csv")
STARTS = {
    "window, to its first paint": ["-c", FIRST_PAINT],
    "imports of Qt's widgets, VTK's renderer and NumPy": [
        "-c",
        "import numpy, PySide6.QtWidgets, vtkmodules.vtkRenderingOpenGL2",
    ],
    "gp-core estimate": [str(Path(sys.executable).with_name("gp-core")), "estimate", TOUCHES, "--side", "L"],
    "import numpy": ["-c", "import numpy"],
}


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("voxels", nargs="?", type=int, default=512)
    parser.add_argument("--folder", type=Path, help="where the scan is kept; thrown away by default")
    options = parser.parse_args()
    report_starts()
    with tempfile.TemporaryDirectory() as thrown_away:
        path = scan_file(options.folder or Path(thrown_away), options.voxels)
        window = make_window(None, atlas=False)
        window.resize(1440, 900)
        window.show()
        QTest.qWaitForWindowExposed(window)
        rest_of_start(window)
        report_opening(window, path, options.voxels)
        window.workspace.document.abandon()
        window.prompts.choose = lambda *a, **k: "Do not save"  # type: ignore[method-assign]
        window.close()


def report_starts() -> None:
    """Print the CPU seconds of each start, and the ratio to the peer below it."""
    taken: dict[str, list[float]] = {title: [] for title in STARTS}
    for _ in range(ROUNDS):
        for title, command in STARTS.items():
            taken[title].append(cpu_of(command))
    medians = [float(np.median(seconds)) for seconds in taken.values()]
    for n, title in enumerate(STARTS):
        ratio = f"{medians[n] / medians[n + 1]:>8.2f} times the next" if n % 2 == 0 else ""
        print(f"{title:<52}{medians[n]:>8.2f} CPU s{ratio}", flush=True)


def cpu_of(command: list[str]) -> float:
    """Return the CPU seconds of a Python process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *command], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def rest_of_start(window: MainWindow) -> None:
    """Wait until nothing runs any more."""
    while window.workspace.jobs.running:
        wait(20)
    wait(200)


def report_opening(window: MainWindow, path: Path, voxels: int) -> None:
    """Open a scan that stays in its file, mesh it, and print the longest gaps between two answers."""
    readers.MAPPED_FROM = 1 << 20
    gaps, last = [], [time.thread_time(), time.perf_counter()]

    def answer() -> None:
        now = [time.thread_time(), time.perf_counter()]
        gaps.append((now[0] - last[0], now[1] - last[1]))
        last[:] = now

    timer = QTimer(interval=2)
    timer.setTimerType(Qt.TimerType.PreciseTimer)
    timer.timeout.connect(answer)
    timer.start()
    scan = window.workspace.scan
    scan.open(path, spacing=max(SPACING, LEAST_MM / voxels))
    while scan.volume is None or window.workspace.jobs.running:
        wait(10)
    scan.set_threshold(THRESHOLD)
    rest(window)
    timer.stop()
    cpu, wall = 1e3 * np.array(gaps).T
    longest = ", ".join(f"{ms:.0f}" for ms in np.sort(cpu)[::-1][:5])
    print(f"opening {path.name}: {len(cpu)} answers; longest gaps {longest} ms of CPU (goal {GOAL_MS:g})")
    print(f"  seconds that passed: longest {wall.max():.0f} ms")


if __name__ == "__main__":
    main()
