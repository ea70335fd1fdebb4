"""Pictures show the scan: known places at the right pixels, every view the right way round, in any size."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtGui import QImage
from window_cases import MIDDLE, VOXEL_MM, image_bytes, wait_until_idle

from gp_labeler.imaging.volume import Volume
from gp_labeler.scene.planes import Plane
from gp_labeler.views.pictures import PICTURES, picture

SPOT = MIDDLE + VOXEL_MM * np.array([10.5, -6.5, 8.5])  # a voxel left, front and above of the middle
SIDES = {Plane.AXIAL: (1, -1), Plane.SAGITTAL: (-1, -1), Plane.CORONAL: (1, -1)}
"""Where the spot lies from the middle of each view: right of it or left (+1, -1), below or above (+1, -1)."""


def spotted() -> Volume:
    """A grey block with one bright spot."""
    values = np.full((48, 56, 64), 200.0, dtype=np.float32)
    start = MIDDLE - VOXEL_MM * (np.array([64, 56, 48]) - 1) / 2
    i, j, k = np.rint((SPOT - start) / VOXEL_MM).astype(int)
    values[k - 1 : k + 2, j - 1 : j + 2, i - 1 : i + 2] = 3000.0
    return Volume.from_parts(values, [VOXEL_MM] * 3, start, name="spotted")


def pixels(image: QImage) -> np.ndarray:
    image = image.convertToFormat(QImage.Format.Format_RGB888)
    rows = image_bytes(image).reshape(image.height(), image.bytesPerLine())
    return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3)


def brightest(image: QImage) -> np.ndarray:
    """Return the middle (x, y) of what is white, without letters, scale bar and lines."""
    grey = pixels(image).min(axis=2).astype(int)
    white = grey > 235
    for axis in (0, 1):  # a spot is solid: drop what is thin
        white = white & np.roll(white, 4, axis) & np.roll(white, -4, axis)
    assert white.any()
    return np.argwhere(white)[:, ::-1].mean(axis=0)


@pytest.fixture
def window(qtbot, make_window):
    window = make_window()
    window.workspace.scan.begin(spotted())
    wait_until_idle(qtbot, window)
    for name in ("outline_visible", "labels_visible"):
        window.workspace.view.update(**{name: False})
    window.workspace.view.update(level=1600.0, width=2400.0)
    return window


@pytest.mark.parametrize("size", [None, (300, 500), (900, 640)])
@pytest.mark.parametrize("plane", list(Plane))
def test_a_bright_spot_is_seen_where_it_lies(window, plane, size) -> None:
    view, aside = window.grid.slice_views[plane], MIDDLE - 4.0
    depth = plane.in_scan.position_of(SPOT)
    aside = plane.in_scan.moved_to(aside, depth)  # in its slice, the crosshair's lines away from it
    window.workspace.view.set_crosshair(aside)
    image = picture(window, plane.value, size)
    found = brightest(image)
    assert (image.width(), image.height()) == (size or (view.width(), view.height()))
    towards = found - (np.array([image.width(), image.height()]) - 1) / 2
    assert tuple(np.sign(towards)) == SIDES[plane]
    if size is None:
        assert np.abs(found - view.pixel_at(SPOT)).max() < 3


def l_shaped() -> Volume:
    """A bar of bone from right to left, with an upright block at its left end."""
    values = np.full((64, 24, 64), 100.0, dtype=np.float32)
    start = MIDDLE - VOXEL_MM * (np.array([64, 24, 64]) - 1) / 2
    values[8:20, 6:18, 6:58] = values[8:50, 6:18, 44:58] = 2000.0
    return Volume.from_parts(values, [VOXEL_MM] * 3, start, name="l-shaped")


@pytest.mark.parametrize(("letter", "sign"), [("A", 1), ("P", -1)])
def test_left_is_where_it_should_be_in_3d(qtbot, make_window, letter, sign) -> None:
    window = make_window()
    window.workspace.scan.begin(l_shaped())
    wait_until_idle(qtbot, window)
    window.grid.scene_view.view_from(letter)
    window.grid.scene_view.reset()
    image = pixels(picture(window, "3d", (500, 400))).astype(int)
    bone = image[:, :, 0] > image[:, :, 2] + 15  # bone is warm, the background is not
    upper = np.argwhere(bone[:200])[:, 1]
    assert 0.05 < bone.mean() < 0.6
    assert sign * (upper.mean() - 250) > 50


@pytest.mark.parametrize("what", PICTURES)
def test_pictures_have_the_size_asked_for_and_are_not_blank(window, what) -> None:
    for size in (None, (1290, 940)):
        image = picture(window, what, size)
        assert size is None or (image.width(), image.height()) == size
        assert pixels(image).std() > 2


def test_a_picture_leaves_the_window_as_it_was(window) -> None:
    before = [(view.size(), getattr(view, "shown", None)) for view in window.grid.views]
    for what in PICTURES:
        picture(window, what, (640, 480))
    after = [(view.size(), getattr(view, "shown", None)) for view in window.grid.views]
    for (size, shown), (size_then, shown_then) in zip(before, after, strict=True):
        assert size == size_then
        if shown is not None:
            np.testing.assert_allclose(shown.centre, shown_then.centre)
            np.testing.assert_allclose(shown.mm_per_pixel, shown_then.mm_per_pixel)
