"""Measure what scrolling costs in planes along the voxels and in oblique ones.

Run from the top of a checkout: ``python benchmarks/oblique.py [voxels along an edge]``. No display is needed.

The window is 1440 x 900, four views, painted canvas, ratio 1. Each view is scrolled by itself, a voxel at a
time, and painted at once. Milliseconds are processor time of the main thread, which other work on the machine
hardly changes; medians over the slices. The last column is `vtkImageReslice` alone, at the voxels' own step.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import numpy as np  # noqa: E402
from event_loop import wait  # noqa: E402
from qtpy.QtTest import QTest  # noqa: E402
from scipy.ndimage import gaussian_filter, zoom  # noqa: E402
from vtkmodules.vtkCommonDataModel import vtkImageData  # noqa: E402
from vtkmodules.vtkImagingCore import vtkImageReslice  # noqa: E402

from gp_labeler.imaging.slab import Slab  # noqa: E402
from gp_labeler.imaging.volume import Volume  # noqa: E402
from gp_labeler.imaging.vtk_arrays import matrix_of, to_vtk  # noqa: E402
from gp_labeler.views.application import make_window  # noqa: E402
from gp_labeler.views.main_window import MainWindow  # noqa: E402

VOXEL_MM, N_SLICES = 0.035, 30
TURNS = ((0, 0), (10, 5), (30, 20), (45, 35))
"""Degrees by which the planes are turned about the axial and the sagittal normal."""


def main() -> None:
    """Print the table."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 512
    volume = bubbles(n)
    window = shown(volume)
    print(f"{n} x {n} x {n} voxels of 16 bits")
    print(f"{'turned by':<14}{'axial':>9}{'sagittal':>9}{'coronal':>9}{'mean':>8}{'ratio':>8}{'reslice':>9}")
    straight = 0.0
    for turn in TURNS:
        turn_planes(window, turn)
        costs = [scrolled(window, name) for name in window.workspace.view.planes]
        mean = float(np.mean(costs))
        straight = straight or mean
        alone = resliced(volume, window)
        print(
            f"{turn[0]:>3}, {turn[1]:>2} deg   "
            + "".join(f"{1e3 * cost:>9.1f}" for cost in costs)
            + f"{1e3 * mean:>8.1f}{mean / straight:>8.2f}{1e3 * alone:>9.1f}"
        )
    window.workspace.document.abandon()
    window.prompts.choose = lambda *a, **k: "Do not save"  # type: ignore[method-assign]
    window.close()


def shown(volume: Volume) -> MainWindow:
    """Return a window that shows a scan and its bone."""
    window = make_window(None, atlas=False)
    window.resize(1440, 900)
    window.show()
    QTest.qWaitForWindowExposed(window)
    window.workspace.scan.begin(volume)
    window.workspace.scan.set_threshold(11_000)
    while window.workspace.jobs.running:
        wait(50)
    return window


def turn_planes(window: MainWindow, turn: tuple[int, int]) -> None:
    """Turn the planes about the middle of the scan, degrees; see `TURNS`."""
    view = window.workspace.view
    view.set_frame(view.frame)
    view.set_crosshair(window.workspace.scan.volume.extent.mean(axis=0))
    view.rotate_planes("axial", np.radians(turn[0]))
    view.rotate_planes("sagittal", np.radians(turn[1]))
    window.grid.reset()


def bubbles(n: int) -> Volume:
    """Make a scan of smooth blobs with noise, whose edges fill the slices."""
    rng = np.random.default_rng(0)
    coarse = gaussian_filter(rng.normal(size=(32, 32, 32)), 1.5)
    values = zoom(coarse / coarse.std(), n / 32, order=1)
    values = 3000 * values + 9000
    values += rng.integers(0, 400, values.shape)
    return Volume.from_parts(values.clip(0, 65535).astype(np.uint16), [VOXEL_MM] * 3, name="blobs")


def scrolled(window: MainWindow, name: str) -> float:
    """Return the processor time of the main thread for a slice of one view, s: the median over some."""
    view = next(v for plane, v in window.grid.slice_views.items() if plane.value == name)
    costs = []
    for _ in range(N_SLICES):
        start = time.thread_time()
        view.step(1)
        view.repaint()
        costs.append(time.thread_time() - start)
    view.step(-N_SLICES)
    return float(np.median(costs))


def resliced(volume: Volume, window: MainWindow, slab: Slab | None = None) -> float:
    """Return what `vtkImageReslice` alone takes of the main thread for the axial slice, or slab, s."""
    image, plane = vtkImageData(), window.workspace.view.planes["axial"]
    image.SetDimensions(volume.size)
    image.SetSpacing(volume.spacing)
    image.SetOrigin(volume.origin.tolist())
    image.GetPointData().SetScalars(to_vtk(volume.array.reshape(-1), share=True))
    costs = []
    for n in range(N_SLICES if slab is None else N_SLICES // 6):
        reslice = vtkImageReslice()
        reslice.SetInputData(image)
        reslice.SetInterpolationModeToLinear()
        reslice.SetOutputDimensionality(2)
        if slab is not None:
            set_mode = {"mean": "Mean", "maximum": "Max", "minimum": "Min"}[slab.mode]
            getattr(reslice, f"SetSlabModeTo{set_mode}")()
            reslice.SetSlabNumberOfSlices(slab.n_layers(VOXEL_MM))
        axes = np.eye(4)
        axes[:3, :3] = plane.axes
        axes[:3, 3] = window.workspace.view.crosshair + n * VOXEL_MM * plane.normal
        reslice.SetResliceAxes(matrix_of(axes))
        reslice.AutoCropOutputOn()
        start = time.thread_time()
        reslice.Update()
        costs.append(time.thread_time() - start)
    return float(np.median(costs))


if __name__ == "__main__":
    main()
