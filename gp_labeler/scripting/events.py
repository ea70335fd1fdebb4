"""Real events on real widgets: what a hand does with mouse and keys."""

from __future__ import annotations

from qtpy.QtCore import QEvent, QPoint, QPointF, Qt
from qtpy.QtGui import QKeySequence, QWheelEvent
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QWidget

from gp_core.errors import GpError

__all__ = ["click", "drag", "leave", "press_keys", "turn_wheel"]

_UNITS_PER_NOTCH = 120
_LEFT = Qt.MouseButton.LeftButton
_NO_KEYS = Qt.KeyboardModifier.NoModifier


def click(widget: QWidget, x: float, y: float, *, ctrl: bool = False) -> None:
    """Click with the left button at a logical pixel of a widget, Ctrl held or not.

    Raises
    ------
    GpError
        The pixel lies outside the widget.
    """
    held = Qt.KeyboardModifier.ControlModifier if ctrl else _NO_KEYS
    QTest.mouseClick(widget, _LEFT, held, _inside(widget, x, y))


def drag(widget: QWidget, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag with the left button from one logical pixel to another."""
    first, last = _inside(widget, *start), _inside(widget, *end)
    QTest.mousePress(widget, _LEFT, _NO_KEYS, first)
    for part in (0.3, 0.7, 1.0):
        QTest.mouseMove(widget, first + (last - first) * part)
    QTest.mouseRelease(widget, _LEFT, _NO_KEYS, last)


def turn_wheel(widget: QWidget, x: float, y: float, notches: int, *, ctrl: bool = False) -> None:
    """Turn the wheel over a logical pixel, away from the user positive, one event a notch."""
    here = QPointF(_inside(widget, x, y))
    held = Qt.KeyboardModifier.ControlModifier if ctrl else _NO_KEYS
    for _ in range(abs(notches)):
        turned = QPoint(0, _UNITS_PER_NOTCH if notches > 0 else -_UNITS_PER_NOTCH)
        event = QWheelEvent(
            here,
            widget.mapToGlobal(here),
            QPoint(),
            turned,
            Qt.MouseButton.NoButton,
            held,
            Qt.ScrollPhase.NoScrollPhase,
            False,
        )
        QApplication.sendEvent(widget, event)


def leave(widget: QWidget) -> None:
    """Take the pointer away from a widget."""
    QApplication.sendEvent(widget, QEvent(QEvent.Type.Leave))


def press_keys(widget: QWidget, keys: str) -> None:
    """Press a combination of keys such as ``Ctrl+Z``, as Qt writes it.

    Raises
    ------
    GpError
        There is no such key.
    """
    sequence = QKeySequence(keys)
    first = sequence[0] if sequence.count() == 1 else None  # type: ignore[index]
    if first is None or first.key() == Qt.Key.Key_unknown:
        raise GpError(f"unknown keys {keys!r}", remedy="For example Ctrl+Z, Return, Space or Left.")
    QTest.keyClick(widget, first.key(), first.keyboardModifiers())


def _inside(widget: QWidget, x: float, y: float) -> QPoint:
    point = QPoint(int(x // 1), int(y // 1))
    if point.isNull():  # which QTest takes for the middle
        point = QPoint(1, 0)
    if not widget.rect().contains(point):
        raise GpError(
            f"pixel {point.x()}, {point.y()} lies outside the view, {widget.width()} x {widget.height()}",
            remedy="Bring it into view first: view, with go_to.",
        )
    return point
