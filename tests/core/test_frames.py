from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gp_core.errors import FrameError, GpError
from gp_core.frames import RigidTransform, cross_matrix, mirror_x


def _random(rng: np.random.Generator, dst: str, src: str) -> RigidTransform:
    rotation = Rotation.random(random_state=rng).as_matrix()
    return RigidTransform.from_parts(rotation, rng.normal(size=3), dst=dst, src=src)


def test_inverse_undoes_and_composition_associates() -> None:
    rng = np.random.default_rng(0)
    T_tracker_scan, T_scan_atlas = _random(rng, "tracker", "scan"), _random(rng, "scan", "atlas")
    points = rng.normal(size=(5, 3))
    both = T_tracker_scan @ T_scan_atlas
    assert (both.dst, both.src) == ("tracker", "atlas")
    np.testing.assert_allclose(both.apply(points), T_tracker_scan.apply(T_scan_atlas.apply(points)))
    np.testing.assert_allclose(both.inverse().apply(both.apply(points)), points, atol=1e-12)


def test_frames_that_do_not_meet_are_refused() -> None:
    rng = np.random.default_rng(1)
    with pytest.raises(FrameError, match=r"T_tracker_scan cannot follow T_atlas_cochlea.*'scan' and 'atlas'"):
        _random(rng, "tracker", "scan") @ _random(rng, "atlas", "cochlea")


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.diag([2.0, 1, 1, 1]), "not rigid"),
        (np.diag([-1.0, 1, 1, 1]), "mirrors"),
        (np.full((4, 4), np.nan), "finite"),
        (np.eye(3), "shape"),
        (np.diag([1.0, 1, 1, 2]), "not rigid"),
    ],
)
def test_what_is_no_rigid_motion_is_refused(matrix: np.ndarray, message: str) -> None:
    with pytest.raises(FrameError, match=message):
        RigidTransform(matrix, "scan", "atlas")


def test_missing_points_stay_missing_and_infinite_ones_are_refused() -> None:
    T = RigidTransform.identity(dst="scan", src="atlas")
    assert np.isnan(T.apply([[np.nan] * 3, [0, 0, 0]])[0]).all()
    with pytest.raises(GpError, match="finite"):
        T.apply([[np.inf, 0, 0]])


def test_mirror_is_its_own_inverse_and_changes_handedness() -> None:
    points = np.random.default_rng(2).normal(size=(3, 3))
    np.testing.assert_array_equal(mirror_x(mirror_x(points)), points)
    assert np.linalg.det(mirror_x(points)) == pytest.approx(-np.linalg.det(points))


def test_transforms_cannot_be_changed_in_place() -> None:
    T = RigidTransform.identity(dst="scan", src="atlas")
    with pytest.raises(ValueError, match="read-only"):
        T.matrix[0, 3] = 1.0


def test_cross_matrix_is_the_cross_product() -> None:
    a, b = np.random.default_rng(3).normal(size=(2, 3))
    np.testing.assert_allclose(cross_matrix(a) @ b, np.cross(a, b))
