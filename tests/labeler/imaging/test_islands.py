"""Parts of a mesh and what becomes of the small ones, beside SciPy's connected components."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gp_labeler.imaging.islands import compact, kept_points, subset


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("n_triangles", [0, 40, 400])
def test_parts_are_kept_by_their_size_and_moved_as_they_are(seed: int, n_triangles: int) -> None:
    rng = np.random.default_rng(seed)
    n, smallest = 300, 0.6
    triangles = rng.permutation(n)[rng.integers(0, n, (n_triangles, 3))]
    points, normals = (rng.normal(0, 0.3, (n, 3)).astype(np.float32) for _ in range(2))
    ends = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    graph = coo_array((np.ones(len(ends)), ends.T), shape=(n, n))
    n_parts, part = connected_components(graph, directed=False)
    diagonal = np.array([np.linalg.norm(np.ptp(points[part == p], axis=0)) for p in range(n_parts)])
    wanted = diagonal[part] >= smallest
    kept = kept_points(points, triangles, smallest_mm=smallest)
    np.testing.assert_array_equal(kept, wanted)
    assert kept_points(points, triangles, smallest_mm=0.0).all()

    sizes = np.bincount(part[triangles[:, 0]], minlength=n_parts) if n_triangles else np.zeros(n_parts)
    largest = kept_points(points, triangles, smallest_mm=0.0, largest=1)
    assert len(set(part[largest])) == 1
    assert sizes[part[largest][0]] == sizes.max()

    inside = kept[triangles].all(axis=1)
    moved = points.copy(), normals.copy(), triangles.copy()
    n_points, n_left = compact(*moved, kept)
    assert (n_points, n_left) == (kept.sum(), inside.sum())
    np.testing.assert_array_equal(moved[0][:n_points], points[kept])
    np.testing.assert_array_equal(moved[1][:n_points], normals[kept])
    np.testing.assert_array_equal(moved[0][moved[2][:n_left]], points[triangles[inside]])

    of_points, of_normals, taken = subset(points, normals, triangles, inside)
    np.testing.assert_array_equal(of_points[taken], points[triangles[inside]])
    np.testing.assert_array_equal(of_normals[taken], normals[triangles[inside]])
    assert len(of_points) == len(np.unique(triangles[inside]))
