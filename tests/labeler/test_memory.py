"""Scans that were closed are freed at once, by counting alone: three of them must fit where one does.

Voxels are gigabytes, and what the collector of cycles looks at is a handful of small objects: it may not come
for hours.
"""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from window_cases import MIDDLE, ball_volume, wait_until_idle, write_ball

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.document.state import How
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.runner import Progress, QueueDispatcher
from gp_labeler.models.workspace import Workspace

Refs = dict[str, weakref.ref]


@dataclass(frozen=True)
class _Fails:
    """A job that fails with voxels in its hands."""

    volume: Volume
    title = "Fails"

    def run(self, progress: Progress) -> None:
        voxels = self.volume.array
        try:
            _ = voxels[len(voxels)]
        except IndexError as problem:
            raise GpError("there is no such slice") from problem


@dataclass(frozen=True)
class _Waits:
    """A job that is stopped with voxels in its hands."""

    volume: Volume
    title = "Waits"

    def run(self, progress: Progress) -> None:
        while True:
            progress.wait(0.005)
            progress(0.5)


@pytest.fixture
def no_collector() -> Iterator[None]:
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.fixture
def workspace() -> Iterator[tuple[Workspace, Callable[[], None]]]:
    dispatcher = QueueDispatcher()
    workspace = Workspace(None, dispatcher)
    yield workspace, lambda: dispatcher.deliver_until_idle(workspace.jobs, timeout=60)
    workspace.close()


def _new_ball(n: int, direction: np.ndarray | None = None) -> Volume:
    ball = ball_volume()
    array = ball.array.copy()
    array[0, 0, n] += 1
    return Volume.from_parts(array, ball.spacing, ball.origin, direction, name=f"ball{n}")


def _remembered(workspace: Workspace) -> Refs:
    """Return weak references to the voxels and meshes that are open."""
    assert workspace.scan.volume is not None
    array = workspace.scan.volume.array
    refs: Refs = {"volume": weakref.ref(workspace.scan.volume), "array": weakref.ref(array)}
    if array.base is not None:
        refs["voxels"] = weakref.ref(array.base)
    for n, surface in enumerate((*workspace.bone.surfaces, *workspace.bone.quick_surfaces)):
        refs |= {f"surface {n}": weakref.ref(surface), f"mesh {n}": weakref.ref(surface.mesh)}
        refs[f"search {n}"] = weakref.ref(surface.search)
    return refs


def _alive(refs: Refs) -> list[str]:
    return [name for name, ref in refs.items() if ref() is not None]


def _work_on(workspace: Workspace, wait: Callable[[], None]) -> Refs:
    """Mesh, place points, change the threshold, to one without a surface too; end jobs in every way."""
    wait()
    refs = _remembered(workspace)
    for n, code in enumerate(("CA", "RWP", "OS", "CB")):
        workspace.labels.place(MIDDLE + np.array([n, 1, 0.3 * n]), How.SLICE, side=Side.LEFT, code=code)
    for threshold in (1100.0, 1e9, 1000.0):
        workspace.scan.set_threshold(threshold)
        wait()
    workspace.jobs.submit(_Fails(workspace.scan.volume))
    waiting = workspace.jobs.submit(_Waits(workspace.scan.volume))
    waiting.cancel()
    del waiting
    wait()
    workspace.document.abandon()
    return refs | {f"later {name}": ref for name, ref in _remembered(workspace).items()}


@pytest.mark.usefixtures("no_collector")
def test_opening_another_scan_frees_the_one_before(workspace) -> None:
    workspace, wait = workspace
    workspace.scan.begin(_new_ball(1))
    first = _work_on(workspace, wait)
    workspace.scan.begin(_new_ball(2))
    wait()
    assert _alive(first) == []
    second = _work_on(workspace, wait)
    workspace.document.begin()
    wait()
    assert _alive(second) == []


@pytest.mark.usefixtures("no_collector")
def test_a_scan_read_from_a_file_is_freed(workspace, tmp_path: Path) -> None:
    workspace, wait = workspace
    workspace.scan.open(write_ball(tmp_path / "ball.nrrd"))
    wait()
    refs = _work_on(workspace, wait)
    workspace.scan.open(tmp_path / "ball.nrrd")
    wait()
    assert _alive(refs) == []


@pytest.mark.usefixtures("no_collector")
def test_closing_frees_the_scan() -> None:
    dispatcher = QueueDispatcher()
    workspace = Workspace(None, dispatcher)
    workspace.scan.begin(_new_ball(3))
    refs = _work_on(workspace, lambda: dispatcher.deliver_until_idle(workspace.jobs, timeout=60))
    workspace.close(discard=True)
    assert _alive(refs) == []


@pytest.mark.parametrize("layout", ["shown", "hidden"])
def test_the_window_frees_the_scan_before(layout: str, qtbot, make_window, no_collector) -> None:
    from scipy.spatial.transform import Rotation

    window = make_window()
    workspace, wait = window.workspace, lambda: wait_until_idle(qtbot, window)
    oblique = Rotation.from_euler("xyz", [10, 20, 5], degrees=True).as_matrix()
    workspace.scan.begin(_new_ball(1))
    first = _work_on(workspace, wait)
    window.grab()
    if layout == "hidden":
        window.hide()
    workspace.scan.begin(_new_ball(2, oblique))
    wait()
    assert _alive(first) == []
    second = _work_on(workspace, wait)
    workspace.document.begin()
    wait()
    assert _alive(second) == []
