"""Points are near bone where there is some within three voxels."""

from __future__ import annotations

import numpy as np

from gp_labeler.imaging.near_bone import near_bone
from gp_labeler.imaging.volume import Volume


def test_three_voxels_are_near_and_outside_is_far() -> None:
    values = np.zeros((20, 20, 20), np.float32)
    values[:, :, :10] = 100.0  # bone for x below 2 mm
    volume = Volume.from_parts(values, [0.2, 0.2, 0.2], [0.1, 0.1, 0.1])
    points = np.array([[1.0, 2, 2], [2.4, 2, 2], [2.8, 2, 2], [50, 2, 2]])
    np.testing.assert_array_equal(near_bone(volume, 50.0, points), [True, True, False, False])
