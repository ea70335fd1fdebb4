"""The camera of the 3D view: named viewpoints, rays through pixels, and the pixels of points.

Pixels are device pixels from the top left; whole numbers are their centres.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.vtkRenderingCore import vtkCamera

from gp_core.errors import GeometryError
from gp_core.validation import FloatArray, as_points, check_option
from gp_labeler.imaging.vtk_arrays import triple

__all__ = ["VIEWPOINTS", "SceneCamera", "Viewpoint"]

_DEGREES_PER_VIEW = 200.0
"""Turn of a drag across the whole view."""

_FIT = 1.08
_SCAN_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_SMALLEST_MM, _LARGEST_MM = 0.02, 5000.0


@dataclass(frozen=True)
class _Pose:
    """Where the eye is seen from the middle of the scene, and what is up (LPS)."""

    eye: tuple[float, float, float]
    up: tuple[float, float, float]


VIEWPOINTS: Mapping[str, _Pose] = MappingProxyType(
    {
        "A": _Pose((0, -1, 0), (0, 0, 1)),
        "P": _Pose((0, 1, 0), (0, 0, 1)),
        "L": _Pose((1, 0, 0), (0, 0, 1)),
        "R": _Pose((-1, 0, 0), (0, 0, 1)),
        "S": _Pose((0, 0, 1), (0, -1, 0)),
        "I": _Pose((0, 0, -1), (0, -1, 0)),
    }
)
"""Viewpoints by letter: from anterior, posterior, left, right, superior, inferior."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """The projection of one moment: scan positions to pixels and back.

    Parameters
    ----------
    matrix : (4, 4) float array
        From scan positions (mm) to clip coordinates, -1 to 1 from near to far.
    size : (2,) tuple of int
        Width and height of the view, pixels.
    """

    matrix: FloatArray
    size: tuple[int, int]

    def display(self, points: ArrayLike) -> FloatArray:
        """Return (N, 3), pixel right and down, and depth (-1 near to 1 far), of (N, 3) scan positions."""
        scan = as_points(points, "points", missing_allowed=True)
        clip = np.column_stack([scan, np.ones(len(scan))]) @ self.matrix.T
        ndc = clip[:, :3] / clip[:, 3:]
        width, height = self.size
        return np.stack(
            [(ndc[:, 0] + 1) * width / 2 - 0.5, (1 - ndc[:, 1]) * height / 2 - 0.5, ndc[:, 2]], axis=1
        )

    def scan(self, display: ArrayLike) -> FloatArray:
        """Return the (N, 3) scan positions, mm, of (N, 3) pixels and depths."""
        x, y, depth = np.asarray(display, dtype=np.float64).reshape(-1, 3).T
        width, height = self.size
        ndc = np.stack(
            [(x + 0.5) * 2 / width - 1, 1 - (y + 0.5) * 2 / height, depth, np.ones_like(depth)], axis=1
        )
        moved = np.linalg.solve(self.matrix, ndc.T).T
        points: FloatArray = moved[:, :3] / moved[:, 3:]
        return points

    def ray(self, x: float, y: float) -> tuple[FloatArray, FloatArray]:
        """Return the near end and the unit direction of the ray through a pixel, in the scan frame."""
        near, far = self.scan([[x, y, -1.0], [x, y, 1.0]])
        return near, (far - near) / np.linalg.norm(far - near)

    def pixel_sizes(self, points: ArrayLike) -> FloatArray:
        """Return how large a pixel is, (N,) mm, at (N, 3) scan positions."""
        beside = self.display(points) + np.array([1.0, 0.0, 0.0])
        sizes: FloatArray = np.linalg.norm(self.scan(beside) - np.asarray(points), axis=1)
        return sizes


class SceneCamera:
    """Moves a VTK camera; orthographic unless told otherwise, since lengths are judged on it.

    Parameters
    ----------
    camera : vtkCamera
        The camera that the renderers share.
    size : callable
        Returns the width and height of the view, pixels.
    """

    def __init__(self, camera: vtkCamera, size: Callable[[], tuple[int, int]]) -> None:
        self._camera = camera
        self._size = size
        camera.ParallelProjectionOn()

    @property
    def focus(self) -> FloatArray:
        """(3,) scan position in the middle of the view, about which it turns."""
        return np.array(self._camera.GetFocalPoint())

    @property
    def direction(self) -> FloatArray:
        """(3,) unit vector from the eye into the scene."""
        return np.array(self._camera.GetDirectionOfProjection())

    @property
    def up(self) -> FloatArray:
        """(3,) unit vector that points up on the screen."""
        return -self._axes()[1]

    @property
    def parallel(self) -> bool:
        """Whether the projection is orthographic."""
        return bool(self._camera.GetParallelProjection())

    @parallel.setter
    def parallel(self, value: bool) -> None:
        half = self._half_height()
        self._camera.SetParallelProjection(bool(value))
        self._scale(half)

    def viewpoint(self) -> Viewpoint:
        """Return the projection as it is now."""
        width, height = self._size()
        matrix = self._camera.GetCompositeProjectionTransformMatrix(width / height, -1, 1)
        return Viewpoint(
            np.array([matrix.GetElement(i, j) for i in range(4) for j in range(4)]).reshape(4, 4),
            (width, height),
        )

    def view_from(self, letter: str, axes: ArrayLike = _SCAN_AXES) -> None:
        """Look from ``A``, ``P``, ``L``, ``R``, ``S`` or ``I`` at what is in the middle now.

        Parameters
        ----------
        letter : str
            See `VIEWPOINTS`.
        axes : (3, 3) array_like
            Columns: left, posterior and superior; by default those of the scan.

        Raises
        ------
        GpError
            Another letter.
        """
        check_option(letter, "viewpoint", VIEWPOINTS)
        frame = np.asarray(axes, dtype=np.float64)
        self.look(-frame @ VIEWPOINTS[letter].eye, frame @ VIEWPOINTS[letter].up)

    def look(self, direction: ArrayLike, up: ArrayLike) -> None:
        """Look along a direction at what is in the middle now, with `up` upwards."""
        self._camera.SetPosition(triple(self.focus - np.asarray(direction) * self._camera.GetDistance()))
        self._camera.SetViewUp(triple(up))
        self._camera.OrthogonalizeViewUp()

    def fit(self, points: ArrayLike) -> None:
        """Show all of (N, 3) scan positions, mm, from where the eye looks now."""
        scan = as_points(points, "points")
        right, down = self._axes()
        axes = np.stack([right, down, -self.direction])
        seen = scan @ axes.T
        middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
        self._aim(middle @ axes)
        across, along, nearer = (seen - middle).T
        width, height = self._size()
        growth = 0.0 if self.parallel else self._slope  # in perspective, what is nearer is larger
        half = np.maximum(np.abs(across) * height / width, np.abs(along)) + growth * nearer
        self._scale(float(half.max()) * _FIT)

    @property
    def across_mm(self) -> float:
        """How much is seen from top to bottom, at the depth of the middle, mm."""
        return 2 * self._half_height()

    def focus_on(self, point: ArrayLike, *, across_mm: float | None = None) -> None:
        """Bring a (3,) scan position to the middle; show `across_mm` from top to bottom where given."""
        self._aim(np.asarray(point, dtype=np.float64))
        if across_mm is not None:
            self._scale(across_mm / 2)

    def rotate(self, dx: float, dy: float) -> None:
        """Turn about the middle as a drag by so many pixels does."""
        width, height = self._size()
        self._camera.Azimuth(-dx * _DEGREES_PER_VIEW / width)
        self._camera.Elevation(dy * _DEGREES_PER_VIEW / height)
        self._camera.OrthogonalizeViewUp()

    def spin(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Turn in the plane of the screen as a drag round the middle does."""
        middle = (np.array(self._size()) - 1) / 2
        (x0, y0), (x1, y1) = start - middle, end - middle
        self._camera.Roll(float(np.degrees(np.arctan2(y0, x0) - np.arctan2(y1, x1))))
        self._camera.OrthogonalizeViewUp()

    def pan(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Shift the scene so that what was under one pixel (at the depth of the middle) is under another."""
        view = self.viewpoint()
        depth = view.display(self.focus[None])[0, 2]
        before, after = view.scan([[*start, depth], [*end, depth]])
        self._aim(self.focus + before - after)

    def zoom(self, factor: float) -> None:
        """Magnify what is in the middle."""
        self._scale(self._half_height() / factor)

    def state(self) -> dict[str, Any]:
        """Return the camera as plain numbers, for a session file or a script."""
        return {
            "position": list(self._camera.GetPosition()),
            "focus": list(self._camera.GetFocalPoint()),
            "up": list(self._camera.GetViewUp()),
            "half_height_mm": self._half_height(),
            "parallel": self.parallel,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Return to a state.

        Raises
        ------
        GeometryError
            It is not one.
        """
        try:
            numbers = [[float(n) for n in state[key]] for key in ("position", "focus", "up")]
            position, focus, up = as_points(numbers, "camera")
            half, parallel = float(state["half_height_mm"]), bool(state["parallel"])
        except (KeyError, TypeError, ValueError) as error:
            raise GeometryError(
                f"the camera state is damaged ({error!r})", remedy="Reset the view."
            ) from None
        direction = focus - position
        if not (np.linalg.norm(np.cross(direction, up)) > 0 and np.isfinite(half) and half > 0):
            raise GeometryError("the camera state looks nowhere", remedy="Reset the view.")
        self._camera.SetFocalPoint(triple(focus))
        self._camera.SetPosition(triple(position))
        self._camera.SetViewUp(triple(up))
        self._camera.SetParallelProjection(parallel)
        self._scale(half)

    def _axes(self) -> tuple[FloatArray, FloatArray]:
        """Screen right and down as unit vectors of the scan frame."""
        up = np.array(self._camera.GetViewUp())
        right = np.cross(self.direction, up)
        right /= np.linalg.norm(right)
        return right, np.cross(self.direction, right)

    def _aim(self, focus: FloatArray) -> None:
        self._camera.SetPosition(triple(np.array(self._camera.GetPosition()) + focus - self.focus))
        self._camera.SetFocalPoint(triple(focus))

    def _half_height(self) -> float:
        """Half of what is seen from top to bottom at the middle, mm."""
        if self.parallel:
            return float(self._camera.GetParallelScale())
        return float(self._camera.GetDistance() * self._slope)

    @property
    def _slope(self) -> float:
        """Half of what is seen from top to bottom, per distance from the eye, in perspective."""
        return float(np.tan(np.radians(self._camera.GetViewAngle()) / 2))

    def _scale(self, half_height: float) -> None:
        half = float(np.clip(half_height, _SMALLEST_MM / 2, _LARGEST_MM / 2))
        self._camera.SetParallelScale(half)
        self._camera.SetPosition(triple(self.focus - self.direction * (half / self._slope)))
