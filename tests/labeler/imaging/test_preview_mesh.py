"""The preview mesh of a surface: few triangles, in the same place, thin walls kept."""

from __future__ import annotations

import numpy as np
import pytest

from gp_labeler.imaging.preview_mesh import coarse_surface
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.volume import Volume


@pytest.fixture(scope="module")
def shell() -> Volume:
    """A hollow ball whose wall is two voxels thick."""
    n = 96
    z, y, x = np.indices((n, n, n)) - (n - 1) / 2
    wall = 1.0 - np.abs(np.sqrt(x**2 + y**2 + z**2) - 40.0)
    return Volume.from_parts((100 * np.clip(wall + 0.5, 0, 1)).astype(np.uint8), [0.1] * 3, [0.0, 0.0, 0.0])


def test_a_preview_has_few_triangles_and_lies_where_the_surface_does(shell: Volume) -> None:
    surface = extract_isosurface(shell, 50)
    middle = shell.extent.mean(axis=0)
    for n in (20_000, 5_000):
        coarse = coarse_surface(surface, n)
        assert n / 4 < coarse.n_triangles <= n
        away = np.linalg.norm(coarse.points - middle, axis=1)
        assert np.abs(away - 4.0).max() < 0.4
        assert np.ptp(coarse.bounds, axis=0) == pytest.approx(np.ptp(surface.bounds, axis=0), rel=0.1)
        assert coarse.mesh.GetPointData().GetNormals() is not None
        rays = np.random.default_rng(0).normal(size=(300, 3))
        seen = [coarse.pick(middle + 8 * ray / np.linalg.norm(ray), -ray) is not None for ray in rays]
        assert np.mean(seen) > 0.9  # a wall of two voxels is not lost
    assert coarse_surface(surface, surface.n_triangles) is surface
