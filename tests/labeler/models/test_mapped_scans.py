"""Scans that stay in their files: checked when there is time, and labels are safe whatever happens."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from window_cases import MIDDLE, write_ball

from gp_core.landmarks.features import Side
from gp_labeler.document.state import How
from gp_labeler.imaging import mapped_file, readers
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workspace import Workspace


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Workspace, Path, Callable]]:
    """A workspace with a scan that is mapped, and what waits until all work is done."""
    monkeypatch.setattr(readers, "MAPPED_FROM", 1)
    path = write_ball(tmp_path / "ball.nrrd")
    dispatcher = QueueDispatcher()
    workspace = Workspace(tmp_path / "state", dispatcher)
    workspace.scan.open(path)

    def wait() -> None:
        dispatcher.deliver_until_idle(workspace.jobs, timeout=60)

    wait()
    assert workspace.scan.volume is not None
    assert workspace.scan.volume.voxels.in_file
    yield workspace, path, wait
    workspace.close()


def test_whether_files_can_be_mapped_is_found_out_while_the_window_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[threading.Thread] = []
    guarded = mapped_file.maps_can_be_guarded
    monkeypatch.setattr(
        mapped_file, "maps_can_be_guarded", lambda: (asked.append(threading.current_thread()), guarded())[1]
    )
    dispatcher = QueueDispatcher()
    workspace = Workspace(tmp_path / "state", dispatcher)
    monkeypatch.setattr(readers, "MAPPED_FROM", 1)
    workspace.scan.open(write_ball(tmp_path / "ball.nrrd"))
    dispatcher.deliver_until_idle(workspace.jobs, timeout=60)
    workspace.close()
    assert asked[0] is not threading.main_thread()


def _label(workspace: Workspace) -> None:
    for n, code in enumerate(("CA", "RWP", "OS")):
        workspace.labels.place(MIDDLE + np.array([n, 1, 0.3 * n]), How.SLICE, side=Side.LEFT, code=code)


def test_the_checksum_is_found_when_the_work_is_done_and_makes_nothing_to_be_saved(opened) -> None:
    workspace, _, _ = opened
    volume, document = workspace.scan.volume, workspace.document
    assert document.state.volume.checksum == volume.known_checksum == volume.checksum != ""
    assert not document.dirty


def test_another_scan_of_the_same_size_is_found_and_asked_about(opened, tmp_path: Path) -> None:
    workspace, path, wait = opened
    _label(workspace)
    file = workspace.document.save(tmp_path / "ball.gpspecimen.json")
    raw = bytearray(path.read_bytes())
    raw[-1000] ^= 1
    path.write_bytes(raw)
    differing: list = []
    workspace.scan.differs.connect(lambda error, volume: differing.append((error, volume)))
    workspace.document.begin()
    workspace.document.open(file)
    wait()
    ((error, volume),) = differing
    assert "changed since it was labelled" in str(error)
    assert workspace.scan.volume is None  # until somebody accepts it
    assert len(workspace.document.landmarks("L").placed) == 3
    workspace.scan.accept(volume)
    wait()
    assert workspace.scan.volume is volume
    assert workspace.document.state.volume.checksum == volume.checksum


def test_a_scan_that_is_cut_while_open_is_told_once_and_labels_can_be_saved(opened, tmp_path: Path) -> None:
    workspace, path, wait = opened
    said: list[str] = []
    workspace.messages.said.connect(lambda text, level: said.append(text))
    _label(workspace)
    os.truncate(path, 20_000)
    for n in range(4):
        workspace.view.set_crosshair(MIDDLE + n)
    workspace.scan.set_threshold(700.0)
    wait()
    told = [text for text in said if "was truncated while it was open: 20,000 of its" in text]
    assert len([text for text in told if text.startswith("The scan ball")]) == 1
    assert len(told) == 2  # the mesh that was asked for says it too
    workspace.labels.place(MIDDLE, How.SLICE, side=Side.RIGHT, code="CA")
    file = workspace.document.save(tmp_path / "saved.gpspecimen.json")
    workspace.document.begin()
    workspace.document.open(file)
    wait()
    assert len(workspace.document.landmarks("L").placed) == 3
    assert len(workspace.document.landmarks("R").placed) == 1
