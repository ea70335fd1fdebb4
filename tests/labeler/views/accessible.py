"""What people need who have no mouse, no sharp eyes or no screen: names, a focus that shows, contrast."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
import pytest
from qtpy.QtCore import QPoint, QRect, QRectF, Qt
from qtpy.QtGui import QFontMetricsF, QImage, QPainter, QRegion
from qtpy.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QCheckBox,
    QComboBox,
    QHeaderView,
    QLabel,
    QLineEdit,
    QMenu,
    QPlainTextEdit,
    QRadioButton,
    QScrollArea,
    QScrollBar,
    QStyle,
    QStyleOptionButton,
    QTextEdit,
    QWidget,
)
from window_cases import image_bytes

from gp_labeler.scene.colours import contrast

__all__ = ["Words", "controls", "focus_contrast", "menu_words", "painted_words", "spoken", "words_of"]

_CONTROLS = (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QComboBox,
    QLineEdit,
    QPlainTextEdit,
    QTextEdit,
)
_SCALE = 3
"""How much larger words are drawn to see their colour: at their own size most pixels are half covered."""

_CARET = 120
"""Pixels, more than the caret of a field has: so many at least make a focus visible."""


def controls(root: QWidget) -> list[QWidget]:
    """Return what can be worked with as it is shown now; the inside of Qt's own widgets is Qt's."""
    return [
        widget
        for widget in root.findChildren(QWidget)
        if widget.isVisible()
        and (isinstance(widget, _CONTROLS) or widget.focusPolicy() != Qt.FocusPolicy.NoFocus)
        and not isinstance(widget, QHeaderView | QScrollBar)
        and not widget.objectName().startswith("qt_")
    ]


def spoken(widget: QWidget) -> str:
    """Return the name that a screen reader says."""
    QAccessible = pytest.importorskip("PySide6.QtGui").QAccessible  # PyQt6 does not give what answers it
    interface = QAccessible.queryAccessibleInterface(widget)
    return interface.text(QAccessible.Text.Name).strip() if interface else ""


# What is seen


def _pixels(root: QWidget, box: QRect, scale: int = 1) -> np.ndarray:
    """Draw a part of a window, so much larger than it is; (H, W) packed colours."""
    image = QImage(box.width() * scale, box.height() * scale, QImage.Format.Format_RGB32)
    image.fill(Qt.GlobalColor.magenta)
    painter = QPainter(image)
    painter.scale(scale, scale)
    root.render(painter, QPoint(), QRegion(box))
    painter.end()
    return image_bytes(image).view(np.uint32).reshape(image.height(), -1)[:, : image.width()] & 0xFFFFFF


def _in_sight(widget: QWidget, root: QWidget, box: QRect | None = None) -> QRect:
    """Scroll to a widget; return the part of it that is seen, in the root's coordinates."""
    parent = widget.parentWidget()
    while parent is not None and parent is not root:
        if isinstance(parent, QScrollArea) and parent.widget() is not None:
            parent.ensureWidgetVisible(widget, 4, 4)
        parent = parent.parentWidget()
    seen = widget.visibleRegion().boundingRect()
    seen = seen if box is None else seen.intersected(box)
    return QRect(widget.mapTo(root, seen.topLeft()), seen.size())


def _luminance(packed: np.ndarray) -> np.ndarray:
    c = np.stack([packed >> 16 & 255, packed >> 8 & 255, packed & 255], axis=-1) / 255
    return np.where(c <= 0.03928, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]


def focus_contrast(widget: QWidget, root: QWidget) -> float:
    """Return how well it is seen that a widget has the keyboard: the contrast of a pixel with and without.

    As many pixels as half its outline has change at least that much: those of a caret are too few.
    """
    box = _in_sight(widget, root)
    root.setFocus()
    QApplication.processEvents()
    before = _luminance(_pixels(root, box))
    widget.setFocus(Qt.FocusReason.TabFocusReason)
    QApplication.processEvents()
    after = _luminance(_pixels(root, box))
    ratio = (np.maximum(before, after) + 0.05) / (np.minimum(before, after) + 0.05)
    least = min(box.width() + box.height(), _CARET)
    return float(np.sort(ratio, axis=None)[-least])


# Words


class Words(NamedTuple):
    """Words of a window: what tells those of other colours apart, where they are, and their contrast."""

    kind: tuple[object, ...]
    words: str
    widget: QWidget
    box: QRect | None

    def contrast(self, root: QWidget) -> float:
        """Return the contrast of their colour with what they stand on; 21 where none is seen."""
        box = _in_sight(self.widget, root, self.box)
        return _contrast(_pixels(root, box, _SCALE)) if box.width() > 3 and box.height() > 3 else 21.0


