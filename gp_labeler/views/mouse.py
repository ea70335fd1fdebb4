"""Qt's mouse and keys in the words of `scene.gestures`: device pixels, buttons, modifiers, notches, zoom."""

from __future__ import annotations

from qtpy.QtCore import QPointF, Qt
from qtpy.QtGui import QKeyEvent, QMouseEvent, QWheelEvent
from qtpy.QtWidgets import QWidget

from gp_labeler.scene.gestures import Button, Modifier

__all__ = ["button_of", "modifiers_of", "notches_of", "painted", "pixel_of", "zoom_of"]

_BUTTONS = {
    Qt.MouseButton.LeftButton: Button.LEFT,
    Qt.MouseButton.MiddleButton: Button.MIDDLE,
    Qt.MouseButton.RightButton: Button.RIGHT,
}
_MODIFIERS = {
    Qt.KeyboardModifier.ShiftModifier: Modifier.SHIFT,
    Qt.KeyboardModifier.ControlModifier: Modifier.CTRL,
    Qt.KeyboardModifier.AltModifier: Modifier.ALT,
}
_UNITS_PER_NOTCH = 120.0
_ZOOMS = {Qt.Key.Key_Plus: 1.25, Qt.Key.Key_Equal: 1.25, Qt.Key.Key_Minus: 0.8}
"""How much a key magnifies; plus and equals are one key on many keyboards."""


def pixel_of(widget: QWidget, position: QPointF) -> tuple[float, float]:
    """Return the device pixel (whole numbers are centres) under an event's position in a widget."""
    ratio = widget.devicePixelRatioF()
    return position.x() * ratio, position.y() * ratio


def painted(widget: QWidget, x: float, y: float) -> QPointF:
    """Return where a painter of the widget, in logical pixels, draws at a device pixel."""
    ratio = widget.devicePixelRatioF()
    return QPointF((x + 0.5) / ratio, (y + 0.5) / ratio)


def button_of(event: QMouseEvent) -> Button | None:
    """Return the button that an event is about; None for one without a meaning."""
    return _BUTTONS.get(event.button())


def modifiers_of(event: QMouseEvent | QWheelEvent | QKeyEvent) -> Modifier:
    """Return the keys held."""
    held = Modifier.NONE
    for key, modifier in _MODIFIERS.items():
        if event.modifiers() & key:
            held |= modifier
    return held


def notches_of(event: QWheelEvent) -> float:
    """Return how far the wheel was turned, away from the user positive; fractions on fine wheels."""
    turned = event.angleDelta()
    return float(turned.y() or turned.x()) / _UNITS_PER_NOTCH


def zoom_of(event: QKeyEvent) -> float | None:
    """Return how much a key magnifies what a view shows; None for a key that does not zoom."""
    return _ZOOMS.get(Qt.Key(event.key())) if modifiers_of(event) in (Modifier.NONE, Modifier.SHIFT) else None
