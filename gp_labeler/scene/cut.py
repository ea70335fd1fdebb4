"""A plane that cuts bone open, so that what lies behind it is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonDataModel import vtkPlane

from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import triple

__all__ = ["CutPlane"]


@dataclass(frozen=True)
class CutPlane:
    """Keeps what lies on one side of a plane.

    Parameters
    ----------
    origin : (3,) tuple of float
        A point of the plane, scan frame, mm.
    normal : (3,) tuple of float
        Unit vector towards what is kept.
    """

    origin: tuple[float, float, float]
    normal: tuple[float, float, float]

    def depth(self, points: ArrayLike) -> FloatArray:
        """Return how far (..., 3) scan positions lie on the side that is kept, mm; negative beyond it."""
        depth: FloatArray = (np.asarray(points, dtype=np.float64) - self.origin) @ np.asarray(self.normal)
        return depth

    def keeps(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Return which of (..., 3) scan positions are on the side that is kept."""
        return np.asarray(self.depth(points) >= 0)

    def crossing(self, origin: ArrayLike, direction: ArrayLike) -> float:
        """Return where a ray goes through the plane, in lengths of its direction; NaN where it never does."""
        along = float(np.asarray(direction, dtype=np.float64) @ np.asarray(self.normal))
        return -float(self.depth(origin)) / along if along else float("nan")

    def kept_part(self, start: ArrayLike, end: ArrayLike) -> tuple[FloatArray, FloatArray] | None:
        """Return the ends of the part of a straight line that is kept, or None."""
        first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        seen = self.keeps(np.stack([first, last]))
        if not seen.any():
            return None
        if seen.all():
            return first, last
        there = first + self.crossing(first, last - first) * (last - first)
        return (first, there) if seen[0] else (there, last)

    def to_vtk(self) -> vtkPlane:
        """Return the plane as VTK's mappers take it."""
        plane = vtkPlane()
        plane.SetOrigin(triple(self.origin))
        plane.SetNormal(triple(self.normal))
        return plane
