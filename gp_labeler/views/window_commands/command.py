"""What a command that needs the window is: a function, which has no result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.prompts import Prompts

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["Asking", "WindowCommand", "bound"]


@dataclass(frozen=True)
class Asking:
    """A command that reads only what the window works on, and who asks the user."""

    ask: Callable[[Workspace, Prompts], object]


WindowCommand = Asking | Callable[["MainWindow"], object]


def bound(command: WindowCommand, window: MainWindow) -> Callable[[], object]:
    """Return what a command does in a window as it is now."""
    if isinstance(command, Asking):
        return partial(command.ask, window.workspace, window.prompts)
    return partial(command, window)
