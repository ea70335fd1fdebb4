"""Close views: a place in a picture is the place in the scan whose grey value, or bone, is seen there."""

from __future__ import annotations

import numpy as np
import pytest

from gp_core.landmarks.features import Side
from gp_labeler.imaging.close_up import PICTURE_AXES, CloseUp
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.close_views import PLANES, DrawCloseViews, PictureToDraw, looks_of
from gp_labeler.jobs.runner import Progress

L, R = Side.LEFT, Side.RIGHT
MIDDLE = np.array([2.0, -3.0, 5.0])
RADIUS = 3.0
TILT = np.array([[0.96, -0.28, 0.0], [0.28, 0.96, 0.0], [0.0, 0.0, 1.0]])
MIRRORED = np.diag([-1.0, 1.0, 1.0])


def ball(direction) -> Volume:
    """A ball of bone around `MIDDLE`, whose grey value rises towards the left, the back and the top."""
    size, spacing = (50, 60, 70), np.array([0.3, 0.25, 0.2])
    k, j, i = np.indices(size)
    start = MIDDLE - direction @ (spacing * (np.array(size[::-1]) - 1) / 2)
    empty = Volume.from_parts(np.zeros(size, np.float32), spacing, start, direction)
    away = empty.voxel_to_scan(np.stack([i, j, k], axis=-1).reshape(-1, 3)) - MIDDLE
    inside = 100 * np.clip((RADIUS - np.linalg.norm(away, axis=1)) / 0.3, -1, 1)
    grey = (inside + away @ [3.0, 5.0, 7.0]).reshape(size).astype(np.float32)
    return Volume.from_parts(grey, spacing, start, direction)


def drawn(volume, side, code, centre, rotation=TILT):
    wanted = tuple(PictureToDraw(side, code, n, tuple(centre)) for n in (0, 1))
    found = DrawCloseViews(volume, wanted, rotation, (-200.0, 200.0), 0.0).run(Progress(lambda *_: None))
    return [found[each] for each in wanted]


@pytest.mark.parametrize("side", [L, R])
@pytest.mark.parametrize("direction", [np.eye(3), MIRRORED, TILT, MIRRORED @ TILT])
@pytest.mark.parametrize("code", ["CA", "RWL", "MH"])
def test_each_place_of_a_picture_is_where_the_scan_has_what_is_seen(side, direction, code) -> None:
    volume = ball(direction)
    for picture, look in zip(
        drawn(volume, side, code, MIDDLE), looks_of(side, code, with_bone=True), strict=True
    ):
        n = len(picture.rgb)
        for row, column in ((60, 100), (130, 90), (150, 170)):
            there = picture.position_at((column + 0.5) / n, (row + 0.5) / n)
            assert picture.place_of(there) == pytest.approx(((column + 0.5) / n, (row + 0.5) / n))
            assert look in PLANES
            grey = picture.rgb[row, column, 0] / 255 * 400 - 200
            assert grey == pytest.approx(100 + (there - MIDDLE) @ [3.0, 5.0, 7.0], abs=1.0)
            assert picture.depth_of(there) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(("side", "leftwards"), [(L, 1), (R, -1)])
@pytest.mark.parametrize("direction", [np.eye(3), MIRRORED])
def test_a_place_on_bone_lies_on_its_surface_on_the_side_of_the_viewer(side, leftwards, direction) -> None:
    beside = MIDDLE + np.array([leftwards * RADIUS, 0.2, -0.1])
    bone = drawn(ball(direction), side, "OI", beside, np.eye(3))[1]
    for across, down in ((0.5, 0.5), (0.6, 0.45), (0.4, 0.62)):
        there = bone.position_at(across, down) - MIDDLE
        assert np.linalg.norm(there) == pytest.approx(RADIUS, abs=0.15)
        assert leftwards * there[0] > 0
        assert leftwards * (there[1] - 0.2) == pytest.approx((across - 0.5) * 8, abs=1e-6)
    assert bone.position_at(0.97, 0.5) is None  # beside the ball


def test_a_slice_alone_is_the_slice_among_all_voxels() -> None:
    volume = ball(TILT)
    for look in PLANES:
        axes = PICTURE_AXES[look].turned(TILT.T)
        every, alone = (CloseUp(volume, MIDDLE + 0.7, 8.0, 60, only=o).slice(axes) for o in (None, axes))
        assert np.array_equal(every, alone, equal_nan=True)
