"""A plane that parts a head into its left and its right half, and mirror images in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gp_core.validation import FloatArray

__all__ = ["MidPlane", "hemisphere"]


@dataclass(frozen=True, eq=False)
class MidPlane:
    """The plane of all points p with ``normal @ p == offset``.

    Parameters
    ----------
    normal : (3,) array_like
        Made a unit vector.
    offset : float
        Distance from the origin along the normal, mm.
    """

    normal: FloatArray
    offset: float

    def __post_init__(self) -> None:
        normal = np.array(self.normal, dtype=np.float64)
        length = float(np.linalg.norm(normal))
        object.__setattr__(self, "normal", normal / length)
        object.__setattr__(self, "offset", float(self.offset) / length)

    @classmethod
    def through(cls, point: ArrayLike, normal: ArrayLike) -> MidPlane:
        """Make the plane through a point (3,), mm."""
        n = np.asarray(normal, dtype=np.float64)
        n = n / np.linalg.norm(n)
        return cls(n, float(n @ np.asarray(point)))

    def heights(self, points: FloatArray) -> FloatArray:
        """Return the signed distances (N,) of points (N, 3), mm."""
        heights: FloatArray = points @ self.normal - self.offset
        return heights

    def mirrored(self, points: FloatArray) -> FloatArray:
        """Return the mirror images of points (N, 3)."""
        return points - 2 * self.heights(points)[:, None] * self.normal

    def nearest(self, point: FloatArray) -> FloatArray:
        """Return the point (3,) of the plane that is nearest to a point (3,)."""
        return point - float(self.normal @ point - self.offset) * self.normal

    def angle_to_deg(self, other: MidPlane) -> float:
        """Return the angle between two planes, 0 to 90 degrees."""
        return float(np.degrees(np.arccos(min(1.0, abs(float(self.normal @ other.normal))))))


def hemisphere(n: int) -> FloatArray:
    """Return n unit vectors (n, 3), evenly spread over half a sphere."""
    i = np.arange(n) + 0.5
    z = i / n
    turn = np.pi * (1 + np.sqrt(5)) * i
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)
