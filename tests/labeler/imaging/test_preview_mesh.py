"""The preview mesh of a surface: few triangles, in the same place, thin walls kept."""

from __future__ import annotations

import numpy as np
import pytest

from gp_labeler.imaging.preview_mesh import coarse_surface
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.volume import Volume
from gp_labeler.imaging.vtk_arrays import to_numpy


@pytest.fixture(scope="module")
def shell() -> Volume:
    """A hollow ball whose wall is two voxels thick."""
    n = 96
    z, y, x = np.indices((n, n, n)) - (n - 1) / 2
    wall = 1.0 - np.abs(np.sqrt(x**2 + y**2 + z**2) - 40.0)
    return Volume.from_parts((100 * np.clip(wall + 0.5, 0, 1)).astype(np.uint8), [0.1] * 3, [0.0, 0.0, 0.0])


def _outwards(surface) -> np.ndarray:
    """How much the corners of each triangle face to the side on which it is seen counter-clockwise."""
    a, b, c = (surface.points[surface.triangles[:, n]].astype(float) for n in range(3))
    normals = to_numpy(surface.mesh.GetPointData().GetNormals())
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), normals[surface.triangles].sum(axis=1))


def test_parts_that_meet_are_joined_and_detail_is_kept_where_asked_for(shell: Volume) -> None:
    surface = extract_isosurface(shell, 50)
    middle = shell.extent.mean(axis=0)
    region = np.array([[48.0, 20.0, 20.0], [95.0, 75.0, 75.0]])
    box = shell.voxel_to_scan(region)
    rest, ear = surface.outside(region), extract_isosurface(shell, 50, box=box)
    coarse = coarse_surface((rest, ear), 8000, detailed=(box,))
    assert coarse.n_triangles <= 8000
    assert (_outwards(coarse) >= -1e-9).all()
    rays = np.random.default_rng(1).normal(size=(400, 3))
    seen = [coarse.pick(middle + 8 * ray / np.linalg.norm(ray), -ray) is not None for ray in rays]
    assert np.mean(seen) > 0.99  # no gap where they meet
    inside = ((coarse.points > box[0]) & (coarse.points < box[1])).all(axis=1)
    share = ((surface.points > box[0]) & (surface.points < box[1])).all(axis=1).mean()
    assert inside.mean() > 1.5 * share


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
        assert np.mean(seen) > 0.99  # a wall of two voxels is not lost
        assert (_outwards(coarse) >= -1e-9).all()  # else it would be drawn black
        inner = np.abs(away - 3.95) < np.abs(away - 4.05)
        assert 0.3 < inner.mean() < 0.7  # both sides of the wall
    assert coarse_surface(surface, surface.n_triangles) is surface
