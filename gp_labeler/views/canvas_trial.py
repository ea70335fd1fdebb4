"""``python -m gp_labeler.views.canvas_trial``: shows a window for some seconds; prints how fast it draws."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from statistics import median

import numpy as np

from gp_labeler.imaging.volume import Volume
from gp_labeler.views.application import make_application, make_window

__all__ = ["main"]

_SIZE = (1000, 750)
_TURNS, _REDRAWS = 12, 20
_VOXELS, _BALLS = 160, 7.0
_PATIENCE_S = 60


def main() -> None:
    """Show a window, turn some bone, and print how long a turned frame and one with a point more take."""
    app = make_application()
    window = make_window(None, atlas=False)
    window.workspace.view.update(layout="3d")
    window.resize(*_SIZE)
    window.show()
    view, workspace = window.grid.scene_view, window.workspace
    workspace.scan.begin(_balls())
    workspace.scan.set_threshold(0.5)

    def wait() -> None:
        end = time.monotonic() + _PATIENCE_S
        while time.monotonic() < end:
            app.processEvents()
            if not workspace.jobs.running and view.is_up_to_date and view.scene.is_fine:
                return
        raise TimeoutError

    wait()

    def again() -> None:
        view.redraw()
        wait()

    def turn() -> None:
        view.scene.camera.rotate(7.0, 2.0)
        again()

    turned, redrawn = _clocked(turn, _TURNS), _clocked(again, _REDRAWS)
    print(json.dumps({"turned_ms": turned, "redrawn_ms": redrawn, "frame_ms": turned + redrawn}))  # noqa: T201
    sys.stdout.flush()
    os._exit(0)  # nothing is to be saved, and nobody is to be asked


def _clocked(work: Callable[[], object], n: int) -> float:
    """Return the median time of some work, ms."""
    work()
    times = []
    for _ in range(n):
        start = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - start))
    return median(times)


def _balls() -> Volume:
    """Make a scan of many balls: about 0.8 million triangles."""
    wave = np.cos(np.arange(_VOXELS, dtype=np.float32) * (2 * np.pi * _BALLS / _VOXELS))
    field = wave[:, None, None] + wave[None, :, None] + wave[None, None, :]
    return Volume.from_parts((1000 * (field - 1.0)).astype(np.int16), [0.2] * 3, name="balls")


if __name__ == "__main__":
    main()
