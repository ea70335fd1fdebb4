"""The surfaces that are delivered are those of scikit-image's marching cubes, for every type and spacing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from skimage.measure import marching_cubes

from gp_core.errors import GpError
from gp_labeler.cli.mesh import run_mesh
from gp_labeler.imaging.mesh_files import read_mesh
from gp_labeler.imaging.surface import METHODS, extract_isosurface
from gp_labeler.imaging.volume import Volume

TOLERANCE_VOXELS = 0.01
OBLIQUE = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
GRIDS = {
    "cube": ((1.0, 1.0, 1.0), np.eye(3)),
    "fine": ((0.0085, 0.0085, 0.0085), np.diag([-1.0, -1.0, 1.0])),
    "thick slices": ((0.05, 0.07, 0.2), OBLIQUE),
    "mirrored": ((0.3, 0.2, 0.1), OBLIQUE @ np.diag([1.0, -1.0, 1.0])),
}
TYPES = {
    "bool": (0, 1),
    "int8": (-128, 127),
    "uint8": (0, 255),
    "int16": (-32768, 32767),
    "uint16": (0, 65535),
    "int32": (-(2**31), 2**31 - 1),
    "uint32": (0, 2**32 - 1),
    "int64": (-(2**40), 2**40),
    "uint64": (0, 2**41),
    "float16": (-1000.0, 1000.0),
    "float32": (-1e5, 1e5),
    "float64": (-1e9, 1e9),
}


def scan(kind: str, grid: str) -> tuple[Volume, float]:
    """Return a scan of blobs that uses all values of its type, and a threshold in the middle."""
    spacing, direction = GRIDS[grid]
    waves = gaussian_filter(np.random.default_rng(3).normal(size=(22, 26, 30)), 1.8)
    share = (waves - waves.min()) / np.ptp(waves)
    low, high = TYPES[kind]
    values = (
        (low + share * (float(high) - low)).round()
        if np.dtype(kind).kind in "iu"
        else low + share * (high - low)
    )
    if kind == "bool":
        values = share > 0.5
    volume = Volume.from_parts(values.clip(low, high).astype(kind), spacing, (3.0, -40.0, 7.0), direction)
    return volume, 1.0 if kind == "bool" else float(low + 0.5 * (float(high) - low))


def reference(volume: Volume, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Return corners (voxels) and faces of scikit-image, of heights above the level: it works in float32."""
    heights = (volume.array.astype(np.float64) - level).clip(-1e30, 1e30)
    corners, faces, _, _ = marching_cubes(heights, 0.0, method="lorensen")
    return corners[:, ::-1].astype(float), faces


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    return max(cKDTree(one).query(other)[0].max(), cKDTree(other).query(one)[0].max())


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("method", METHODS)
def test_every_surface_is_that_of_scikit_image(method: str, kind: str, grid: str) -> None:
    volume, threshold = scan(kind, grid)
    surface = extract_isosurface(volume, threshold, method=method, smallest_mm=0)
    corners, faces = reference(volume, surface.level)
    found = volume.scan_to_voxel(surface.points)
    assert len(faces) > 1000
    assert surface.n_triangles == pytest.approx(len(faces), rel=0.01)  # some cubes may be cut in two ways
    assert _apart(found, corners) < TOLERANCE_VOXELS
    middles = found[surface.triangles].mean(axis=1)
    assert np.quantile(cKDTree(corners[faces].mean(axis=1)).query(middles)[0], 0.95) < TOLERANCE_VOXELS


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("method", METHODS)
def test_every_surface_faces_outward_with_its_normals(method: str, grid: str) -> None:
    spacing, direction = GRIDS[grid]
    index = np.moveaxis(np.indices((24, 24, 24)), 0, -1)[..., ::-1] - 11.5
    values = 8.0 - np.linalg.norm(index, axis=-1)
    volume = Volume.from_parts(values.astype(np.float32), spacing, (1.0, 2.0, 3.0), direction)
    surface = extract_isosurface(volume, 0.0, method=method, smallest_mm=0)
    away = surface.points - volume.voxel_to_scan([[11.5, 11.5, 11.5]])
    corners = surface.points[surface.triangles].astype(float)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = np.einsum("ij,ij->i", facing, away[surface.triangles[:, 0]])
    assert (outward > 0).all()
    normals = surface.mesh.point_normals
    assert np.einsum("ij,ij->i", normals, away).min() > 0
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_the_command_takes_each_method(method: str, tmp_path: Path, capsys) -> None:
    volume, threshold = scan("int16", "thick slices")
    image = sitk.GetImageFromArray(volume.array)
    image.SetSpacing([0.5, 0.7, 2.0])
    sitk.WriteImage(image, str(tmp_path / "head.nrrd"))
    mesh = tmp_path / "head.ply"
    arguments = [
        str(tmp_path / "head.nrrd"),
        "-o",
        str(mesh),
        "--threshold",
        str(threshold),
        "--smallest",
        "0",
    ]
    assert run_mesh([*arguments, "--method", method]) == 0
    assert read_mesh(mesh).n_cells == pytest.approx(len(reference(volume, threshold - 0.5)[1]), rel=0.01)


@pytest.mark.parametrize("method", METHODS)
def test_where_there_is_no_surface_each_says_so(method: str) -> None:
    with pytest.raises(GpError, match="no surface in the volume at threshold 300"):
        extract_isosurface(Volume(np.zeros((4, 5, 6), np.uint8), np.eye(4)), 300, method=method)


def test_another_method_is_refused() -> None:
    with pytest.raises(GpError, match="method must be one of flying-edges, marching-cubes, skimage"):
        extract_isosurface(scan("uint8", "cube")[0], 128, method="dual-contouring")
