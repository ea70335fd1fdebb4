"""How long a touch takes in the window: until it is told, and until all that comes of it is seen.

Run from the project's root: ``python benchmarks/touch.py``. No display is needed. A synthetic head is
labelled on both sides and open in four views; one of seven touches is recorded again and again, each time a
little elsewhere: it is written to the journal, the pose estimated and registered, the panel, mesh and slices
brought up to date and painted. The peer, in the same run, is that window painted whole with nothing changed.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
_ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(_ROOT), str(_ROOT / "benchmarks")]

import numpy as np  # noqa: E402
from event_loop import wait  # noqa: E402
from qtpy.QtTest import QTest  # noqa: E402
from qtpy.QtWidgets import QApplication, QWidget  # noqa: E402

from gp_core import PROBE, RigidTransform, Side  # noqa: E402
from gp_core.landmarks.features import FEATURES  # noqa: E402
from gp_core.validation import FloatArray  # noqa: E402
from gp_labeler.document import touching  # noqa: E402
from gp_labeler.document.edits import PlacePoint  # noqa: E402
from gp_labeler.document.state import How, Provenance  # noqa: E402
from gp_labeler.views.application import make_window  # noqa: E402
from gp_labeler.views.main_window import MainWindow  # noqa: E402

_SIZE = (1440, 900)
_REPEATS, _WARM = 60, 10
_AGAIN = "ZL"


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as state:
        window = _labelled_head(Path(state))
        rng = np.random.default_rng(0)
        T_tracker_scan = _somewhere(rng)
        truth = window.workspace.scan.truth
        assert truth is not None
        touched = {
            code: T_tracker_scan.apply(truth.side(Side.LEFT)[code][None])[0] + rng.normal(0, 0.15, 3)
            for code in (*PROBE, _AGAIN)
        }
        for code, position in touched.items():
            touching.record_touch(window.workspace.document, Side.LEFT, code, position)
        _rest(window)
        told, seen = _touches(window, touched[_AGAIN], rng)
        _print(told, seen, _whole_paints(window))
        window.workspace.document.abandon()
        window.prompts.choose = lambda *a, **k: "Do not save"  # type: ignore[method-assign]
        window.close()


def _labelled_head(state: Path) -> MainWindow:
    window = make_window(state, atlas=True)
    window.resize(*_SIZE)
    window.show()
    QTest.qWaitForWindowExposed(window)
    workspace = window.workspace
    workspace.scan.open_demo(0, 0.2)
    _until(
        lambda: (
            workspace.scan.truth is not None and bool(workspace.bone.surfaces) and not workspace.jobs.running
        )
    )
    assert workspace.scan.truth is not None
    for side in Side:
        for row in FEATURES:
            if not row.computed:
                place = workspace.scan.truth.side(side)[row.code]
                workspace.document.do(PlacePoint(side, row.code, place, Provenance(How.MESH)))
    window.set_step("pose")
    _rest(window)
    return window


def _somewhere(rng: np.random.Generator) -> RigidTransform:
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    return RigidTransform.from_parts(turn, (9.0, 90.0, -200.0), dst="tracker", src="scan")


def _touches(
    window: MainWindow, position: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return ms until touches are told, and until they are seen."""
    told, seen = [], []
    for _ in range(_WARM + _REPEATS):
        there = position + rng.normal(0, 0.15, 3)
        start = time.perf_counter()
        touching.record_touch(window.workspace.document, Side.LEFT, _AGAIN, there)
        told.append(time.perf_counter() - start)
        _paint(window)
        seen.append(time.perf_counter() - start)
        wait(40)
    return 1e3 * np.array(told[_WARM:]), 1e3 * np.array(seen[_WARM:])


def _whole_paints(window: MainWindow) -> FloatArray:
    """Return ms that the window takes to repaint everything, with nothing changed."""
    taken = []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        for widget in window.findChildren(QWidget):
            widget.update()
        window.grid.scene_view.redraw()
        _paint(window)
        taken.append(time.perf_counter() - start)
        wait(40)
    return 1e3 * np.array(taken)


def _paint(window: MainWindow) -> None:
    """Let Qt paint until the 3D view's frame is that of now, and on the window."""
    while window.grid.scene_view.is_stale:
        QApplication.processEvents()
    QApplication.processEvents()


def _rest(window: MainWindow) -> None:
    scene = window.grid.scene_view.scene
    _until(lambda: not window.workspace.jobs.running and scene.is_fine)
    wait(300)


def _until(done: Callable[[], bool]) -> None:
    while not done():
        wait(20)


def _print(told: FloatArray, seen: FloatArray, whole: FloatArray) -> None:
    peer = float(np.median(whole))
    print(f"{'a touch, ' + str(_REPEATS) + ' times':<52}{'best':>7}{'median':>8}{'p95':>7}{'ratio':>7}")
    for name, ms in (
        ("journalled, estimated, told to panel and overlay, ms", told),
        ("... and painted in all four views and the panel, ms", seen),
        ("peer: the window painted whole, ms", whole),
    ):
        middle = float(np.median(ms))
        print(f"{name:<52}{ms.min():7.1f}{middle:8.1f}{np.percentile(ms, 95):7.1f}{middle / peer:7.2f}")


if __name__ == "__main__":
    main()
