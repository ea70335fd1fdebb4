"""All commands that need the window, by id: what `gp_labeler.commands` only names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING

from gp_labeler.views.window_commands.atlas import ATLAS_COMMANDS
from gp_labeler.views.window_commands.estimate import ESTIMATE_COMMANDS
from gp_labeler.views.window_commands.file import FILE_COMMANDS
from gp_labeler.views.window_commands.help import HELP_COMMANDS
from gp_labeler.views.window_commands.landmarks import LANDMARK_COMMANDS
from gp_labeler.views.window_commands.measure import MEASURE_COMMANDS
from gp_labeler.views.window_commands.view import VIEW_COMMANDS

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["window_commands"]


def window_commands(window: MainWindow) -> Mapping[str, Callable[[], object]]:
    """Return what a window does for each command that needs one."""
    tables = (
        FILE_COMMANDS,
        VIEW_COMMANDS,
        LANDMARK_COMMANDS,
        MEASURE_COMMANDS,
        ATLAS_COMMANDS,
        ESTIMATE_COMMANDS,
        HELP_COMMANDS,
    )
    return {id: partial(run, window) for table in tables for id, run in table.items()}
