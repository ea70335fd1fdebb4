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
BALL, RADIUS = MIDDLE + np.array([1.0, 0.5, -0.7]), 3.0


def scan_of(balls: list[tuple[np.ndarray, float]], direction: np.ndarray, *, half_mm: float = 8.0) -> Volume:
    """Make an 8-bit scan of bright balls (centre, radius; mm) with soft edges around `MIDDLE`."""
    size = np.rint(2 * half_mm / SPACING).astype(int)
    origin = MIDDLE - direction @ ((size - 1) / 2 * SPACING)
    index = np.moveaxis(np.indices(size[::-1]), 0, -1)[..., ::-1]
    points = (index * SPACING) @ direction.T + origin
    inside = np.max([r - np.linalg.norm(points - c, axis=-1) for c, r in balls], axis=0)
    values = (200 * np.clip(inside / 0.4 + 0.5, 0, 1)).astype(np.uint8)
    return Volume.from_parts(values, SPACING, origin, direction)


def unlike_background(pixels: np.ndarray) -> np.ndarray:
    """Where something is drawn: the background is a gentle gradient of one hue from top to bottom."""
    background = pixels[:, :1].astype(int)
    return np.abs(pixels.astype(int) - background).max(axis=2) > 25


def coloured(pixels: np.ndarray, colour: str) -> np.ndarray:
    """Where a hue prevails, however it is lit."""
    wanted = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)], float)
    shown = pixels.astype(float)
    cosine = shown @ wanted / np.maximum(np.linalg.norm(shown, axis=2) * np.linalg.norm(wanted), 1)
    return (cosine > 0.985) & (shown.max(axis=2) > 70)
