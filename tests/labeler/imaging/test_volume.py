from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gp_core.errors import GeometryError, GpError
from gp_labeler.imaging.volume import Volume


def make_volume(seed: int = 0, *, mirrored: bool = False, dtype: str = "uint16") -> Volume:
    rng = np.random.default_rng(seed)
    direction = Rotation.random(random_state=rng).as_matrix()
    if mirrored:
        direction = direction * [1, 1, -1]
    shape = rng.integers(3, 12, 3)
    array = rng.integers(0, 200, shape).astype(dtype)
    return Volume.from_parts(array, rng.uniform(0.01, 0.5, 3), rng.uniform(-50, 50, 3), direction)


@given(seed=st.integers(0, 10**6), mirrored=st.booleans())
@settings(max_examples=40, deadline=None)
def test_voxel_and_scan_positions_are_inverse(seed: int, mirrored: bool) -> None:
    volume = make_volume(seed, mirrored=mirrored)
    indices = np.random.default_rng(seed).uniform(-5, 20, (20, 3))
    np.testing.assert_allclose(volume.scan_to_voxel(volume.voxel_to_scan(indices)), indices, atol=1e-9)
    assert volume.is_mirrored is mirrored
    assert np.linalg.det(volume.direction) == pytest.approx(-1 if mirrored else 1)
    np.testing.assert_allclose(volume.direction * volume.spacing, volume.T_scan_voxel[:3, :3])


def test_an_index_counts_x_first_and_an_array_z_first() -> None:
    array = np.arange(4 * 5 * 6, dtype=np.int16).reshape(4, 5, 6)
    volume = Volume.from_parts(array, (0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    assert volume.size == (6, 5, 4)
    np.testing.assert_allclose(volume.voxel_to_scan([[5, 3, 2]]), [[1.5, 2.6, 3.6]])
    assert volume.value_at([1.5, 2.6, 3.6]) == array[2, 3, 5]


@given(seed=st.integers(0, 10**6), mirrored=st.booleans())
@settings(max_examples=30, deadline=None)
def test_every_voxel_answers_for_its_own_box_and_nothing_answers_outside(seed: int, mirrored: bool) -> None:
    volume = make_volume(seed, mirrored=mirrored)
    rng = np.random.default_rng(seed + 1)
    index = np.stack([rng.integers(0, n, 50) for n in volume.size], axis=1)
    points = volume.voxel_to_scan(index + rng.uniform(-0.49, 0.49, index.shape))
    i, j, k = index.T
    np.testing.assert_array_equal(volume.values_at(points), volume.array[k, j, i])
    beyond = volume.voxel_to_scan([[-0.51, 0, 0], [0, volume.size[1] - 0.49, 0], [0, 0, -3]])
    assert np.isnan(volume.values_at(beyond)).all()
    assert not volume.contains(beyond).any()
    assert volume.value_at(beyond[0]) is None
    low, high = volume.extent
    assert ((points >= low) & (points <= high)).all()


def test_a_missing_point_lies_nowhere() -> None:
    volume = make_volume()
    assert volume.contains([[np.nan] * 3]).tolist() == [False]
    assert np.isnan(volume.scan_to_voxel([[np.nan] * 3])).all()


def test_extent_holds_the_half_widths_of_the_outer_voxels() -> None:
    volume = Volume.from_parts(np.zeros((2, 3, 4), np.uint8), (1.0, 2.0, 3.0))
    np.testing.assert_allclose(volume.extent, [[-0.5, -1, -1.5], [3.5, 5, 4.5]])


def test_the_voxels_are_native_contiguous_and_cannot_be_changed() -> None:
    big = np.arange(24, dtype=">u2").reshape(2, 3, 4)[:, ::-1]
    volume = Volume.from_parts(big, (1, 1, 1))
    assert volume.array.dtype.isnative
    assert volume.array.flags.c_contiguous
    np.testing.assert_array_equal(volume.array, big)
    with pytest.raises(ValueError, match="read-only"):
        volume.array[0, 0, 0] = 1


def test_intensity_range_leaves_out_the_extremes() -> None:
    array = np.full((50, 50, 50), 100, np.int16)
    array[:25] = 200
    array[0, 0, :3] = 30_000
    volume = Volume.from_parts(array, (1, 1, 1))
    assert volume.intensity_range == (100.0, 200.0)


@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32"])
@pytest.mark.parametrize("shape", [(3, 5, 7), (40, 70, 65)])
def test_the_checksum_notices_any_one_voxel(dtype: str, shape: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(3)
    array = rng.integers(0, 100, shape).astype(dtype)
    first = Volume.from_parts(array, (1, 1, 1)).checksum
    assert first == Volume.from_parts(array.copy(), (1, 1, 1)).checksum
    for flat in (0, array.size - 1, *rng.integers(0, array.size, 20)):
        changed = array.copy()
        changed.reshape(-1)[flat] += 1
        assert Volume.from_parts(changed, (1, 1, 1)).checksum != first


def test_the_checksum_notices_mirrors_types_shapes_and_places() -> None:
    array = np.random.default_rng(4).integers(0, 100, (40, 48, 64)).astype(np.uint8)
    volumes = [
        Volume.from_parts(array, (1, 1, 1)),
        Volume.from_parts(array[::-1], (1, 1, 1)),
        Volume.from_parts(array[:, :, ::-1], (1, 1, 1)),
        Volume.from_parts(np.roll(array, 8, axis=2), (1, 1, 1)),
        Volume.from_parts(array.astype(np.uint16), (1, 1, 1)),
        Volume.from_parts(array.reshape(40, 64, 48), (1, 1, 1)),
        Volume.from_parts(array, (1, 1, 1.001)),
        Volume.from_parts(array, (1, 1, 1), (0, 0.001, 0)),
    ]
    assert len({volume.checksum for volume in volumes}) == len(volumes)
    assert Volume.from_parts(array, (1, 1, 1 + 1e-8), (-0.0, 0, 0)).checksum == volumes[0].checksum


@pytest.mark.parametrize(
    ("affine", "words"),
    [
        (np.eye(3), "finite \\(4, 4\\)"),
        (np.diag([1, 1, np.nan, 1]), "finite"),
        (np.diag([1, 0, 1, 1]), "three voxel axes"),
        (np.array([[1, 0.2, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "orthogonal"),
    ],
)
def test_an_affine_that_is_no_grid_is_refused(affine: np.ndarray, words: str) -> None:
    with pytest.raises(GeometryError, match=words):
        Volume(np.zeros((2, 2, 2)), affine)


def test_other_than_three_dimensions_are_refused() -> None:
    with pytest.raises(GeometryError, match=r"got shape \(4, 4\)"):
        Volume(np.zeros((4, 4)), np.eye(4))
    with pytest.raises(GpError, match="points must have the shape"):
        make_volume().values_at([1, 2, 3])
