"""ICP: exact nearest points, known motions found again, and refusal of what has no answer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from gp_core import GpError, RigidTransform
from gp_core.io.stl import read_stl
from gp_core.registration.icp import icp
from gp_core.registration.icp_targets import Cloud, TriangleMesh

Points = NDArray[np.float64]


def motion(angle: float, shift: float, rng: np.random.Generator) -> RigidTransform:
    """T_scan_tracker that turns by `angle` (rad) and moves by `shift` (mm)."""
    axis, step = rng.normal(size=(2, 3))
    rotation = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    return RigidTransform.from_parts(rotation, shift * step / np.linalg.norm(step), dst="scan", src="tracker")


def bumpy(n: int, rng: np.random.Generator) -> tuple[Points, NDArray[np.int64]]:
    """A closed surface that no motion brings onto itself."""
    unit = rng.normal(size=(n, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    triangles = ConvexHull(unit).simplices.astype(np.int64)
    bumps = 1 + 0.2 * np.sin(4 * unit[:, :1]) * np.cos(3 * unit[:, 1:2])
    return unit * bumps * [10.0, 8.0, 6.0], triangles


@pytest.mark.parametrize("n_points", [4, 8, 40])
def test_known_motion_of_a_cloud_is_found_from_anywhere(n_points: int) -> None:
    rng = np.random.default_rng(n_points)
    target = rng.normal(size=(n_points, 3)) * [10, 7, 4]
    T_scan_tracker = motion(2.5, 80.0, rng)
    source = T_scan_tracker.inverse().apply(target)[rng.permutation(n_points)]
    found = icp(source, Cloud(target), dst="scan", src="tracker")
    assert found.converged
    assert found.rms < 1e-9
    np.testing.assert_allclose(found.transform.matrix, T_scan_tracker.matrix, atol=1e-9)


def test_noise_is_left_as_residual() -> None:
    rng = np.random.default_rng(0)
    target = rng.normal(size=(12, 3)) * [10, 7, 4]
    T_scan_tracker = motion(1.0, 30.0, rng)
    source = T_scan_tracker.inverse().apply(target + 0.1 * rng.normal(size=target.shape))
    found = icp(source, Cloud(target), dst="scan", src="tracker")
    assert 0.05 < found.rms < 0.2
    assert np.abs(found.transform.apply(source) - target).max() < 0.6


def test_each_iteration_brings_points_nearer() -> None:
    rng = np.random.default_rng(1)
    vertices, triangles = bumpy(300, rng)
    surface = TriangleMesh(vertices, triangles)
    start = motion(0.2, 2.0, rng)
    errors = [
        icp(vertices[:40], surface, start=start, dst="scan", src="tracker", max_iterations=n).rms
        for n in range(1, 8)
    ]
    assert errors == sorted(errors, reverse=True)


def test_points_on_bone_find_their_place() -> None:
    rng = np.random.default_rng(2)
    vertices, triangles = bumpy(800, rng)
    weights = rng.dirichlet([1, 1, 1], size=50)
    picked = triangles[rng.integers(len(triangles), size=50)]
    on_bone = np.einsum("nk,nkc->nc", weights, vertices[picked])
    T_scan_tracker = motion(0.15, 1.5, rng)
    start = RigidTransform.identity(dst="scan", src="tracker")
    touched = T_scan_tracker.inverse().apply(on_bone)
    found = icp(touched, TriangleMesh(vertices, triangles), start=start, dst="scan", src="tracker")
    assert found.converged
    assert np.abs(found.transform.apply(touched) - on_bone).max() < 1e-3


def test_nearest_points_are_exact() -> None:
    rng = np.random.default_rng(3)
    vertices = rng.normal(size=(40, 3)) * 3
    triangles = np.array([rng.choice(40, 3, replace=False) for _ in range(60)])
    vertices[:3] *= 20  # sizes of all kinds
    points = np.vstack([rng.normal(size=(30, 3)) * 4, rng.normal(size=(5, 3)) * 100])
    nearest = TriangleMesh(vertices, triangles).nearest(points)
    corners = vertices[triangles]
    for point, found in zip(points, nearest, strict=True):
        distance = np.linalg.norm(found - point)
        assert distance == pytest.approx(slow_distance(point, corners), rel=1e-9)
        assert slow_distance(found, corners) < 1e-9  # it lies on the surface


def slow_distance(point: Points, corners: Points) -> float:
    """Least distance from a point to any triangle, by quadratic programming over each (brute force)."""
    best = np.inf
    for triangle in corners:
        for keep in ([0, 1, 2], [0, 1], [1, 2], [0, 2], [0], [1], [2]):
            origin, edges = triangle[keep[0]], (triangle[keep[1:]] - triangle[keep[0]]).T
            along = np.linalg.lstsq(edges, point - origin, rcond=None)[0] if len(keep) > 1 else np.zeros(0)
            if (along >= 0).all() and along.sum() <= 1:
                best = min(best, float(np.linalg.norm(origin + edges @ along - point)))
    return best


def test_mesh_of_points_equals_cloud_far_away() -> None:
    rng = np.random.default_rng(4)
    vertices, triangles = bumpy(500, rng)
    far = rng.normal(size=(20, 3)) * 1000
    surface, cloud = (target.nearest(far) for target in (TriangleMesh(vertices, triangles), Cloud(vertices)))
    distance, upper = (np.linalg.norm(near - far, axis=1) for near in (surface, cloud))
    assert (distance <= upper + 1e-9).all()
    np.testing.assert_allclose(distance, upper, atol=0.5)


def test_triangles_without_area_are_passed_over() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5.0]])
    surface = TriangleMesh(vertices, [[0, 1, 2], [3, 3, 3], [0, 1, 1]])
    np.testing.assert_allclose(surface.nearest(np.array([[5.0, 5, 5]])), [[0.5, 0.5, 0]], atol=1e-12)
    with pytest.raises(GpError, match="no triangle with an area"):
        TriangleMesh(vertices, [[3, 3, 3]])


def test_what_has_no_answer_is_refused() -> None:
    cloud = Cloud(np.eye(3))
    with pytest.raises(GpError, match="at least 3 points, got 2"):
        icp(np.eye(3)[:2], cloud, dst="scan", src="tracker")
    with pytest.raises(GpError, match="target needs at least 3 points"):
        Cloud(np.zeros((2, 3)))
    line = np.arange(4.0)[:, None] * [1.0, 2.0, 3.0]
    with pytest.raises(GpError, match="on one line"):
        icp(line, Cloud(line + 1), dst="scan", src="tracker")
    start = RigidTransform.identity(dst="tracker", src="scan")
    with pytest.raises(GpError, match="cannot start a search for T_scan_tracker"):
        icp(np.eye(3), cloud, start=start, dst="scan", src="tracker")
    with pytest.raises(GpError, match="must be finite"):
        icp([[0, 0, np.nan]] * 3, cloud, dst="scan", src="tracker")
    with pytest.raises(GpError, match="whole numbers in"):
        TriangleMesh(np.eye(3), [[0.5, 1, 2]])
    with pytest.raises(GpError, match="vertices from 0 to 2"):
        TriangleMesh(np.eye(3), [[0, 1, 3]])


def test_stl_text_and_binary_are_the_same(tmp_path: Path) -> None:
    vertices, triangles = bumpy(30, np.random.default_rng(5))
    corners = vertices[triangles].astype("<f4")
    text = "solid bone\n" + "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in triangle.tolist())
        + "endloop\nendfacet\n"
        for triangle in corners
    )
    (tmp_path / "text.stl").write_text(text + "endsolid bone\n")
    records = b"".join(bytes(12) + triangle.tobytes() + bytes(2) for triangle in corners)
    count = len(corners).to_bytes(4, "little")
    (tmp_path / "binary.stl").write_bytes(b"solid binary, though".ljust(80) + count + records)
    points = np.random.default_rng(6).normal(size=(10, 3)) * 12
    expected = TriangleMesh(corners.astype(float).reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    for name in ("text.stl", "binary.stl"):
        found = read_stl(tmp_path / name).nearest(points)
        np.testing.assert_allclose(found, expected.nearest(points), atol=1e-6)


@pytest.mark.parametrize(
    "content", [b"", b"solid x\nendsolid", b"solid\nvertex 1 2\n", bytes(84), b"\xff" * 200]
)
def test_what_is_no_stl_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "bone.stl").write_bytes(content)
    with pytest.raises(GpError, match=r"bone.stl: is no surface in STL"):
        read_stl(tmp_path / "bone.stl")
    with pytest.raises(GpError, match="does not exist"):
        read_stl(tmp_path / "none.stl")
