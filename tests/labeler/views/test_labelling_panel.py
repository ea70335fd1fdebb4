"""Who labels, how surely, and labelling again, through the widgets of the step Label."""

from __future__ import annotations

import numpy as np
import pytest
from panel_cases import ATLAS, actions_of, cut_words, deliver, place, workspace_with_scan
from qtpy.QtCore import Qt
from window_cases import one_turn

from gp_core.landmarks.features import Side
from gp_core.landmarks.provenance import Certainty
from gp_labeler.commands.actions import run
from gp_labeler.views.fonts import TEXT_SIZES
from gp_labeler.views.panels.label.labellings_dialog import LabellingsDialog
from gp_labeler.views.panels.label.panel import LabelPanel
from gp_labeler.views.theme import DARK, apply_theme

L, R = Side.LEFT, Side.RIGHT


@pytest.fixture
def workspace():
    workspace = workspace_with_scan()
    yield workspace
    workspace.close()


def shown(panel, qtbot):
    qtbot.addWidget(panel)
    panel.resize(480, 700)
    panel.show()
    return panel


def test_the_observer_is_asked_for_until_somebody_answers(workspace, qtbot):
    workspace.document.author = ""
    panel = shown(LabelPanel(workspace, actions_of(workspace, qtbot)), qtbot)
    place(workspace, "CA")
    row = panel.observer
    assert row.name.isVisible()
    qtbot.keyClicks(row.name, "AB")
    qtbot.mouseClick(row.keep, Qt.MouseButton.LeftButton)
    assert not row.name.isVisible()
    assert workspace.document.author == "AB"
    assert workspace.document.state.labeller == "AB"  # of what was placed before, too
    assert row.words.words == "Labelled by AB, round 1"
    workspace.document.author = "CD"
    assert row.words.words == "Labels of AB, round 1; you are CD"
    assert list(cut_words(panel.observer)) == []


def test_certainty_and_note_are_edits_of_the_active_point(workspace, qtbot):
    panel = shown(LabelPanel(workspace, actions_of(workspace, qtbot)), qtbot)
    row = panel.card.annotation
    assert not row.isVisible()
    place(workspace, "CA", "CB")
    workspace.labels.go_to(L, "CA")
    one_turn()  # the card is refreshed once a turn
    assert row.isVisible()
    qtbot.mouseClick(row.buttons[Certainty.FAIR], Qt.MouseButton.LeftButton)
    qtbot.keyClicks(row.note, "fluid")
    qtbot.keyClick(row.note, Qt.Key.Key_Return)
    mark = workspace.document.state.landmark(L, "CA")
    assert (mark.certainty, mark.note) == (Certainty.FAIR, "fluid")
    assert workspace.document.undo_text == "note on CA left"
    workspace.labels.go_to(L, "CB")
    one_turn()  # the card is refreshed once a turn
    assert row.note.text() == ""
    assert not row.buttons[Certainty.FAIR].isChecked()
    workspace.labels.go_to(L, "CA")
    one_turn()  # the card is refreshed once a turn
    qtbot.mouseClick(row.buttons[Certainty.FAIR], Qt.MouseButton.LeftButton)
    assert workspace.document.state.landmark(L, "CA").certainty is None


def test_a_key_marks_the_point_that_was_placed_last(workspace):
    place(workspace, "CA")
    said = []
    workspace.messages.said.connect(lambda text, level: said.append(text))
    assert run("point.guess", workspace)
    assert workspace.document.state.landmark(L, "CA").certainty is Certainty.GUESS
    assert said == ["CA left: guess"]


@pytest.mark.parametrize("percent", TEXT_SIZES)
def test_no_heading_of_the_dialog_is_cut_however_narrow_it_is(workspace, qtbot, percent):
    place(workspace, "CA", "CB")
    dialog = LabellingsDialog(workspace)
    qtbot.addWidget(dialog)
    apply_theme(dialog, DARK, text_scale=percent / 100)
    dialog.show()
    dialog.resize(dialog.minimumSizeHint())
    one_turn()
    header = dialog.table.horizontalHeader()
    assert all(header.sectionSize(n) >= header.sectionSizeHint(n) for n in range(header.count()))


def test_the_dialog_begins_and_opens_labellings(workspace, qtbot):
    place(workspace, "CA", "CB", "RWA", "RWP")
    first = workspace.document.state.landmarks
    dialog = LabellingsDialog(workspace)
    qtbot.addWidget(dialog)
    dialog.show()
    assert dialog.again.text() == "Begin tester, round 2, blind"
    dialog.observer.setText("CD")
    assert dialog.again.text() == "Begin CD, round 1, blind"
    assert list(cut_words(dialog)) == []
    qtbot.mouseClick(dialog.again, Qt.MouseButton.LeftButton)
    state = workspace.document.state
    assert (state.observer, state.blind, dict(state.landmarks)) == ("CD", True, {})
    assert workspace.document.author == "CD"
    middle = workspace.scan.volume.extent.mean(axis=0)
    assert np.allclose(workspace.view.crosshair, middle)
    assert not workspace.labels.ghosts(L)
    place(workspace, "CA")
    dialog = LabellingsDialog(workspace)
    qtbot.addWidget(dialog)
    dialog.show()
    dialog.table.selectRow(1)
    qtbot.mouseClick(dialog.open_chosen, Qt.MouseButton.LeftButton)
    assert workspace.document.state.landmarks == first
    dialog.reject()


def test_blind_ghosts_follow_no_atlas_that_knows_the_specimen(workspace):
    from dataclasses import replace

    own = replace(ATLAS, specimens=(workspace.document.state.specimen, "GP-2"), name="own")
    workspace.atlas.use(own)
    deliver(workspace)
    place(workspace, "CA", "CB", "RWA", "RWP")
    assert workspace.atlas.predict.args == (own,)
    workspace.label_again("CD")
    assert workspace.atlas.predict.args == (ATLAS,)
    place(workspace, "CA")
    workspace.open_labelling("tester", 1)
    assert workspace.atlas.predict.args == (own,)
