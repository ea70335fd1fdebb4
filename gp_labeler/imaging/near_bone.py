"""Whether points lie near bone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.imaging.volume import Volume

__all__ = ["near_bone"]

_REACH_VOXELS = 3.0
_SAMPLES = 7


def near_bone(volume: Volume, threshold: float, points: FloatArray) -> NDArray[np.bool_]:
    """Return which of (N, 3) scan positions, mm, have bone within three voxels.

    Parameters
    ----------
    volume : Volume
        The scan.
    threshold : float
        Grey value where bone begins.
    points : (N, 3) float array
        Scan positions, mm; outside the scan there is no bone.
    """
    reach = _REACH_VOXELS * min(volume.spacing)
    steps = np.linspace(-reach, reach, _SAMPLES)
    around = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    values = volume.values_at((points[:, None] + around).reshape(-1, 3)).reshape(len(points), -1)
    return np.asarray((np.nan_to_num(values, nan=-np.inf) >= threshold).any(axis=1))
