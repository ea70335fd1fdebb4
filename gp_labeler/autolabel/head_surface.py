"""The surface of a known head's bone, as it is kept on disk."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.head_pose.bone import Bone

__all__ = ["HeadSurface"]


@dataclass(frozen=True, eq=False)
class HeadSurface:
    """Points on the bone of a head whose landmarks are known, in its own scan.

    Parameters
    ----------
    points : (N, 3) array, LPS mm
    centre : (3,) array, LPS mm
        Centroid of the bone.
    radius : float
        Root mean square distance of the bone from its centroid, mm.
    T_index_scan : (4, 4) array
        From LPS mm to an index (i, j, k) of the coarse scan.
    size : (3,) array of int
        Of the coarse scan, along i, j, k: what lies in it could have been seen.
    """

    points: FloatArray
    centre: FloatArray
    radius: float
    T_index_scan: FloatArray
    size: NDArray[np.intp]

    @classmethod
    def of(cls, bone: Bone) -> HeadSurface:
        """Make it of the bone found in a scan."""
        scan = bone.scan
        size = np.array(scan.grid.shape[::-1], dtype=np.intp)
        return cls(bone.points, bone.centre, bone.radius, scan.T_index_scan, size)

    @cached_property
    def tree(self) -> Any:
        """A search tree of the points."""
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    def inside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which points (N, 3), LPS mm, lie in its scan."""
        index = points @ self.T_index_scan[:3, :3].T + self.T_index_scan[:3, 3]
        there: NDArray[np.bool_] = np.all((index >= -0.5) & (index < self.size - 0.5), axis=1)
        return there

    def mirrored(self) -> HeadSurface:
        """Return its mirror image in x."""
        flip = np.diag([-1.0, 1.0, 1.0, 1.0])
        return HeadSurface(
            self.points * flip.diagonal()[:3],
            self.centre * flip.diagonal()[:3],
            self.radius,
            self.T_index_scan @ flip,
            self.size,
        )
