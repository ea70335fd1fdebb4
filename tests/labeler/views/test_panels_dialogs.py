"""The dialogs: opening a scan, export, import of landmarks, and recovery."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import tifffile
from panel_cases import cut_words, deliver, in_scan, place
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QApplication, QWidget

from gp_core.landmarks.features import Side
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.imaging.readers import inspect_volume
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.label.export_dialog import ExportDialog
from gp_labeler.views.panels.label.landmark_import_dialog import LandmarkImportDialog
from gp_labeler.views.panels.parts import Notice
from gp_labeler.views.panels.scan.import_dialog import ImportDialog
from gp_labeler.views.panels.scan.recover_dialog import RecoverDialog
from gp_labeler.views.theme import DARK, LIGHT, apply_theme

pytestmark = pytest.mark.any_binding

CLICK = Qt.MouseButton.LeftButton


@pytest.fixture
def stack(tmp_path) -> Path:
    """Forty slices whose files say nothing of voxel size or sides; brighter at one side and at one end."""
    folder = tmp_path / "GP-014_rec"
    folder.mkdir()
    for k in range(40):
        plane = np.full((30, 50), 20, np.uint8)
        plane[10:20, 5:15] = 120 + 3 * k
        tifffile.imwrite(folder / f"GP-014_{k:04d}.tif", plane)
    return folder


def opened(workspace: Workspace, path: Path, parent: QWidget) -> ImportDialog:
    dialog = ImportDialog(workspace, inspect_volume(path), parent=parent)
    dialog.show()
    deliver(workspace)
    return dialog


def findings(dialog: QWidget) -> list[tuple[str, str]]:
    QApplication.processEvents()  # what was put into a layout that is seen shows a turn later
    return [(n.level, n.words) for n in dialog.findChildren(Notice) if n.isVisible()]


# Opening a scan


def test_a_stack_is_refused_until_somebody_knows_its_voxel_size(workspace, stack, parent, qtbot):
    dialog = opened(workspace, stack, parent)
    assert not dialog.load.isEnabled()
    assert [field.text() for field in dialog.spacing.fields] == ["", "", ""]
    dialog.accept()
    assert workspace.jobs.running == ()
    assert dialog.isVisible()
    qtbot.keyClicks(dialog.spacing.fields[0], "0.5")
    assert dialog.load.isEnabled()
    assert dialog.plan.spacing == (0.5, 0.5, 0.5)
    assert dialog.facts.values["Size"].text() == "25.0 × 15.0 × 20.0 mm"  # noqa: RUF001
    qtbot.mouseClick(dialog.load, CLICK)
    deliver(workspace)
    assert workspace.scan.volume.size == (50, 30, 40)
    assert workspace.scan.volume.spacing == pytest.approx((0.5, 0.5, 0.5))
    assert workspace.document.state.import_choices["spacing"] == pytest.approx([0.5] * 3)


def test_micrometres_and_a_voxel_size_of_its_own_for_each_axis(workspace, stack, parent, qtbot):
    dialog = opened(workspace, stack, parent)
    dialog.spacing.unit.setCurrentText("µm")
    dialog.spacing.same.click()
    for field, text in zip(dialog.spacing.fields, ("300", "300", "400,5"), strict=True):
        qtbot.keyClicks(field, text)
    assert dialog.plan.spacing == pytest.approx((0.3, 0.3, 0.4005))
    dialog.reject()


def test_nonsense_and_impossible_sizes_are_said(workspace, stack, parent, qtbot):
    dialog = opened(workspace, stack, parent)
    field = dialog.spacing.fields[0]
    qtbot.keyClicks(field, "0.5x")
    assert not dialog.load.isEnabled()
    assert "0.5x" in dialog.why.text()
    field.clear()
    qtbot.keyClicks(field, "500")
    assert not dialog.load.isEnabled()
    assert any(level == "error" and "25 m" in words for level, words in findings(dialog))
    accept = dialog.accepts["extent"]
    accept.click()
    assert dialog.load.isEnabled()
    assert dialog.plan.options.accept == {"extent"}
    dialog.reject()


def test_the_sides_are_shown_and_can_be_reversed(workspace, stack, parent, qtbot):
    dialog = opened(workspace, stack, parent)
    qtbot.keyClicks(dialog.spacing.fields[0], "0.5")
    axial, coronal = (picture.plane for picture in dialog.pictures)
    assert (axial.letters, coronal.letters) == ("RLPA", "RLIS")
    assert coronal.grey[:5].max() > coronal.grey[-5:].max()
    dialog.reverse.click()
    deliver(workspace)
    coronal = dialog.pictures[1].plane
    assert coronal.grey[:5].max() < coronal.grey[-5:].max()
    qtbot.mouseClick(dialog.load, CLICK)
    deliver(workspace)
    assert workspace.document.state.import_choices["reverse"] is True
    assert workspace.scan.volume.array[0].max() > workspace.scan.volume.array[-1].max()


def test_every_second_voxel_takes_an_eighth(workspace, stack, parent, qtbot):
    dialog = opened(workspace, stack, parent)
    before = dialog.plan.n_bytes
    dialog.stride.setCurrentIndex(1)
    assert dialog.plan.n_bytes == before / 8
    dialog.reject()


def test_several_stacks_can_be_chosen_from(workspace, tmp_path, parent):
    for name, width in (("a", 40), ("b", 60)):
        for k in range(20):
            tifffile.imwrite(tmp_path / f"{name}_{k:03d}.tif", np.full((30, width), k, np.uint8))
    dialog = opened(workspace, tmp_path, parent)
    assert dialog.series.count() == 2
    other = next(n for n in range(2) if "60" in dialog.series.itemText(n) or "b" in dialog.series.itemText(n))
    dialog.series.setCurrentIndex(other)
    dialog.series.activated.emit(other)
    deliver(workspace)
    assert dialog.plan.choice == dialog.series.itemData(other)
    assert dialog.plan.size[0] == 60
    dialog.reject()


@pytest.mark.parametrize("theme", [DARK, LIGHT], ids=lambda t: t.name)
def test_no_word_of_the_import_dialog_is_cut_off(workspace, stack, parent, qtbot, theme):
    apply_theme(parent, theme)
    dialog = opened(workspace, stack, parent)
    qtbot.keyClicks(dialog.spacing.fields[0], "500")
    assert list(cut_words(dialog)) == []
    dialog.reject()


def test_names_of_any_length_fit(workspace, tmp_path, parent, qtbot):
    folder = tmp_path / ("a_very_long_name_without_a_single_space_" * 4)
    folder.mkdir()
    for k in range(3):
        tifffile.imwrite(folder / f"s{k}.tif", np.full((30, 30), k, np.uint8))
    dialog = opened(workspace, folder, parent)
    content = dialog.facts.parentWidget()
    qtbot.waitUntil(lambda: content.width() <= dialog.width())
    assert content.minimumSizeHint().width() < 560
    dialog.reject()


# Export


def test_an_export_says_what_is_missing_and_writes_the_chosen_formats(workspace, tmp_path, parent, qtbot):
    place(workspace, "CA", "CB", "RWA")
    workspace.labels.mark_unseen(side=Side.LEFT, code="RWM")
    dialog = ExportDialog(workspace, tmp_path, parent=parent)
    dialog.show()
    said = dict(reversed(pair) for pair in findings(dialog))
    left = next(words for words in said if "left side has" in words)
    assert "RWM" in left.split("not seen:")[1]
    assert "OS" in left.split("to do:")[1]
    assert any("right side is not labelled" in words for words in said)
    dialog.formats[".csv"].click()
    qtbot.mouseClick(dialog.export, CLICK)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["unnamed_L.csv", "unnamed_L.mrk.json"]
    assert json.loads((tmp_path / "unnamed_L.mrk.json").read_text())["markups"]


def test_files_of_that_name_are_replaced_only_when_asked(workspace, tmp_path, parent, qtbot):
    place(workspace, "CA", "CB", "RWA")
    export_landmarks(workspace.document.state, tmp_path)
    before = (tmp_path / "unnamed_L.mrk.json").read_bytes()
    place(workspace, "RWP")
    dialog = ExportDialog(workspace, tmp_path, parent=parent)
    dialog.show()
    assert not dialog.export.isEnabled()
    dialog.replace.click()
    qtbot.mouseClick(dialog.export, CLICK)
    assert (tmp_path / "unnamed_L.mrk.json").read_bytes() != before


def test_nothing_placed_is_nothing_to_export(workspace, tmp_path, parent, qtbot):
    dialog = ExportDialog(workspace, tmp_path, parent=parent)
    dialog.show()
    assert not dialog.export.isEnabled()
    assert list(cut_words(dialog)) == []
    dialog.reject()


# Import of landmarks


@pytest.fixture
def landmark_file(workspace, tmp_path) -> Path:
    place(workspace, "CA", "CB", "RWA", "RWP")
    export_landmarks(workspace.document.state, tmp_path)
    for code in ("CA", "CB", "RWA", "RWP"):
        workspace.labels.clear(side=Side.LEFT, code=code)
    return tmp_path / "unnamed_L.mrk.json"


def test_an_import_shows_what_the_file_holds_and_takes_it(workspace, landmark_file, parent, qtbot):
    dialog = LandmarkImportDialog(workspace, [landmark_file], parent=parent)
    dialog.show()
    assert findings(dialog) == [("info", "unnamed_L.mrk.json: 5 points of the left side")]
    qtbot.mouseClick(dialog.take, CLICK)
    assert set(workspace.document.landmarks(Side.LEFT).placed) == {"CA", "CB", "CO", "RWA", "RWP"}
    np.testing.assert_allclose(workspace.document.landmarks(Side.LEFT)["CA"], in_scan("CA"))


def test_points_off_the_bone_need_a_second_word(workspace, landmark_file, parent, qtbot):
    off_bone = lambda points: np.zeros(len(points), dtype=bool)  # noqa: E731
    dialog = LandmarkImportDialog(workspace, [landmark_file], off_bone, parent=parent)
    dialog.show()
    qtbot.mouseClick(dialog.take, CLICK)
    assert workspace.document.landmarks(Side.LEFT).placed == ()
    assert "off the bone" in findings(dialog)[0][1]
    assert not dialog.take.isEnabled()
    dialog.anyway.click()
    qtbot.mouseClick(dialog.take, CLICK)
    assert len(workspace.document.landmarks(Side.LEFT).placed) == 5
    assert [level for level, _ in findings(dialog)] == ["good", "warning"]
    dialog.reject()


def test_a_file_that_is_none_is_named(workspace, tmp_path, parent):
    bad = tmp_path / "x.mrk.json"
    bad.write_text("{")
    dialog = LandmarkImportDialog(workspace, [bad], parent=parent)
    dialog.show()
    assert not dialog.take.isEnabled()
    level, words = findings(dialog)[0]
    assert level == "error"
    assert "x.mrk.json" in words
    dialog.reject()


# Recovery


@pytest.fixture
def state_directory(tmp_path) -> Path:
    """What two programs left that were killed in the middle of their work."""
    directory = tmp_path / "state"
    code = (
        "import os; from pathlib import Path; from gp_labeler.models.workspace import Workspace\n"
        f"for n in ('GP-014', 'GP-015'):\n    w = Workspace(Path({str(directory)!r})); w.document.begin(n)\n"
        "    w.labels.place([1, 2, 3], side='L', code='CA')\n"
        "os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code], check=False, cwd=Path(__file__).parents[3])
    return directory


def test_what_can_be_recovered_is_read_without_scrolling_sideways(state_directory, parent, qtbot):
    dialog = RecoverDialog(find_recoveries(state_directory), parent=parent)
    words = "phantom-0: 12 unsaved edits, the last at 2026-11-22 13:41: mark CA left as checked"
    dialog.list.item(0).setText(f"{words}\nNever saved")
    dialog.show()
    qtbot.waitExposed(dialog)
    assert dialog.list.horizontalScrollBar().maximum() == 0
    assert not dialog.list.horizontalScrollBar().isVisible()


def test_recovery_offers_each_and_deletes_only_at_the_second_click(state_directory, parent, qtbot):
    recoveries = find_recoveries(state_directory)
    dialog = RecoverDialog(recoveries, parent=parent)
    dialog.show()
    assert dialog.list.count() == 2
    dialog.list.setCurrentRow(1)
    qtbot.mouseClick(dialog.delete, CLICK)
    assert recoveries[1].journal.exists()
    qtbot.mouseClick(dialog.delete, CLICK)
    assert not recoveries[1].journal.exists()
    assert dialog.list.count() == 1
    with qtbot.waitSignal(dialog.recover_asked) as told:
        qtbot.mouseClick(dialog.recover, CLICK)
    workspace = Workspace(state_directory, QueueDispatcher())
    workspace.document.recover(told.args[0])
    assert "CA" in workspace.document.landmarks(Side.LEFT)
    workspace.close(discard=True)
