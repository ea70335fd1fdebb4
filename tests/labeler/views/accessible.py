"""What people need who have no mouse, no sharp eyes or no screen: names, a focus that shows, contrast."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import NamedTuple

import numpy as np
import qtpy
from qtpy.QtCore import QPoint, QRect, QRectF, Qt
from qtpy.QtGui import QFontInfo, QFontMetricsF, QImage, QPainter, QRegion
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
from replaced_methods import replaced
from window_cases import image_bytes

from gp_labeler.scene.colours import contrast
from gp_labeler.views.main_window import MainWindow
from gp_labeler.views.theme import DARK, THEMES, Theme, apply_theme

__all__ = ["WORD_CONTRAST", "Walk", "contrast_of", "menu_words", "painted_words", "words_of"]

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
FOCUS_CONTRAST, WORD_CONTRAST = 3.0, 4.5
"""Web Content Accessibility Guidelines 2.2, criteria 2.4.13 and 1.4.3, level AA for words of any size."""

LARGE = 150
"""A text size, percent, that a dialog has to follow."""

_SCALE = 3
"""How much larger words are drawn to see their colour: at their own size most pixels are half covered."""

_NO_ROLES = ("", "NoRole", "Client", "Window")
_CARET = 120
"""Pixels, more than the caret of a field has: so many at least make a focus visible."""


def controls(root: QWidget) -> list[QWidget]:
    """Return what can be worked with as it is shown now; the inside of Qt's own widgets is Qt's."""
    return [
        widget
        for widget in root.findChildren(QWidget)
        if widget.isVisible()
        and (isinstance(widget, _CONTROLS) or widget.focusPolicy() != Qt.FocusPolicy.NoFocus)
        and not isinstance(widget, QHeaderView | QLabel | QScrollBar)
        and not widget.objectName().startswith("qt_")
        and widget.metaObject().className() != "QTableCornerButton"  # qt_… only from Qt 6.11 on
    ]


def spoken(widget: QWidget) -> str:
    """Return the name that a screen reader says."""
    QAccessible = import_module("PySide6.QtGui").QAccessible
    interface = QAccessible.queryAccessibleInterface(widget)
    return interface.text(QAccessible.Text.Name).strip() if interface else ""


def role_of(widget: QWidget) -> str:
    """Return what a screen reader calls it, such as ``Button``."""
    QAccessible = import_module("PySide6.QtGui").QAccessible
    interface = QAccessible.queryAccessibleInterface(widget)
    return interface.role().name if interface else ""


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


def _seen_part(widget: QWidget, root: QWidget, box: QRect | None = None) -> QRect:
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

    As many pixels as half its outline has change at least that much: those of a caret are too few. It is 21
    for a widget that is not seen, as one that a job has hidden by its end.
    """
    box = _seen_part(widget, root)
    if box.isEmpty():
        return 21.0
    root.setFocus()
    QApplication.processEvents()
    before = _luminance(_pixels(root, box))
    widget.setFocus(Qt.FocusReason.TabFocusReason)
    QApplication.processEvents()
    if not widget.hasFocus() and not widget.isVisible():
        return 21.0
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
        box = _seen_part(self.widget, root, self.box)
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
        if widget.isVisible() and any(map(str.isalnum, words := _text(widget))):
            yield Words(_kind(widget), words, widget, _room(widget))


def _text(widget: QWidget) -> str:
    if isinstance(widget, QLabel):
        return widget.text() if widget.pixmap().isNull() else ""
    if isinstance(widget, QAbstractButton):
        return widget.text() if type(widget).__module__.startswith(("PySide6", "PyQt6")) else ""
    if isinstance(widget, QLineEdit):  # of what is selected, the ground is another
        return "" if widget.hasSelectedText() else widget.text() or widget.placeholderText()
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
    return inner if isinstance(widget, QAbstractButton | QLineEdit | QPlainTextEdit) else None


@contextmanager
def _drawing() -> Iterator[list[Words]]:
    """Gather what widgets draw themselves, of this program and of Qt's tables, in the meantime."""
    texts: list[Words] = []
    draw = QPainter.drawText

    def drawn(painter: QPainter, *args: object, **options: object) -> object:
        device = painter.device()
        if isinstance(device, QWidget) and any(map(str.isalnum, str(args[-1]))):
            kind = (type(device.parent() or device).__name__, painter.pen().color().name(), painter.opacity())
            texts.append(Words(kind, str(args[-1]), device, _box(painter, args)))
        return draw(painter, *args, **options)

    with replaced(QPainter, "drawText", drawn):
        yield texts


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


