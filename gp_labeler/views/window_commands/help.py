"""What the menu Help shows, and the recording of scripts."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from gp_labeler.document.specimen_file import application
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.recorder import Recorder
from gp_labeler.views.shortcuts_sheet import ShortcutsSheet
from gp_labeler.views.window_commands.command import Asking, WindowCommand

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["HELP_COMMANDS"]


def show_shortcuts(window: MainWindow) -> None:
    """Show what keys and mouse do."""
    ShortcutsSheet(window).open()


def toggle_recording(window: MainWindow) -> None:
    """Begin to write down what is done, or ask where to, and write it."""
    workspace = window.workspace
    recorder = window.findChild(Recorder)
    if recorder is None:
        Recorder(window)
        workspace.say("Recording. Choose Help > Record script once more to end it.")
        return
    path = window.prompts.save_file("Save the script", "script.toml", "Scripts (*.toml *.json)")
    if path is not None:
        recorder.save(path)
        workspace.say(f"Wrote {path.name}, {len(recorder.tables)} steps")
    recorder.setParent(None)
    recorder.deleteLater()


def show_about(workspace: Workspace, prompts: Prompts) -> None:
    """Say what this program is."""
    prompts.tell(
        "About gp-labeler",
        f"{application()}\n\nLabels guinea-pig heads in micro-CT, and estimates the pose of the cochlea "
        "from a few touched points.\n\nCoordinates are LPS, mm. No usage data are collected.",
    )


HELP_COMMANDS: Mapping[str, WindowCommand] = MappingProxyType(
    {
        "help.shortcuts": show_shortcuts,
        "help.record": toggle_recording,
        "help.about": Asking(show_about),
    }
)
