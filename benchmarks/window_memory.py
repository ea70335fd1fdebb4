"""Measure what a scan that stays in its file, its bone and both ears add to the memory of the window.

Run from the top of a checkout: ``python benchmarks/window_memory.py [voxels on an edge] [--folder DIR]``. It
needs no display. Memory is anonymous and shared memory above that of the started window, which is printed
first: pages of the file are none of it. The most is that of the whole time before a line.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import threading
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from big_scans import MB, THRESHOLD, anonymous_mb, scan_file  # noqa: E402
from event_loop import wait  # noqa: E402
from hands import rest  # noqa: E402
from qtpy.QtTest import QTest  # noqa: E402

from gp_labeler.document.state import How  # noqa: E402
from gp_labeler.imaging.readers import read_volume  # noqa: E402
from gp_labeler.views.application import make_window  # noqa: E402
from gp_labeler.views.main_window import MainWindow  # noqa: E402

GOAL_MB = 1000.0
RETURNED_MS = 2500
"""By then what was freed has been returned to the system."""

_EAR_MM = 8.0
"""How far each ear lies from the middle of the scan; less in a scan that is smaller."""


class Watch:
    """Memory above that of the started window: now, and the most so far, MB."""

    def __init__(self) -> None:
        self.most = self.started = anonymous_mb()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def _look(self) -> None:
        while not self._done.wait(0.02):
            self.most = max(self.most, anonymous_mb())

    def report(self, title: str, window: MainWindow) -> None:
        """Print a row, once what was freed has been returned."""
        rest(window)
        wait(RETURNED_MS)
        millions = sum(surface.n_triangles for surface in window.workspace.bone.surfaces) / 1e6
        now, most = anonymous_mb() - self.started, self.most - self.started
        print(f"{title:<32}{millions:>12.1f}{now:>10.0f}{most:>10.0f}{GOAL_MB:>8.0f}", flush=True)

    def stop(self) -> None:
        """Look no more."""
        self._done.set()
        self._thread.join()


def show_ears(window: MainWindow) -> None:
    """Place a point in each ear, so that both are meshed at full resolution."""
    workspace = window.workspace
    assert workspace.scan.volume is not None
    low, high = workspace.scan.volume.extent
    apart = min(_EAR_MM, 0.3 * float(high[0] - low[0]))
    for side, way in (("L", 1.0), ("R", -1.0)):
        workspace.labels.place((low + high) / 2 + [way * apart, 0, 0], How.SLICE, side=side, code="CA")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("voxels", nargs="?", type=int, default=920)
    parser.add_argument("--folder", type=Path, help="where the scan is kept; thrown away by default")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as thrown_away:
        path = scan_file(options.folder or Path(thrown_away), options.voxels)
        window = make_window(None, atlas=False)
        window.resize(1440, 900)
        window.show()
        QTest.qWaitForWindowExposed(window)
        wait(RETURNED_MS)
        watch = Watch()
        print(f"the started window: {watch.started:.0f} MB; the scan: {path.stat().st_size / MB:.0f} MB")
        print(f"{'above it, MB':<32}{'M triangles':>12}{'now':>10}{'most':>10}{'goal':>8}")
        window.workspace.scan.begin(read_volume(path, mapped=True))
        window.workspace.scan.set_threshold(THRESHOLD)
        watch.report("slices and overview", window)
        show_ears(window)
        watch.report("both ears at full resolution", window)
        watch.stop()
        window.workspace.document.abandon()
        window.prompts.choose = lambda *a, **k: "Do not save"  # type: ignore[method-assign]
        window.close()


if __name__ == "__main__":
    main()
