"""Mouse gestures as 3D Slicer has them, without Qt, so that every display behaves alike.

Left drag rotates (Ctrl: spins), middle or Shift and left drag pans, right drag and the wheel zoom.
Positions are device pixels from the top left.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, Flag, auto
from typing import Protocol

from gp_labeler.scene.slice_viewport import SliceViewport

__all__ = ["Button", "CameraControl", "DragMode", "Modifier", "SliceControl", "Turnable", "drag_of"]

CLICK_PIXELS = 4.0
"""A press and release nearer than this is a click, not a drag."""

_ZOOM_PER_PIXEL = 1.008
_ZOOM_PER_NOTCH = 1.15


class Button(Enum):
    """A mouse button."""

    LEFT = auto()
    MIDDLE = auto()
    RIGHT = auto()


class Modifier(Flag):
    """Keys held while the mouse is used."""

    NONE = 0
    SHIFT = auto()
    CTRL = auto()
    ALT = auto()


class DragMode(Enum):
    """What a drag does to a view."""

    NONE = auto()
    ROTATE = auto()
    SPIN = auto()
    PAN = auto()
    ZOOM = auto()


def drag_of(button: Button, modifiers: Modifier = Modifier.NONE) -> DragMode:
    """Return what dragging with a button means."""
    if button is Button.RIGHT:
        return DragMode.ZOOM
    if button is Button.MIDDLE or Modifier.SHIFT in modifiers:
        return DragMode.PAN
    return DragMode.SPIN if Modifier.CTRL in modifiers else DragMode.ROTATE


class Turnable(Protocol):
    """What `CameraControl` moves (`gp_labeler.scene.camera.SceneCamera` is one)."""

    def rotate(self, dx: float, dy: float) -> None: ...  # noqa: D102
    def spin(self, start: tuple[float, float], end: tuple[float, float]) -> None: ...  # noqa: D102
    def pan(self, start: tuple[float, float], end: tuple[float, float]) -> None: ...  # noqa: D102
    def zoom(self, factor: float) -> None: ...  # noqa: D102


@dataclass
class _Gesture:
    """The drag that is going on."""

    drag: DragMode = DragMode.NONE
    start: tuple[float, float] = (0.0, 0.0)
    last: tuple[float, float] = (0.0, 0.0)
    is_click: bool = False

    def begin(self, drag: DragMode, x: float, y: float) -> None:
        self.drag, self.start, self.last, self.is_click = drag, (x, y), (x, y), True

    def step(self, x: float, y: float) -> tuple[float, float]:
        """Go on to (x, y), and return by how much."""
        dx, dy = x - self.last[0], y - self.last[1]
        self.last = (x, y)
        if max(abs(x - self.start[0]), abs(y - self.start[1])) >= CLICK_PIXELS:
            self.is_click = False
        return dx, dy


class CameraControl:
    """Turns presses, moves and wheel notches into camera movements.

    Parameters
    ----------
    camera : SceneCamera
        What is moved.
    """

    def __init__(self, camera: Turnable) -> None:
        self._camera = camera
        self._gesture = _Gesture()

    def press(self, button: Button, x: float, y: float, modifiers: Modifier = Modifier.NONE) -> None:
        """Take a press of a button."""
        self._gesture.begin(drag_of(button, modifiers), x, y)

    def move(self, x: float, y: float) -> bool:
        """Take a movement; return whether the view has changed and must be drawn."""
        gesture = self._gesture
        if gesture.drag is DragMode.NONE:
            return False
        before = gesture.start if gesture.is_click else gesture.last
        gesture.step(x, y)
        if gesture.is_click:
            return False  # a hand that trembles while it clicks does not turn the head
        dx, dy = x - before[0], y - before[1]
        if gesture.drag is DragMode.ROTATE:
            self._camera.rotate(dx, dy)
        elif gesture.drag is DragMode.SPIN:
            self._camera.spin(before, (x, y))
        elif gesture.drag is DragMode.PAN:
            self._camera.pan(before, (x, y))
        else:
            self._camera.zoom(_ZOOM_PER_PIXEL ** (-dy))
        return True

    def release(self, x: float, y: float) -> bool:
        """Take a release; return whether the whole was a click, which left the camera as it was."""
        self.move(x, y)
        clicked = self._gesture.drag is not DragMode.NONE and self._gesture.is_click
        self.cancel()
        return clicked

    def cancel(self) -> None:
        """Forget the drag that is going on, as when the mouse is taken away."""
        self._gesture = _Gesture()

    def wheel(self, notches: float) -> bool:
        """Take a turn of the wheel, away from the user positive; return whether the view has changed."""
        self._camera.zoom(_ZOOM_PER_NOTCH**notches)
        return notches != 0


class SliceControl:
    """Turns presses, moves and wheel notches over a slice into new views; not by plain left drags."""

    def __init__(self) -> None:
        self._gesture = _Gesture()

    def press(self, button: Button, x: float, y: float, modifiers: Modifier = Modifier.NONE) -> bool:
        """Take a press; return whether its drag is one that moves the view."""
        drag = drag_of(button, modifiers)
        self._gesture.begin(drag if drag in (DragMode.PAN, DragMode.ZOOM) else DragMode.NONE, x, y)
        return self._gesture.drag is not DragMode.NONE

    def move(self, view: SliceViewport, x: float, y: float) -> SliceViewport:
        """Take a movement; return the view that follows from it (the same where nothing changes)."""
        dx, dy = self._gesture.step(x, y)
        if self._gesture.drag is DragMode.PAN:
            return view.panned(dx, dy)
        if self._gesture.drag is DragMode.ZOOM and dy:
            return view.zoomed(_ZOOM_PER_PIXEL ** (-dy), about=self._gesture.start)
        return view

    def release(self, x: float, y: float) -> bool:
        """Take a release; return whether the whole was a click."""
        self._gesture.step(x, y)
        clicked = self._gesture.is_click
        self._gesture = _Gesture()
        return clicked

    def wheel(
        self, view: SliceViewport, notches: float, x: float, y: float, modifiers: Modifier, step: float
    ) -> SliceViewport:
        """Take a turn of the wheel: slices of `step` mm, or with Ctrl zoom about the pointer."""
        if Modifier.CTRL in modifiers:
            return view.zoomed(_ZOOM_PER_NOTCH**notches, about=(x, y))
        return view.at(view.position + notches * step)
