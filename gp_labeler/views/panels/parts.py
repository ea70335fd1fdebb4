"""Small parts that several panels are put together from."""

from __future__ import annotations

from types import MappingProxyType

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QLabel,
    QLayout,
    QScrollArea,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from gp_labeler.views.icons import icon_pixmap
from gp_labeler.views.theme import theme_of

__all__ = [
    "Card",
    "ElidedLabel",
    "Facts",
    "IconLabel",
    "Notice",
    "breakable",
    "emptied",
    "scrolled",
    "text_label",
]


def text_label(words: str = "", role: str = "", *, wrap: bool = False) -> QLabel:
    """Return a label in one of the looks of the style sheet; its text is never taken for markup."""
    label = QLabel(words)
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setWordWrap(wrap)
    if role:
        label.setProperty("role", role)
    return label


def emptied(layout: QLayout) -> None:
    """Take everything out of a layout, and do away with it."""
    while (item := layout.takeAt(0)) is not None:
        widget = item.widget()
        if widget is not None:
            widget.hide()
            widget.deleteLater()


def breakable(words: str) -> str:
    """Return words that a line may break inside paths and long file names."""
    return words.replace("/", "/" + _BREAK).replace("\\", "\\" + _BREAK).replace("_", "_" + _BREAK)


_BREAK = "\N{ZERO WIDTH SPACE}"
_LONGEST_WORD = 34


class ElidedLabel(QLabel):
    """One line that is shortened in its middle where there is no room; the whole is in its tool tip."""

    def __init__(self, words: str = "", role: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._words = words
        if role:
            self.setProperty("role", role)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.set_words(words)

    def set_words(self, words: str) -> None:
        """Show other words."""
        self._words = words
        self.setToolTip(words)
        self.setAccessibleName(words)
        self._shorten()

    def _shorten(self) -> None:
        middle = Qt.TextElideMode.ElideMiddle
        self.setText(self.fontMetrics().elidedText(self._words, middle, max(self.width() - 2, 40)))

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().resizeEvent(event)
        self._shorten()


def scrolled(content: QWidget) -> QScrollArea:
    """Return a scroll area that is as wide as what it holds allows, and scrolls up and down only."""
    area = QScrollArea()
    area.setWidgetResizable(True)
    area.setFrameShape(QFrame.Shape.NoFrame)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    area.setWidget(content)
    return area


class Card(QWidget):
    """A box with a heading.

    Parameters
    ----------
    heading : str
        What stands over it.
    """

    def __init__(self, heading: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("role", "card")
        self._layout = QVBoxLayout(self)
        self._layout.setContentsMargins(12, 8, 12, 12)
        self._layout.setSpacing(6)
        self.heading = text_label(heading, "heading")
        self._top = QHBoxLayout()
        self._top.addWidget(self.heading, 1)
        self._layout.addLayout(self._top)

    def add_to_heading(self, widget: QWidget) -> None:
        """Put something at the right of the heading."""
        self._top.addWidget(widget)

    def add(self, what: QWidget | QLayout) -> None:
        """Put something under what is there."""
        if isinstance(what, QLayout):
            self._layout.addLayout(what)
        else:
            self._layout.addWidget(what)


class Facts(QWidget):
    """Names with their values, one below the other; values can be selected and copied."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._layout = QVBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setSpacing(3)
        self.values: dict[str, QLabel] = {}

    def show_facts(self, facts: dict[str, str]) -> None:
        """Show these in place of those before."""
        emptied(self._layout)
        self.values = {}
        for name, value in facts.items():
            self._layout.addWidget(self._row(name, value))

    def _row(self, name: str, value: str) -> QWidget:
        row = QWidget()
        layout = QHBoxLayout(row)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(8)
        caption = text_label(name, "hint")
        caption.setFixedWidth(80)
        is_long = max(map(len, value.split()), default=0) > _LONGEST_WORD
        words = ElidedLabel(value) if is_long else text_label(value, wrap=True)
        words.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.values[name] = words
        layout.addWidget(caption, 0, Qt.AlignmentFlag.AlignTop)
        layout.addWidget(words, 1)
        return row


class IconLabel(QLabel):
    """An icon in a colour of the theme, which it follows.

    Parameters
    ----------
    name : str
        The icon.
    colour : str
        Name of a field of `Theme`, such as ``warning``.
    size : int
        Logical pixels.
    """

    def __init__(self, name: str, colour: str, size: int = 16, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._name, self._colour, self._size = name, colour, size
        self.setFixedSize(size, size)

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().changeEvent(event)
        if event.type() is QEvent.Type.StyleChange:
            self.take_theme()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802 - Qt's name
        self.take_theme()
        super().resizeEvent(event)

    def take_theme(self) -> None:
        """Draw it in the colour of the theme that is in effect."""
        colour = getattr(theme_of(self), self._colour)
        self.setPixmap(icon_pixmap(self._name, colour, self._size, self.devicePixelRatioF()))


_LOOKS = MappingProxyType(
    {
        "error": ("error", "danger"),
        "warning": ("warning", "warning"),
        "info": ("info", "accent_text"),
        "good": ("check", "good"),
    }
)


class Notice(QWidget):
    """One finding: an icon and a sentence, and what to do about it beneath.

    Parameters
    ----------
    level : str
        ``error``, ``warning``, ``info`` or ``good``.
    words, remedy : str
        What is said.
    """

    def __init__(self, level: str, words: str, remedy: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        name, colour = _LOOKS[level]
        self.level, self.words = level, words
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(8)
        row.addWidget(IconLabel(name, colour, 16), 0, Qt.AlignmentFlag.AlignTop)
        column = QVBoxLayout()
        column.setSpacing(1)
        column.addWidget(text_label(breakable(words), wrap=True))
        if remedy:
            column.addWidget(text_label(breakable(remedy), "hint", wrap=True))
        row.addLayout(column, 1)
