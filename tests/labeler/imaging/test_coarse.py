"""Scans at reduced resolution: means of cubes, and a smooth surface of them where it should be."""

from __future__ import annotations

import numpy as np
import pytest
from window_cases import BALL_MM, MIDDLE, VOXEL_MM, ball_volume

from gp_labeler.imaging.coarse import means_of_cubes
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.volume import Volume


def test_means_of_extreme_values_are_exact() -> None:
    for dtype, value in (("uint16", 65535), ("int16", -32768), ("uint32", 4_000_000_000), ("float32", 1e9)):
        values = np.full((12, 12, 12), value, dtype)
        values[::2] = 0
        for side in (4, 6):
            means = means_of_cubes(values, side, value / 2)
            assert np.abs(means).max() < 1e-7 * abs(value) + 1e-9


@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint16", "float32"])
@pytest.mark.parametrize("side", [1, 2, 3])
def test_cubes_have_their_mean(dtype, side) -> None:
    values = np.random.default_rng(0).integers(0, 120, (13, 11, 16)).astype(dtype)[:, 1:, ::1]
    nz, ny, nx = (n // side for n in values.shape)
    whole = values[: nz * side, : ny * side, : nx * side].astype(float)
    expected = whole.reshape(nz, side, ny, side, nx, side).mean(axis=(1, 3, 5))
    np.testing.assert_allclose(means_of_cubes(values, side), expected, rtol=1e-5)


@pytest.mark.parametrize("stride", [2, 3])
def test_a_coarse_surface_is_within_a_tenth_of_its_voxels(stride) -> None:
    surface = extract_isosurface(ball_volume(), 1000.0, stride=stride)
    radius = np.linalg.norm(surface.points - MIDDLE, axis=1)
    assert np.abs(radius[radius > 4.5] - BALL_MM).max() < 0.1 * stride * VOXEL_MM


def test_noise_leaves_no_terraces_on_a_coarse_surface() -> None:
    still = ball_volume()
    noise = 100 * np.random.default_rng(0).normal(size=still.array.shape)
    volume = Volume.from_parts(
        (still.array + noise).astype(np.float32), still.spacing, still.origin, name="b"
    )
    rough = {}
    for stride in (1, 2):
        points = extract_isosurface(volume, 1000.0, stride=stride).points
        radius = np.linalg.norm(points - MIDDLE, axis=1)
        rough[stride] = np.sqrt(np.mean((radius[radius > 4.5] - BALL_MM) ** 2))
    assert rough[2] < 0.7 * rough[1] < 0.2 * VOXEL_MM
