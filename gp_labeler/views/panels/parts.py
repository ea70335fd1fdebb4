"""Small parts that several panels are put together from."""

from __future__ import annotations

from types import MappingProxyType

from qtpy.QtCore import QEvent, QObject, QSize, Qt
from qtpy.QtGui import QResizeEvent
from qtpy.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QLayout,
    QScrollArea,
    QSizePolicy,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from gp_labeler.views.fonts import elided, fit, line_height, pixels, text_width
from gp_labeler.views.formatting import capitalised
from gp_labeler.views.icons import icon_pixmap
from gp_labeler.views.layouts import in_column, in_row, placed
from gp_labeler.views.theme import theme_of

__all__ = [
    "Card",
    "ElidedLabel",
    "Facts",
    "IconLabel",
    "Notice",
    "Scrolled",
    "breakable",
    "column_of_captions",
    "emptied",
    "fix_headers",
    "keep_room",
    "lay_out_hidden",
    "open_at",
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
    """Take everything out of a layout, and delete it."""
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
_LEAST_NAME = 42
"""Of a name that is shortened, logical pixels."""


class ElidedLabel(QLabel):
    """A file name, or what a user typed: one line, shortened in its middle where there is no room.

    The whole is in its tool tip. Words of the program itself are never shortened: let them wrap.
    """

    def __init__(self, words: str = "", role: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._words = words
        if role:
            self.setProperty("role", role)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.setMinimumWidth(_LEAST_NAME)  # else a layout may leave it none
        self.set_words(words)

    @property
    def words(self) -> str:
        """The whole of what it says."""
        return self._words

    def set_words(self, words: str) -> None:
        """Show other words."""
        self._words = words
        self.setToolTip(words)
        self.setAccessibleName(words)
        self._shorten()

    def _shorten(self) -> None:
        self.setText(elided(self.font(), self._words, max(self.width(), _LEAST_NAME) - 2))

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().changeEvent(event)
        if event.type() in (QEvent.Type.FontChange, QEvent.Type.StyleChange):
            self._shorten()

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Return the room that the whole takes."""
        metrics = self.fontMetrics()
        return QSize(metrics.horizontalAdvance(self._words) + 4, super().sizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().resizeEvent(event)
        self._shorten()


class Scrolled(QScrollArea):
    """Scrolls what it holds up and down; sideways only in a window too small for the longest word.

    It asks for the width that its content needs, with the scroll bar, so that nothing is cut at the side.

    Parameters
    ----------
    content : QWidget
        What it holds.
    """

    def __init__(self, content: QWidget, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._content = content
        self.setWidget(content)

    @property
    def needed_width(self) -> int:
        """The least width, logical pixels, at which nothing has to scroll sideways."""
        return self._content.minimumSizeHint().width() + self.verticalScrollBar().sizeHint().width()

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(self.needed_width, self._content.sizeHint().height())

    def minimumSizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(self.needed_width, line_height(self) * _FEWEST_LINES)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: D102, N802 - Qt's name
        if watched is self._content and event.type() is QEvent.Type.LayoutRequest:
            self.updateGeometry()
        return super().eventFilter(watched, event)


def open_at(dialog: QWidget, width: int, height: int) -> None:
    """Give a dialog the size to open at, no larger than its screen; what does not fit then scrolls.

    Parameters
    ----------
    dialog : QWidget
        Its content lies in a `Scrolled`, its buttons below that.
    width, height : int
        Logical pixels at the normal text size.
    """
    screen = dialog.screen().availableSize()
    wanted = QSize(pixels(dialog, width), pixels(dialog, height)).expandedTo(dialog.minimumSizeHint())
    dialog.resize(wanted.boundedTo(screen))


_FEWEST_LINES = 4
_LONGEST_FACT = "Which scan"
"""The longest name of a fact: values of all lists begin at the same place."""


def scrolled(content: QWidget, *, page: str = "") -> Scrolled:
    """Return a scroll area that asks for the width its content needs.

    Parameters
    ----------
    content : QWidget
        What it holds.
    page : str
        For a page that is only read: what it is. It takes the focus then, so that keys can scroll it.
    """
    area = Scrolled(content)
    if page:
        area.setProperty("role", "page")
        area.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        area.setAccessibleName(page)
    return area


def lay_out_hidden(content: QWidget) -> None:
    """Bring up to date what a widget asks for: Qt lays out only what is shown."""
    for widget in (*reversed(content.findChildren(QWidget)), content):  # children before their parents
        layout = widget.layout()
        if layout is not None:
            layout.activate()


def keep_room(widget: QWidget) -> None:
    """Let a widget keep its room while it is hidden, so that nothing beside it moves."""
    policy = widget.sizePolicy()
    policy.setRetainSizeWhenHidden(True)
    widget.setSizePolicy(policy)


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
        column_of_captions(caption)
        is_long = max(map(len, value.split()), default=0) > _LONGEST_WORD
        words = ElidedLabel(value) if is_long else text_label(value, wrap=True)
        words.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.values[name] = words
        layout.addWidget(caption, 0, Qt.AlignmentFlag.AlignTop)
        layout.addWidget(words, 1)
        return row


def fix_headers(table: QTableView, *, stretched: int = 0) -> None:
    """Fix the rows and columns of a table; one column takes the remaining width."""
    table.verticalHeader().hide()
    table.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
    header = table.horizontalHeader()
    header.setHighlightSections(False)
    header.setSectionsClickable(False)
    header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    header.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
    header.setSectionResizeMode(stretched, QHeaderView.ResizeMode.Stretch)


def column_of_captions(caption: QLabel) -> None:
    """Make the name of a fact or field as wide as those above and below it."""
    fit(caption, lambda: caption.setFixedWidth(text_width(caption, _LONGEST_FACT) + 4))


class IconLabel(QLabel):
    """An icon in a colour of the theme, which it follows.

    Parameters
    ----------
    name : str
        The icon.
    colour : str
        Name of a field of `Theme`, such as ``warning``.
    size : int
        Logical pixels at the normal text size.
    """

    def __init__(self, name: str, colour: str, size: int = 16, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._name, self._colour, self._base = name, colour, size
        self._size = size
        fit(self, self._fit)

    def _fit(self) -> None:
        self._size = pixels(self, self._base)
        self.setFixedSize(self._size, self._size)

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
        row = in_row(
            placed(IconLabel(name, colour, 16), Qt.AlignmentFlag.AlignTop), margins=0, spacing=8, of=self
        )
        column = in_column(text_label(breakable(capitalised(words)), wrap=True), spacing=1)
        if remedy:
            column.addWidget(text_label(breakable(remedy), "hint", wrap=True))
        row.addLayout(column, 1)
