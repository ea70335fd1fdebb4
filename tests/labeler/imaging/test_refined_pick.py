"""A click on a coarse surface gives the point of the surface of the full data."""

from __future__ import annotations

import numpy as np
import pytest
from window_cases import BALL_MM, MIDDLE, VOXEL_MM, ball_volume

from gp_labeler.imaging.mesh import SurfaceHit
from gp_labeler.imaging.refined_pick import refined_hit
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.volume import Volume

EYE = 40.0


@pytest.mark.parametrize("stride", [2, 4])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_click_lies_on_the_surface_of_the_full_data(stride: int, mirrored: bool) -> None:
    ball = ball_volume()
    direction = np.diag([-1.0, 1.0, 1.0]) if mirrored else None
    origin = ball.origin + (np.array([ball.extent[1, 0] - ball.extent[0, 0], 0, 0]) if mirrored else 0)
    volume = Volume.from_parts(ball.array, ball.spacing, origin, direction)
    middle = volume.extent.mean(axis=0)
    fine, coarse = (extract_isosurface(volume, 1000.0, stride=s) for s in (1, stride))
    rng = np.random.default_rng(0)
    for _ in range(20):
        towards = -rng.normal(size=3)
        towards /= np.linalg.norm(towards)
        eye = middle - EYE * towards + rng.uniform(-2, 2, 3)
        hit, truth = coarse.pick(eye, towards), fine.pick(eye, towards)
        assert hit is not None
        assert truth is not None
        refined = refined_hit(volume, 1000.0, hit, towards)
        assert np.linalg.norm(refined.point - truth.point) < 0.1 * VOXEL_MM
        assert np.linalg.norm(refined.point - middle) == pytest.approx(BALL_MM, abs=0.1 * VOXEL_MM)
        assert refined.normal @ towards < 0


def test_without_bone_near_it_a_click_stays_where_it_is() -> None:
    volume = ball_volume()
    hit = SurfaceHit(MIDDLE, np.array([0.0, 0, 1]), 0, 2)
    assert refined_hit(volume, 1e6, hit, [0, 0, -1]) is hit


def test_a_surface_at_full_resolution_needs_nothing() -> None:
    volume = ball_volume()
    fine = extract_isosurface(volume, 1000.0)
    hit = fine.pick(MIDDLE + np.array([0, 0, EYE]), [0, 0, -1])
    assert refined_hit(volume, 1000.0, hit, [0, 0, -1]) is hit
