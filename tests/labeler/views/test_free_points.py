"""The three points that a head is straightened by: seen in every view as they are marked, never picked."""

from __future__ import annotations

import numpy as np
import pytest
from document_cases import head_frame
from window_cases import BALL_MM, MIDDLE, one_turn, shown_pixels, wait_until_idle

from gp_labeler.document.head_edits import SetHeadFrame
from gp_labeler.scene.planes import Plane
from gp_labeler.views.panels.scan.head_card import HeadCard

INSIDE = MIDDLE + np.array([2.125, -1.625, 0.125])
ON_BONE = MIDDLE + np.array([0.0, -BALL_MM, 0.0])


@pytest.fixture
def window(qtbot, one_window, ball):
    one_window.workspace.interaction.set_tool("look")
    one_window.workspace.view.update(layout="four-up")
    one_window.workspace.scan.begin(ball)
    wait_until_idle(qtbot, one_window)
    yield one_window
    one_window.workspace.head.forget_points()


def _changed(view, before) -> np.ndarray:
    return np.argwhere((shown_pixels(view) != before).any(axis=-1))[:, ::-1]


def _nearest(view, before, position) -> float:
    changed = _changed(view, before)
    return float(np.linalg.norm(changed - view.pixel_at(position), axis=1).min()) if len(changed) else np.inf


@pytest.mark.parametrize("plane", list(Plane))
def test_a_marked_point_is_drawn_on_slices_near_it_and_goes_when_taken_away(window, plane) -> None:
    view = window.grid.slice_views[plane]
    window.workspace.view.set_crosshair(INSIDE)
    before = shown_pixels(view)
    assert not window.commands.actions["head.forget_points"].isEnabled()
    assert window.commands.run("head.left")
    assert _nearest(view, before, INSIDE) < 8
    assert window.commands.run("head.forget_points")
    assert not len(_changed(view, before))
    window.workspace.head.mark_point("left", INSIDE + 4.0 * plane.in_scan.normal)
    assert not len(_changed(view, before))  # on a slice far from it


def test_a_marked_point_is_drawn_on_bone_and_is_no_landmark(qtbot, window) -> None:
    view = window.grid.scene_view
    view.view_from("A")
    wait_until_idle(qtbot, window)
    before = shown_pixels(view)
    window.workspace.head.mark_point("midline", ON_BONE)
    wait_until_idle(qtbot, window)
    assert _nearest(view, before, ON_BONE) < 8
    assert "midline" in view.overlay.names
    x, y = view.pixel_at(ON_BONE)
    assert view.scene.mark_at(x, y) is None


def test_the_card_has_room_for_what_it_says_while_the_head_is_turned_by_hand(qtbot, window) -> None:
    window.set_step("scan")
    card = window.findChild(HeadCard)
    window.workspace.document.do(SetHeadFrame(head_frame()))
    window.commands.run("head.by_hand")

    def fits() -> bool:
        return card.height() >= card.layout().heightForWidth(card.width())

    qtbot.waitUntil(lambda: card.isVisible() and fits())
    window.workspace.head.turn("pitch", 0.1)  # what it says is put in again
    one_turn()
    qtbot.waitUntil(fits)
    window.commands.run("head.by_hand")
