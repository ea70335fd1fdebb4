"""Questions to the user, each as one call that returns the answer; tests and scripts answer in its place."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from math import inf
from pathlib import Path

from qtpy.QtWidgets import QFileDialog, QInputDialog, QMessageBox, QWidget

from gp_labeler.views.window_state import WindowState

__all__ = ["Prompts"]


class Prompts:
    """Asks by dialogs over a window.

    Parameters
    ----------
    parent : QWidget, optional
        The window.
    memory : WindowState, optional
        Remembers the folder of the last file, where the next dialog begins.
    """

    in_dialogs = True
    """Whether a person answers, in dialogs that show more than a question; scripts are asked in words."""

    def __init__(self, parent: QWidget | None = None, memory: WindowState | None = None) -> None:
        self._parent, self._memory = parent, memory or WindowState()

    @property
    def last_folder(self) -> Path:
        """Folder of the file that was opened or saved last."""
        return Path(self._memory.get("folder", str, str(Path.home())))

    def remember(self, path: Path) -> None:
        """Let the next dialog begin in the folder that holds a path."""
        self._memory.set(folder=str(path.absolute().parent))

    def choose(
        self, title: str, text: str, answers: Sequence[str], *, detail: str = "", kind: str = "question"
    ) -> str:
        """Ask for one of a few answers, the first of which is what Enter means.

        Returns
        -------
        str
            The answer; empty where the user wants none of them.
        """
        box = QMessageBox(self._parent)
        box.setWindowTitle(title)
        box.setText(text)
        box.setInformativeText(detail)
        box.setIcon(QMessageBox.Icon.Warning if kind == "warning" else QMessageBox.Icon.Question)
        roles = [QMessageBox.ButtonRole.AcceptRole] + [QMessageBox.ButtonRole.ActionRole] * (len(answers) - 1)
        buttons = [box.addButton(answer, role) for answer, role in zip(answers, roles, strict=True)]
        box.setEscapeButton(box.addButton(QMessageBox.StandardButton.Cancel))
        box.setDefaultButton(buttons[0])
        box.exec()
        clicked = box.clickedButton()
        return next((a for a, button in zip(answers, buttons, strict=True) if button is clicked), "")

    def tell(self, title: str, text: str) -> None:
        """Say something that must be read."""
        QMessageBox.information(self._parent, title, text)

    def open_files(
        self, title: str, filters: str, *, many: bool = False, start: Path | None = None
    ) -> list[Path]:
        """Ask for a file, or several; empty where the user thinks better of it."""
        at = str(start or self.last_folder)
        if many:
            names, _ = QFileDialog.getOpenFileNames(self._parent, title, at, filters)
        else:
            name, _ = QFileDialog.getOpenFileName(self._parent, title, at, filters)
            names = [name] if name else []
        return self._remembered([Path(name) for name in names])

    def folder(self, title: str, *, start: Path | None = None) -> Path | None:
        """Ask for a folder."""
        name = QFileDialog.getExistingDirectory(self._parent, title, str(start or self.last_folder))
        return next(iter(self._remembered([Path(name)] if name else [])), None)

    def save_file(self, title: str, suggestion: str, filters: str) -> Path | None:
        """Ask where to save, by a suggested name; the dialog itself asks before a file is replaced."""
        at = str(self.last_folder / suggestion)
        name, _ = QFileDialog.getSaveFileName(self._parent, title, at, filters)
        return next(iter(self._remembered([Path(name)] if name else [])), None)

    def _remembered(self, chosen: list[Path]) -> list[Path]:
        if chosen:
            self.remember(chosen[0])
        return chosen

    def item(self, title: str, text: str, items: Sequence[str]) -> str:
        """Ask for one of many; empty where the user thinks better of it."""
        chosen, ok = QInputDialog.getItem(self._parent, title, text, list(items), 0, False)
        return chosen if ok else ""

    def text(self, title: str, text: str, value: str = "") -> str | None:
        """Ask for words; None where the user thinks better of it."""
        given, ok = QInputDialog.getText(self._parent, title, text, text=value)
        return given if ok else None

    def number(self, title: str, text: str, value: float) -> float | None:
        """Ask for a number above 0, until one is given; None where the user thinks better of it."""
        while (given := self.text(title, text, f"{value:g}")) is not None:
            with suppress(ValueError):
                if 0 < (number := float(given.replace(",", "."))) < inf:
                    return number
        return None
