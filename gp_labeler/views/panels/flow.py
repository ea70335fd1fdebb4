"""A row of buttons that goes on in the next line where the first is full."""

from __future__ import annotations

from qtpy.QtCore import QPoint, QRect, QSize, Qt
from qtpy.QtWidgets import QLayout, QLayoutItem, QWidget

__all__ = ["FlowLayout"]


class FlowLayout(QLayout):
    """Puts widgets beside each other, and below where there is no room: no word on them is cut.

    Parameters
    ----------
    spacing : int
        Between them, logical pixels.
    """

    def __init__(self, parent: QWidget | None = None, *, spacing: int = 6) -> None:
        super().__init__(parent)
        self._items: list[QLayoutItem] = []
        self.setSpacing(spacing)
        self.setContentsMargins(0, 0, 0, 0)

    def addItem(self, item: QLayoutItem) -> None:  # noqa: D102, N802 - Qt's name
        self._items.append(item)

    def count(self) -> int:  # noqa: D102
        return len(self._items)

    def itemAt(self, index: int) -> QLayoutItem | None:  # noqa: D102, N802
        return self._items[index] if 0 <= index < len(self._items) else None

    def takeAt(self, index: int) -> QLayoutItem | None:  # noqa: D102, N802
        return self._items.pop(index) if 0 <= index < len(self._items) else None

    def expandingDirections(self) -> Qt.Orientation:  # noqa: D102, N802 - Qt's name
        return Qt.Orientation(0)

    def hasHeightForWidth(self) -> bool:  # noqa: D102, N802 - Qt's name
        return True

    def heightForWidth(self, width: int) -> int:  # noqa: D102, N802 - Qt's name
        margins = self.contentsMargins()
        return self._place(QRect(0, 0, width, 0), move=False) + margins.top() + margins.bottom()

    def setGeometry(self, rect: QRect) -> None:  # noqa: D102, N802 - Qt's name
        super().setGeometry(rect)
        self._place(rect, move=True)

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        hints = [item.sizeHint() for item in self._shown()]
        width = sum(hint.width() for hint in hints) + self.spacing() * max(len(hints) - 1, 0)
        return self._with_margins(QSize(width, max((hint.height() for hint in hints), default=0)))

    def minimumSize(self) -> QSize:  # noqa: D102, N802 - Qt's name
        size = QSize()
        for item in self._shown():
            size = size.expandedTo(item.minimumSize())
        return self._with_margins(size)

    def _shown(self) -> list[QLayoutItem]:
        return [item for item in self._items if not item.isEmpty()]

    def _with_margins(self, size: QSize) -> QSize:
        margins = self.contentsMargins()
        return size + QSize(margins.left() + margins.right(), margins.top() + margins.bottom())

    def _place(self, rect: QRect, *, move: bool) -> int:
        """Go along the lines, each item in the middle of its line; return how high they are together."""
        inner = rect.marginsRemoved(self.contentsMargins())
        bottom = inner.top()
        for n, line in enumerate(self._lines(inner.width())):
            top = bottom + (self.spacing() if n else 0)
            height = max(item.sizeHint().height() for _, item in line)
            for x, item in line if move else ():
                size = item.sizeHint()
                corner = QPoint(inner.left() + x, top + (height - size.height()) // 2)
                item.setGeometry(QRect(corner, size))
            bottom = top + height
        return bottom - inner.top()

    def _lines(self, width: int) -> list[list[tuple[int, QLayoutItem]]]:
        """Return the items of each line, with their distances from its beginning."""
        lines: list[list[tuple[int, QLayoutItem]]] = []
        x = width
        for item in self._shown():
            if not lines or x + item.sizeHint().width() > width:
                lines.append([])
                x = 0
            lines[-1].append((x, item))
            x += item.sizeHint().width() + self.spacing()
        return lines
