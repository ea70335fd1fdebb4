"""Two views side by side, a typed position, one view reset, and bone cut open at a hidden feature."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtCore import QCoreApplication, QEvent, QPoint, Qt
from qtpy.QtTest import QTest
from window_cases import BALL_MM, MIDDLE, wait_until_idle

from gp_core.landmarks.features import Side
from gp_labeler.document.state import How
from gp_labeler.scene.planes import Plane


@pytest.fixture
def window(qtbot, one_window, ball):
    one_window.workspace.scan.begin(ball)
    one_window.workspace.view.update(layout="four-up")
    one_window.activateWindow()
    wait_until_idle(qtbot, one_window)
    return one_window


def visible(window) -> set[str]:
    return {name for name, frame in window.grid.frames.items() if frame.isVisible()}


def test_two_up_shows_the_slice_in_which_the_chosen_feature_is_best_seen(qtbot, window) -> None:
    labels, frames = window.workspace.labels, window.grid.frames
    labels.choose("L", "MN")  # coronal
    window.commands.run("view.two-up")
    qtbot.waitUntil(lambda: abs(frames["3d"].width() - frames["coronal"].width()) < 12)
    assert visible(window) == {"3d", "coronal"}
    left = [frames[name].mapTo(window, QPoint(0, 0)) for name in ("3d", "coronal")]
    assert left[0].y() == left[1].y()
    assert left[0].x() < left[1].x()
    labels.choose("L", "CC")  # axial
    assert visible(window) == {"3d", "axial"}
    labels.choose("L", "OS")  # seen in 3D: the slice stays
    assert visible(window) == {"3d", "axial"}
    frames["axial"].header.maximise_asked.emit()
    assert visible(window) == {"axial"}
    frames["axial"].header.maximise_asked.emit()
    assert visible(window) == {"3d", "axial"}
    window.commands.run("view.four-up")
    assert visible(window) == set(frames)

    def are_in_rows() -> bool:
        top = {name: frame.mapTo(window, QPoint(0, 0)).y() for name, frame in frames.items()}
        return top["sagittal"] == top["coronal"] > top["3d"] == top["axial"]

    qtbot.waitUntil(are_in_rows)


def test_a_typed_position_is_brought_into_every_view(window) -> None:
    there = MIDDLE + np.array([2.0, -1.0, 3.0])
    prompts, view = window.prompts, window.workspace.view
    prompts.answers = [f"L {there[0]} A {-there[1]} S {there[2]}"]
    window.commands.run("view.go_to")
    assert np.allclose(view.crosshair, there)
    for plane, shown in window.grid.slice_views.items():
        x, y = shown.pixel_at(there)
        assert 0 <= x < shown.width(), plane
        assert 0 <= y < shown.height(), plane
    said = []
    window.workspace.messages.said.connect(lambda text, level: said.append(text))
    for answer, words in (("L 900 P 0 S 0", "outside the scan"), ("here", "not a position")):
        prompts.answers = [answer]
        window.commands.run("view.go_to")
        assert words in said[-1]
        assert np.allclose(view.crosshair, there)


@pytest.mark.parametrize("pointer_over", [None, "axial", "coronal"])
def test_one_view_alone_is_reset_that_under_the_pointer_else_the_focused_one(window, pointer_over) -> None:
    axial, coronal = (window.grid.slice_views[plane] for plane in (Plane.AXIAL, Plane.CORONAL))
    for frame in window.grid.frames.values():  # on a real display the pointer lies somewhere
        over = frame.name == pointer_over
        QCoreApplication.sendEvent(frame, QEvent(QEvent.Type.Enter if over else QEvent.Type.Leave))
    for shown in (axial, coronal):
        shown.zoom_to(MIDDLE, 2.0)
    before = {view: view.shown.mm_per_pixel for view in (axial, coronal)}
    axial.setFocus()
    QTest.keyClick(axial, Qt.Key.Key_R, Qt.KeyboardModifier.ControlModifier)
    reset, other = (coronal, axial) if pointer_over == "coronal" else (axial, coronal)
    assert reset.shown.mm_per_pixel > 3 * before[reset]
    assert other.shown.mm_per_pixel == before[other]


@pytest.mark.parametrize("code", ["CA", "MH", "CC", "RWA"])  # coronal, sagittal, axial, 3D
def test_the_card_of_a_hidden_feature_offers_to_cut_the_bone_open(qtbot, window, code) -> None:
    workspace, view = window.workspace, window.grid.scene_view
    card = window.steps["label"].card
    window.set_step("label")
    inside, outside = MIDDLE + np.array([1.0, 0.5, -0.7]), MIDDLE - [0, BALL_MM, 0]
    workspace.labels.place(inside, How.SLICE, side="L", code=code)
    workspace.labels.place(outside, How.MESH, side="R", code=code)
    view.view_from("A")
    workspace.labels.go_to(Side.RIGHT, code)
    wait_until_idle(qtbot, window)
    qtbot.waitUntil(lambda: not card.cut_open.isVisible())
    workspace.labels.go_to(Side.LEFT, code)
    qtbot.waitUntil(card.cut_open.isVisible)
    QTest.mouseClick(card.cut_open, Qt.MouseButton.LeftButton)
    wait_until_idle(qtbot, window)
    assert not view.scene.hidden(inside)[0]
    assert np.allclose(workspace.view.state.cut.origin, inside)
    qtbot.waitUntil(lambda: not card.cut_open.isVisible())
