"""Text of the window: its font, its size, and how much room it takes.

How to write a widget whose words are never cut
-----------------------------------------------
1. Leave the size of anything that holds words to its layout: a label, button, check box or combo box is as
   wide as its text, and a label made with ``wrap=True`` (`panels.parts.text_label`) as high.
2. Where a width must be set (a field for a number, a column that lines up with another), state it in words,
   never in pixels, and `fit` it, so that it follows the font and the text size: ::

       fit(field, lambda: field.setFixedWidth(text_width(field, "-1000.00") + pixels(field, 16)))

3. Sizes that are not text but belong beside it (an icon, a chip, a bar, the height of a row) are given at the
   normal text size and scaled with `pixels`, inside a `fit` rule.
4. Whatever paints words itself takes its font from `font_of`, and reports a `sizeHint` in `text_width` and
   `line_height`.
5. Only file names and what a user typed may be shortened: with `panels.parts.ElidedLabel` or `elided`, which
   keep the whole in a tooltip.
6. A row of buttons that may not fit goes into a `panels.flow.FlowLayout`, which wraps.

``tests/labeler/views/test_cut_words.py`` walks over every panel and dialog and names each word that is cut.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from qtpy.QtCore import QEvent, QObject, Qt
from qtpy.QtGui import QFont, QFontDatabase, QFontInfo, QFontMetricsF
from qtpy.QtWidgets import QApplication, QWidget

from gp_labeler.views.typeface import FAMILY, font_files

__all__ = [
    "BIG",
    "CAPTION",
    "HEADING",
    "TEXT",
    "TEXT_SIZES",
    "TITLE",
    "base_font",
    "desktop_scale",
    "elided",
    "families",
    "family",
    "field_width",
    "fit",
    "font_of",
    "heading_width",
    "line_height",
    "nearest_text_size",
    "pixels",
    "set_text_scale",
    "styled",
    "text_scale",
    "text_width",
    "use_family",
]

CAPTION, TEXT, HEADING, TITLE, BIG = 12, 13, 14, 18, 26
"""Heights of text, logical pixels at the normal size."""

TEXT_SIZES = (85, 100, 115, 130, 150, 175, 200)
"""What View > Text size offers, percent."""

_FALLBACKS = ("Inter", "Segoe UI", "SF Pro Text", "Noto Sans", "DejaVu Sans")
_DESKTOP_PX = 40 / 3
"""Text of 10 points at 96 dots an inch: what most desktops begin with."""
_LARGEST_SCALE = 2.0
_FIELD_PADDING, _HEADING_PADDING = 22, 28
"""Frame, padding and cursor of a field, and margins of a heading, as the style sheet has them."""
_PROPERTY, _STYLE = "gpTextScale", "gpTextStyle"

_state: dict[str, str] = {}


def family() -> str:
    """Return the family that text is drawn in."""
    return _state.get("family", FAMILY)


def families() -> list[str]:
    """Return the family that text is drawn in, and what stands in where it is not there."""
    return [family(), *_FALLBACKS]


def use_family(name: str | None) -> None:
    """Draw text in another installed family, None for the program's own; apply the theme afterwards."""
    _state.pop("family", None)
    if name is not None:
        _state["family"] = name


def base_font(scale: float = 1.0) -> QFont:
    """Return the font of all text that says nothing else.

    Parameters
    ----------
    scale : float
        Text size, 1 for normal.
    """
    _load()
    font = QFont()
    font.setFamilies(families())
    font.setPixelSize(round(TEXT * scale))
    return font


def desktop_scale() -> float:
    """Return how much larger than usual the desktop's own text is; 1 where it is smaller."""
    system = QFontInfo(QFontDatabase.systemFont(QFontDatabase.SystemFont.GeneralFont))
    return min(max(system.pixelSize() / _DESKTOP_PX, 1.0), _LARGEST_SCALE)


def nearest_text_size(percent: float, *, step: int = 0) -> int:
    """Return the text size nearest to a percentage, or so many steps above or below it."""
    nearest = min(range(len(TEXT_SIZES)), key=lambda n: abs(TEXT_SIZES[n] - percent))
    return TEXT_SIZES[min(max(nearest + step, 0), len(TEXT_SIZES) - 1)]


def set_text_scale(target: QObject, scale: float) -> None:
    """Say how large the text of a window, with all that it opens, is drawn; 1 is normal."""
    target.setProperty(_PROPERTY, float(scale))


