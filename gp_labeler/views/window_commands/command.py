"""What a command that needs the window is: a function of it, which has no result."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.prompts import Prompts

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["WindowCommand", "asking"]

WindowCommand = Callable[["MainWindow"], object]


def asking(ask: Callable[[Workspace, Prompts], object]) -> WindowCommand:
    """Return the command of a function that reads only what the window works on, and who asks the user."""
    return lambda window: ask(window.workspace, window.prompts)
