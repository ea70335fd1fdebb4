"""Measure what a hand pays: CPU of the main thread for each frame of a drag, beside VTK's own slice mapper.

Run from the top of a checkout: ``python benchmarks/hands.py [voxels on an edge] [--profile CASE]``. It needs
no display. The window is 1440 x 900 at a ratio of 1, on the painted canvas; each frame is one event and all
painting that follows from it.
"""

from __future__ import annotations

import argparse
import cProfile
import os
import pstats
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import numpy as np  # noqa: E402
from big_scans import THRESHOLD, scan_file  # noqa: E402
from event_loop import wait  # noqa: E402
from qtpy.QtCore import QCoreApplication, QEvent  # noqa: E402
from qtpy.QtTest import QTest  # noqa: E402

from gp_labeler.imaging.readers import read_volume  # noqa: E402
from gp_labeler.imaging.volume import Volume  # noqa: E402
from gp_labeler.scene.planes import Plane  # noqa: E402
from gp_labeler.views.application import make_window  # noqa: E402
from gp_labeler.views.main_window import MainWindow  # noqa: E402

N_FRAMES = 60
GOALS_MS = {"crosshair": 16.0, "window": 12.0, "axial": 14.0, "coronal": 14.0, "sagittal": 14.0}

Step = Callable[[int], None]


def crosshair(window: MainWindow) -> Step:
    """Drag the crosshair: three slices and the mark in the 3D view follow."""
    view, volume = window.workspace.view, window.workspace.scan.volume
    assert volume is not None
    middle = volume.extent.mean(axis=0)
    return lambda n: view.set_crosshair(middle + 1.5 * np.array([np.sin(n / 5), np.cos(n / 7), n / 60]))


def window_level(window: MainWindow) -> Step:
    """Drag the grey window."""
    view = window.workspace.view
    return lambda n: view.update(level=700.0 + 5.0 * n, width=1500.0 + 7.0 * n)


def scroll(plane: Plane) -> Callable[[MainWindow], Step]:
    """Scroll one view through its slices."""

    def start(window: MainWindow) -> Step:
        view = window.grid.slice_views[plane]
        return lambda n: view.step(1 if n < N_FRAMES // 2 else -1)

    return start


CASES: dict[str, Callable[[MainWindow], Step]] = {
    "crosshair": crosshair,
    "window": window_level,
    **{plane.name.lower(): scroll(plane) for plane in Plane},
}


def frames(step: Step) -> list[float]:
    """Return the CPU seconds of the main thread for each frame."""
    taken = []
    for n in range(N_FRAMES):
        begun = time.thread_time()
        step(n)
        for _ in range(3):  # what was asked for is painted, and what that asked for
            QCoreApplication.sendPostedEvents()
            QCoreApplication.processEvents()
        taken.append(time.thread_time() - begun)
    return taken


def slice_mapper(volume: Volume) -> Iterator[tuple[str, float]]:
    """Yield what `vtkImageSliceMapper` takes for a frame of the same size, ms, by axis."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkRenderingCore import vtkImageSlice, vtkImageSliceMapper, vtkRenderer, vtkRenderWindow

    image = vtkImageData()
    image.SetDimensions(volume.size)
    image.GetPointData().SetScalars(numpy_to_vtk(volume.array.reshape(-1)))
    mapper, shown, renderer, target = vtkImageSliceMapper(), vtkImageSlice(), vtkRenderer(), vtkRenderWindow()
    mapper.SetInputData(image)
    shown.SetMapper(mapper)
    shown.GetProperty().SetColorWindow(1500)
    shown.GetProperty().SetColorLevel(700)
    renderer.AddViewProp(shown)
    target.SetOffScreenRendering(1)
    target.SetSize(560, 420)
    target.AddRenderer(renderer)
    for axis, name in enumerate(("sagittal", "coronal", "axial")):
        mapper.SetOrientation(axis)
        renderer.ResetCamera()
        taken = []
        for n in range(N_FRAMES):
            begun = time.process_time()
            mapper.SetSliceNumber(volume.size[axis] // 2 + n % 30)
            target.Render()
            taken.append(time.process_time() - begun)
        yield name, 1e3 * float(np.median(taken))


def opened(path: Path) -> MainWindow:
    """Return the window with a scan and its bone, at rest."""
    window = make_window(None, atlas=False)
    window.resize(1440, 900)
    window.show()
    QTest.qWaitForWindowExposed(window)
    window.workspace.scan.begin(read_volume(path))
    window.workspace.scan.set_threshold(THRESHOLD)
    rest(window)
    return window


def rest(window: MainWindow) -> None:
    """Wait until all work is done and the bone is drawn finely."""
    while window.workspace.jobs.running or not window.grid.scene_view.scene.is_fine:
        wait(20)
    wait(50)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("voxels", nargs="?", type=int, default=512)
    parser.add_argument("--folder", type=Path, help="where the scan is kept; thrown away by default")
    parser.add_argument("--profile", choices=CASES)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as thrown_away:
        path = scan_file(options.folder or Path(thrown_away), options.voxels)
        window = opened(path)
        if options.profile:
            profiler = cProfile.Profile(time.thread_time)
            profiler.runcall(frames, CASES[options.profile](window))
            pstats.Stats(profiler).sort_stats("tottime").print_stats(25)
        else:
            report(window)
        window.workspace.document.abandon()
        window.prompts.choose = lambda *a, **k: "Do not save"  # type: ignore[method-assign]
        window.close()
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def report(window: MainWindow) -> None:
    """Print ms a frame for each case, the goal, and VTK's own."""
    assert window.workspace.scan.volume is not None
    peers = dict(slice_mapper(window.workspace.scan.volume))
    print(f"{'ms a frame':<14}{'median':>8}{'p95':>8}{'goal':>8}{'VTK mapper':>12}")
    for name, start in CASES.items():
        ms = 1e3 * np.array(frames(start(window)))
        rest(window)
        peer = f"{peers[name]:>12.1f}" if name in peers else ""
        print(f"{name:<14}{np.median(ms):>8.1f}{np.percentile(ms, 95):>8.1f}{GOALS_MS[name]:>8.0f}{peer}")


if __name__ == "__main__":
    main()
