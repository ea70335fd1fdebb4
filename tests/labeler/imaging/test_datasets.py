"""What leaves the program as pyvista datasets is where it was, named, and not a copy."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from gp_core import PROBE, Atlas, GpError, LandmarkSet, Side, Specimen, estimate_pose
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.imaging.datasets import ellipsoid, to_pyvista
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.volume import Volume

OBLIQUE = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
DIRECTIONS = {"straight": np.eye(3), "oblique": OBLIQUE, "mirrored": OBLIQUE @ np.diag([1.0, -1.0, 1.0])}
TYPES = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64")


def scan(direction: np.ndarray = OBLIQUE, kind: str = "int16") -> Volume:
    array = np.arange(4 * 5 * 6).reshape(4, 5, 6).astype(kind)
    return Volume.from_parts(array, (0.1, 0.2, 0.3), (-5.0, 7.0, 11.0), direction)


@pytest.mark.parametrize("name", DIRECTIONS)
def test_a_voxel_lies_where_it_lay(name: str) -> None:
    volume = scan(DIRECTIONS[name])
    image = volume.to_pyvista()
    assert isinstance(image, pv.ImageData)
    index = np.argwhere(np.ones(volume.size, bool))
    index = index[np.lexsort((index[:, 0], index[:, 1], index[:, 2]))]  # i runs fastest, as in VTK
    np.testing.assert_allclose(image.points, volume.voxel_to_scan(index), atol=1e-5)
    np.testing.assert_array_equal(image["values"], volume.values_at(volume.voxel_to_scan(index)))
    np.testing.assert_allclose(image.direction_matrix, volume.direction)


@pytest.mark.parametrize("kind", TYPES)
def test_the_voxels_are_shared_not_copied(kind: str) -> None:
    volume = scan(kind=kind)
    image = volume.to_pyvista()
    assert image["values"].dtype == volume.array.dtype
    image["values"][:] = 7
    image["values"][6 * 5 * 3 + 6 * 2 + 1] = 99
    assert volume.array[3, 2, 1] == 99
    assert volume.array[0, 0, 0] == 7


@pytest.mark.parametrize("kind", ["bool", "float16"])
def test_types_that_vtk_has_not_are_converted(kind: str) -> None:
    volume = Volume(np.eye(4, dtype=kind)[None].repeat(3, axis=0), np.eye(4))
    np.testing.assert_array_equal(
        volume.to_pyvista()["values"].reshape(volume.array.shape), volume.array.astype(float)
    )


def test_the_image_keeps_its_voxels_alive() -> None:
    image = scan().to_pyvista()
    assert image["values"].sum() == np.arange(120).sum()


def test_a_surface_is_a_mesh_of_pyvista_with_the_same_corners() -> None:
    index = np.moveaxis(np.indices((12, 12, 12)), 0, -1)
    volume = Volume((30 - 6 * np.linalg.norm(index - 5.5, axis=-1)).astype(np.float32), np.eye(4))
    surface = extract_isosurface(volume, 0.0, smallest_mm=0)
    mesh = to_pyvista(surface)
    assert isinstance(mesh, pv.PolyData)
    assert mesh is surface.mesh
    assert mesh.is_manifold
    assert mesh.n_open_edges == 0
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 5.0**3, rel=0.03)
    assert np.shares_memory(mesh.points, surface.points)


def test_landmarks_keep_names_and_what_is_suggested_stays_apart() -> None:
    labels = LandmarkSet.from_mapping({"RWA": [1, 2, 3], "CA": [4, 5, 6]}, "R")
    labels = labels.with_suggestions({"OS": Suggestion((7.0, 8.0, 9.0), 0.5)})
    blocks = to_pyvista(labels)
    assert {
        code: tuple(at) for code, at in zip(blocks["placed"]["code"], blocks["placed"].points, strict=True)
    } == {
        "CA": (4, 5, 6),
        "RWA": (1, 2, 3),
    }
    assert blocks["suggested"]["code"].tolist() == ["OS"]
    assert blocks.field_data["frame"].tolist() == ["scan"]
    both = to_pyvista(Specimen("GP-1", {Side.RIGHT: labels, Side.LEFT: LandmarkSet.empty("L")}))
    assert set(both.keys()) == {"L", "R"}
    assert both["L"]["placed"].n_points == 0


def test_an_atlas_has_a_region_for_each_mean() -> None:
    atlas = Atlas.published()
    blocks = to_pyvista(atlas)
    assert blocks["mean"]["code"].tolist() == list(atlas.codes) == blocks["regions"].keys()
    np.testing.assert_array_equal(blocks["mean"].points, atlas.mean)
    np.testing.assert_allclose(blocks["regions"]["MN"].center, atlas["MN"], atol=0.02)


@pytest.mark.parametrize("side", list(Side))
def test_a_pose_lies_in_the_frame_of_its_touches(side: Side) -> None:
    atlas = Atlas.published()
    turn, shift = OBLIQUE, np.array([-150.0, 65.0, -87.0])
    mirror = np.array([1.0 if side is Side.LEFT else -1.0, 1.0, 1.0])
    pose = estimate_pose({code: turn @ (mirror * atlas[code]) + shift for code in PROBE}, side, atlas)
    blocks = to_pyvista(pose)
    np.testing.assert_allclose(blocks["origin"].points[0], pose.origin)
    np.testing.assert_allclose(np.diff(blocks["axis"].points, axis=0)[0] / 5.0, pose.axis, atol=1e-6)
    along = (blocks["duct"].points - pose.origin) @ pose.axis
    assert -1.0 < along.min() < along.max() < 4.6
    cone = blocks["cone_95"].points
    apex = cone[np.linalg.norm(cone - pose.origin, axis=1).argmin()]
    np.testing.assert_allclose(apex, pose.origin, atol=1e-4)
    assert blocks.field_data["radius_95_mm"][0] == pytest.approx(pose.radius_95)


def test_a_region_holds_95_percent() -> None:
    spread = np.array([[0.5, 0.2, 0.0], [0.2, 0.3, -0.1], [0.0, -0.1, 0.2]])
    surface = ellipsoid(np.array([3.0, -1.0, 2.0]), spread)
    away = surface.points - [3.0, -1.0, 2.0]
    squared = np.einsum("ij,jk,ik->i", away, np.linalg.inv(spread), away)
    np.testing.assert_allclose(squared, chi2.ppf(0.95, 3), rtol=1e-4)
    assert surface.compute_normals()["Normals"][0] @ away[0] > 0


def test_anything_else_is_refused() -> None:
    with pytest.raises(GpError, match="no pyvista dataset can be made of str"):
        to_pyvista("head.nrrd")
