"""The physical test from the window: a drawn skull touched and labelled, and one that cannot be tested."""

from __future__ import annotations

import json

import numpy as np
import pytest
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QWidget

from gp_core import PROBE, Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.frames import RigidTransform
from gp_labeler.document import touching
from gp_labeler.document.edits import PlacePoint
from gp_labeler.document.state import How, Provenance
from gp_labeler.jobs.physical import PhysicalTest
from gp_labeler.jobs.runner import Progress
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.dispatch import QtDispatcher
from gp_labeler.views.panels.pose.physical_dialog import PhysicalDialog

SKULL = {f"S{n}": position for n, position in enumerate(np.random.default_rng(8).uniform(-15, 15, (8, 3)), 1)}


class Saving:
    """Answers where to save."""

    def __init__(self, folder):
        self._folder = folder

    def save_file(self, title, suggestion, kinds):
        return self._folder / suggestion


@pytest.fixture
def workspace(qtbot):
    workspace = Workspace(dispatcher=QtDispatcher(), atlas=Atlas.published(), author="AB")
    yield workspace
    workspace.close(discard=True)


@pytest.fixture
def top(qtbot):
    widget = QWidget()
    qtbot.addWidget(widget)
    return widget


def touch_and_label(document):
    rng = np.random.default_rng(4)
    animal = draw_animal(Atlas.published(), rng=rng).side("L")
    for code in ("CA", "CB", "RWA", "RWP"):
        document.do(PlacePoint(animal.side, code, animal[code], Provenance(How.MESH)))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    T_tracker_scan = RigidTransform.from_parts(turn, (9, 90, -200), dst="tracker", src="scan")
    for name, position in {**animal.as_mapping(PROBE), **SKULL}.items():
        moved = T_tracker_scan.apply([position])[0] + 0.05 * rng.normal(size=3)
        touching.record_touch(document, "L", name, moved)
    for name, position in SKULL.items():
        touching.mark_skull(document, name, position)
    return animal


def test_the_job_gives_what_the_estimate_shows(workspace):
    touch_and_label(workspace.document)
    test = PhysicalTest.of(workspace.document.state, workspace.pose.side, workspace.atlas.current)
    result = PhysicalTest(test.touches, test.ct, test.atlas, n=20).run(Progress(lambda *_: None))
    row = next(r for r in result.report.rows if r.registration == "names")
    error_mm, error_deg = workspace.pose.estimate.errors()
    assert row.e_co_mm == pytest.approx(error_mm, abs=1e-9)
    assert row.e_ma_deg == pytest.approx(error_deg, abs=1e-9)
    assert result.figure.startswith(b"\x89PNG")


def test_the_dialog_shows_and_saves(qtbot, workspace, top, tmp_path):
    touch_and_label(workspace.document)
    dialog = PhysicalDialog(workspace, Saving(tmp_path), top)
    dialog.show()
    qtbot.waitUntil(lambda: dialog.result_found is not None)
    assert dialog.rows.rowCount() == 1 + len(dialog.result_found.report.rows)
    assert not dialog.figure.pixmap().isNull()
    for button in (dialog.save_figure, dialog.save_json):
        qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert (tmp_path / "physical.png").stat().st_size > 5000
    written = json.loads((tmp_path / "physical.json").read_text())
    assert written == json.loads(json.dumps(dialog.result_found.report.as_dict()))
    dialog.accept()


def test_without_skull_features_the_remedy_is_told(qtbot, workspace, top, tmp_path):
    animal = draw_animal(Atlas.published(), rng=np.random.default_rng(4)).side("L")
    for code in PROBE:
        touching.record_touch(workspace.document, "L", code, animal[code])
    dialog = PhysicalDialog(workspace, Saving(tmp_path), top)
    dialog.show()
    qtbot.waitUntil(lambda: dialog.findings.count() > 0)
    assert "CA" in dialog.findings.itemAt(0).widget().words
    assert dialog.result_found is None
    dialog.accept()
