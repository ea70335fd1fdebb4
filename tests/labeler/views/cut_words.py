"""Names every word that cannot be read in full: cut, covered, shortened, or off the screen.

`cut_words` looks at everything a window holds: labels, buttons, check boxes, fields, combo boxes, tabs, group
titles, heads and cells of tables, menus, and whatever a widget paints itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import combinations
from typing import NamedTuple

import numpy as np
from qtpy.QtCore import QPointF, QRect, QRectF, QSize, Qt
from qtpy.QtGui import QFontMetricsF, QPainter
from qtpy.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractScrollArea,
    QApplication,
    QComboBox,
    QGroupBox,
    QHeaderView,
    QLabel,
    QLineEdit,
    QMenu,
    QMenuBar,
    QPlainTextEdit,
    QStyle,
    QStyleOptionComboBox,
    QStyleOptionGroupBox,
    QTabBar,
    QToolButton,
    QWidget,
)
from replaced_methods import replaced

from gp_labeler.views.painting import name_tags
from gp_labeler.views.panels.number_field import NumberField
from gp_labeler.views.panels.parts import ElidedLabel

__all__ = ["cut_words"]

_SLACK = 1.5
"""Logical pixels: metrics are rounded, and a letter's box has some air about it."""

_BREAK = "\N{ZERO WIDTH SPACE}"


def cut_words(root: QWidget, *, own: Iterable[str] = (), screen: tuple[int, int] | None = None) -> list[str]:
    """Return a line for each word below `root` that cannot be read in full.

    Parameters
    ----------
    root : QWidget
        A window, dialog or panel that is shown.
    own : iterable of str
        File names and what a user typed: texts that hold one of them may be shortened, with the whole in a
        tooltip.
    screen : (2,) int, optional
        Size of the screen, logical pixels, that windows and menus have to fit.
    """
    for _ in range(4):  # layouts inside layouts take a turn each
        QApplication.processEvents()
    own = tuple(own)
    with _placed() as names:
        texts, shortened = _all_painted(root)
    found = [line for widget in _shown(root) for line in _cut_in(widget, own, root)]
    found += [*_covered(root), *_names_in_views(names)]
    found += [line for page in texts for line in _painted_badly(page)]
    found += [f"shortened: {words!r} to {short!r}" for words, short in shortened if not _is_own(words, own)]
    if screen is not None:
        found += _off_screen(root, screen)
    return sorted(set(found))


# Widgets


def _shown(root: QWidget) -> list[QWidget]:
    return [
        w for w in (root, *root.findChildren(QWidget)) if w.isVisible() and not w.visibleRegion().isEmpty()
    ]


def _cut_in(widget: QWidget, own: tuple[str, ...], root: QWidget) -> Iterator[str]:
    for kind, check in _CHECKS:
        if isinstance(widget, kind):
            yield from (f"{type(widget).__name__}: {line}" for line in check(widget, own))
    if _words_of(widget) and not _is_reachable(widget, root):
        yield f"{type(widget).__name__}: {_words_of(widget)!r} lies outside of what holds it"


def _label(label: QLabel, own: tuple[str, ...]) -> Iterator[str]:
    if not label.text() or not label.pixmap().isNull():
        return
    if isinstance(label, ElidedLabel):
        if label.text() != label.words:
            if label.words not in label.toolTip():
                yield f"{label.text()!r} has not the whole in its tooltip"
            if not _is_own(label.words, own):
                yield f"{label.words!r} is shortened to {label.text()!r}"
        return
    room, metrics = label.contentsRect(), QFontMetricsF(label.font())
    if label.wordWrap():
        parts = label.text().replace(_BREAK, " ").split()
        need = label.heightForWidth(label.width())
        if label.height() + _SLACK < need:
            yield f"{label.text()!r} is {label.height()} high, needs {need}"
    else:
        parts = label.text().splitlines()
        if room.height() + 3 < metrics.height() * len(parts):
            yield f"{label.text()!r} is {room.height()} high, needs {metrics.height() * len(parts):.0f}"
    wide = max((metrics.horizontalAdvance(part) for part in parts), default=0)
    if room.width() + _SLACK < wide:
        yield f"{label.text()!r} is {room.width()} wide, needs {wide:.0f}"


def _button(button: QAbstractButton, own: tuple[str, ...]) -> Iterator[str]:
    if isinstance(button, QToolButton) and button.toolButtonStyle() is Qt.ToolButtonStyle.ToolButtonIconOnly:
        return
    if not button.text():
        return
    hint = button.sizeHint()
    if button.width() + _SLACK < hint.width():
        words = QFontMetricsF(button.font()).horizontalAdvance(button.text())
        if not (_is_own(button.toolTip(), own) and words < button.width()):
            yield f"{button.text()!r} is {button.width()} wide, needs {hint.width()}"
    if button.height() + _SLACK < min(hint.height(), QFontMetricsF(button.font()).height()):
        yield f"{button.text()!r} is {button.height()} high, needs {hint.height()}"


