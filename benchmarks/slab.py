"""Measure what scrolling costs with a thick slab and with denoising, beside `vtkImageReslice` alone.

Run from the top of a checkout: ``python benchmarks/slab.py [voxels along an edge]``. No display is needed.

As in ``benchmarks/oblique.py``: the window is 1440 x 900, four views, painted canvas, ratio 1, and each view
is scrolled a voxel at a time and painted at once. Milliseconds are processor time of the main thread, means
over the three views of medians over slices: along the voxels, and turned by 30 and 20 degrees. The last
columns are `vtkImageReslice` with the same slab, at the voxels' own step.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import numpy as np  # noqa: E402
from oblique import VOXEL_MM, bubbles, resliced, scrolled, shown, turn_planes  # noqa: E402

from gp_labeler.imaging.slab import DENOISERS, SLAB_MODES, Slab  # noqa: E402
from gp_labeler.imaging.volume import Volume  # noqa: E402
from gp_labeler.views.main_window import MainWindow  # noqa: E402

TURNS = ((0, 0), (30, 20))
SLAB_MM = (0.5, 2.0)


def main() -> None:
    """Print the table."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 512
    volume = bubbles(n)
    window = shown(volume)
    print(f"{n} x {n} x {n} voxels of 16 bits and {VOXEL_MM} mm; ms of the main thread for a slice")
    print(f"{'shown':<18}{'straight':>10}{'turned':>10}{'reslice straight':>18}{'reslice turned':>16}")
    cases: list[tuple[str, dict[str, Any]]] = [("single slice", {})]
    cases += [(f"{m} {mm:g} mm", {"slab": Slab(m, mm)}) for m in SLAB_MODES for mm in SLAB_MM]
    cases += [(kind, {"denoise": kind}) for kind in DENOISERS]
    for name, how in cases:
        window.workspace.view.update(**{"slab": None, "denoise": None, **how})
        costs = [cost(volume, window, turn, how.get("slab")) for turn in TURNS]
        alone = [f"{1e3 * each:.1f}" if "denoise" not in how else "" for _, each in costs]
        print(f"{name:<18}" + "".join(f"{1e3 * each:>10.1f}" for each, _ in costs), end="")
        print(f"{alone[0]:>18}{alone[1]:>16}", flush=True)
    window.workspace.document.abandon()
    window.prompts.choose = lambda *a, **k: "Do not save"  # type: ignore[method-assign]
    window.close()


def cost(volume: Volume, window: MainWindow, turn: tuple[int, int], slab: Slab | None) -> tuple[float, float]:
    """Return what a slice takes of the main thread in the window, and in `vtkImageReslice` alone, s."""
    turn_planes(window, turn)
    return float(np.mean([scrolled(window, name) for name in window.workspace.view.planes])), resliced(
        volume, window, slab
    )


if __name__ == "__main__":
    main()
