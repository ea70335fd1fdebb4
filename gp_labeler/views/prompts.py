"""Questions to the user, each as one call that returns the answer; tests and scripts answer in its place."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from qtpy.QtWidgets import QFileDialog, QInputDialog, QMessageBox, QWidget

__all__ = ["Prompts"]


class Prompts:
    """Asks by dialogs over a window.

    Parameters
    ----------
    parent : QWidget, optional
        The window.
    """

    def __init__(self, parent: QWidget | None) -> None:
        self._parent = parent

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

    def open_files(self, title: str, folder: str, filters: str, *, many: bool = False) -> list[Path]:
        """Ask for a file, or several; empty where the user thinks better of it."""
        if many:
            names, _ = QFileDialog.getOpenFileNames(self._parent, title, folder, filters)
        else:
            name, _ = QFileDialog.getOpenFileName(self._parent, title, folder, filters)
            names = [name] if name else []
        return [Path(name) for name in names]

    def folder(self, title: str, folder: str) -> Path | None:
        """Ask for a folder."""
        name = QFileDialog.getExistingDirectory(self._parent, title, folder)
        return Path(name) if name else None

    def save_file(self, title: str, suggestion: str, filters: str) -> Path | None:
        """Ask where to save; the dialog itself asks before a file is replaced."""
        name, _ = QFileDialog.getSaveFileName(self._parent, title, suggestion, filters)
        return Path(name) if name else None

    def item(self, title: str, text: str, items: Sequence[str]) -> str:
        """Ask for one of many; empty where the user thinks better of it."""
        chosen, ok = QInputDialog.getItem(self._parent, title, text, list(items), 0, False)
        return chosen if ok else ""

    def text(self, title: str, text: str, value: str = "") -> str | None:
        """Ask for words; None where the user thinks better of it."""
        given, ok = QInputDialog.getText(self._parent, title, text, text=value)
        return given if ok else None

    def number(self, title: str, text: str, value: float) -> float | None:
        """Ask for a number above 0."""
        given, ok = QInputDialog.getDouble(self._parent, title, text, value, 0.0001, 1000.0, 5)
        return given if ok else None
