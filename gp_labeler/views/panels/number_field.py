"""A field for one number, that arrow keys and the wheel change in steps."""

from __future__ import annotations

from qtpy.QtCore import QRegularExpression, QSize, Qt, Signal
from qtpy.QtGui import QKeyEvent, QRegularExpressionValidator, QWheelEvent
from qtpy.QtWidgets import QLineEdit, QWidget

from gp_labeler.views.fonts import field_width, fit
from gp_labeler.views.formatting import value_text

__all__ = ["NumberField"]

_NUMBER = QRegularExpression(r"[-+]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)([eE][-+]?[0-9]+)?")
"""In every locale: a keyboard's number block may write a comma for the point."""


class NumberField(QLineEdit):
    """Tells `value_chosen` once a number was typed and confirmed, or stepped to.

    Parameters
    ----------
    name : str
        What the number is, for those who cannot see the caption.
    widest : str
        The longest text that it has to show.
    """

    value_chosen = Signal(float)

    def __init__(self, name: str, parent: QWidget | None = None, *, widest: str = "-32768") -> None:
        super().__init__(parent)
        self._value = 0.0
        self.step = 1.0
        self.setAccessibleName(name)
        self.setValidator(QRegularExpressionValidator(_NUMBER, self))
        self.editingFinished.connect(self._on_typed)
        fit(self, lambda: self.setMinimumWidth(field_width(self, widest)))

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(self.minimumWidth(), super().sizeHint().height())

    @property
    def value(self) -> float:
        """The number."""
        return self._value

    def set_value(self, value: float | None) -> None:
        """Show a number without a signal; None shows an empty field."""
        self._value = 0.0 if value is None else value
        self.setText("" if value is None else self._words())

    def _words(self) -> str:
        return value_text(self._value).replace("\N{MINUS SIGN}", "-")

    def _on_typed(self) -> None:
        try:
            typed = float(self.text().replace(",", "."))
        except ValueError:
            self.setText(self._words())
            return
        if self.text() != self._words():
            self._choose(typed)

    def _choose(self, value: float) -> None:
        self.set_value(value)
        self.value_chosen.emit(value)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102, N802 - Qt's name
        steps = {Qt.Key.Key_Up: 1, Qt.Key.Key_Down: -1, Qt.Key.Key_PageUp: 10, Qt.Key.Key_PageDown: -10}
        by = steps.get(Qt.Key(event.key()))
        if by is None:
            super().keyPressEvent(event)
        else:
            self._choose(round(self._value + by * self.step, 6))

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: D102, N802 - Qt's name
        if self.hasFocus():
            self._choose(round(self._value + self.step * (1 if event.angleDelta().y() > 0 else -1), 6))
        else:
            event.ignore()  # the panel scrolls
