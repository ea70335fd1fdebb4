"""Landmark files under other names, in the import dialog: chosen once, remembered, recorded for a script."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QWidget

from gp_core.landmarks.features import Side
from gp_core.landmarks.labels import LabelNames
from gp_labeler.document.lab_names import LabNamesMemory
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.label.landmark_import_dialog import LandmarkImportDialog
from gp_labeler.views.panels.parts import ElidedLabel, Notice

pytestmark = pytest.mark.any_binding

_CLICK = Qt.MouseButton.LeftButton


@pytest.fixture
def workspace(tmp_path):
    workspace = Workspace(tmp_path / "state")
    yield workspace
    workspace.close()


@pytest.fixture
def parent(qtbot):
    widget = QWidget()
    qtbot.addWidget(widget)
    return widget


@pytest.fixture
def theirs(tmp_path):
    file = tmp_path / "GP01.csv"
    rows = "Apex,left,1,2,3\nBase,left,4,5,6\nApex R,,7,8,9\nBregma,,0,1,2\n"
    file.write_text("name,side,x,y,z\n" + rows, encoding="utf-8")
    return file


def _choose(dialog: LandmarkImportDialog, name: str, code: str) -> None:
    box = dialog.names.box(name)
    box.setCurrentIndex(box.findData(code))


def test_unknown_names_are_chosen_once_and_remembered(workspace, parent, qtbot, theirs) -> None:
    dialog = LandmarkImportDialog(workspace, [theirs], parent=parent)
    dialog.show()
    assert dialog.names.isVisible()
    labels = dialog.names.findChildren(ElidedLabel)
    assert [label.text() for label in labels] == ["Apex", "Base", "Apex R", "Bregma"]
    assert all(label.width() >= label.fontMetrics().horizontalAdvance(label.text()) for label in labels)
    assert not dialog.take.isEnabled()
    _choose(dialog, "Apex", "CA")
    _choose(dialog, "Base", "CB")
    assert dialog.names.undecided == 2
    qtbot.mouseClick(dialog.names.leave_rest, _CLICK)
    assert dialog.take.isEnabled()
    qtbot.mouseClick(dialog.take, _CLICK)
    placed = workspace.document.landmarks(Side.LEFT)
    assert set(placed.placed) == {"CA", "CB"}
    np.testing.assert_allclose(placed["CA"], [1, 2, 3])

    again = LandmarkImportDialog(workspace, [theirs], parent=parent)
    again.show()
    assert not again.names.isVisible()
    assert again.take.isEnabled()
    again.reject()


def test_one_list_of_both_sides_is_taken_whole(workspace, parent, qtbot, tmp_path) -> None:
    file = tmp_path / "GP01.csv"
    file.write_text("name,x,y,z\nCA_L,1,2,3\nCA_R,9,2,3\nIN,5,0,0\n", encoding="utf-8")
    dialog = LandmarkImportDialog(workspace, [file], parent=parent)
    dialog.show()
    qtbot.mouseClick(dialog.take, _CLICK)
    for side, x in ((Side.LEFT, 1), (Side.RIGHT, 9)):
        assert set(workspace.document.landmarks(side).placed) == {"CA", "IN"}
        assert workspace.document.landmarks(side)["CA"][0] == x


def test_a_memory_that_is_damaged_counts_as_empty(tmp_path) -> None:
    memory = LabNamesMemory(tmp_path)
    memory.remember({"Apex": "CA"})
    memory.remember({"Base": "CB", "apex": "CA"})
    assert memory.recall().codes == {"apex": "CA", "base": "CB"}
    (tmp_path / "lab-names.json").write_text('{"Apex": "no feature"}', encoding="utf-8")
    assert memory.recall() == LabelNames({})
    assert LabNamesMemory(None).recall() == LabelNames({})


def test_a_name_stands_for_a_feature_of_one_side(workspace, parent, qtbot, theirs) -> None:
    dialog = LandmarkImportDialog(workspace, [theirs], parent=parent)
    dialog.show()
    assert not dialog.names.side_box("Apex R").isEnabled()
    _choose(dialog, "Apex", "CA")
    _choose(dialog, "Base", "CB")
    _choose(dialog, "Apex R", "CA")
    qtbot.mouseClick(dialog.names.leave_rest, _CLICK)
    assert not dialog.take.isEnabled()  # a point of no side, among points that tell theirs
    side = dialog.names.side_box("Apex R")
    side.setCurrentIndex(side.findData("R"))
    qtbot.mouseClick(dialog.take, _CLICK)
    np.testing.assert_allclose(workspace.document.landmarks(Side.LEFT)["CA"], [1, 2, 3])
    np.testing.assert_allclose(workspace.document.landmarks(Side.RIGHT)["CA"], [7, 8, 9])
    assert LabNamesMemory(workspace.directory).recall().translate("apex r") == "CA_R"


def test_a_table_of_names_is_loaded_and_remembered(workspace, parent, qtbot, theirs, tmp_path) -> None:
    table = tmp_path / "names.csv"
    table.write_text("their name,our code\nAPEX,CA\nbase,CB\nApex R,CA_R\nBregma,\nLambda,\nTip,OS\n")
    prompts = SimpleNamespace(open_files=lambda *_, **__: [table])
    dialog = LandmarkImportDialog(workspace, [theirs], None, prompts, parent)
    dialog.show()
    qtbot.mouseClick(dialog.names.load, _CLICK)
    assert dialog.names.codes == {"Apex": "CA", "Base": "CB", "Apex R": "CA_R", "Bregma": ""}
    qtbot.mouseClick(dialog.take, _CLICK)
    assert set(workspace.document.landmarks(Side.LEFT).placed) == {"CA", "CB"}
    assert LabNamesMemory(workspace.directory).recall().translate("tip") == "OS"  # of another file, next time


def test_a_table_that_is_none_is_named(workspace, parent, qtbot, theirs, tmp_path) -> None:
    table = tmp_path / "names.csv"
    table.write_text("Apex,no feature\n")
    prompts = SimpleNamespace(open_files=lambda *_, **__: [table])
    dialog = LandmarkImportDialog(workspace, [theirs], None, prompts, parent)
    dialog.show()
    qtbot.mouseClick(dialog.names.load, _CLICK)
    said = [notice.words for notice in dialog.findChildren(Notice)]
    assert any(text.startswith(str(table)) for text in said), said
    assert not dialog.take.isEnabled()
