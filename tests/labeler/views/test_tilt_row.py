"""The step Label offers to straighten a head before anything is labelled; of several heads, one is chosen."""

from __future__ import annotations

import numpy as np
import pytest
from document_cases import head_frame
from qtpy.QtCore import Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QLabel, QPushButton
from window_cases import wait_until_idle

from gp_labeler.document.head_edits import SetHeadFrame
from gp_labeler.head_pose import HeadPose, HeadPoseError, SeveralHeadsError
from gp_labeler.jobs.head import Straighten
from gp_labeler.views.panels.label.tilt_row import TiltRow
from gp_labeler.views.panels.scan.head_card import HeadCard

HEADS = (np.array([-3.0, 0.0, 0.0]), np.array([3.0, 0.0, 0.0]))
POSE = HeadPose(head_frame().T_head_scan, "symmetry", None, "proposed", "the file")


@pytest.fixture
def window(qtbot, one_window, ball):
    one_window.workspace.scan.begin(ball)
    wait_until_idle(qtbot, one_window)
    one_window.set_step("label")
    return one_window


def refuse(error):
    def run(job, progress):
        if isinstance(error, SeveralHeadsError) and job.near is not None:
            return POSE
        raise error

    return run


def heads_in(card):
    return [b for b in card.findChildren(QPushButton) if b.isVisible() and b.text().startswith("Head ")]


def notices_in(card):
    return [label.text() for label in card.findChildren(QLabel) if label.isVisible()]


def test_a_new_scan_is_offered_to_be_straightened_until_it_is_or_is_labelled(qtbot, window, monkeypatch):
    monkeypatch.setattr(Straighten, "run", lambda job, progress: POSE)
    row, document = window.findChild(TiltRow), window.workspace.document
    assert row.isVisible()
    assert [b.text() for b in row.findChildren(QPushButton) if b.isVisible()] == ["Straighten"]
    row.straighten.click()
    assert [b.text() for b in row.findChildren(QPushButton) if b.isVisible()] == ["Stop"]
    wait_until_idle(qtbot, window)
    assert not row.isVisible()
    document.undo()
    assert row.isVisible()
    window.workspace.labels.place(HEADS[0])
    assert not row.isVisible()
    document.undo()
    document.do(SetHeadFrame(head_frame()))
    assert not row.isVisible()


def test_a_head_that_is_refused_leads_to_the_other_ways(qtbot, window, monkeypatch):
    monkeypatch.setattr(Straighten, "run", refuse(HeadPoseError("only 40 % of the bone agrees")))
    row = window.findChild(TiltRow)
    row.straighten.click()
    wait_until_idle(qtbot, window)
    assert "could not be straightened" in row.words.text()
    assert [b for b in row.findChildren(QPushButton) if b.isVisible()] == [row.other_ways]
    row.other_ways.click()
    assert window.findChild(HeadCard).isVisible()


def test_of_several_heads_the_card_offers_each(qtbot, window, monkeypatch):
    monkeypatch.setattr(Straighten, "run", refuse(SeveralHeadsError(HEADS)))
    row, card = window.findChild(TiltRow), window.findChild(HeadCard)
    row.straighten.click()
    wait_until_idle(qtbot, window)
    assert "2 heads" in row.words.text()
    row.other_ways.click()
    offered = heads_in(card)
    assert [b.text() for b in offered] == ["Head 1 (towards R)", "Head 2 (towards L)"]
    offered[1].click()
    wait_until_idle(qtbot, window)
    np.testing.assert_allclose(window.workspace.view.crosshair, HEADS[1], atol=0.2)
    assert window.workspace.head.frame is not None
    assert not heads_in(card)


def test_the_keyboard_stays_with_the_button_that_began_the_search(qtbot, window, monkeypatch):
    monkeypatch.setattr(Straighten, "run", lambda job, progress: POSE)
    window.set_step("scan")
    card = window.findChild(HeadCard)
    card.straighten.setFocus()
    QTest.keyClick(card.straighten, Qt.Key.Key_Space)
    assert card.stop.hasFocus()
    wait_until_idle(qtbot, window)
    assert card.straighten.hasFocus()
    card.confirm.setFocus()
    QTest.keyClick(card.confirm, Qt.Key.Key_Space)
    assert not card.confirm.isVisible()
    assert card.straighten.hasFocus()


def test_a_head_that_is_turned_by_hand_is_refused_no_more(qtbot, window, monkeypatch):
    monkeypatch.setattr(Straighten, "run", refuse(HeadPoseError("only 40 % agrees", file="/scans/a.nrrd")))
    head, card = window.workspace.head, window.findChild(HeadCard)
    window.set_step("scan")
    card.straighten.click()
    wait_until_idle(qtbot, window)
    said = notices_in(card)
    assert any(words.startswith("Only 40 % agrees. Place IN") for words in said)  # the file is the open one
    head.turn("roll", 0.2)
    assert "40 %" not in " ".join(notices_in(card))