def _combo(combo: QComboBox, own: tuple[str, ...]) -> Iterator[str]:
    option = QStyleOptionComboBox()
    option.initFrom(combo)  # PyQt6 protects `initStyleOption` of boxes that Qt made
    option.editable, option.frame = combo.isEditable(), combo.hasFrame()
    part = QStyle.SubControl.SC_ComboBoxEditField
    room = combo.style().subControlRect(QStyle.ComplexControl.CC_ComboBox, option, part, combo).width()
    metrics = QFontMetricsF(combo.font())
    for text in (*(combo.itemText(n) for n in range(combo.count())), combo.placeholderText()):
        if metrics.horizontalAdvance(text) > room + _SLACK and not _is_own(text, own):
            yield f"{text!r} is {room} wide, needs {metrics.horizontalAdvance(text):.0f}"


def _field(field: QLineEdit, own: tuple[str, ...]) -> Iterator[str]:
    room = field.width() - 18
    metrics = QFontMetricsF(field.font())
    texts = [field.placeholderText()] if not field.text() else []
    if isinstance(field, NumberField):
        texts.append(field.text())
    for text in texts:
        if metrics.horizontalAdvance(text) > room + _SLACK:
            yield f"{text!r} is {room} wide, needs {metrics.horizontalAdvance(text):.0f}"
    if field.height() + _SLACK < metrics.height():
        yield f"{field.accessibleName()!r} is {field.height()} high"


def _text(edit: QPlainTextEdit, own: tuple[str, ...]) -> Iterator[str]:
    text, room = edit.placeholderText(), edit.viewport().rect().adjusted(4, 4, -4, -4)
    flags = Qt.TextFlag.TextWordWrap
    if text and not edit.toPlainText():
        need = QFontMetricsF(edit.font()).boundingRect(QRectF(room), flags, text)
        if need.height() > room.height() + _SLACK or need.width() > room.width() + _SLACK:
            yield f"{text!r} needs {_size(need)}, has {_size(room)}"


def _header(header: QHeaderView, own: tuple[str, ...]) -> Iterator[str]:
    model = header.model()
    if header.orientation() is Qt.Orientation.Vertical or model is None:
        return
    for n in range(header.count()):
        text = str(model.headerData(n, Qt.Orientation.Horizontal) or "")
        need = header.sectionSizeHint(n)
        if text and not header.isSectionHidden(n) and header.sectionSize(n) + _SLACK < need:
            yield f"head {text!r} is {header.sectionSize(n)} wide, needs {need}"
    if header.height() + _SLACK < QFontMetricsF(header.font()).height():
        yield f"head is {header.height()} high"


def _view(view: QAbstractItemView, own: tuple[str, ...]) -> Iterator[str]:
    if isinstance(view, QHeaderView):  # shows no cells, and has a check of its own
        return
    if type(view.itemDelegate()).__module__.startswith("gp_labeler"):
        return  # it paints its words itself, and these are looked at
    model = view.model()
    for row in range(model.rowCount()):
        index = model.index(row, 0)
        room = view.visualRect(index)
        need = view.sizeHintForIndex(index)
        if need.height() > room.height() + _SLACK:
            yield f"row {index.data()!r} is {room.height()} high, needs {need.height()}"


def _tabs(bar: QTabBar, own: tuple[str, ...]) -> Iterator[str]:
    metrics = QFontMetricsF(bar.font())
    for n in range(bar.count()):
        if metrics.horizontalAdvance(bar.tabText(n)) > bar.tabRect(n).width() - 8:
            yield f"tab {bar.tabText(n)!r} is {bar.tabRect(n).width()} wide"


def _group(group: QGroupBox, own: tuple[str, ...]) -> Iterator[str]:
    option = QStyleOptionGroupBox()
    group.initStyleOption(option)
    part = QStyle.SubControl.SC_GroupBoxLabel
    room = group.style().subControlRect(QStyle.ComplexControl.CC_GroupBox, option, part, group).width()
    if group.title() and QFontMetricsF(group.font()).horizontalAdvance(group.title()) > room + _SLACK:
        yield f"title {group.title()!r} is {room} wide"


def _menus(bar: QMenuBar, own: tuple[str, ...]) -> Iterator[str]:
    for entry in bar.actions():
        if entry.isVisible() and not bar.rect().contains(bar.actionGeometry(entry)):
            yield f"{entry.text()!r} has no room in the bar"


