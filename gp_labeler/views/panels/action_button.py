"""Buttons that do an action of the menus: enabled, ticked and explained as it is."""

from __future__ import annotations

from collections.abc import Mapping

from qtpy.QtCore import QObject
from qtpy.QtGui import QAction
from qtpy.QtWidgets import QAbstractButton, QPushButton

__all__ = ["Actions", "action_button", "do_action"]

Actions = Mapping[str, QAction]
"""The window's actions by their ids."""


class _ActionLink(QObject):
    """Keeps a button as its action is, for as long as the button exists."""

    def __init__(self, button: QAbstractButton, action: QAction) -> None:
        super().__init__(button)
        self._button, self._action = button, action
        button.setCheckable(action.isCheckable())
        action.changed.connect(self.refresh)
        button.clicked.connect(self.trigger)
        self.refresh()

    def refresh(self) -> None:
        """Take over whether the action can be done, and whether it is on."""
        self._button.setEnabled(self._action.isEnabled())
        if self._action.isCheckable():
            self._button.setChecked(self._action.isChecked())

    def trigger(self) -> None:
        """Do the action; an action that stays as it was leaves the button as it was."""
        self._action.trigger()
        self.refresh()


def do_action(button: QAbstractButton, action: QAction) -> None:
    """Let a button with words of its own do an action, and be enabled and ticked as the action is.

    `QToolButton.setDefaultAction` would replace the button's words by those of the menu.

    Parameters
    ----------
    button : QAbstractButton
        A button without a tool tip gets that of the action.
    action : QAction
        What a click does.
    """
    if not button.toolTip():
        button.setToolTip(action.toolTip())
    _ActionLink(button, action)


def action_button(action: QAction, words: str, hint: str = "") -> QPushButton:
    """Return a push button that does an action.

    Parameters
    ----------
    action : QAction
        What it does.
    words : str
        What it says; beside its neighbours that can be shorter than in a menu.
    hint : str
        Its tool tip; by default that of the action.
    """
    button = QPushButton(words)
    button.setToolTip(hint)
    do_action(button, action)
    return button
