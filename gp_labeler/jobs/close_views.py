"""Close views of suggestions: the slices by which each is judged, made off the user's thread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gp_core.landmarks.features import Side, feature
from gp_core.validation import FloatArray
from gp_labeler.imaging.close_up import PICTURE_AXES, CloseUp
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.picture_page import bone_picture, grey_picture, picture_plane
from gp_labeler.jobs.runner import Progress

__all__ = ["ACROSS_MM", "CloseView", "DrawCloseViews", "PointToDraw"]

ACROSS_MM = 8.0
"""Width of a close view: all are at one scale."""

_PIXELS = 240
_ACROSS = {"axial": "coronal", "coronal": "axial", "sagittal": "axial"}
"""The second plane, which shows what lies before and behind the first."""


@dataclass(frozen=True)
class PointToDraw:
    """A suggestion whose close view is wanted: its side, its code, and its position, mm, scan frame."""

    side: Side
    code: str
    position: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class CloseView:
    """What is seen around one suggestion, which lies in the middle of both pictures.

    Parameters
    ----------
    names : (2,) tuple of str
        Such as ``coronal`` and ``axial``, or ``axial`` and ``from the left``, which shows bone.
    pictures : (2,) tuple of (pixels, pixels, 3) array
        RGB, 0 to 255.
    across_mm : float
        Their width.
    """

    names: tuple[str, str]
    pictures: tuple[NDArray[np.uint8], NDArray[np.uint8]]
    across_mm: float = ACROSS_MM


@dataclass(frozen=True, eq=False)
class DrawCloseViews:
    """Draw close views.

    Parameters
    ----------
    volume : Volume
        The scan.
    points : tuple of PointToDraw
        In the order in which they are drawn.
    rotation : (3, 3) array
        From the frame of the views into that of the scan: the pictures are as straight as the views.
    window : (float, float)
        Grey values that are black and white.
    threshold : float, optional
        Where bone begins; None where that is not known, so that slices alone are drawn.
    """

    volume: Volume
    points: tuple[PointToDraw, ...]
    rotation: FloatArray
    window: tuple[float, float]
    threshold: float | None

    @property
    def title(self) -> str:
        """What the user reads."""
        return "Drawing close views"

    def run(self, progress: Progress) -> dict[PointToDraw, CloseView]:
        """Draw them, each in the plane in which its feature is best seen; beside it what that cannot show."""
        load_modules("scipy.ndimage")
        found = {}
        for n, point in enumerate(self.points):
            progress(n / len(self.points))
            found[point] = self._drawn(point)
        return found

    def _drawn(self, point: PointToDraw) -> CloseView:
        row = feature(point.code)
        near = CloseUp(self.volume, point.position, ACROSS_MM, _PIXELS)
        plane = picture_plane(row)
        if row.view == "3D" and self.threshold is not None:
            axes = PICTURE_AXES[point.side.value]
            bone = bone_picture(near.bone(axes.turned(self.rotation), self.threshold))
            return CloseView((plane, axes.name), (self._slice(near, plane), _bytes(bone)))
        across = _ACROSS[plane]
        return CloseView((plane, across), (self._slice(near, plane), self._slice(near, across)))

    def _slice(self, near: CloseUp, look: str) -> NDArray[np.uint8]:
        return _bytes(grey_picture(near.slice(PICTURE_AXES[look].turned(self.rotation)), *self.window))


def _bytes(picture: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.ascontiguousarray((picture * 255).round().astype(np.uint8))
