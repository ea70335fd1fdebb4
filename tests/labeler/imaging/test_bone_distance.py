"""How far points are from bone, in voxels of any shape, near and far, and what is no bone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.imaging.bone_distance import bone_distances, scan_evidence
from gp_labeler.imaging.volume import Volume

SPACING = (0.2, 0.2, 0.3)
TURN = Rotation.from_euler("xyz", [20, -30, 40], degrees=True).as_matrix()


def _volume(array: np.ndarray, spacing=SPACING) -> Volume:
    affine = np.eye(4)
    affine[:3, :3] = TURN * np.array(spacing)
    return Volume(array, affine, name="block")


def _place(voxel) -> np.ndarray:
    return (TURN * np.array(SPACING)) @ np.array(voxel, dtype=float)


@pytest.fixture(scope="module")
def block() -> Volume:
    """Bone in voxels x from 20 to 29, and one loud voxel far from it."""
    array = np.zeros((60, 80, 100), np.int16)
    array[:, :, 20:30] = 1000
    array[30, 40, 90] = 5000
    return _volume(array)


@pytest.mark.parametrize(
    ("voxel", "expected"),
    [
        ((25, 40, 30), 0.0),
        ((29.5, 40, 30), 0.0),
        ((31.5, 40, 30), 0.4),
        ((39.5, 40.3, 30.2), 2.0),
        ((69.5, 40, 30), 8.0),
        ((90, 40, 30), 12.1),
    ],
)
def test_it_is_the_distance_from_the_faces_of_bone(block: Volume, voxel, expected: float) -> None:
    (distance,) = bone_distances(block, 500, {"IN": _place(voxel)}).values()
    assert distance == pytest.approx(expected, abs=1e-6)


def test_a_thin_sheet_is_bone_and_a_speck_is_none() -> None:
    array = np.zeros((40, 40, 40), np.int16)
    array[20, :, :] = 1000
    array[2, 2, 2] = 1000
    thin = _volume(array)
    distances = bone_distances(thin, 500, {"IN": _place((2, 2, 2)), "ZL": _place((9, 9, 20.4))})
    assert distances["ZL"] == 0
    assert distances["IN"] == pytest.approx(0.3 * 17.5)


def test_the_scan_says_what_lies_outside_it_and_how_far_is_too_far(block: Volume) -> None:
    side = LandmarkSet.from_mapping({"CA": _place((25, 40, 30)), "IN": _place((-200, 0, 0))}, "L")
    evidence = scan_evidence(block, 500, side)
    assert evidence.outside == {"IN"}
    assert evidence.bone_distances["CA"] == 0
    assert evidence.tolerance == 0.3
    assert scan_evidence(_volume(block.array, (0.5, 0.5, 0.6)), 500, side).tolerance == pytest.approx(0.6)


def test_without_bone_everything_is_infinitely_far() -> None:
    empty = _volume(np.zeros((10, 10, 10), np.int16))
    assert bone_distances(empty, 500, {"IN": _place((5, 5, 5))}) == {"IN": np.inf}