def _contrast(pixels: np.ndarray) -> float:
    """Return the contrast of the two colours that most pixels have."""
    colours, counts = np.unique(pixels, return_counts=True)
    if len(colours) < 2:
        return 21.0
    ground, ink = (f"#{colour:06X}" for colour in colours[np.argsort(-counts)][:2])
    return contrast(ground, ink)


def words_of(root: QWidget) -> Iterator[Words]:
    """Yield the words of widgets that Qt draws."""
    for widget in root.findChildren(QWidget):
        if widget.isVisible() and (words := _text(widget)):
            yield Words(_kind(widget), words, widget, _room(widget))


def _text(widget: QWidget) -> str:
    if isinstance(widget, QLabel):
        return widget.text() if widget.pixmap().isNull() else ""
    if isinstance(widget, QAbstractButton):
        return widget.text() if type(widget).__module__.startswith("PySide6") else ""
    if isinstance(widget, QLineEdit):
        return widget.text() or widget.placeholderText()
    if isinstance(widget, QPlainTextEdit):
        return widget.toPlainText() or widget.placeholderText()
    return widget.currentText() if isinstance(widget, QComboBox) else ""


def _kind(widget: QWidget) -> tuple[object, ...]:
    """Return what the colours of a widget depend on."""
    on = widget.parentWidget()
    while on is not None and not on.property("role"):
        on = on.parentWidget()
    states = [widget.property("role"), widget.isEnabled(), widget.property("checked"), widget.styleSheet()]
    empty = not getattr(widget, "text", lambda: "")()
    return (type(widget).__name__, *states, empty, on and on.property("role"))


def _room(widget: QWidget) -> QRect | None:
    """Return where the words of a widget are, without its border, box and arrow."""
    if isinstance(widget, QCheckBox | QRadioButton):
        option = QStyleOptionButton()
        widget.initStyleOption(option)
        return widget.style().subElementRect(QStyle.SubElement.SE_CheckBoxContents, option, widget)
    inner = widget.rect().adjusted(6, 4, -6, -4)
    if isinstance(widget, QComboBox):
        return inner.adjusted(0, 0, -22, 0)
    if isinstance(widget, QAbstractButton) and not widget.icon().isNull():
        return inner.adjusted(widget.iconSize().width() + 8, 0, 0, 0)
    return inner if isinstance(widget, QAbstractButton | QLineEdit) else None


@contextmanager
def _drawing() -> Iterator[list[Words]]:
    """Gather what widgets draw themselves, of this program and of Qt's tables, in the meantime."""
    texts: list[Words] = []
    draw = QPainter.drawText

    def drawn(painter: QPainter, *args: object, **options: object) -> object:
        device = painter.device()
        if isinstance(device, QWidget) and str(args[-1]).strip():
            kind = (type(device.parent() or device).__name__, painter.pen().color().name(), painter.opacity())
            texts.append(Words(kind, str(args[-1]), device, _box(painter, args)))
        return draw(painter, *args, **options)

    QPainter.drawText = drawn  # type: ignore[method-assign]
    try:
        yield texts
    finally:
        QPainter.drawText = draw  # type: ignore[method-assign]


def _box(painter: QPainter, args: tuple[object, ...]) -> QRect:
    metrics, words, where = QFontMetricsF(painter.font()), str(args[-1]), args[0]
    if isinstance(where, QRectF | QRect):
        flags = args[1]
        box = metrics.boundingRect(QRectF(where), int(getattr(flags, "value", flags)), words)  # type: ignore[call-overload]
    else:
        box = metrics.boundingRect(words).translated(where)  # type: ignore[arg-type]
    return painter.transform().mapRect(box).toAlignedRect()


def painted_words(root: QWidget) -> list[Words]:
    """Return the words that widgets of a window paint themselves; those in the views have their own test."""
    with _drawing() as texts:
        root.grab()
    return [words for words in texts if type(words.widget).__name__ not in ("SceneView", "SliceView")]


def menu_words(menu: QMenu) -> Iterator[tuple[str, float]]:
    """Yield the entries of a menu, with their contrast as they are and where the keyboard is on them."""
    menu.ensurePolished()
    menu.resize(menu.sizeHint())
    for entry in menu.actions():
        if entry.isVisible() and not entry.isSeparator():
            for active in (None, entry):
                menu.setActiveAction(active)
                box = menu.actionGeometry(entry).adjusted(14, 4, -30, -4)
                yield entry.text(), _contrast(_pixels(menu, box, _SCALE))
    menu.setActiveAction(None)
