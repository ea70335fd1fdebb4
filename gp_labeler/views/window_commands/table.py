"""All commands that need the window, by id: what `gp_labeler.commands` only names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from gp_labeler.views.window_commands.atlas import ATLAS_COMMANDS
from gp_labeler.views.window_commands.command import WindowCommand, bound
from gp_labeler.views.window_commands.estimate import ESTIMATE_COMMANDS
from gp_labeler.views.window_commands.file import FILE_COMMANDS
from gp_labeler.views.window_commands.help import HELP_COMMANDS
from gp_labeler.views.window_commands.landmarks import LANDMARK_COMMANDS
from gp_labeler.views.window_commands.measure import MEASURE_COMMANDS
from gp_labeler.views.window_commands.view import VIEW_COMMANDS

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["WINDOW_COMMANDS", "command_of"]

WINDOW_COMMANDS: Mapping[str, WindowCommand] = MappingProxyType(
    {
        **FILE_COMMANDS,
        **VIEW_COMMANDS,
        **LANDMARK_COMMANDS,
        **MEASURE_COMMANDS,
        **ATLAS_COMMANDS,
        **ESTIMATE_COMMANDS,
        **HELP_COMMANDS,
    }
)


def command_of(window: MainWindow, id: str) -> Callable[[], object]:
    """Return what a window does for a command."""
    return bound(WINDOW_COMMANDS[id], window)
