"""What actions of the menu Measure ask of the window: files, and the list of measurements."""

from __future__ import annotations

from gp_core.errors import GpError
from gp_labeler.views.panels.measure.dialog import MeasureDialog
from gp_labeler.views.ui_part import UiPart

__all__ = ["MeasureUi"]

_LINES = "Lines and angles of 3D Slicer (*.mrk.json *.json);;All files (*)"


class MeasureUi(UiPart):
    """The part of `WindowUi` that concerns rulers, angles and distances."""

    def show_measurements(self) -> None:
        """Show the list of measurements, and the distances between landmarks, beside the window."""
        dialog = self._window.findChild(MeasureDialog)
        if dialog is None:
            dialog = MeasureDialog(self._workspace, self._window.commands.actions, self._window)
        dialog.show()
        dialog.raise_()

    def ask_import_measurements(self) -> None:
        """Ask for lines and angles of 3D Slicer, and add them."""
        files = self.prompts.open_files("Import rulers and angles", self._folder, _LINES, many=True)
        if files:
            self._remember_folder(files[0])
            self._workspace.measure.open(*files)

    def ask_export_measurements(self) -> None:
        """Ask for a folder, and write a file for each measurement into it."""
        folder = self.prompts.folder("Export rulers and angles into this folder", self._folder)
        if folder is None:
            return
        try:
            files = self._workspace.measure.export(folder)
        except GpError as error:
            if "exists already" not in error.problem:
                raise
            if not self.prompts.choose("Replace?", str(error), ["Replace"], kind="warning"):
                return
            files = self._workspace.measure.export(folder, overwrite=True)
        self._remember_folder(files[0])
