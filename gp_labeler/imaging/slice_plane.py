"""The geometry of a slice view: where its slices lie in the scan, and how they lie on the screen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GeometryError
from gp_core.validation import FloatArray, as_points

__all__ = ["SlicePlane"]

_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class SlicePlane:
    """Parallel slices of any orientation; planes along the axes of the scan are a case of it.

    All of it is in the scan frame (LPS, mm). Positions of slices are counted along the normal, and
    coordinates within a slice along `right` and `down`, from the origin.

    Parameters
    ----------
    right, down : (3,) array_like
        Unit vectors that point right and down on the screen.
    normal : (3,) array_like
        Unit vector across the slices, towards higher positions. It may point to the viewer or away.
    origin : (3,) array_like
        Where all coordinates are 0.

    Raises
    ------
    GeometryError
        The three directions are not orthogonal unit vectors.

    Examples
    --------
    >>> plane = SlicePlane([1, 0, 0], [0, 1, 0], [0, 0, 1])
    >>> plane.flat([[3, 4, 5]]), plane.depth([[3, 4, 5]])
    (array([[3., 4.]]), array([5.]))
    """

    right: FloatArray
    down: FloatArray
    normal: FloatArray
    origin: FloatArray = (0.0, 0.0, 0.0)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        for name in ("right", "down", "normal", "origin"):
            vector = np.array(getattr(self, name), dtype=np.float64)
            vector.setflags(write=False)
            object.__setattr__(self, name, vector)
        axes = self.axes
        if axes.shape != (3, 3) or not np.abs(axes.T @ axes - np.eye(3)).max() < 1e-6:
            raise GeometryError("right, down and normal of a slice plane must be orthogonal unit vectors")

    @cached_property
    def axes(self) -> FloatArray:
        """(3, 3) columns: right, down and normal."""
        return np.stack([self.right, self.down, self.normal], axis=-1)

    @property
    def towards_viewer(self) -> FloatArray:
        """(3,) unit vector out of the screen."""
        return -np.cross(self.right, self.down)

    def flat(self, points: ArrayLike) -> FloatArray:
        """Return the (N, 2) coordinates right and down, mm, of (N, 3) scan positions."""
        scan = as_points(points, "points", missing_allowed=True) - self.origin
        flat: FloatArray = scan @ self.axes[:, :2]
        return flat

    def depth(self, points: ArrayLike) -> FloatArray:
        """Return the (N,) coordinates across the slices, mm, of (N, 3) scan positions."""
        depth: FloatArray = (as_points(points, "points", missing_allowed=True) - self.origin) @ self.normal
        return depth

    def position_of(self, point: ArrayLike) -> float:
        """Return the position of the slice through one (3,) scan position, mm."""
        return float(self.depth(np.reshape(point, (1, 3)))[0])

    def scan(self, flat: ArrayLike, position: float) -> FloatArray:
        """Return the (N, 3) scan positions of (N, 2) coordinates right and down at `position`, mm."""
        right, down = np.asarray(flat, dtype=np.float64).T
        points: FloatArray = (
            self.origin + right[:, None] * self.right + down[:, None] * self.down + position * self.normal
        )
        return points

    def moved_to(self, point: ArrayLike, position: float) -> FloatArray:
        """Return the (3,) scan position over `point` on the slice at `position`, mm."""
        scan = np.asarray(point, dtype=np.float64)
        moved: FloatArray = scan + (position - self.position_of(scan)) * self.normal
        return moved

    def rotated(self, axis: ArrayLike, angle: float, about: ArrayLike) -> SlicePlane:
        """Return the plane rotated about an axis (3,) through a point (3,); the angle in rad."""
        unit = np.asarray(axis, dtype=np.float64)
        from scipy.spatial.transform import Rotation  # takes long to import: not at start-up

        R = Rotation.from_rotvec(angle * unit / np.linalg.norm(unit)).as_matrix()
        right, down, normal = (R @ self._orthonormal()).T
        point = np.asarray(about, dtype=np.float64)
        return SlicePlane(right, down, normal, point + R @ (self.origin - point))

    def same_as(self, other: SlicePlane) -> bool:
        """Whether it is the same plane on the same screen."""
        return self is other or all(
            bool(np.abs(getattr(self, name) - getattr(other, name)).max() < _SAME)
            for name in ("right", "down", "normal", "origin")
        )

    def _orthonormal(self) -> FloatArray:
        """Return the axes cleaned of rounding, so that many small rotations do not add up."""
        right = self.right / np.linalg.norm(self.right)
        down = self.down - (self.down @ right) * right
        down = down / np.linalg.norm(down)
        across = np.cross(right, down)
        return np.stack([right, down, across if across @ self.normal > 0 else -across], axis=-1)
