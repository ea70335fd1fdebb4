"""The sheet of everything that keys and mouse do, made from the table of actions."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import (
    QDialog,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from gp_labeler.actions import ACTIONS, MENUS, gestures

__all__ = ["ShortcutsSheet", "keys_text"]

_KEYS_WIDTH = 128
_COLUMNS = (("In the 3D view", "On a slice", "Estimate"), ("View",), ("Landmarks", "File", "Edit", "Help"))


def keys_text(keys: str) -> str:
    """Return keys as the platform writes them."""
    return QKeySequence(keys).toString(QKeySequence.SequenceFormat.NativeText)


class ShortcutsSheet(QDialog):
    """A dialog that lists keys and mouse gestures in three columns."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Keyboard and mouse")
        sheet = QWidget()
        sheet.setProperty("role", "panel")
        columns = QHBoxLayout(sheet)
        columns.setContentsMargins(20, 12, 20, 12)
        columns.setSpacing(36)
        blocks = _blocks()
        for names in _COLUMNS:
            column = QVBoxLayout()
            column.setSpacing(4)
            for name in names:
                _add_block(column, name, blocks[name])
            column.addStretch(1)
            columns.addLayout(column)
        scroll = QScrollArea()
        scroll.setWidgetResizable(True)
        scroll.setWidget(sheet)
        close = QPushButton("Close")
        close.setProperty("role", "primary")
        close.clicked.connect(self.accept)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 8, 0, 12)
        whole.addWidget(scroll)
        row = QHBoxLayout()
        row.setContentsMargins(20, 0, 20, 0)
        row.addStretch(1)
        row.addWidget(close)
        whole.addLayout(row)
        hint = sheet.sizeHint()
        self.resize(hint.width() + 24, min(hint.height() + 90, 760))


def _blocks() -> dict[str, list[tuple[str, str]]]:
    blocks = {where: list(rows) for where, rows in gestures()}
    for menu in MENUS:
        rows = [row for row in ACTIONS.values() if row.menu == menu and row.shortcuts]
        blocks[menu] = [("  or  ".join(keys_text(k) for k in row.shortcuts[:2]), row.title) for row in rows]
    return blocks


def _add_block(column: QVBoxLayout, name: str, rows: list[tuple[str, str]]) -> None:
    heading = QLabel(name)
    heading.setProperty("role", "heading")
    heading.setContentsMargins(0, 8, 0, 2)
    column.addWidget(heading)
    grid = QGridLayout()
    grid.setHorizontalSpacing(14)
    grid.setVerticalSpacing(1)
    grid.setColumnStretch(1, 1)
    grid.setColumnMinimumWidth(0, _KEYS_WIDTH)
    for n, (keys, text) in enumerate(rows):
        key = QLabel(keys)
        key.setProperty("role", "ghost")
        grid.addWidget(key, n, 0, Qt.AlignmentFlag.AlignTop)
        grid.addWidget(QLabel(text.rstrip("…")), n, 1, Qt.AlignmentFlag.AlignTop)
    column.addLayout(grid)
