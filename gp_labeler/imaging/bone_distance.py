"""How far points are from bone, for the check of labels."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.sets import LandmarkSet
from gp_core.validation import FloatArray
from gp_labeler.imaging.volume import Volume

__all__ = ["bone_distances", "scan_evidence"]

_LEAST_TOLERANCE_MM = 0.3
_REACHES_MM = (1.0, 4.0, 30.0)
"""Half edges of the boxes that are searched one after the other."""

_MOST_VOXELS = 200_000
"""Of a box; larger ones are searched coarsely first."""

_MOST_SPECKS = 5000
"""That may lie nearer than the bone."""

_FEWEST_OF_27 = 4
"""Bone voxels about one that is no speck of noise."""


def scan_evidence(volume: Volume, threshold: float, landmarks: LandmarkSet) -> ScanEvidence:
    """Return what a scan says of the labels of one side, placed in its frame.

    Parameters
    ----------
    volume : Volume
        The scan.
    threshold : float
        Grey value where bone begins.
    landmarks : LandmarkSet
        In the frame of the scan, mm.
    """
    points = landmarks.as_mapping()
    distances = bone_distances(volume, threshold, points)
    outside = frozenset(code for code, point in points.items() if not volume.contains(point[None])[0])
    positions = {code: (float(x), float(y), float(z)) for code, (x, y, z) in points.items()}
    tolerance = max(*volume.spacing, _LEAST_TOLERANCE_MM)
    return ScanEvidence(distances, tolerance, outside, positions, float(threshold))


def bone_distances(volume: Volume, threshold: float, points: Mapping[str, FloatArray]) -> dict[str, float]:
    """Return the distance of named points (3,) from the nearest bone, mm: 0 in it, infinite if none.

    Beyond 4 mm it is exact to about 1 mm.
    """
    return {code: _distance(volume, threshold, point) for code, point in points.items()}


def _distance(volume: Volume, threshold: float, point: FloatArray) -> float:
    for reach in _REACHES_MM:
        found, nearest = _nearest(volume, threshold, point, point, reach)
        if found <= reach:
            break
    if nearest is not None and found > _REACHES_MM[1]:  # found coarsely: look again about what was found
        found = min(found, _nearest(volume, threshold, point, nearest, _REACHES_MM[0])[0])
    return found


def _nearest(
    volume: Volume, threshold: float, point: FloatArray, middle: FloatArray, reach: float
) -> tuple[float, FloatArray | None]:
    """Return how far a point is from the bone in a box about `middle`, mm, and the middle of that voxel."""
    spacing = np.asarray(volume.spacing)
    centre = np.floor(volume.scan_to_voxel(middle[None])[0] + 0.5)
    half = np.ceil(reach / spacing)
    low = np.clip(centre - half, 0, volume.size).astype(int)
    high = np.clip(centre + half + 1, 0, volume.size).astype(int)
    if not (high > low).all():
        return np.inf, None
    stride = max(1, int(np.ceil((np.prod(high - low) / _MOST_VOXELS) ** (1 / 3))))
    i, j, k = (slice(a, b, stride) for a, b in zip(low, high, strict=True))
    voxels = low + stride * np.argwhere(volume.voxels.read(k, j, i) >= threshold)[:, ::-1]
    # along the axes of the voxels, mm, from the faces of each
    away = np.abs(voxels - volume.scan_to_voxel(point[None])[0]) * spacing
    distances = np.linalg.norm(np.maximum(away - spacing / 2, 0), axis=1)
    nearest = np.argsort(distances)[:_MOST_SPECKS]
    nearest = nearest[_is_no_speck(volume, threshold, voxels[nearest])]
    if not len(nearest):
        return np.inf, None
    best = int(nearest[0])
    return float(distances[best]), volume.voxel_to_scan(voxels[best][None].astype(np.float64))[0]


def _is_no_speck(volume: Volume, threshold: float, voxels: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which voxels (N, 3) of bone have others about them."""
    steps = np.array(list(product((-1, 0, 1), repeat=3)))
    i, j, k = np.clip(voxels[:, None] + steps, 0, np.asarray(volume.size) - 1).transpose(2, 0, 1)
    enough: NDArray[np.bool_] = (volume.voxels.at(k, j, i) >= threshold).sum(axis=1) >= _FEWEST_OF_27
    return enough
