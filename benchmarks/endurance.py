"""Open, mesh, label and close 20 scans in one window, and print memory and handles after each.

Run from the top of a checkout: ``python benchmarks/endurance.py [--scans 20] [--voxels 256]``. It needs no
display. Every other scan is packed, and every third one is cancelled while it is read and opened again. At
the end stands how far memory and handles of the last five lie above those of the third to the seventh.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import numpy as np  # noqa: E402
import SimpleITK  # noqa: E402
from big_scans import THRESHOLD, anonymous_mb, scan_file  # noqa: E402
from event_loop import wait  # noqa: E402
from hands import rest  # noqa: E402

from gp_labeler.document.state import How  # noqa: E402
from gp_labeler.imaging import readers  # noqa: E402
from gp_labeler.views.application import make_window  # noqa: E402
from gp_labeler.views.main_window import MainWindow  # noqa: E402


def work_on(window: MainWindow, path: Path, *, cancelled: bool) -> None:
    """Open a scan, with a cancelled try before if asked for, mesh it, and place a few points."""
    workspace = window.workspace
    if cancelled:
        workspace.scan.open(path, spacing=0.1)
        wait(30)
        workspace.jobs.cancel_all()
        while workspace.jobs.running:
            wait(10)
    workspace.scan.open(path, spacing=0.1)
    while workspace.scan.volume is None or workspace.jobs.running:
        wait(10)
    workspace.scan.set_threshold(THRESHOLD)
    rest(window)
    middle = workspace.scan.volume.extent.mean(axis=0)
    for n, code in enumerate(("CA", "CB", "RWP", "OS")):
        workspace.labels.place(middle + np.array([n, 1.0, 0.5 * n * n]), How.SLICE, side="L", code=code)
    rest(window)
    workspace.document.abandon()
    workspace.document.begin()
    rest_closed(window)


def rest_closed(window: MainWindow) -> None:
    """Wait until nothing runs any more."""
    while window.workspace.jobs.running:
        wait(10)
    wait(50)


def n_handles() -> int:
    """Return how many files the process holds open."""
    return len(list(Path("/proc/self/fd").iterdir()))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--scans", type=int, default=20)
    parser.add_argument("--voxels", type=int, default=256)
    options = parser.parse_args()
    readers.MAPPED_FROM = 1 << 20
    with tempfile.TemporaryDirectory() as folder:
        raw = scan_file(Path(folder), options.voxels)
        packed = Path(folder) / "packed.nrrd"
        SimpleITK.WriteImage(SimpleITK.ReadImage(str(raw)), str(packed), True)
        window = make_window(None, atlas=False)
        window.resize(1440, 900)
        window.show()
        memory, handles = [], []
        print(f"{'scan':>5}{'MB':>8}{'handles':>9}")
        for n in range(options.scans):
            work_on(window, packed if n % 2 else raw, cancelled=n % 3 == 2)
            memory.append(anonymous_mb())
            handles.append(n_handles())
            print(f"{n + 1:>5}{memory[-1]:>8.0f}{handles[-1]:>9}", flush=True)
        grown = np.median(memory[-5:]) / np.median(memory[2:7]) - 1
        print(f"memory {100 * grown:+.1f} % (goal 5), handles {handles[-1] - handles[2]:+d}")
        window.workspace.document.abandon()
        window.close()


if __name__ == "__main__":
    main()