def text_scale(widget: QWidget | None) -> float:
    """Return how large text is drawn in a widget: as its window says, or the one that opened it."""
    while widget is not None:
        window = widget.window()
        scale = window.property(_PROPERTY)
        if scale is not None:
            return float(scale)
        widget = window.parentWidget()
    app = QApplication.instance()
    scale = app.property(_PROPERTY) if app is not None else None
    return 1.0 if scale is None else float(scale)


def font_of(widget: QWidget | None, size: float = TEXT, *, bold: bool = False) -> QFont:
    """Return the font that a widget paints with.

    Parameters
    ----------
    widget : QWidget or None
        Whose text size holds.
    size : float
        Logical pixels at the normal text size, such as `TEXT`.
    bold : bool
    """
    font = base_font()
    font.setPixelSize(_height(widget, size))
    font.setBold(bold)
    return font


def pixels(widget: QWidget | None, size: float) -> int:
    """Return a length, logical pixels at the normal text size, as it is at the widget's."""
    return round(size * text_scale(widget))


def text_width(widget: QWidget | None, *texts: str, size: float = TEXT, bold: bool = False) -> int:
    """Return the width of the longest of some texts, logical pixels, rounded up."""
    _load()
    return _text_width(texts, family(), _height(widget, size), bold)


def _height(widget: QWidget | None, size: float) -> int:
    return max(round(size * text_scale(widget)), 1)


@lru_cache(4096)
def _text_width(texts: tuple[str, ...], _: str, height: int, bold: bool) -> int:
    """Measure once what is painted again and again: codes, headings, states."""
    font = base_font()
    font.setPixelSize(height)
    font.setBold(bold)
    metrics = QFontMetricsF(font)
    return int(max((metrics.horizontalAdvance(text) for text in texts), default=0.0) + 1)


def field_width(widget: QWidget | None, *texts: str) -> int:
    """Return the width of an entry field in which the longest of some texts can be read, logical pixels."""
    return text_width(widget, *texts) + _FIELD_PADDING


def heading_width(widget: QWidget | None, text: str) -> int:
    """Return the width of a column in which its heading can be read, logical pixels."""
    return text_width(widget, text) + _HEADING_PADDING if text else 0


def line_height(widget: QWidget | None, size: float = TEXT) -> int:
    """Return the height of a line of text, logical pixels, rounded up."""
    return int(QFontMetricsF(font_of(widget, size)).height() + 1)


def elided(font: QFont, words: str, width: float, *, middle: bool = True) -> str:
    """Shorten a file name or what a user typed; whoever shows it keeps the whole in a tooltip."""
    where = Qt.TextElideMode.ElideMiddle if middle else Qt.TextElideMode.ElideRight
    return QFontMetricsF(font).elidedText(words, where, width)


def fit(widget: QWidget, rule: Callable[[], object]) -> None:
    """Apply a rule now, and again whenever the widget's font or text size changes.

    Parameters
    ----------
    widget : QWidget
        Whose text it depends on.
    rule : callable
        Sets sizes from `text_width`, `line_height` and `pixels`.
    """
    _Fitter(widget, rule)
    rule()


def styled(widget: QWidget, size: float, *, bold: bool = False, rest: str = "") -> None:
    """Write a widget's words in a size, logical pixels at the normal text size; `rest` is further style."""
    is_new = widget.property(_STYLE) is None
    widget.setProperty(_STYLE, [float(size), 600 if bold else 400, rest])
    if is_new:
        fit(widget, lambda: _restyle(widget))
    else:
        _restyle(widget)


def _restyle(widget: QWidget) -> None:
    size, weight, rest = widget.property(_STYLE)
    sheet = f"font-size: {pixels(widget, size)}px; font-weight: {weight:.0f}; {rest}"
    if widget.styleSheet() != sheet:  # to restyle takes its time, and tells of a change again
        widget.setStyleSheet(sheet)


class _Fitter(QObject):
    """Watches for what changes the room that text takes."""

    _CHANGES = frozenset({QEvent.Type.FontChange, QEvent.Type.StyleChange, QEvent.Type.Polish})

    def __init__(self, widget: QWidget, rule: Callable[[], object]) -> None:
        super().__init__(widget)
        self._rule, self._is_at_it = rule, False
        widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802 - Qt's name
        if event.type() in self._CHANGES and not self._is_at_it:  # a rule may itself change the font
            self._is_at_it = True
            self._rule()
            self._is_at_it = False
            if isinstance(watched, QWidget):
                watched.updateGeometry()
        return False


def _load() -> None:
    """Give Qt the font files, once for each application."""
    app: Any = QApplication.instance()
    if app is not None and not app.property("gpFontsLoaded"):
        app.setProperty("gpFontsLoaded", True)
        for path in font_files():
            QFontDatabase.addApplicationFont(str(path))
