"""Bringing a scan position before the eye as a hand does: scroll to its slice, zoom, turn the bone."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.scene.planes import Plane
from gp_labeler.scripting.events import turn_wheel
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["aim_at_bone", "scroll_to"]

_PIXELS_PER_VOXEL = 5.0
"""A click is exact to a pixel: zoom until that is a small part of a voxel."""

_ZOOM_PER_NOTCH = 1.15
_MARGIN = 12.0
_TRIES = 2
"""A crosshair between two slices makes the first turn of the wheel half a slice too long or short."""

_NEAR_VOXELS = 0.6
"""A click on bone that lands nearer than this to the aim has found it."""


def scroll_to(driver: WindowDriver, plane: Plane, aim: FloatArray) -> None:
    """Turn the wheel until the slice nearest to a (3,) scan position is shown, and seen closely enough."""
    view = driver.view(plane.value)
    for _ in range(_TRIES):
        steps = _slices_to(driver, plane, aim)
        turn_wheel(view, view.width() // 2, view.height() // 2, steps)
    x, y = view.pixel_at(aim)
    if not (_MARGIN <= x < view.width() - _MARGIN and _MARGIN <= y < view.height() - _MARGIN):
        view.go_to(_on_slice(driver, plane, aim))
        x, y = view.pixel_at(aim)
    turn_wheel(view, x, y, _notches(view.shown.mm_per_pixel, driver), ctrl=True)  # type: ignore[union-attr]


def aim_at_bone(driver: WindowDriver, aim: FloatArray, *, turn: bool) -> bool:
    """Bring a (3,) scan position to the middle of the 3D view, closely; return whether a click would hit it.

    Parameters
    ----------
    driver : WindowDriver
        The window.
    aim : (3,) float array, mm
        Where to click.
    turn : bool
        Whether to look from another side where that is better; the camera stays where none is.
    """
    view = driver.view("3d")
    camera = driver.scene.scene.camera
    before = camera.state()
    camera.focus_on(aim)
    size = float(camera.viewpoint().pixel_sizes(aim[None])[0])
    middle = view.rect().center()
    turn_wheel(view, middle.x(), middle.y(), _notches(size, driver))
    looks = list(_directions(driver.workspace.view.frame.axes)) if turn else [(camera.direction, camera.up)]
    misses = []
    for look in looks:
        camera.look(*look)
        misses.append(_miss(driver, aim))
    best = int(np.argmin(misses))
    if misses[best] > _NEAR_VOXELS * driver.voxel:
        camera.restore(before)
        return False
    camera.look(*looks[best])
    driver.scene.redraw()
    return True


def _slices_to(driver: WindowDriver, plane: Plane, aim: FloatArray) -> int:
    """Return how many slices lie between the one shown and the one nearest to the aim."""
    view = driver.window.grid.slice_views[plane]
    source, shown = view.source, view.slice_plane
    assert source is not None
    here, there = (source.snap(shown, shown.position_of(p)) for p in (driver.workspace.view.crosshair, aim))
    return round((there - here) / source.step(shown))


def _notches(mm_per_pixel: float, driver: WindowDriver) -> int:
    wanted = driver.voxel / _PIXELS_PER_VOXEL
    return max(0, math.ceil(math.log(mm_per_pixel / wanted) / math.log(_ZOOM_PER_NOTCH)))


def _on_slice(driver: WindowDriver, plane: Plane, aim: FloatArray) -> FloatArray:
    """Return the position over `aim` on the slice that is shown: panning does not scroll."""
    shown = driver.window.grid.slice_views[plane].slice_plane
    return shown.moved_to(aim, shown.position_of(driver.workspace.view.crosshair))


def _miss(driver: WindowDriver, aim: FloatArray) -> float:
    """Return how far from the aim a click would land, mm."""
    x, y = driver.scene.scene.display_of(aim[None])[0]
    hit = driver.scene.scene.pick(round(x), round(y))
    return math.inf if hit is None else float(np.linalg.norm(hit.point - aim))


def _directions(axes: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Directions to look in, along axes, edges and corners of a cube, each with what is up."""
    for corner in product((-1.0, 0.0, 1.0), repeat=3):
        if any(corner):
            direction = np.array(corner) / np.linalg.norm(corner)
            up = np.array([0.0, -1.0, 0.0] if abs(direction[2]) > 0.95 else [0.0, 0.0, 1.0])
            yield axes @ direction, axes @ up