def contrast_of(root: QWidget) -> float:
    """Return the contrast of the words of a window that holds one text only."""
    return _contrast(_pixels(root, root.rect().adjusted(5, 3, -5, -3), _SCALE))


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


class Walk:
    """Looks at each state of a window once, at what is new in it in each theme, and keeps what it finds."""

    def __init__(self, window: MainWindow) -> None:
        self.window = window
        self.found: dict[str, set[str]] = defaultdict(set)
        self.seen: set[tuple[object, ...]] = set()

    def look(self, state: str, root: QWidget) -> None:
        """Look at a state; a dialog keeps the look in which it was looked at last."""
        if not root.isActiveWindow():
            root.window().activateWindow()
            QApplication.processEvents()
        for widget in controls(root) if qtpy.PYSIDE6 else ():  # PyQt6 has nothing that says the names
            name = spoken(widget)
            if sum(map(str.isalnum, name)) < 2:
                self.found["names"].add(f"{state}: {type(widget).__name__} {name!r}")
            if role_of(widget) in _NO_ROLES:
                self.found["roles"].add(f"{state}: {type(widget).__name__}")
        focusable = [each for each in _focusable(root) if self._is_new(_focus_kind(each))]
        words = [each for each in words_of(root) if self._is_new(each.kind)]
        painted = {each.words for each in painted_words(root) if self._is_new(each.kind)}
        if focusable or words or painted:
            for theme in THEMES.values():
                self._show(root, theme)
                again = [each for each in painted_words(root) if each.words in painted] if painted else []
                self._look_in(f"{state}, {theme.name}", root, focusable, [*words, *again])
            if not self._is_dialog(root):
                self.window.set_theme("dark")
        if self._is_dialog(root):
            self._enlarge(state, root)

    def _is_dialog(self, root: QWidget) -> bool:
        return root.isWindow() and root is not self.window

    def _show(self, root: QWidget, theme: Theme) -> None:
        """Show a theme: in the whole window, or in a dialog alone, which is quicker."""
        if self._is_dialog(root):
            apply_theme(root, theme)
        elif self.window.theme_name != theme.name:
            self.window.set_theme(theme.name)
        QApplication.processEvents()

    def _look_in(self, state: str, root: QWidget, focusable: list[QWidget], words: list[Words]) -> None:
        for each in words:
            ratio = each.contrast(root)
            if ratio < WORD_CONTRAST:
                self.found["words"].add(f"{state}: {each.words!r} {each.kind} {ratio:.1f}")
        for widget in focusable:
            ratio = focus_contrast(widget, root)
            if ratio < FOCUS_CONTRAST:
                self.found["focus"].add(f"{state}: {_focus_kind(widget)} {ratio:.1f}")

    def _enlarge(self, state: str, root: QWidget) -> None:
        """Find words of a dialog that do not grow with the text size."""
        before = {each.widget: QFontInfo(each.widget.font()).pixelSize() for each in words_of(root)}
        apply_theme(root, DARK, text_scale=LARGE / 100)
        QApplication.processEvents()
        for widget, size in before.items():
            if QFontInfo(widget.font()).pixelSize() < 0.9 * LARGE / 100 * size:
                self.found["size"].add(f"{state}: {type(widget).__name__} {widget.property('role')}")

    def _is_new(self, kind: tuple[object, ...]) -> bool:
        is_new = kind not in self.seen
        self.seen.add(kind)
        return is_new


def _focusable(root: QWidget) -> list[QWidget]:
    policy = Qt.FocusPolicy.TabFocus
    return [each for each in controls(root) if each.isEnabled() and each.focusPolicy() & policy]


def _focus_kind(widget: QWidget) -> tuple[object, ...]:
    """Return what the look of the focus depends on."""
    looks = [widget.property("role"), widget.property("checked"), widget.styleSheet()]
    is_qt = type(widget).__module__.startswith(("PySide6", "PyQt6"))
    return ("focus", type(widget).__name__, *looks, "" if is_qt else widget.accessibleName())
