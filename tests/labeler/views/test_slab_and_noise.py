"""Slabs and denoising in the window: seen, said in the headers, and no part of what is placed or read."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest
from window_cases import MIDDLE, VOXEL_MM, image_bytes, wait_until_idle

from gp_core.errors import GpError
from gp_labeler.imaging.slab import Slab
from gp_labeler.scene.planes import Plane

NEAR_SHELL = MIDDLE + np.array([2.1, -1.7, 4.0])


@pytest.fixture
def window(qtbot, one_window, ball):
    one_window.workspace.scan.begin(ball)
    one_window.activateWindow()
    wait_until_idle(qtbot, one_window)
    one_window.workspace.view.set_crosshair(NEAR_SHELL)
    return one_window


def picture(window, plane=Plane.AXIAL) -> np.ndarray:
    return image_bytes(window.grid.slice_views[plane].grab().toImage())


def headers(window) -> set[str]:
    return {window.grid.frames[plane.value].header.filters.text() for plane in Plane}


@pytest.mark.parametrize(
    ("command", "words"),
    [("view.slab_mean", "mean"), ("view.slab_minimum", "min"), ("view.denoise_gaussian", "gaussian")],
)
def test_it_is_seen_and_said_in_every_header_until_it_is_off_again(window, command, words) -> None:
    before = picture(window)
    assert headers(window) == {""}
    window.commands.run(command)
    assert all(words in text for text in headers(window))
    assert not np.array_equal(picture(window), before)
    window.commands.run(command)
    assert headers(window) == {""}
    assert np.array_equal(picture(window), before)


def test_what_is_placed_read_and_outlined_is_that_of_the_slice(window) -> None:
    workspace, axial = window.workspace, window.grid.slice_views[Plane.AXIAL]
    window.set_step("label")

    def look() -> tuple[object, ...]:
        workspace.labels.choose("L", "CA")
        x, y = axial.pixel_at(NEAR_SHELL)
        QTest.mouseMove(axial, QPoint(int(x), int(y)))
        QTest.mouseClick(axial, Qt.MouseButton.LeftButton, pos=QPoint(int(x), int(y)))
        placed = workspace.document.landmarks("L")["CA"].copy()
        workspace.document.undo()
        window.status.show_position(NEAR_SHELL)
        axial.grab()
        outline = axial.slice_painter.outline_length
        return tuple(placed), window.status.where.text(), outline

    before = look()
    workspace.view.update(slab=Slab("maximum", 2.0), denoise="median")
    assert look() == before


def test_another_scan_begins_without(qtbot, window, ball) -> None:
    window.workspace.view.update(slab=Slab("mean", 1.0), denoise="median")
    window.workspace.scan.begin(ball)
    wait_until_idle(qtbot, window)
    assert window.workspace.view.state.slab is None
    assert window.workspace.view.state.denoise is None
    assert headers(window) == {""}


def test_thicker_and_thinner_stay_within_limits_and_the_header_says_whole_layers(window) -> None:
    window.commands.run("view.slab_mean")
    for command, mm in (("view.slab_thicker", 2.0), ("view.slab_thinner", 0.1)):
        for _ in range(12):
            window.commands.run(command)
        assert window.workspace.view.state.slab.mm == mm
    hint = window.grid.frames["axial"].header.filters.toolTip()
    assert f"over {VOXEL_MM:.2f} mm" in hint
    assert "Display only" in hint
    window.commands.run("view.slab_mean")


def test_the_panel_sets_it_too(window) -> None:
    window.set_step("scan")
    card = window.steps["scan"].slab
    card.mode.setCurrentText("Maximum")
    card.mode.activated.emit(2)
    assert window.workspace.view.state.slab == Slab("maximum", 0.5)
    card.thickness.value_chosen.emit(5.0)  # is refused
    assert window.workspace.view.state.slab == Slab("maximum", 0.5)
    card.denoise.setCurrentText("Bilateral")
    card.denoise.activated.emit(3)
    assert window.workspace.view.state.denoise == "bilateral"
    with pytest.raises(GpError, match="denoise"):
        window.workspace.view.update(denoise="sharpen")
    window.workspace.view.update(slab=None, denoise=None)
    assert card.mode.currentText() == "Single slice"
