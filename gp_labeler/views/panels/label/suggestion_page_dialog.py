"""The window in which suggestions are checked in pages of close views."""

from __future__ import annotations

from functools import partial

from qtpy.QtCore import Qt
from qtpy.QtGui import QAction, QKeySequence
from qtpy.QtWidgets import QDialog, QGridLayout, QPushButton, QWidget

from gp_labeler.models.suggestion_pages import PAGE_SIZE
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit
from gp_labeler.views.layouts import STRETCH, in_column, in_row, wide
from gp_labeler.views.panels.label.close_view_tile import CloseViewTile
from gp_labeler.views.panels.parts import open_at, scrolled, text_label
from gp_labeler.views.signals import attempt, follow
from gp_labeler.views.stylesheet import set_role

__all__ = ["SuggestionPageDialog"]

_MOST_COLUMNS = 3
_GAP = 8
_BESIDE = 60
"""Logical pixels that the margins and the scroll bar take."""


class SuggestionPageDialog(QDialog):
    """Shows one page of `SuggestionPagesModel` at a time; stays beside the main window.

    Parameters
    ----------
    workspace : Workspace
        Whose suggestions; its pages have begun.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace, self._pages = workspace, workspace.pages
        self.setWindowTitle("Check suggestions in pages")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.text, self.hint = text_label(role="heading"), text_label(_EXPLAINED, "hint", wrap=True)
        self.tiles = [self._tile() for _ in range(PAGE_SIZE)]
        self.back = self._button("Back", partial(self._turn, -1), "Show the page before")
        self.leave = self._button(
            "Next, without confirming", partial(self._turn, 1), "Confirm nothing of this page"
        )
        self.confirm = self._button("Confirm and go on", self._confirm, "Enter")
        self.confirm.setProperty("role", "primary")
        self._lay_out()
        self._listen()
        self.refresh()
        self.tiles[0].setFocus()
        open_at(self, 1600, 760)

    def refresh(self, *_: object) -> None:
        """Show the page as it stands."""
        entries = self._pages.entries
        self._show_hint(_EXPLAINED, "hint")
        self.text.setText(self._pages.text)
        for tile, entry in zip(self.tiles, entries, strict=False):
            tile.show_entry(entry)
        for n, tile in enumerate(self.tiles):
            tile.setVisible(n < len(entries))
        self.back.setEnabled(self._pages.number > 0)
        n_offered = sum(entry.is_offered for entry in entries)
        self.confirm.setText(f"Confirm {n_offered} and go on" if n_offered else "Go on")

    @property
    def shown_tiles(self) -> list[CloseViewTile]:
        """The tiles of the suggestions that the page has."""
        return self.tiles[: len(self._pages.entries)]

    def done(self, code: int) -> None:
        """Close; what is still suggested comes up in the views."""
        self._pages.finish()
        super().done(code)

    def _tile(self) -> CloseViewTile:
        tile = CloseViewTile()
        tile.clicked.connect(partial(self._mark, tile))
        tile.shown.connect(self._pages.take_shown)
        tile.pointed_at.connect(partial(self._correct, tile))
        tile.scrolled.connect(partial(self._scroll, tile))
        return tile

    def _button(self, words: str, run: object, hint: str) -> QPushButton:
        button = QPushButton(words)
        button.setToolTip(hint)
        button.setAutoDefault(False)
        button.clicked.connect(run)
        return button

    def _lay_out(self) -> None:
        page, self._grid = QWidget(), QGridLayout()
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(_GAP)
        page.setProperty("role", "panel")
        page.setLayout(self._grid)
        fit(self, self._arrange)
        close = self._button("Close", self.reject, "What is left comes up in the views")
        buttons = in_row(self.back, self.leave, STRETCH, close, self.confirm, margins=0)
        self.area = scrolled(page)
        in_column(
            self.text, self.hint, wide(self.area), buttons, margins=(14, 10, 14, 12), spacing=8, of=self
        )
        self._enter((page, self.confirm))

    def _arrange(self) -> None:
        """Lay the tiles in as many columns as the screen is wide enough for; the rest scrolls."""
        widest = max(tile.minimumSizeHint().width() for tile in self.tiles)
        room = self.screen().availableSize().width() - _BESIDE
        n_columns = min(max(room // (widest + _GAP), 1), _MOST_COLUMNS)
        for n, tile in enumerate(self.tiles):
            self._grid.addWidget(tile, n // n_columns, n % n_columns)
        for column in range(_MOST_COLUMNS):
            self._grid.setColumnStretch(column, int(column < n_columns))

    def _enter(self, where: tuple[QWidget, ...]) -> None:
        """Let Enter confirm the page; a key that is held down confirms no second one."""
        confirm = QAction("Confirm the page", self)
        confirm.setShortcuts([QKeySequence("Return"), QKeySequence("Enter")])
        confirm.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
        confirm.setAutoRepeat(False)
        confirm.triggered.connect(self._confirm)
        undo = QAction("Undo", self)
        undo.setShortcut(QKeySequence("Ctrl+Z"))
        undo.triggered.connect(self._undo)
        self.addAction(undo)
        for widget in where:
            widget.addAction(confirm)

    def _listen(self) -> None:
        follow(self, self._pages.changed, self.refresh)
        follow(self, self._pages.finished, self._on_finished)
        follow(self, self._workspace.messages.said, self._on_said)

    def _on_said(self, text: str, level: str) -> None:
        """Show here what went wrong: the window, which says it too, may be hidden."""
        if level != "info" and self.isVisible():
            self.hint.setMinimumHeight(self.hint.height())  # the page stays where it is
            self._show_hint(text, "warning")

    def _show_hint(self, text: str, role: str) -> None:
        self.hint.setText(text)
        set_role(self.hint, role)

    def _on_finished(self) -> None:
        if self.isVisible():
            self.accept()

    def _mark(self, tile: CloseViewTile, *_: object) -> None:
        if tile.entry is not None:
            self._pages.mark(tile.entry.side, tile.entry.code, tile.isChecked())
            tile.show_entry(tile.entry)  # what is decided stays unmarked

    def _correct(self, tile: CloseViewTile, number: int, across: float, down: float) -> None:
        entry = tile.entry
        if entry is not None:
            attempt(
                self._workspace,
                lambda: self._pages.correct(entry.side, entry.code, number, across, down),
            )

    def _scroll(self, tile: CloseViewTile, number: int, n_slices: float) -> None:
        if tile.entry is not None:
            self._pages.scroll(tile.entry.side, tile.entry.code, number, n_slices)

    def _confirm(self, *_: object) -> None:
        attempt(self._workspace, self._pages.confirm)

    def _turn(self, step: int, *_: object) -> None:
        self._pages.turn(step)

    def _undo(self, *_: object) -> None:
        attempt(self._workspace, self._pages.undo)


_EXPLAINED = (
    "Check the cross in both pictures; the wheel shows the next slices. If it is wrong, hold Ctrl and click "
    "where the feature is, or click without Ctrl to look at it in the views afterwards. Enter confirms the "
    "others, except the doubtful ones (orange), which come up in the views, too."
)
