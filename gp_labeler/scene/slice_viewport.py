"""What part of a slice a view shows, and the mouse that moves it.

Pixels are device pixels, counted from the top left; whole numbers are their centres, as mouse events give
them. A painter whose whole numbers are pixel corners adds half a pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from gp_core.validation import FloatArray
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.scene.slices import SliceImage, VolumeSlicer

__all__ = ["SliceViewport", "scale_bar_length"]

_FINEST, _COARSEST = 1e-4, 10.0
"""Limits of zoom, mm per pixel."""

_MARGIN = 1.06
_ROOM = 0.1
"""Around the points that a view is fitted to, over how long they are: soft tissue around bone."""


@dataclass(frozen=True, eq=False)
class SliceViewport:
    """A view of one plane: never changed in place, so a widget keeps the current one.

    Parameters
    ----------
    plane : SlicePlane
        Which plane: along the axes of the scan or not.
    position : float
        Where the slice is along the plane's normal, mm.
    centre : (2,) float array
        Coordinates right and down, mm, at the middle of the view.
    mm_per_pixel : float
        Zoom.
    size : (2,) tuple of int
        Width and height, pixels.
    """

    plane: SlicePlane
    position: float
    centre: FloatArray
    mm_per_pixel: float
    size: tuple[int, int]

    @classmethod
    def fitted(
        cls,
        source: VolumeSlicer,
        plane: SlicePlane,
        size: tuple[int, int],
        *,
        around: FloatArray | None = None,
    ) -> SliceViewport:
        """Make the view that shows the whole of the middle slice of a volume.

        Parameters
        ----------
        source : VolumeSlicer
        plane : SlicePlane
        size : (int, int)
            Width and height, pixels.
        around : (N, 3) array, mm, optional
            Show what lies over these points, as far as the slice reaches: that of a volume cut askew is
            mostly empty.
        """
        position = source.snap(plane, plane.position_of(source.corners.mean(axis=0)))
        outline = source.section(plane, position)
        low, high = outline.min(axis=0), outline.max(axis=0)
        if around is not None and len(around):
            flat = plane.flat(around)
            room = _ROOM * np.ptp(flat, axis=0).max()
            low = np.maximum(low, flat.min(axis=0) - room)
            high = np.minimum(high, flat.max(axis=0) + room)
        zoom = float(((high - low) / np.maximum(size, 1)).max()) * _MARGIN
        return cls(plane, position, (low + high) / 2, zoom, size)

    def scan_to_pixel(self, points: ArrayLike) -> FloatArray:
        """Return the (N, 2) pixels over which (N, 3) scan positions lie, on the slice or off it."""
        return self.flat_to_pixel(self.plane.flat(points))

    def flat_to_pixel(self, flat: ArrayLike) -> FloatArray:
        """Return the pixels of (..., 2) coordinates right and down, mm, such as outlines."""
        from_centre = (np.asarray(flat, dtype=np.float64) - self.centre) / self.mm_per_pixel
        pixels: FloatArray = from_centre + (np.array(self.size) - 1) / 2
        return pixels

    def pixel_to_scan(self, pixels: ArrayLike) -> FloatArray:
        """Return the (N, 3) scan positions, mm, on the slice under (N, 2) pixels."""
        from_centre = np.asarray(pixels, dtype=np.float64) - (np.array(self.size) - 1) / 2
        return self.plane.scan(from_centre * self.mm_per_pixel + self.centre, self.position)

    def off_slice(self, points: ArrayLike) -> FloatArray:
        """Return how far (N, 3) scan positions lie from the slice, mm, signed."""
        return self.plane.depth(points) - self.position

    def line_of(self, other: SlicePlane) -> FloatArray:
        """Return the (2,) unit direction, right and down, of the line in which a plane meets this one."""
        right, down = float(other.normal @ self.plane.right), float(other.normal @ self.plane.down)
        length = math.hypot(right, down)  # the line is at right angles to what the other normal shows here
        return np.array([-down, right]) / length if length else np.array([1.0, 0.0])

    def image_corners(self, image: SliceImage) -> FloatArray:
        """Return the (2, 2) painter's coordinates (corners of pixels) between which an image is stretched."""
        return self.flat_to_pixel(image.edges) + 0.5

    def zoomed(self, factor: float, about: ArrayLike | None = None) -> SliceViewport:
        """Return the view magnified, keeping what is under a pixel (the middle by default) where it is."""
        zoom = float(np.clip(self.mm_per_pixel / factor, _FINEST, _COARSEST))
        pixel = (np.array(self.size) - 1) / 2 if about is None else np.asarray(about, dtype=np.float64)
        offset = (pixel - (np.array(self.size) - 1) / 2) * (self.mm_per_pixel - zoom)
        return replace(self, mm_per_pixel=zoom, centre=self.centre + offset)

    def panned(self, dx: float, dy: float) -> SliceViewport:
        """Return the view with its content dragged by so many pixels."""
        return replace(self, centre=self.centre - np.array([dx, dy]) * self.mm_per_pixel)

    def resized(self, width: int, height: int) -> SliceViewport:
        """Return the view at another size, with the same middle and zoom."""
        return replace(self, size=(int(width), int(height)))

    def looks_like(self, other: SliceViewport) -> bool:
        """Whether it has the middle and the zoom of another view, of whatever slice and size."""
        return self.mm_per_pixel == other.mm_per_pixel and bool((self.centre == other.centre).all())

    def at(self, position: float) -> SliceViewport:
        """Return the view of the slice at another position, mm."""
        return replace(self, position=float(position))

    def centred(self, point: ArrayLike) -> SliceViewport:
        """Return the view with a (3,) scan position on its slice and in its middle."""
        scan = np.asarray(point, dtype=np.float64).reshape(1, 3)
        return replace(self, centre=self.plane.flat(scan)[0], position=self.plane.position_of(scan))

    def showing(self, point: ArrayLike, margin: float = 0.1) -> SliceViewport:
        """Return the view of the slice through a (3,) scan position, shifted only if that lies outside."""
        scan = np.asarray(point, dtype=np.float64).reshape(1, 3)
        there = self.at(self.plane.position_of(scan))
        pixel, size = there.scan_to_pixel(scan)[0], np.array(self.size)
        inside = ((pixel >= margin * size) & (pixel <= (1 - margin) * size)).all()
        return there if inside else there.centred(point)


def scale_bar_length(mm_per_pixel: float, longest_pixels: float) -> tuple[float, float]:
    """Return a round length in mm (1, 2 or 5 times a power of ten) and how many pixels it is.

    Parameters
    ----------
    mm_per_pixel : float
        Zoom.
    longest_pixels : float
        How long the bar may be.
    """
    longest = mm_per_pixel * longest_pixels
    power = 10.0 ** np.floor(np.log10(longest))
    length = float(max(f * power for f in (1.0, 2.0, 5.0) if f * power <= longest * (1 + 1e-9)))
    return length, length / mm_per_pixel