_CHECKS: tuple[tuple[type, Callable[..., Iterator[str]]], ...] = (
    (QLabel, _label),
    (QAbstractButton, _button),
    (QComboBox, _combo),
    (QLineEdit, _field),
    (QPlainTextEdit, _text),
    (QHeaderView, _header),
    (QAbstractItemView, _view),
    (QTabBar, _tabs),
    (QGroupBox, _group),
    (QMenuBar, _menus),
)


def _words_of(widget: QWidget) -> str:
    if isinstance(widget, QLabel):
        return widget.text() if widget.pixmap().isNull() else ""
    if isinstance(widget, QAbstractButton):
        return widget.text() or widget.accessibleName()
    if isinstance(widget, QLineEdit):
        return widget.placeholderText() or widget.text()
    return widget.title() if isinstance(widget, QGroupBox) else ""


def _is_reachable(widget: QWidget, root: QWidget) -> bool:
    """Whether a widget lies within all that hold it; scroll areas may hide it above and below."""
    box, parent = QRectF(widget.rect()), widget
    while parent is not root and parent.parentWidget() is not None:
        box.translate(QPointF(parent.pos()))
        parent = parent.parentWidget()
        area = parent.parentWidget()
        room = QRectF(parent.rect()).adjusted(-_SLACK, -_SLACK, _SLACK, _SLACK)
        is_viewport = isinstance(area, QAbstractScrollArea) and area.viewport() is parent
        if is_viewport and area.verticalScrollBar().maximum() > 0:
            box.setHeight(min(box.height(), room.height()))
            box.moveTop(min(max(box.top(), room.top()), room.bottom() - box.height()))
        if not room.contains(box):
            return False
        box = box.intersected(QRectF(parent.rect()))
    return True


def _covered(root: QWidget) -> Iterator[str]:
    """Yield pairs of widgets with words of which one lies on the other."""
    boxes = []
    for widget in _shown(root):
        if _words_of(widget):
            seen: QRect = widget.visibleRegion().boundingRect()
            if seen.isEmpty():
                continue
            seen.translate(widget.mapTo(root, seen.topLeft()) - seen.topLeft())
            boxes.append((widget, seen))
    for (one, first), (other, second) in combinations(boxes, 2):
        if one.isAncestorOf(other) or other.isAncestorOf(one):
            continue
        both = first.intersected(second)
        if both.width() > 2 and both.height() > 2:
            yield f"{_words_of(one)!r} and {_words_of(other)!r} lie on each other"


def _size(thing: QWidget | QRect | QSize) -> tuple[int, int]:
    return thing.width(), thing.height()


def _off_screen(root: QWidget, screen: tuple[int, int]) -> Iterator[str]:
    width, height = screen
    if root.isWindow() and (root.width() > width or root.height() > height):
        yield f"{type(root).__name__} {_size(root)} does not fit a screen of {screen}"
    for menu in root.findChildren(QMenu):
        size = menu.sizeHint()
        if size.width() > width or size.height() > height:
            yield f"menu {menu.title()!r} {_size(size)} does not fit a screen of {screen}"


# What widgets paint


class _Text(NamedTuple):
    """A text as it was painted: its letters, the room given to it, and all that there is; logical pixels."""

    device: str
    words: str
    box: QRectF
    room: QRectF | None
    whole: QRectF


@contextmanager
def _painted() -> Iterator[tuple[list[_Text], list[tuple[str, str]]]]:
    """Gather what is painted, and what is shortened, in the meantime."""
    texts: list[_Text] = []
    shortened: list[tuple[str, str]] = []
    draw, shorten = QPainter.drawText, QFontMetricsF.elidedText

    def drawn(painter: QPainter, *args: object, **options: object) -> object:
        if (text := _text_of(painter, args)) is not None:
            texts.append(text)
        return draw(painter, *args, **options)

    def short(metrics: QFontMetricsF, words: str, *args: object) -> str:
        result = shorten(metrics, words, *args)
        if result != words:
            shortened.append((words, result))
        return result

    with replaced(QPainter, "drawText", drawn), replaced(QFontMetricsF, "elidedText", short):
        yield texts, shortened


def _all_painted(root: QWidget) -> tuple[list[list[_Text]], list[tuple[str, str]]]:
    """Paint everything, also what has to be scrolled to; return the texts of each time, and what was cut."""
    seen, shortened = [], []
    areas = [area for area in root.findChildren(QAbstractScrollArea) if area.isVisible()]
    n_pages = 1 + max((_pages(area) for area in areas), default=0)
    before = [area.verticalScrollBar().value() for area in areas]
    for page in range(n_pages):
        for area in areas:
            area.verticalScrollBar().setValue(page * area.viewport().height())
        with _painted() as (texts, short):
            root.grab()
        seen.append(texts)
        shortened += short
    for area, value in zip(areas, before, strict=True):
        area.verticalScrollBar().setValue(value)
    return seen, shortened


