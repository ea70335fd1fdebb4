"""What a command of the window is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gp_labeler.models.workspace import Workspace

__all__ = ["IN_WINDOW", "MENUS", "Action", "Run", "Test"]

MENUS = ("File", "Edit", "View", "Landmarks", "Measure", "Atlas", "Estimate", "Help")


Run = Callable[[Workspace], object]
Test = Callable[[Workspace], bool]
IN_WINDOW: Run | None = None
"""Stands for the function of an action that needs the window, to ask or to show something.

The module of `gp_labeler.views.window_commands` of the same menu has it, under the same id.
"""


@dataclass(frozen=True)
class Action:
    """One command.

    Parameters
    ----------
    id : str
        Its name in scripts, such as ``edit.undo``; never changes.
    menu : str
        One of `MENUS`.
    title : str
        What the menu says.
    shortcuts : tuple of str
        Keys, as Qt writes them; the first is shown.
    run : callable, optional
        Does it on the models; `IN_WINDOW` where that is not enough.
    enabled : callable
        Whether it can be done now.
    checked : callable, optional
        For what is on or off: whether it is on.
    hint : str
        A sentence more, for tool tips and the sheet.
    group : str
        Neighbours of the same group stand between the same separators.
    icon : str
        Name of its icon.
    """

    id: str
    menu: str
    title: str
    shortcuts: tuple[str, ...]
    run: Run | None
    enabled: Test = lambda workspace: True
    checked: Test | None = None
    hint: str = ""
    group: str = ""
    icon: str = ""
