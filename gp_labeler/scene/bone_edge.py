"""The edge of bone on a slice, for points that are to stay on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gp_core.validation import FloatArray
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.scene.slices import VolumeSlicer

__all__ = ["BoneEdge", "nearest_on_segments"]


class BoneEdge:
    """Finds the point of the bone surface nearest to another within a slice; remembers the slice's edge.

    Parameters
    ----------
    source : VolumeSlicer
        The scan.
    plane : SlicePlane
        Which way it is cut.
    threshold : float
        Where bone begins.
    """

    def __init__(self, source: VolumeSlicer, plane: SlicePlane, threshold: float) -> None:
        self.source, self.plane, self.threshold = source, plane, threshold
        self._position = self._snapped = float("nan")
        self._segments = np.empty((0, 2, 2))

    def nearest(self, point: ArrayLike, within_mm: float) -> FloatArray | None:
        """Return the (3,) point of bone's edge nearest to a (3,) scan position, on the slice nearest to it.

        None where there is none within so many mm.
        """
        scan = np.asarray(point, dtype=np.float64).reshape(1, 3)
        self._cut(self.plane.position_of(scan))
        flat = self.plane.flat(scan)[0]
        found = nearest_on_segments(flat, self._segments)
        if found is None or np.linalg.norm(found - flat) > within_mm:
            return None
        edge: FloatArray = self.plane.scan(found[None], self._position)[0]
        return edge

    def _cut(self, position: float) -> None:
        if abs(position - self._position) < 1e-9:
            return
        snapped = self.source.snap(self.plane, position)
        if snapped != self._snapped:
            self._snapped = snapped
            image = self.source.image(self.plane, position)
            self._position, self._segments = image.position, image.outline(self.threshold)


def nearest_on_segments(point: FloatArray, segments: FloatArray) -> FloatArray | None:
    """Return the (2,) point of (M, 2, 2) line segments nearest to another, or None where there are none."""
    if not len(segments):
        return None
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    length = np.einsum("ij,ij->i", along, along)
    part = np.einsum("ij,ij->i", point - start, along) / np.where(length > 0, length, 1.0)
    feet = start + part.clip(0, 1)[:, None] * along
    nearest: FloatArray = feet[int(np.linalg.norm(feet - point, axis=1).argmin())]
    return nearest
