"""Small parts that the cards of the step Pose share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from qtpy.QtCore import QEvent, Qt, Signal
from qtpy.QtWidgets import (
    QButtonGroup,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from gp_labeler.views.chips import chip_pixmap
from gp_labeler.views.fonts import TEXT, fit, pixels, styled
from gp_labeler.views.layouts import in_row
from gp_labeler.views.panels.parts import Notice, emptied, text_label
from gp_labeler.views.signals import blocked
from gp_labeler.views.theme import theme_of

_CHIP = 14

__all__ = ["Notices", "QualityBadge", "Segments", "link", "numbers"]


class Segments(QWidget):
    """Buttons side by side, one of which is chosen.

    Parameters
    ----------
    words : mapping of str to str
        What is chosen, and what stands on its button.
    hints : mapping of str to str, optional
        Tool tips.
    """

    chosen = Signal(str)

    def __init__(
        self, words: Mapping[str, str], hints: Mapping[str, str] | None = None, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._group = QButtonGroup(self)
        self.buttons: dict[str, QToolButton] = {}
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(4)
        for name, text in words.items():
            button = QToolButton()
            button.setText(text)
            button.setCheckable(True)
            button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            button.setToolTip((hints or {}).get(name, ""))
            button.clicked.connect(lambda _=False, name=name: self.chosen.emit(name))
            self._group.addButton(button)
            self.buttons[name] = button
            row.addWidget(button, 1)

    @property
    def value(self) -> str:
        """What is chosen."""
        return next((name for name, button in self.buttons.items() if button.isChecked()), "")

    def set_value(self, name: str) -> None:
        """Show what is chosen, without a signal."""
        with blocked(self._group):
            self.buttons[name].setChecked(True)


class Notices(QWidget):
    """Findings, one below the other; they are made again only when they change."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(4)
        self.shown: tuple[tuple[str, ...], ...] = ()
        self.hide()

    def show_notices(self, notices: Sequence[tuple[str, ...]]) -> None:
        """Show level, words and perhaps a remedy of each."""
        if tuple(notices) != self.shown:
            self.shown = tuple(notices)
            emptied(self._column)
            for notice in notices:
                self._column.addWidget(Notice(notice[0], notice[1], "".join(notice[2:])))
            self.setVisible(bool(notices))


class QualityBadge(QWidget):
    """A shape and a word in the colour of how good something is."""

    _CHIPS = {"good": "checked", "warning": "placed", "danger": "doubtful", "": "to do"}  # noqa: RUF012

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._chip, self.label = QLabel(), text_label("", "heading")
        self._level = ""
        in_row(self._chip, self.label, margins=0, spacing=6, of=self)
        fit(self, self._fit)

    def _fit(self) -> None:
        self._chip.setFixedSize(pixels(self, _CHIP), pixels(self, _CHIP))

    def show_verdict(self, level: str, word: str, reason: str) -> None:
        """Show ``good``, ``warning`` or ``danger``, and its word; the reason is the tool tip."""
        self._level = level
        self.label.setText(word)
        self.setToolTip(reason)
        self.setAccessibleName(f"{word}. {reason}")
        self.take_theme()

    def take_theme(self) -> None:
        """Draw in the colours of the theme."""
        theme, shape = theme_of(self), self._CHIPS[self._level]
        self._chip.setPixmap(chip_pixmap(shape, pixels(self, _CHIP), theme, self.devicePixelRatioF()))
        if (sheet := f"color: {theme.states[shape]}") != self.label.styleSheet():  # to restyle takes its time
            self.label.setStyleSheet(sheet)

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().changeEvent(event)
        if event.type() is QEvent.Type.StyleChange and self.label.text():
            self.take_theme()


def link(text: str, hint: str = "") -> QPushButton:
    """Return a button that looks like a link."""
    button = QPushButton(text)
    button.setProperty("role", "link")
    button.setStyleSheet("QPushButton { padding: 3px 2px } QPushButton:focus { padding: 2px 1px }")
    button.setToolTip(hint)
    button.setCursor(Qt.CursorShape.PointingHandCursor)
    return button


def numbers(size: float = TEXT, *, bold: bool = False) -> QLabel:
    """Return a label for numbers that can be selected and copied."""
    label = text_label()
    label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    styled(label, size, bold=bold)
    return label
