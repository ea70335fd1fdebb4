"""The sheet of everything that keys and mouse do, made from the table of actions."""

from __future__ import annotations

from qtpy.QtCore import Qt
from qtpy.QtGui import QKeySequence
from qtpy.QtWidgets import (
    QDialog,
    QGridLayout,
    QLabel,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from gp_labeler.commands.actions import ACTIONS, MENUS, gestures
from gp_labeler.views.fonts import fit, text_width
from gp_labeler.views.layouts import STRETCH, in_column, in_row
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.parts import open_at, scrolled

__all__ = ["ShortcutsSheet", "keys_text"]

_LONGEST_KEYS = "Middle drag, Shift+drag"
"""What the keys of all blocks are lined up to."""

_COLUMNS = (
    ("In the 3D view", "On a slice", "On a page of close views", "Estimate"),
    ("View",),
    ("Landmarks", "Measure", "File", "Edit", "Help"),
)


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
        columns = FlowLayout(sheet, spacing=36)
        columns.setContentsMargins(12, 4, 12, 4)
        blocks = _blocks()
        for names in _COLUMNS:
            part = QWidget()
            column = QVBoxLayout(part)
            column.setContentsMargins(0, 0, 0, 0)
            column.setSpacing(4)
            for name in names:
                _add_block(column, name, blocks[name])
            column.addStretch(1)
            columns.addWidget(part)
        close = QPushButton("Close")
        close.setProperty("role", "primary")
        close.clicked.connect(self.accept)
        keys, foot = (
            scrolled(sheet, page="Keys and mouse gestures"),
            in_row(STRETCH, close, margins=(12, 0, 12, 0)),
        )
        in_column(keys, foot, margins=(8, 8, 8, 12), of=self)
        open_at(self, 0, 760)
        hint = sheet.sizeHint()
        self.resize(min(hint.width() + 40, self.screen().availableSize().width()), self.height())


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
    fit(heading, lambda: grid.setColumnMinimumWidth(0, text_width(heading, _LONGEST_KEYS)))
    for n, (keys, text) in enumerate(rows):
        key = QLabel(keys)
        key.setProperty("role", "ghost")
        grid.addWidget(key, n, 0, Qt.AlignmentFlag.AlignTop)
        grid.addWidget(QLabel(text.rstrip("…")), n, 1, Qt.AlignmentFlag.AlignTop)
    column.addLayout(grid)
