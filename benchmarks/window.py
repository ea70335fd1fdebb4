"""Measure how long the window lets a hand wait, against one whole redraw of the scene in the same run.

Run from the top of a checkout: ``python benchmarks/window.py [million triangles]``. No display is needed.

A timer asks every few milliseconds whether the window answers; the longest time between two answers is what a
hand would feel. It is told in milliseconds, and as a part of the peer: the same scene drawn whole, as every
placed point once cost. Other work on the machine lengthens both.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import numpy as np  # noqa: E402
from event_loop import wait  # noqa: E402
from qtpy.QtCore import QPoint, QPointF, Qt, QTimer  # noqa: E402
from qtpy.QtTest import QTest  # noqa: E402

from gp_core.validation import FloatArray  # noqa: E402
from gp_labeler.imaging.volume import Volume  # noqa: E402
from gp_labeler.jobs.mesh import MeshFirst, MeshOverview  # noqa: E402
from gp_labeler.jobs.runner import Job  # noqa: E402
from gp_labeler.views.application import make_window  # noqa: E402
from gp_labeler.views.main_window import MainWindow  # noqa: E402

N_POINTS, N_TURNS = 20, 20
LEFT = Qt.MouseButton.LeftButton
PER_MM = 5.0


def main() -> None:
    """Print the table."""
    millions = float(sys.argv[1]) if len(sys.argv) > 1 else 0.8
    window = make_window(None, atlas=False)
    window.resize(1440, 900)
    window.show()
    QTest.qWaitForWindowExposed(window)
    window.workspace.scan.begin(sphere_field(millions))
    window.workspace.scan.set_threshold(0.5)
    rest(window)
    n = sum(surface.n_triangles for surface in window.workspace.bone.surfaces)
    quick = sum(surface.n_triangles for surface in window.workspace.bone.quick_surfaces)
    print(f"{n / 1e6:.2f} million triangles, a preview mesh of {quick / 1e3:.0f} thousand")
    whole = whole_redraw_seconds(window)
    print(f"the scene drawn whole: {1e3 * whole:.0f} ms\n")
    print(f"{'while':<46}{'answers':>8}{'median':>8}{'p95':>8}{'longest':>9}{'of whole':>10}{'bone':>6}")
    for title, work in CASES:
        report(title, window, whole, work)
    drawing_alone(window, whole)
    window.workspace.document.abandon()
    window.prompts.choose = lambda *a, **k: "Do not save"  # type: ignore[method-assign]
    window.close()


def sphere_field(millions: float) -> Volume:
    """Make a scan of balls in rows, whose surface has about so many triangles (up to 2 million)."""
    n, level = 160, 1.0
    cells = 7.0 * millions
    index = np.arange(n, dtype=np.float32)
    wave = np.cos(index * (2 * np.pi * cells / n))
    field = wave[:, None, None] + wave[None, :, None] + wave[None, None, :]
    rng = np.random.default_rng(0)
    values = 1000 * (field - level) + rng.normal(0, 8, field.shape)
    return Volume.from_parts(values.astype(np.int16), [1 / PER_MM] * 3, [0.0, 0.0, 0.0], name="balls")


def rest(window: MainWindow) -> None:
    """Wait until all work is done and the bone is drawn finely."""
    view = window.grid.scene_view
    while window.workspace.jobs.running or not view.scene.is_fine:
        wait(20)
    wait(50)


def whole_redraw_seconds(window: MainWindow) -> float:
    """Return how long the scene takes from nothing, the median of three."""
    scene, taken = window.grid.scene_view.scene, []
    for _ in range(3):
        scene.camera.rotate(1.0, 0.0)
        start = time.perf_counter()
        scene.render()
        taken.append(time.perf_counter() - start)
    rest(window)
    return float(np.median(taken))


@contextmanager
def asking() -> Iterator[list[float]]:
    """Collect the seconds between two answers of the window."""
    gaps: list[float] = []
    last = time.perf_counter()

    def answer() -> None:
        nonlocal last
        now = time.perf_counter()
        gaps.append(now - last)
        last = now

    timer = QTimer(interval=2)
    timer.setTimerType(Qt.TimerType.PreciseTimer)
    timer.timeout.connect(answer)
    timer.start()
    yield gaps
    timer.stop()


def report(title: str, window: MainWindow, whole: float, work: Callable[[MainWindow], None]) -> None:
    """Do something, and print a row of how the window answered."""
    rest(window)
    drawn = window.grid.scene_view.scene.n_bone_frames
    with asking() as gaps:
        work(window)
    drawn = window.grid.scene_view.scene.n_bone_frames - drawn
    ms = 1e3 * np.array(gaps)
    middle, high, longest = np.median(ms), np.percentile(ms, 95), ms.max()
    part = longest / (1e3 * whole)
    print(f"{title:<46}{len(ms):>8}{middle:>8.1f}{high:>8.1f}{longest:>9.1f}{part:>10.2f}{drawn:>6}")


def drawing_alone(window: MainWindow, whole: float) -> None:
    """Print what one point more costs the 3D view itself, without the rest of the window."""
    view, taken = window.grid.scene_view, []
    rest(window)
    for _ in range(20):
        view._show_points()
        start = time.perf_counter()
        view.draw_frame()
        taken.append(time.perf_counter() - start)
    ms, top = 1e3 * float(np.median(taken)), 1e3 * max(taken)
    print(
        f"\nthe 3D view alone, a point more: {ms:.1f} ms, at most {top:.1f}; {ms / whole / 1e3:.3f} of whole"
    )


def place(window: MainWindow) -> None:
    """Click on 20 points of bone that are seen, one after the other."""
    view = window.grid.scene_view
    for x, y in seen(window):
        QTest.mouseClick(view, LEFT, Qt.KeyboardModifier.NoModifier, QPoint(int(x), int(y)))
        wait(60)


def seen(window: MainWindow) -> FloatArray:
    """Return logical pixels of points on bone, well inside the view."""
    view, rng = window.grid.scene_view, np.random.default_rng(1)
    found: list[tuple[float, float]] = []
    while len(found) < N_POINTS:
        x, y = rng.uniform(0.25, 0.75, 2) * [view.width(), view.height()]
        ratio = view.devicePixelRatioF()
        if view.scene.pick(int(x) * ratio, int(y) * ratio) is not None:
            found.append((x, y))
    return np.array(found)


def turn(window: MainWindow) -> None:
    """Drag across the view, and let it rest."""
    view = window.grid.scene_view
    middle = QPointF(view.rect().center())
    QTest.mousePress(view, LEFT, Qt.KeyboardModifier.NoModifier, middle.toPoint())
    for n in range(N_TURNS):
        QTest.mouseMove(view, (middle + QPointF(3.0 * n, 1.0 * n)).toPoint())
        wait(16)
    QTest.mouseRelease(view, LEFT, Qt.KeyboardModifier.NoModifier, view.rect().center())
    rest(window)


def refine(window: MainWindow) -> None:
    """Let the bone be drawn finely from a new viewpoint, three times."""
    for letter in "APL":
        window.grid.scene_view.view_from(letter)
        rest(window)


def cut(window: MainWindow) -> None:
    """Move a cut through the bone."""
    workspace = window.workspace
    workspace.view.set_crosshair(workspace.scan.volume.extent.mean(axis=0))  # type: ignore[union-attr]
    window.commands.run("view.cut_coronal")
    for _ in range(10):
        window.commands.run("view.cut_deeper")
        wait(16)
    window.commands.run("view.cut_coronal")
    rest(window)


def mesh(window: MainWindow) -> None:
    """Mesh the scan in the background, as after another threshold."""
    workspace = window.workspace
    assert workspace.scan.volume is not None
    assert workspace.scan.threshold is not None
    jobs: tuple[Job[object], ...] = (
        MeshOverview(workspace.scan.volume, workspace.scan.threshold),
        MeshFirst(workspace.scan.volume, workspace.scan.threshold),
    )
    for job in jobs:
        workspace.jobs.submit(job)
    while workspace.jobs.running:
        wait(5)


def mesh_and_show(window: MainWindow) -> None:
    """Set another threshold: mesh, and show what comes of it."""
    workspace = window.workspace
    assert workspace.scan.threshold is not None
    workspace.scan.set_threshold(workspace.scan.threshold + 1.0)
    rest(window)


CASES: tuple[tuple[str, Callable[[MainWindow], None]], ...] = (
    ("nothing happens", lambda window: wait(300)),
    (f"{N_POINTS} points are placed by clicks", place),
    (f"the bone is turned, {N_TURNS} steps, and rests", turn),
    ("bone is drawn finely from 3 new viewpoints", refine),
    ("a cut moves through bone, 10 steps", cut),
    ("a mesh is made in the background", mesh),
    ("a threshold is set: meshed again and shown", mesh_and_show),
)


if __name__ == "__main__":
    main()
