"""Scans whose content says where everything must appear."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gp_labeler.imaging.volume import Volume

OBLIQUE = Rotation.from_euler("xyz", [12, -20, 30], degrees=True).as_matrix()
DIRECTIONS = {
    "straight": np.eye(3),
    "flipped": np.diag([-1.0, -1.0, 1.0]),
    "mirrored": np.diag([1.0, 1.0, -1.0]),
    "permuted": np.eye(3)[[2, 0, 1]],
    "oblique": OBLIQUE,
    "oblique mirrored": OBLIQUE @ np.diag([1.0, -1.0, 1.0]),
}
MIDDLE = np.array([14.0, -8.0, 5.0])
SPACING = np.array([0.2, 0.25, 0.3])


def scan_of(balls: list[tuple[np.ndarray, float]], direction: np.ndarray, *, half_mm: float = 8.0) -> Volume:
    """Make an 8-bit scan of bright balls (centre, radius; mm) with soft edges around `MIDDLE`."""
    size = np.rint(2 * half_mm / SPACING).astype(int)
    origin = MIDDLE - direction @ ((size - 1) / 2 * SPACING)
    index = np.moveaxis(np.indices(size[::-1]), 0, -1)[..., ::-1]
    points = (index * SPACING) @ direction.T + origin
    inside = np.max([r - np.linalg.norm(points - c, axis=-1) for c, r in balls], axis=0)
    values = (200 * np.clip(inside / 0.4 + 0.5, 0, 1)).astype(np.uint8)
    return Volume.from_parts(values, SPACING, origin, direction)
