"""Close views of suggestions: pictures by which each is judged and corrected, made off the user's thread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.landmarks.features import Side, feature
from gp_core.validation import FloatArray
from gp_labeler.imaging.close_up import PICTURE_AXES, CloseUp, PictureAxes
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.picture_page import bone_picture, grey_picture, picture_plane
from gp_labeler.jobs.runner import Progress

__all__ = ["ACROSS_MM", "PLANES", "ClosePicture", "DrawCloseViews", "PictureToDraw", "looks_of"]

ACROSS_MM = 8.0
"""Width of a close view: all are at one scale."""

_PIXELS = 240
_ACROSS = {"axial": "coronal", "coronal": "axial", "sagittal": "axial"}
"""The second plane, which shows what lies before and behind the first."""

PLANES = tuple(_ACROSS)
"""Pictures of these names are slices; the others show bone."""


def looks_of(side: Side, code: str, *, with_bone: bool) -> tuple[str, str]:
    """Return the two pictures that a close view has: names of planes, and the side from which bone is seen.

    Parameters
    ----------
    side : Side
    code : str
        A feature: first comes the plane in which it is best seen, then what that plane cannot show.
    with_bone : bool
        Whether it is known where bone begins, so that it can be shown.
    """
    row = feature(code)
    plane = picture_plane(row)
    return plane, side.value if row.view == "3D" and with_bone else _ACROSS[plane]


@dataclass(frozen=True)
class PictureToDraw:
    """A picture that is wanted.

    Parameters
    ----------
    side : Side
    code : str
        Of which feature.
    number : int
        Which of its two pictures, 0 or 1.
    centre : (3,) tuple of float, mm, scan frame
        What lies in the middle.
    """

    side: Side
    code: str
    number: int
    centre: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class ClosePicture:
    """A slice, or bone as seen from one side, and where in the scan each place of the picture lies.

    Parameters
    ----------
    rgb : (pixels, pixels, 3) array
        0 to 255.
    axes : PictureAxes
        How it lies in the scan, and its name.
    centre : (3,) tuple of float, mm, scan frame
        What lies in the middle.
    depths : (n, n) array, optional
        How far behind the middle the bone lies that is seen, mm, NaN where there is none; None for a slice.
    across_mm : float
        Width of the picture.
    """

    rgb: NDArray[np.uint8]
    axes: PictureAxes
    centre: tuple[float, float, float]
    depths: NDArray[np.float32] | None = None
    across_mm: float = ACROSS_MM

    @property
    def name(self) -> str:
        """Such as ``axial`` or ``from the left``."""
        return self.axes.name

    def position_at(self, across: float, down: float) -> FloatArray | None:
        """Return what is seen at a place of the picture, (3,) mm, scan frame.

        Parameters
        ----------
        across, down : float
            From the top left corner, 0 to 1 of the picture's width.

        Returns
        -------
        (3,) array, optional
            None outside the picture, and where it shows no bone.
        """
        if not (0 <= across < 1 and 0 <= down < 1):
            return None
        depth = 0.0
        if self.depths is not None:
            n = len(self.depths)
            depth = float(self.depths[int(down * n), int(across * n)])
        right, below = (across - 0.5) * self.across_mm, (down - 0.5) * self.across_mm
        seen: FloatArray = (
            np.asarray(self.centre)
            + right * np.asarray(self.axes.right)
            + below * np.asarray(self.axes.down)
            + depth * self.axes.away
        )
        return seen if np.isfinite(depth) else None

    def place_of(self, position: ArrayLike) -> tuple[float, float]:
        """Return where in the picture a (3,) scan position, mm, lies: across and down, 0 to 1 of it."""
        offset = np.asarray(position, dtype=np.float64) - self.centre
        across, down = (float(offset @ np.asarray(axis)) for axis in (self.axes.right, self.axes.down))
        return across / self.across_mm + 0.5, down / self.across_mm + 0.5

    def depth_of(self, position: ArrayLike) -> float:
        """Return how far behind the plane through the middle a (3,) scan position lies, mm."""
        return float((np.asarray(position, dtype=np.float64) - self.centre) @ self.axes.away)


@dataclass(frozen=True, eq=False)
class DrawCloseViews:
    """Draw pictures of close views.

    Parameters
    ----------
    volume : Volume
        The scan.
    pictures : tuple of PictureToDraw
        In the order in which they are drawn.
    rotation : (3, 3) array
        From the frame of the views into that of the scan: the pictures are as straight as the views.
    window : (float, float)
        Grey values that are black and white.
    threshold : float, optional
        Where bone begins; None where that is not known, so that slices alone are drawn.
    """

    volume: Volume
    pictures: tuple[PictureToDraw, ...]
    rotation: FloatArray
    window: tuple[float, float]
    threshold: float | None

    @property
    def title(self) -> str:
        """What the user reads."""
        return "Drawing close views"

    def run(self, progress: Progress) -> dict[PictureToDraw, ClosePicture]:
        """Draw them, each in the plane in which its feature is best seen; beside it what that cannot show."""
        load_modules("scipy.ndimage")
        found = {}
        for n, wanted in enumerate(self.pictures):
            progress(n / len(self.pictures))
            found[wanted] = self._drawn(wanted)
        return found

    def _drawn(self, wanted: PictureToDraw) -> ClosePicture:
        looks = looks_of(wanted.side, wanted.code, with_bone=self.threshold is not None)
        look = looks[wanted.number]
        axes = PICTURE_AXES[look].turned(self.rotation)
        if look not in PLANES and self.threshold is not None:
            near = CloseUp(self.volume, wanted.centre, ACROSS_MM, _PIXELS)
            depths = near.bone_depths(axes, self.threshold)
            return ClosePicture(_bytes(bone_picture(near.shaded(depths))), axes, wanted.centre, depths)
        near = CloseUp(self.volume, wanted.centre, ACROSS_MM, _PIXELS, only=axes)
        return ClosePicture(_bytes(grey_picture(near.slice(axes), *self.window)), axes, wanted.centre)


def _bytes(picture: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.ascontiguousarray((picture * 255).round().astype(np.uint8))
