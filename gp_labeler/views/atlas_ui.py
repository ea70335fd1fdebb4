"""What actions of the menu Atlas ask of the window: files, folders, which panel is shown."""

from __future__ import annotations

from pathlib import Path

from gp_core.atlas.label_check import Finding
from gp_core.errors import GpError
from gp_core.landmarks.features import feature
from gp_core.study.reliability import Disagreement
from gp_labeler.views.signals import attempt
from gp_labeler.views.ui_part import UiPart

__all__ = ["AtlasUi"]

_ATLASES = "Atlases (*.json);;All files (*)"
_REPORTS = "Tables (*.csv);;JSON (*.json);;Pictures (*.png *.pdf *.svg)"
_LABELLED = "Labelled animals (*.mrk.json *.fcsv *.gpspecimen.json);;All files (*)"


class AtlasUi(UiPart):
    """The part of `WindowUi` that concerns the atlas."""

    def show_step(self, step: str) -> None:
        """Show the panel of a step of the rail."""
        self._window.set_step(step)

    def ask_open_atlas(self) -> None:
        """Ask for an atlas file, and take it."""
        for path in self.prompts.open_files("Open an atlas", self._folder, _ATLASES):
            self._remember_folder(path)
            self._workspace.atlas.open(path)

    def ask_fit_atlas(self, *, folder: bool = False) -> None:
        """Ask for the files of labelled animals, or a folder of them, and fit an atlas."""
        if paths := self._ask_animals("Fit an atlas to these animals", folder=folder):
            self._workspace.atlas.fit(paths)

    def show_finding(self, finding: Finding) -> None:
        """Open the animal of a finding, and go to its first point."""
        workspace, name, side = self._workspace, finding.specimen, finding.side
        if workspace.document.state.specimen != name:
            file = (
                None if workspace.atlas.animals is None else workspace.atlas.animals.specimen_file(name, side)
            )
            if file is None:
                workspace.say(
                    f"{name} has no specimen file: open its scan and import its landmarks", "warning"
                )
                return
            self.open_path(file)
            if workspace.document.state.specimen != name:
                return
        self._window.set_step("label")
        code = next((code for code in finding.landmarks if not feature(code).computed), None)
        if code is not None:
            attempt(workspace, lambda: workspace.labels.go_to(side, code))

    def ask_reliability(self, *, folder: bool = False) -> None:
        """Ask for animals that were labelled more than once, and compare their labels."""
        if paths := self._ask_animals("Compare the labels of these animals", folder=folder):
            self._workspace.reliability.measure(paths)

    def ask_save_reliability(self) -> None:
        """Ask where, and write what was found on repeated labels."""
        where = str(Path(self._folder) / "reliability.csv")
        path = self.prompts.save_file("Save how repeatable labels are", where, _REPORTS)
        if path is not None:
            self._workspace.reliability.save(path)
            self._remember_folder(path)
            self._workspace.say(f"Wrote {path.name}")

    def show_disagreement(self, row: Disagreement) -> None:
        """Open the animal of two labels that lie apart, one of its labellings, and go to the point.

        The other label is shown as a grey reference point.
        """
        workspace = self._workspace
        try:
            file = workspace.reliability.file_of(row)
            if workspace.document.path != file:
                self.open_path(file)
            if workspace.document.state.specimen != row.specimen:
                return
            self._window.set_step("label")
            workspace.reliability.show(row)
        except GpError as error:
            workspace.say(str(error), "warning")
            return
        attempt(workspace, lambda: workspace.labels.go_to(row.side, row.code))

    def ask_save_atlas(self) -> None:
        """Ask where, and write the atlas in use."""
        path = self.prompts.save_file("Save the atlas", str(Path(self._folder) / "atlas.json"), _ATLASES)
        if path is not None:
            self._workspace.atlas.save(path)
            self._remember_folder(path)
            self._workspace.say(f"Wrote {path.name}")

    def _ask_animals(self, title: str, *, folder: bool) -> list[Path]:
        """Ask for the files of labelled animals, or a folder of them, and show the step Atlas."""
        if folder:
            chosen = self.prompts.folder(title, self._folder)
            paths = [] if chosen is None else [chosen]
        else:
            paths = self.prompts.open_files(title, self._folder, _LABELLED, many=True)
        if paths:
            self._remember_folder(paths[0])
            self._window.set_step("atlas")
        return paths
