"""The tracked probe as a person meets it: dialog, card and guide, against a server in another process."""

from __future__ import annotations

import numpy as np
import pytest
from panel_cases import actions_of
from qtpy.QtCore import QPoint, Qt
from qtpy.QtWidgets import QWidget
from tracker_cases import POINTS, TIP, SimulatorProcess

from gp_core import PROBE, Atlas, Side
from gp_core.pose.quality import pose_quality
from gp_labeler.document.touches import TouchHow
from gp_labeler.models.pose import ORDER
from gp_labeler.models.workspace import Workspace
from gp_labeler.tracker import TrackerAddress
from gp_labeler.views.guide import GuideWindow
from gp_labeler.views.panels.tracker.card import TrackerCard
from gp_labeler.views.panels.tracker.dialog import TrackerDialog
from gp_labeler.views.theme import THEMES, apply_theme
from gp_labeler.views.window_state import WindowState


@pytest.fixture
def workspace():
    workspace = Workspace(atlas=Atlas.published(), author="AB")
    yield workspace
    workspace.close(discard=True)


@pytest.fixture
def top(qtbot):
    widget = QWidget()
    qtbot.addWidget(widget)
    return widget


@pytest.fixture(scope="module")
def simulator(tmp_path_factory):
    process = SimulatorProcess(tmp_path_factory.mktemp("views"), "--noise", "0.05")
    yield process
    process.close()


def going(qtbot, workspace, true):
    """Poll as the window's timer does, until something is true."""

    def step():
        workspace.tracker.poll()
        assert true()

    qtbot.waitUntil(step)


def connected(qtbot, workspace, simulator):
    workspace.tracker.set_tip_offset(TIP)
    workspace.tracker.connect(TrackerAddress(port=simulator.port))
    going(qtbot, workspace, lambda: workspace.tracker.visible)


def typed(qtbot, field, text):
    field.clear()
    qtbot.keyClicks(field, text)


def test_the_dialog_connects_remembers_and_finds_the_tip(qtbot, workspace, top, simulator):
    memory = WindowState()
    dialog = TrackerDialog(workspace, memory, top)
    dialog.show()
    typed(qtbot, dialog.fields["port"], str(simulator.port))
    qtbot.mouseClick(dialog.connect_button, Qt.MouseButton.LeftButton)
    simulator.do("go RWA 0.2")
    going(qtbot, workspace, lambda: workspace.tracker.visible)
    assert "Receiving ProbeToTracker" in dialog.words.text()
    qtbot.mouseClick(dialog.pivot, Qt.MouseButton.LeftButton)
    simulator.tell("turn 15")
    going(qtbot, workspace, lambda: dialog.finish.isEnabled())
    qtbot.mouseClick(dialog.finish, Qt.MouseButton.LeftButton)
    tip = np.array([float(word) for word in dialog.fields["tip"].text().split()])
    assert np.linalg.norm(tip - TIP) < 1.0
    assert "residual" in dialog.pivot_words.text()
    qtbot.mouseClick(dialog.connect_button, Qt.MouseButton.LeftButton)
    assert not workspace.tracker.on
    again = TrackerDialog(workspace, memory, top)
    assert again.fields["port"].text() == str(simulator.port)
    again.close()
    dialog.close()


