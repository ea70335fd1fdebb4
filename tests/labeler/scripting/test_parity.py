"""Python calls, a script and events in the window leave the same landmark files to the byte, times aside."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest
from script_cases import run, untimed
from window_cases import wait_until_idle

from gp_core.io import read_landmarks
from gp_core.landmarks.features import Side, index_of
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.document.state import How
from gp_labeler.imaging.bone_distance import scan_evidence
from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.threshold import propose_threshold
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.planes import Plane

SIZE = (1200, 800)
CLICKS = (
    ("L", "IN", "axial", (160, 150)),
    ("R", "OS", "sagittal", (170, 140)),
    ("L", "CA", "coronal", (180, 120)),
    ("L", "CB", "3d", (160, 150)),
)
"""No more than three a side: from then on a row brings the views to its ghost, which is not in this scan."""

FILES = ("ball_L.mrk.json", "ball_R.mrk.json")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What a script leaves, from which the others take the scan and the positions."""
    folder = tmp_path_factory.mktemp("parity")
    clicks = [
        {"do": "place", "side": side, "feature": code, "view": view, "pixel": list(pixel)}
        for side, code, view, pixel in CLICKS
    ]
    look = {"do": "view", "size": list(SIZE), "camera": "A"}
    report = run(folder, look, {"do": "view", "reset": True}, *clicks, {"do": "export"})
    assert report.ok, report.error
    return folder


def texts(folder) -> list[str]:
    return [untimed(folder / name) for name in FILES]


def test_python_calls_leave_the_same_files(folder) -> None:
    workspace = Workspace()
    workspace.document.begin("ball")
    volume = read_volume(folder / "ball.nrrd")
    workspace.document.attach_volume(volume)
    workspace.document.measure = partial(scan_evidence, volume, propose_threshold(volume))
    sets = {side: read_landmarks(folder / "out" / f"ball_{side.value}.mrk.json") for side in Side}
    for side, code, view, _ in CLICKS:
        how = How.MESH if view == "3d" else How.SLICE
        workspace.labels.place(sets[Side(side)][code], how, side=side, code=code)
    export_landmarks(workspace.document.measured_state, folder / "python")
    workspace.close(discard=True)
    assert texts(folder / "python") == texts(folder / "out")


def test_events_in_the_window_leave_the_same_files(qtbot, make_window, folder) -> None:
    window = make_window(atlas=True)
    window.resize(*SIZE)
    window.workspace.scan.open(folder / "ball.nrrd")
    wait_until_idle(qtbot, window)
    window.grid.scene_view.view_from("A")
    window.grid.reset()
    views = {"3d": window.grid.scene_view, **{p.value: window.grid.slice_views[p] for p in Plane}}
    table = window.steps["label"].table
    for side, code, view, pixel in CLICKS:
        row = table.view.visualRect(table.model.index(index_of(code), 1 + list(Side).index(Side(side))))
        QTest.mouseClick(table.view.viewport(), Qt.MouseButton.LeftButton, pos=row.center())
        QTest.mouseClick(views[view], Qt.MouseButton.LeftButton, pos=QPoint(*pixel))
        wait_until_idle(qtbot, window)
    window.prompts.files = [folder / "window"]
    window.commands.run("file.export")
    assert texts(folder / "window") == texts(folder / "out")


def test_the_files_hold_what_was_clicked(folder) -> None:
    left = read_landmarks(folder / "out" / FILES[0])
    assert set(left.placed) == {"CA", "CB", "IN"}
    assert np.ptp([left[code] for code in left.placed], axis=0).min() > 1.0