def _pages(area: QAbstractScrollArea) -> int:
    bar, height = area.verticalScrollBar(), max(area.viewport().height(), 1)
    return 0 if isinstance(area, QAbstractItemView) else -(-bar.maximum() // height)


def _text_of(painter: QPainter, args: tuple[object, ...]) -> _Text | None:
    device, where, words = painter.device(), args[0], str(args[-1])
    if not isinstance(device, QWidget) or not words.strip():
        return None
    metrics, move = QFontMetricsF(painter.font()), painter.transform()
    whole = QRectF(device.rect())
    if painter.hasClipping():
        whole = whole.intersected(move.mapRect(painter.clipBoundingRect()))
    name = f"{type(device.parent() or device).__name__} {id(device)}"
    if isinstance(where, QRectF | QRect):
        room, flags = QRectF(where), args[1]
        assert isinstance(flags, Qt.AlignmentFlag | Qt.TextFlag | int) or flags is not None
        wrap = bool(int(getattr(flags, "value", flags)) & int(Qt.TextFlag.TextWordWrap.value))
        if wrap:
            box = metrics.boundingRect(room, int(getattr(flags, "value", flags)), words)
        else:
            size = metrics.size(0, words)
            box = QRectF(room.left(), room.top(), metrics.horizontalAdvance(words), size.height())
            _align(box, room, int(getattr(flags, "value", flags)))
        return _Text(name, words, move.mapRect(box), move.mapRect(room), whole)
    box = metrics.tightBoundingRect(words).translated(QPointF(where))  # type: ignore[arg-type]
    return _Text(name, words, move.mapRect(box), None, whole)


def _align(box: QRectF, room: QRectF, flags: int) -> None:
    if flags & Qt.AlignmentFlag.AlignRight.value:
        box.moveRight(room.right())
    elif flags & Qt.AlignmentFlag.AlignHCenter.value:
        box.moveLeft(room.center().x() - box.width() / 2)
    if flags & Qt.AlignmentFlag.AlignBottom.value:
        box.moveBottom(room.bottom())
    elif flags & Qt.AlignmentFlag.AlignVCenter.value:
        box.moveTop(room.center().y() - box.height() / 2)


def _painted_badly(texts: list[_Text]) -> Iterator[str]:
    by_device: dict[str, list[_Text]] = {}
    for text in texts:
        by_device.setdefault(text.device, []).append(text)
        kind = text.device.split()[0]
        for room in filter(None, (text.room, text.whole)):
            if text.box.left() < room.left() - _SLACK or text.box.right() > room.right() + _SLACK:
                yield f"{kind} paints {text.words!r} {text.box.width():.0f} wide into {room.width():.0f}"
        if text.room is not None and text.box.height() > text.room.height() + 4:
            yield f"{kind} paints {text.words!r} {text.box.height():.0f} high into {text.room.height():.0f}"
    for kind, together in by_device.items():
        for one, other in combinations(together, 2):
            both = one.box.intersected(other.box)
            if one.words != other.words and both.width() > 2 and both.height() > 0.4 * one.box.height():
                yield f"{kind.split()[0]} paints {one.words!r} onto {other.words!r}"


# Names in the views


@contextmanager
def _placed() -> Iterator[list[tuple[np.ndarray, np.ndarray]]]:
    """Gather the boxes (left, top, right, bottom) of names that are placed in the views meanwhile."""
    placed, place = [], name_tags.place_labels

    def placing(marks: object, sizes: object, view: tuple[int, int], **options: object) -> object:
        corners, shown = place(marks, sizes, view, **options)
        size = np.asarray(sizes, dtype=float).reshape(-1, 2)
        placed.append((np.hstack([corners, corners + size])[shown], np.array(view)))
        return corners, shown

    name_tags.place_labels = placing
    try:
        yield placed
    finally:
        name_tags.place_labels = place


def _names_in_views(placed: Iterable[tuple[np.ndarray, np.ndarray]]) -> Iterator[str]:
    for boxes, view in placed:
        for box in boxes[((boxes[:, :2] < -_SLACK) | (boxes[:, 2:] > view + _SLACK)).any(axis=1)]:
            yield f"a name at {box.round().tolist()} is cut by the edge of a view of {view.tolist()}"


def _is_own(words: str, own: tuple[str, ...]) -> bool:
    return any(name and name in words for name in own)
