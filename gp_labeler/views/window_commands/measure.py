"""What the menu Measure asks: files of rulers and angles; and the list of measurements."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from gp_core.errors import AlreadyExistsError
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.measure.dialog import MeasureDialog
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.window_commands.command import Asking, WindowCommand

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["MEASURE_COMMANDS"]

_LINES = "Lines and angles of 3D Slicer (*.mrk.json *.json);;All files (*)"


def show_measurements(window: MainWindow) -> None:
    """Show the list of measurements, and the distances between landmarks, beside the window."""
    dialog = window.findChild(MeasureDialog)
    if dialog is None:
        dialog = MeasureDialog(window.workspace, window.commands.actions, window)
    dialog.show()
    dialog.raise_()


def ask_import_measurements(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for lines and angles of 3D Slicer, and add them."""
    files = prompts.open_files("Import rulers and angles", _LINES, many=True)
    if files:
        workspace.measure.open(*files)


def ask_export_measurements(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for a folder, and write a file for each measurement into it."""
    folder = prompts.folder("Export rulers and angles into this folder")
    if folder is None:
        return
    try:
        workspace.measure.export(folder)
    except AlreadyExistsError as error:
        if prompts.choose("Replace?", str(error), ["Replace"], kind="warning"):
            workspace.measure.export(folder, overwrite=True)


MEASURE_COMMANDS: Mapping[str, WindowCommand] = MappingProxyType(
    {
        "measure.show": show_measurements,
        "measure.import": Asking(ask_import_measurements),
        "measure.export": Asking(ask_export_measurements),
    }
)
