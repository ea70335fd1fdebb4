"""The list of specimens as a dialog: what it shows, and what its buttons do."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from panel_cases import cut_words, deliver
from qtpy.QtCore import QPoint, Qt
from repeated_cases import write_repeated

from gp_labeler.document.specimen_file import read_specimen, write_specimen
from gp_labeler.imaging.thumbnail import thumbnail
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workspace import Workspace
from gp_labeler.scripting.prompts import ScriptPrompts
from gp_labeler.views.panels.scan.specimen_list_dialog import SpecimenListDialog

CODES = ("CA", "CB", "RWA", "RWP", "OS", "LLI")


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "lab"
    folder.mkdir()
    files = write_repeated(folder, 3)
    (part,) = write_repeated(folder, 1, codes=CODES)  # GP0 again, unfinished
    assert part == files[0]
    (folder / "damaged.gpspecimen.json").write_text("{")
    return folder


@pytest.fixture
def workspace():
    workspace = Workspace(None, QueueDispatcher(), author="AB")
    yield workspace
    workspace.close(discard=True)


@pytest.fixture
def prompts():
    return ScriptPrompts()


@pytest.fixture
def dialog(workspace, prompts, folder, qtbot):
    dialog = SpecimenListDialog(workspace, prompts)
    qtbot.addWidget(dialog)
    dialog.resize(820, 500)
    dialog.show()
    prompts.prepare(files=[folder])
    qtbot.mouseClick(dialog.add_folder, Qt.MouseButton.LeftButton)
    deliver(workspace)
    return dialog


def cells(dialog, column):
    model = dialog.model
    return [model.data(model.index(row, column)) for row in range(model.rowCount())]


def test_it_shows_progress_rounds_and_what_is_wrong(dialog, workspace):
    assert cells(dialog, 1) == ["damaged", "GP0", "GP1", "GP2"]
    assert cells(dialog, 2) == ["\N{EN DASH}", "7/20", "20/20", "20/20"]
    assert cells(dialog, 5)[1:] == ["AB 2, CD"] * 3
    assert cells(dialog, 7)[0] == "cannot be read: is not JSON: damaged or cut off"
    assert cells(dialog, 7)[1] == "no scan"
    assert dialog.words.text() == "4 specimens, 2 finished"
    assert list(cut_words(dialog)) == []


def test_words_and_the_box_filter_it(dialog, qtbot):
    qtbot.keyClicks(dialog.search, "gp2")
    assert cells(dialog, 1) == ["GP2"]
    assert dialog.words.text() == "1 of 4 specimens, 2 finished"
    dialog.search.clear()
    dialog.kind.setCurrentText("Unfinished")
    assert cells(dialog, 1) == ["damaged", "GP0"]
    assert dialog.export.isEnabled()
    dialog.kind.setCurrentText("With notes")
    assert cells(dialog, 1) == []
    assert not dialog.export.isEnabled()


def test_a_click_on_a_header_sorts_it(dialog, qtbot):
    header = dialog.table.horizontalHeader()

    def click(column):
        at = QPoint(header.sectionViewportPosition(column) + 8, header.height() // 2)
        qtbot.mouseClick(header.viewport(), Qt.MouseButton.LeftButton, pos=at)

    click(2)
    assert cells(dialog, 1) == ["damaged", "GP0", "GP1", "GP2"]
    click(2)
    assert cells(dialog, 2) == ["20/20", "20/20", "7/20", "\N{EN DASH}"]
    qtbot.keyClicks(dialog.search, "cd")  # the filter keeps the order
    assert cells(dialog, 1) == ["GP1", "GP2", "GP0"]
    click(1)
    assert cells(dialog, 1) == ["GP0", "GP1", "GP2"]
    for column in (4, 5, 6, 7):
        click(column)
        assert len(cells(dialog, 1)) == 3
    assert list(cut_words(dialog)) == []


def test_rows_and_the_next_unfinished_open(dialog, folder, qtbot):
    asked = []
    dialog.open_asked.connect(asked.append)
    dialog.table.activated.emit(dialog.model.index(2, 1))
    dialog.table.activated.emit(dialog.model.index(0, 1))  # which cannot be read
    qtbot.mouseClick(dialog.next, Qt.MouseButton.LeftButton)
    assert [path.name for path in asked] == ["GP1.gpspecimen.json", "GP0.gpspecimen.json"]


def test_a_scan_that_is_not_begun_opens_too(dialog, workspace, folder, qtbot):
    (folder / "GP3.nrrd").touch()
    workspace.specimens.refresh()
    deliver(workspace)
    dialog.kind.setCurrentText("Not begun")
    assert cells(dialog, 1) == ["GP3"]
    assert cells(dialog, 7) == ["not begun"]
    assert not dialog.export.isEnabled()
    asked = []
    dialog.open_asked.connect(asked.append)
    dialog.table.activated.emit(dialog.model.index(0, 1))
    assert asked == [folder / "GP3.nrrd"]
    assert list(cut_words(dialog)) == []


def test_chosen_rows_are_exported(dialog, prompts, workspace, folder, tmp_path, qtbot):
    dialog.table.selectRow(2)
    assert dialog.chosen is None  # one row is where the pointer is: all that are shown are meant
    dialog.table.selectionModel().select(
        dialog.model.index(3, 0),
        dialog.table.selectionModel().SelectionFlag.Select | dialog.table.selectionModel().SelectionFlag.Rows,
    )
    prompts.prepare(files=[tmp_path / "out"])
    qtbot.mouseClick(dialog.export, Qt.MouseButton.LeftButton)
    deliver(workspace)
    assert {path.name.split("_")[0] for path in (tmp_path / "out").iterdir()} == {"GP1", "GP2"}


def test_a_thumbnail_is_painted_in_its_row(dialog, workspace, folder):
    block = SimpleNamespace(points=np.random.default_rng(0).uniform(0, 30, (20000, 3)))
    file = folder / "GP1.gpspecimen.json"
    write_specimen(file, read_specimen(file), thumbnail=thumbnail([block]))
    workspace.specimens.refresh()
    deliver(workspace)
    picture = dialog.model.data(dialog.model.index(2, 0), Qt.ItemDataRole.DecorationRole)
    assert picture.width() == 128
    assert dialog.model.data(dialog.model.index(1, 0), Qt.ItemDataRole.DecorationRole) is None


def test_labels_are_checked_against_each_other(dialog, workspace, prompts, tmp_path, qtbot):
    failed = []
    workspace.jobs.failed.connect(lambda task: failed.append((task.key, task.message)))
    prompts.prepare(saves=[tmp_path / "review.pdf"])
    qtbot.mouseClick(dialog.check, Qt.MouseButton.LeftButton)
    deliver(workspace)
    ((key, message),) = failed  # these specimens have no scan
    assert key == "check library"
    assert "there is no labelled scan" in message