def test_a_device_without_noise_is_believed_where_a_person_says_so(qtbot, workspace, top, simulator):
    memory = WindowState()
    dialog = TrackerDialog(workspace, memory, top)
    dialog.show()
    assert not dialog.still.isChecked()
    typed(qtbot, dialog.fields["port"], str(simulator.port))
    qtbot.mouseClick(dialog.connect_button, Qt.MouseButton.LeftButton)
    simulator.do("go MN 0.2")
    simulator.tell("stale 60")
    going(qtbot, workspace, lambda: "readings do not change" in dialog.words.text())
    qtbot.mouseClick(dialog.still, Qt.MouseButton.LeftButton, pos=QPoint(8, dialog.still.height() // 2))
    going(qtbot, workspace, lambda: workspace.tracker.visible)
    workspace.tracker.refused.connect(lambda _: workspace.tracker.press())
    workspace.tracker.press()
    going(qtbot, workspace, lambda: bool(workspace.document.state.touches))
    (touch,) = workspace.document.state.touches.values()
    assert touch.spread_mm < 1e-9
    simulator.tell("stale 0")
    dialog.close()
    workspace.tracker.disconnect()
    workspace.tracker.set_may_stand_still(False)
    again = TrackerDialog(workspace, memory, top)
    assert again.still.isChecked(), "remembered with the device"
    qtbot.mouseClick(again.connect_button, Qt.MouseButton.LeftButton)
    assert workspace.tracker.may_stand_still
    again.close()


def test_a_tip_typed_while_the_probe_is_tracked_counts_at_once(qtbot, workspace, top, simulator):
    dialog = TrackerDialog(workspace, WindowState(), top)
    dialog.show()
    typed(qtbot, dialog.fields["port"], str(simulator.port))
    qtbot.keyClick(dialog.fields["port"], Qt.Key.Key_Return)
    assert workspace.tracker.on, "Return connects"
    going(qtbot, workspace, lambda: workspace.tracker.visible)
    for text, complaint in (("1 2", "three finite numbers"), ("1 2 3", "")):
        typed(qtbot, dialog.fields["tip"], text)
        qtbot.keyClick(dialog.fields["tip"], Qt.Key.Key_Return)
        assert complaint in dialog.problem.text()
    np.testing.assert_array_equal(workspace.tracker.probe.tip_offset, (1, 2, 3))
    assert workspace.tracker.on, "Return does not disconnect"
    dialog.close()


@pytest.mark.parametrize(
    ("field", "text", "complaint"),
    [("port", "99999", "1 to 65535"), ("host", "", "host is empty"), ("tip", "1 2", "three finite numbers"),
     ("tip", "a b c", "three numbers")],
)  # fmt: skip
def test_the_dialog_refuses_what_cannot_be(qtbot, workspace, top, field, text, complaint):
    dialog = TrackerDialog(workspace, WindowState(), top)
    dialog.show()
    typed(qtbot, dialog.fields[field], text)
    qtbot.mouseClick(dialog.connect_button, Qt.MouseButton.LeftButton)
    assert complaint in dialog.problem.text()
    assert not workspace.tracker.on
    dialog.close()


def test_the_pose_is_sent_and_stopped_from_the_dialog(qtbot, workspace, top):
    dialog = TrackerDialog(workspace, WindowState(), top)
    dialog.show()
    typed(qtbot, dialog.send_port, "x")
    qtbot.mouseClick(dialog.send, Qt.MouseButton.LeftButton)
    assert "port must be a whole number" in dialog.problem.text()
    typed(qtbot, dialog.send_port, "0")
    qtbot.mouseClick(dialog.send, Qt.MouseButton.LeftButton)
    assert "sending no pose" in dialog.send_words.text()
    qtbot.mouseClick(dialog.send, Qt.MouseButton.LeftButton)
    assert workspace.tracker.sending == ""
    dialog.close()


def test_the_card_shows_only_a_tracker_that_is_asked_for(qtbot, workspace, top, simulator):
    card = TrackerCard(workspace, actions_of(workspace, qtbot), top)
    top.show()
    assert not card.isVisible()
    connected(qtbot, workspace, simulator)
    assert card.isVisible()
    assert card.record.text() == f"Record {ORDER[0]}"
    going(qtbot, workspace, lambda: "mm" in card.tip.text())
    workspace.tracker.disconnect()
    assert not card.isVisible()


def test_guided_touching_by_a_foot_pedal(qtbot, workspace, top, simulator):
    guide = GuideWindow(workspace, top)
    guide.show()
    connected(qtbot, workspace, simulator)
    names = list(POINTS)
    simulator.do(f"go {names[0]} 0.2")
    workspace.pose.set_target(names[0])
    assert guide.code.text() == names[0]

    def press_until_touched(key):
        qtbot.keyClick(guide, key)
        workspace.tracker.refused.connect(lambda _: workspace.tracker.press())
        going(qtbot, workspace, lambda: (Side.LEFT, names[0]) in workspace.document.state.touches)
        workspace.tracker.refused.disconnect()

    press_until_touched(Qt.Key.Key_PageDown)
    assert guide.code.text() == workspace.pose.target != names[0]
    assert guide.counter.text() == "Left ear · 1 touched, 6 to go"
    assert guide.redo.text() == f"Redo {names[0]}"
    qtbot.keyClick(guide, Qt.Key.Key_Backspace)
    assert workspace.pose.target == names[0]
    qtbot.keyClick(guide, Qt.Key.Key_S)
    assert workspace.pose.target != names[0]
    guide.close()


def test_the_guide_tells_the_estimate_and_why_nothing_was_recorded(qtbot, workspace, top, simulator):
    guide = GuideWindow(workspace, top)
    guide.show()
    atlas = Atlas.published()
    assert "3 more touches" in guide.result.text()
    for code in ORDER[:4]:
        workspace.pose.record(atlas[code], TouchHow.TYPED)
    assert "mm" in guide.result.text()
    assert "Only 4 points" in guide.warning.text()
    connected(qtbot, workspace, simulator)
    simulator.do("hide")
    going(qtbot, workspace, lambda: not workspace.tracker.visible)
    qtbot.keyClick(guide, Qt.Key.Key_Space)
    going(qtbot, workspace, lambda: bool(guide.told.text()))
    simulator.do("show")
    assert len(workspace.document.state.touches) == 4
    qtbot.keyClick(guide, Qt.Key.Key_Escape)
    assert not guide.isVisible()


def test_the_guide_proposes_in_as_the_seventh_touch_and_says_what_for(qtbot, workspace, top):
    guide = GuideWindow(workspace, top)
    guide.show()
    touch(workspace, *PROBE)
    assert (guide.code.text(), guide.counter.text()) == ("IN", "Left ear · 6 touched, 1 to go")
    assert "it determines the side" in guide.definition.text()
    workspace.pose.skip()
    assert guide.code.text() == "ZL"
    assert "it determines the side" in guide.definition.text()
    touch(workspace, "IN")
    assert guide.counter.text() == "Left ear · 7 touched"
    assert "it determines the side" not in guide.definition.text()


def touch(workspace, *codes, noise=0.0):
    rng = np.random.default_rng(1)
    for code in codes:
        position = Atlas.published()[code] + rng.normal(0, noise, 3)
        workspace.pose.record(position, TouchHow.TYPED, name=code)


@pytest.mark.parametrize("key", [Qt.Key.Key_Space, Qt.Key.Key_PageDown, Qt.Key.Key_Escape, None])
def test_done_closes_the_guide_also_without_a_tracker(qtbot, workspace, top, key):
    touch(workspace, *ORDER[:-1])
    guide = GuideWindow(workspace, top)
    guide.show()
    assert not guide.record.isEnabled()
    touch(workspace, ORDER[-1])
    assert (guide.code.text(), guide.record.text()) == ("All touched", "Done")
    assert guide.record.isEnabled()
    assert not guide.picture.isVisible()
    with qtbot.waitSignal(guide.closed):
        if key is None:
            qtbot.mouseClick(guide.record, Qt.MouseButton.LeftButton)
        else:
            qtbot.keyClick(guide, key)
    assert not guide.isVisible()
    assert len(workspace.document.state.touches) == len(ORDER)


def test_redo_goes_back_through_what_was_touched_before_the_guide_was_opened(qtbot, workspace, top):
    touch(workspace, *reversed(ORDER))  # in whatever order, such as from a file
    guide = GuideWindow(workspace, top)
    guide.show()
    for key, code in zip((Qt.Key.Key_Backspace, Qt.Key.Key_PageUp), ORDER[:-3:-1], strict=True):
        assert guide.redo.text() == f"Redo {code}"
        qtbot.keyClick(guide, key)
        assert guide.code.text() == workspace.pose.target == code
        assert guide.picture.isVisible()
    qtbot.keyClick(guide, Qt.Key.Key_S)
    assert workspace.pose.target is None
    workspace.pose.set_target(ORDER[0])
    assert not guide.redo.isEnabled()
    touch(workspace, ORDER[0])
    assert guide.redo.text() == f"Redo {ORDER[0]}", "what was touched here comes before the order"
    guide.close()


def test_redo_is_for_this_side_only_and_not_for_what_was_undone(qtbot, workspace, top):
    touch(workspace, *ORDER[:2])
    guide = GuideWindow(workspace, top)
    guide.show()
    touch(workspace, ORDER[2])
    workspace.document.undo()
    assert guide.redo.text() == f"Redo {ORDER[1]}"
    workspace.pose.choose(side=Side.RIGHT)
    assert (guide.redo.text(), guide.redo.isEnabled()) == ("Redo", False)
    qtbot.keyClick(guide, Qt.Key.Key_Backspace)
    assert workspace.pose.target == ORDER[0]
    guide.close()


@pytest.mark.parametrize("theme", list(THEMES))
def test_every_estimate_is_shown_with_how_far_it_can_be_trusted(qtbot, workspace, top, theme):
    apply_theme(top, THEMES[theme])
    guide = GuideWindow(workspace, top)
    guide.show()
    assert not guide.trust.isVisible()
    assert not guide.reason.isVisible()
    seen = {}
    for codes, noise in ((ORDER[:3], 0.0), (ORDER[:6], 0.0), (ORDER, 0.0), (ORDER, 3.0)):
        touch(workspace, *codes, noise=noise)
        trust = pose_quality(workspace.pose.estimate.pose)
        assert guide.trust.isVisible()
        assert (guide.trust.text(), guide.reason.text()) == (trust.word, trust.reason)
        assert guide.trust.fontInfo().pixelSize() > guide.result.fontInfo().pixelSize()
        colour = guide.trust.palette().color(guide.trust.foregroundRole()).name()
        assert colour == getattr(THEMES[theme], trust.level).lower()
        seen[trust.level] = colour
    assert len(set(seen.values())) == 3, "good, warning and danger"
    workspace.pose.choose(side=Side.RIGHT)
    assert not guide.trust.isVisible()
    guide.close()
