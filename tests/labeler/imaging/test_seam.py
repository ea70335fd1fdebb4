"""A finer mesh goes over into the coarser one around it without a line where they meet."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gp_labeler.imaging.seam import shaded_like
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.volume import Volume
from gp_labeler.imaging.vtk_arrays import to_numpy

REGION = np.array([[0.0, 15.0, 15.0], [79.0, 64.0, 64.0]])
"""Of the box: its faces in x are those of the scan."""


def _normals(surface) -> np.ndarray:
    return to_numpy(surface.mesh.GetPointData().GetNormals())


@pytest.fixture(scope="module")
def meshes():
    """A noisy ball, its overview, and its middle at full resolution."""
    z, y, x = np.indices((80, 80, 80)) - 39.5
    values = 100 * np.clip(30.5 - np.sqrt(x**2 + y**2 + z**2), 0, 1)
    values += np.random.default_rng(0).normal(0, 12, values.shape)
    volume = Volume.from_parts(values.astype(np.float32), [0.1] * 3, [0.0, 0.0, 0.0])
    overview = extract_isosurface(volume, 50, stride=2)
    ear = extract_isosurface(volume, 50, box=volume.voxel_to_scan(REGION))
    return volume, overview, ear, shaded_like(ear, (overview,), 1.0)


def test_nothing_moves_that_is_picked_or_measured(meshes):
    _, _, ear, shaded = meshes
    assert np.array_equal(shaded.points, ear.points)
    assert np.array_equal(shaded.triangles, ear.triangles)


def test_at_the_faces_of_its_box_it_is_shaded_as_what_is_around_it(meshes):
    volume, overview, ear, shaded = meshes
    index = volume.scan_to_voxel(ear.points)
    from_face = np.abs(index[:, 1:, None] - REGION[:, 1:].T).min(axis=(1, 2)) * 0.1
    at_face, within = from_face < 0.05, from_face > 1.0
    assert at_face.sum() > 100
    _, nearest = cKDTree(overview.points).query(ear.points)
    around = _normals(overview)[nearest]

    def off(normals):
        return np.linalg.norm(normals - around, axis=1)

    before, after = off(_normals(ear))[at_face].mean(), off(_normals(shaded))[at_face].mean()
    assert after < 0.35 * before
    assert np.array_equal(_normals(shaded)[within], _normals(ear)[within])
    assert np.allclose(np.linalg.norm(_normals(shaded), axis=1), 1.0, atol=1e-5)


def test_faces_of_the_scan_itself_have_nothing_around_them(meshes):
    volume, _, ear, shaded = meshes
    index = volume.scan_to_voxel(ear.points)
    from_face = np.abs(index[:, 1:, None] - REGION[:, 1:].T).min(axis=(1, 2)) * 0.1
    middle = from_face > 1.0
    assert (np.abs(index[middle, 0] - 39.5) > 25).any()  # near the faces in x
    assert np.array_equal(_normals(shaded)[middle], _normals(ear)[middle])
