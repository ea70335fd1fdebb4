"""The proposed threshold lies between soft tissue and bone; the level never lies on a voxel value."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gp_core.errors import GpError
from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.threshold import propose_threshold, surface_level
from gp_labeler.imaging.volume import Volume

MICE = ("BALB_CJ_", "C57BL6_J_", "DBA_2J_")


def _head(air: float, tissue: float, bone: float, noise: float, *, n: int = 64) -> Volume:
    """Make a ball of tissue with a thin shell of bone in it."""
    rng = np.random.default_rng(3)
    z, y, x = np.indices((n, n, n)) - (n - 1) / 2
    radius = np.sqrt(x**2 + y**2 + z**2)
    values = np.where(radius < 0.45 * n, tissue, air)
    values = np.where(np.abs(radius - 0.33 * n) < 1.5, bone, values)
    return Volume(values + rng.normal(0, noise, values.shape), np.diag([0.2, 0.2, 0.2, 1]))


@pytest.mark.parametrize("name", MICE)
def test_real_mouse_bone_is_parted_from_tissue(shared_data: Path, name: str) -> None:
    threshold = propose_threshold(read_volume(shared_data / "mouse_ct" / f"{name}.nii.gz"))
    assert (
        25 < threshold < 45
    )  # tissue peaks at 9, and the 45 landmarks on bone lie at 17 to 51, mostly near 31


@pytest.mark.parametrize(
    ("air", "tissue", "bone"),
    [(-1000, 50, 1500), (0, 9, 90), (5000, 11000, 30000), (0, 0, 200), (0.0, 0.2, 1.0)],
)
@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_it_lies_between_tissue_and_bone(air: float, tissue: float, bone: float, noise: float) -> None:
    volume = _head(air, tissue, bone, noise * (bone - air))
    threshold = propose_threshold(volume)
    assert tissue + 0.15 * (bone - tissue) < threshold < bone - 0.15 * (bone - tissue)


def test_a_scan_of_two_values_and_an_even_one() -> None:
    array = np.zeros((8, 8, 8), np.uint8)
    array[2:6, 2:6, 2:6] = 1
    assert 0 < propose_threshold(Volume(array, np.eye(4))) < 1
    with pytest.raises(GpError, match="no contrast: every voxel is 7"):
        propose_threshold(Volume(np.full((4, 4, 4), 7, np.int16), np.eye(4)))


def test_the_level_keeps_off_voxel_values() -> None:
    whole = np.arange(27, dtype=np.uint16).reshape(3, 3, 3)
    assert surface_level(13, whole) == 12.5  # the same voxels are at 13 and above as above 12.5
    assert surface_level(13.4, whole) == 13.4
    assert surface_level(13, whole.astype(np.float32)) == 12.5
    assert surface_level(13, whole + 0.25) == 13
