"""Rays and nearest points on a mesh, beside VTK's locator and beside a look at every triangle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from vtkmodules.vtkCommonCore import mutable
from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator

from gp_labeler.imaging.surface import Surface, extract_isosurface
from gp_labeler.imaging.triangle_search import TriangleSearch
from gp_labeler.imaging.volume import Volume


@pytest.fixture(scope="module")
def blobs() -> Surface:
    waves = gaussian_filter(np.random.default_rng(3).normal(size=(40, 40, 40)), 2.0).astype(np.float32)
    return extract_isosurface(Volume.from_parts(waves, [0.2] * 3, [0.0, 0.0, 0.0]), 0.02, smallest_mm=0)


@pytest.fixture(scope="module")
def locator(blobs: Surface) -> vtkStaticCellLocator:
    made = vtkStaticCellLocator()
    made.SetDataSet(blobs.mesh)
    made.BuildLocator()
    return made


def test_a_ray_meets_what_vtk_says_it_meets(blobs: Surface, locator: vtkStaticCellLocator) -> None:
    rng, n_met = np.random.default_rng(1), 0
    for _ in range(300):
        start, end = rng.uniform(-4, 12, (2, 3))
        share, point, inside, part, cell = mutable(0.0), [0.0] * 3, [0.0] * 3, mutable(0), mutable(0)
        met = locator.IntersectWithLine(start, end, 0.0, share, point, inside, part, cell)
        found = blobs.search.first_along(start, end - start)
        assert (found is not None) == bool(met)
        if found is not None:
            n_met += 1
            assert found[1] == pytest.approx(float(share), abs=1e-9)
    assert n_met > 100


def test_the_nearest_point_is_the_one_that_vtk_finds(blobs: Surface, locator: vtkStaticCellLocator) -> None:
    for place in np.random.default_rng(2).uniform(-4, 12, (300, 3)):
        point, cell, part, squared = [0.0] * 3, mutable(0), mutable(0), mutable(0.0)
        locator.FindClosestPoint(place, point, cell, part, squared)
        triangle, nearest = blobs.search.nearest(place)
        assert np.linalg.norm(nearest - place) == pytest.approx(float(squared) ** 0.5, abs=1e-9)
        corners = blobs.points[blobs.triangles[triangle]].astype(float)
        shares = np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), [*nearest, 1.0], rcond=None)[0]
        assert shares.min() > -1e-5  # it lies in its triangle


@pytest.mark.parametrize("axis", range(3))
def test_no_ray_slips_between_two_triangles(axis: int) -> None:
    """Through corners, along edges and along the grid, where boxes have no thickness in one direction."""
    solid = np.zeros((12, 12, 12), np.uint8)
    solid[3:9, 3:9, 3:9] = 2
    surface = extract_isosurface(Volume(solid, np.eye(4)), 2, smallest_mm=0)
    towards = np.eye(3)[axis]
    steps = np.arange(3.0, 8.01, 0.5)
    for u in steps:
        for v in steps:
            start = np.insert([u, v], axis, -5.0)
            for way, face in ((towards, 2.75), (-towards, 8.25)):
                hit = surface.pick(start if way[axis] > 0 else start + 30 * towards, way)
                assert hit is not None
                assert hit.point[axis] == pytest.approx(face)
                assert hit.normal @ way < -0.5


@pytest.mark.parametrize("n", [1, 7, 8, 9, 64, 65, 600])
def test_triangles_in_any_order_and_number_are_found(n: int) -> None:
    rng = np.random.default_rng(n)
    points = rng.uniform(0, 1, (3 * n, 3)).astype(np.float32)
    triangles = rng.permutation(3 * n).reshape(n, 3).astype(np.int32)
    search = TriangleSearch.of(points, triangles)
    for row in rng.integers(0, n, 20):
        middle = points[triangles[row]].mean(axis=0, dtype=np.float64)
        triangle, nearest = search.nearest(middle)
        assert np.linalg.norm(nearest - middle) < 1e-6
        share = search.first_along(middle + np.array([0, 0, 3.0]), np.array([0, 0, -6.0]))
        assert share is not None
        assert share[1] <= 0.5 + 1e-6
        assert 0 <= triangle < n


def test_a_way_ends_where_it_ends_and_none_is_no_way(blobs: Surface) -> None:
    start = np.array([-10.0, 4.0, 4.0])
    found = blobs.search.first_along(start, np.array([30.0, 0.0, 0.0]))
    assert found is not None
    there = 30.0 * found[1]
    assert blobs.search.first_along(start, np.array([there - 1e-3, 0.0, 0.0])) is None
    assert blobs.search.first_along(start, np.array([there + 1e-3, 0.0, 0.0])) is not None
    assert blobs.search.first_along(start, np.zeros(3)) is None
