"""The scan panel and the first page, by real clicks, drags and keys."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from panel_cases import actions_of, cut_words, deliver, grey_volume, place, workspace_with_scan
from qtpy.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from qtpy.QtGui import QDropEvent
from qtpy.QtWidgets import QApplication, QPushButton

from gp_core.landmarks.features import Side
from gp_labeler.document.specimen_edits import SetThreshold
from gp_labeler.imaging.volume import Volume
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.formatting import mm_text, position_text, spacing_text, value_text
from gp_labeler.views.panels.number_field import NumberField
from gp_labeler.views.panels.rail import Rail
from gp_labeler.views.panels.scan.notes_card import NotesCard
from gp_labeler.views.panels.scan.panel import ScanPanel, facts_of
from gp_labeler.views.panels.scan.welcome import Welcome
from gp_labeler.views.theme import DARK, LIGHT, apply_theme

pytestmark = pytest.mark.any_binding

CLICK = Qt.MouseButton.LeftButton


@pytest.fixture
def workspace() -> Iterator[Workspace]:
    workspace = workspace_with_scan()
    workspace.document.do(SetThreshold(110.0))
    deliver(workspace)
    yield workspace
    workspace.close(discard=True)


@pytest.fixture
def asked() -> list[str]:
    return []


@pytest.fixture
def panel(workspace: Workspace, qtbot, asked) -> ScanPanel:
    panel = ScanPanel(workspace, actions_of(workspace, qtbot, asked))
    apply_theme(panel, DARK)
    qtbot.addWidget(panel)
    panel.resize(panel.width(), 760)
    panel.show()
    qtbot.waitExposed(panel)
    return panel


def undo_texts(workspace: Workspace) -> list[str]:
    found = []
    while workspace.document.undo_text is not None:
        found.append(workspace.document.undo_text)
        workspace.document.undo()
    return found


# Threshold


def test_a_drag_of_the_threshold_previews_all_the_way_and_is_one_undo(workspace, panel, qtbot):
    previewed = []
    workspace.scan.threshold_previewed.connect(previewed.append)
    slider, y = panel.bone.slider, 40
    start = round(slider.x_of(110.0))
    qtbot.mousePress(slider, CLICK, pos=QPoint(start, y))
    for x in range(start, start + 60, 10):
        qtbot.mouseMove(slider, QPoint(x, y))
    assert workspace.document.state.threshold == 110.0
    assert len([value for value in previewed if value is not None]) >= 6
    qtbot.mouseRelease(slider, CLICK, pos=QPoint(start + 50, y))
    chosen = workspace.document.state.threshold
    assert chosen > 120
    assert previewed[-1] is None
    assert len(undo_texts(workspace)) == 2


def test_the_threshold_moves_by_keys_and_a_held_key_is_one_undo(workspace, panel, qtbot):
    slider = panel.bone.slider
    slider.setFocus()
    for _ in range(5):
        qtbot.keyPress(slider, Qt.Key.Key_Right)
    assert workspace.document.state.threshold == 110.0
    qtbot.keyRelease(slider, Qt.Key.Key_Right)
    assert workspace.document.state.threshold > 110.0
    assert len(undo_texts(workspace)) == 2


def test_a_typed_threshold_is_taken_and_nonsense_is_not(workspace, panel, qtbot):
    box = panel.bone.box
    box.selectAll()
    qtbot.keyClicks(box, "95.5")
    qtbot.keyClick(box, Qt.Key.Key_Return)
    assert workspace.document.state.threshold == 95.5
    box.selectAll()
    qtbot.keyClicks(box, "-")
    panel.mesh.opacity.setFocus()
    assert workspace.document.state.threshold == 95.5


def test_grey_values_are_counted_when_somebody_looks(workspace, panel):
    before = panel.bone.slider.x_of(110.0)
    panel.hide()
    volume = grey_volume()
    brighter = Volume.from_parts(volume.array.astype(np.int16) * 10, (1.5,) * 3, (0, 0, 0), name="GP-015")
    workspace.scan.begin(brighter)
    assert panel.bone.slider.x_of(1100.0) == panel.bone.slider.x_of(0.0)
    panel.show()
    assert panel.bone.slider.x_of(1100.0) == pytest.approx(before, abs=2)
    workspace.scan.begin(volume)
    assert panel.bone.slider.x_of(110.0) == pytest.approx(before, abs=2)


def test_undo_brings_the_slider_back(workspace, panel):
    workspace.scan.set_threshold(140.0)
    assert panel.bone.slider.value == 140.0
    workspace.document.undo()
    assert panel.bone.slider.value == 110.0
    assert panel.bone.box.value == 110.0


def test_the_proposed_threshold_parts_the_two_grey_values(workspace, panel, qtbot):
    qtbot.mouseClick(panel.bone.propose, CLICK)
    deliver(workspace)
    assert 60 < workspace.document.state.threshold < 170


# Window, level and mesh


def test_grey_presets_set_the_window_and_auto_takes_it_back(workspace, panel, qtbot):
    view = workspace.view
    qtbot.mouseClick(panel.grey.presets["Bone"], CLICK)
    assert view.state.level > 110.0
    assert panel.grey.presets["Bone"].isChecked()
    qtbot.mouseClick(panel.grey.presets["Auto"], CLICK)
    assert (view.state.level, view.state.width) == (None, None)
    panel.grey.width_box.selectAll()
    qtbot.keyClicks(panel.grey.width_box, "50")
    qtbot.keyClick(panel.grey.width_box, Qt.Key.Key_Return)
    assert view.state.width == 50


def test_opacity_and_what_is_shown(workspace, panel, qtbot):
    panel.mesh.opacity.setFocus()
    qtbot.keyClick(panel.mesh.opacity, Qt.Key.Key_PageDown)
    assert workspace.view.state.mesh_opacity == pytest.approx(0.9)
    panel.mesh.checks["outline_visible"].setFocus()
    qtbot.keyClick(panel.mesh.checks["outline_visible"], Qt.Key.Key_Space)
    assert workspace.view.state.outline_visible is False
    workspace.view.update(mesh_opacity=0.4)
    assert panel.mesh.opacity.value() == 40


def test_the_mesh_card_counts_triangles_and_offers_to_save(workspace, panel, asked, qtbot):
    assert "triangles" in panel.mesh.state.text()
    qtbot.mouseClick(panel.mesh.save, CLICK)
    assert asked == ["file.save_mesh"]


# Facts and notes


def test_facts_tell_size_type_and_axes():
    volume = Volume.from_parts(
        np.zeros((30, 20, 10), np.int16), (0.1, 0.1, 0.2), direction=np.diag([-1.0, 1.0, 1.0]), name="head"
    )
    facts = facts_of(volume)
    assert facts["Voxels"] == "10 × 20 × 30 of 0.1 × 0.1 × 0.2 mm"  # noqa: RUF001
    assert facts["Size"] == "1.0 × 2.0 × 6.0 mm"  # noqa: RUF001
    assert facts["Axes"] == "x to R, y to P, z to S"
    assert facts["Values"].startswith("int16")


def test_an_empty_panel_says_what_to_do(qtbot):
    workspace = Workspace(None)
    panel = ScanPanel(workspace, actions_of(workspace, qtbot))
    qtbot.addWidget(panel)
    panel.show()
    assert panel.bone.slider.value is None
    assert not panel.bone.propose.isEnabled()
    assert not panel.mesh.save.isEnabled()
    volume = grey_volume()
    workspace.document.attach_volume(volume)
    workspace.scan.opened.emit(volume)
    assert panel.facts.values["Name"].text() == "GP-014"
    workspace.close(discard=True)


def test_notes_are_one_undo_for_all_that_was_typed(workspace, qtbot):
    notes = NotesCard(workspace)
    qtbot.addWidget(notes)
    notes.show()
    notes.text.setFocus()
    qtbot.keyClicks(notes.text, "left bulla")
    notes.keep()
    assert workspace.document.state.notes == "left bulla"
    qtbot.keyClicks(notes.text, " damaged")
    notes.keep()
    assert workspace.document.state.notes == "left bulla damaged"
    workspace.document.undo()
    assert workspace.document.state.notes == ""
    assert notes.text.toPlainText() == ""


@pytest.mark.parametrize("theme", [DARK, LIGHT], ids=lambda t: t.name)
def test_no_word_of_the_scan_panel_is_cut_off(workspace, panel, theme):
    apply_theme(panel, theme)
    assert list(cut_words(panel)) == []


# First page


def drop(page: Welcome, path: Path) -> None:
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path))])
    event = QDropEvent(QPointF(50, 50), Qt.DropAction.CopyAction, data, CLICK, Qt.KeyboardModifier.NoModifier)
    page.dropEvent(event)


def test_the_first_page_offers_scan_specimen_demo_and_recent_files(tmp_path, qtbot):
    workspace = Workspace(tmp_path / "state")
    (tmp_path / "GP-014.nrrd").write_text("")
    workspace.recent.add(tmp_path / "GP-014.nrrd")
    workspace.recent.add(tmp_path / "gone.nrrd")
    asked = []
    page = Welcome(workspace, actions_of(workspace, qtbot, asked))
    apply_theme(page, DARK)
    qtbot.addWidget(page)
    page.resize(900, 640)
    page.show()
    for button in (page.open_scan, page.open_specimen, page.demo):
        qtbot.mouseClick(button, CLICK)
    assert asked == ["file.open", "file.open", "file.demo"]
    QApplication.processEvents()
    recent = [b for b in page.findChildren(QPushButton, "recent") if b.isVisible()]
    assert [b.accessibleName() for b in recent] == ["Open GP-014.nrrd"]
    with qtbot.waitSignal(page.path_chosen) as told:
        qtbot.mouseClick(recent[0], CLICK)
    assert told.args == [str((tmp_path / "GP-014.nrrd").resolve())]
    with qtbot.waitSignal(page.path_chosen) as told:
        drop(page, tmp_path)
    assert told.args == [str(tmp_path)]
    assert list(cut_words(page)) == []
    workspace.close(discard=True)


# Parts


def test_numbers_are_written_for_people():
    assert [mm_text(x) for x in (12.34, 0.456, 0.0123)] == ["12.3 mm", "0.46 mm", "0.012 mm"]
    assert position_text([4.6, -9.1, 0.0]) == "L 4.6  A 9.1  S 0.0 mm"
    assert spacing_text((0.035, 0.035, 0.035)) == "0.035 mm"
    assert [value_text(x) for x in (None, 1234.5, -3)][1:] == ["1234.5", "\N{MINUS SIGN}3"]


def test_a_number_field_steps_and_tells_once(qtbot):
    field = NumberField("x")
    qtbot.addWidget(field)
    field.show()
    field.set_value(5.0)
    told = []
    field.value_chosen.connect(told.append)
    qtbot.keyClick(field, Qt.Key.Key_Up)
    qtbot.keyClick(field, Qt.Key.Key_PageDown)
    assert told == [6.0, -4.0]
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert told == [6.0, -4.0]


def test_the_rail_marks_what_is_done(workspace, qtbot):
    rail = Rail(workspace, actions_of(workspace, qtbot))
    qtbot.addWidget(rail)
    assert rail.buttons["scan"].accessibleDescription().endswith("done")
    place(workspace, "CA", side=Side.RIGHT)
    assert not rail.buttons["label"].accessibleDescription().endswith("done")
