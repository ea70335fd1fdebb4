"""What the menu Atlas asks: files and folders of atlases and labelled animals; and going to a finding."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from gp_core.atlas.label_check import Finding
from gp_core.errors import GpError
from gp_core.landmarks.features import feature
from gp_core.study.reliability import Disagreement
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.signals import attempt
from gp_labeler.views.window_commands.command import Asking, WindowCommand
from gp_labeler.views.window_commands.file import open_path

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["ATLAS_COMMANDS", "show_disagreement", "show_finding"]

_ATLASES = "Atlases (*.json);;All files (*)"
_REPORTS = "Tables (*.csv);;JSON (*.json);;Pictures (*.png *.pdf *.svg)"
_LABELLED = "Labelled animals (*.mrk.json *.fcsv *.gpspecimen.json);;All files (*)"
_FIT, _COMPARE = "Fit an atlas to these animals", "Compare the labels of these animals"


def ask_open_atlas(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for an atlas file, and take it."""
    for path in prompts.open_files("Open an atlas", _ATLASES):
        workspace.atlas.open(path)


def ask_save_atlas(workspace: Workspace, prompts: Prompts) -> None:
    """Ask where, and write the atlas in use."""
    path = prompts.save_file("Save the atlas", "atlas.json", _ATLASES)
    if path is not None:
        workspace.atlas.save(path)
        workspace.say(f"Wrote {path.name}")


def ask_save_reliability(workspace: Workspace, prompts: Prompts) -> None:
    """Ask where, and write what was found on repeated labels."""
    path = prompts.save_file("Save how repeatable labels are", "reliability.csv", _REPORTS)
    if path is not None:
        workspace.reliability.save(path)
        workspace.say(f"Wrote {path.name}")


def fit_atlas(window: MainWindow, paths: list[Path]) -> None:
    """Fit an atlas to labelled animals, and show the step Atlas; without any, do nothing."""
    if paths:
        window.set_step("atlas")
        window.workspace.atlas.fit(paths)


def compare_labels(window: MainWindow, paths: list[Path]) -> None:
    """Compare the labels of animals that were labelled more than once; without any, do nothing."""
    if paths:
        window.set_step("atlas")
        window.workspace.reliability.measure(paths)


def show_finding(window: MainWindow, finding: Finding) -> None:
    """Open the animal of a finding, and go to its first point."""
    workspace, name, side = window.workspace, finding.specimen, finding.side
    if workspace.document.state.specimen != name:
        animals = workspace.atlas.animals
        file = None if animals is None else animals.specimen_file(name, side)
        if file is None:
            workspace.say(f"{name} has no specimen file: open its scan and import its landmarks", "warning")
            return
        open_path(workspace, window.prompts, file)
        if workspace.document.state.specimen != name:
            return
    window.set_step("label")
    code = next((code for code in finding.landmarks if not feature(code).computed), None)
    if code is not None:
        attempt(workspace, lambda: workspace.labels.go_to(side, code))


def show_disagreement(window: MainWindow, row: Disagreement) -> None:
    """Open the animal of two labels that lie apart, one of its labellings, and go to the point.

    The other label is shown as a grey reference point.
    """
    workspace = window.workspace
    try:
        file = workspace.reliability.file_of(row)
        if workspace.document.path != file:
            open_path(workspace, window.prompts, file)
        if workspace.document.state.specimen != row.specimen:
            return
        window.set_step("label")
        workspace.reliability.show(row)
    except GpError as error:
        workspace.say(str(error), "warning")
        return
    attempt(workspace, lambda: workspace.labels.go_to(row.side, row.code))


def _ask_files(window: MainWindow, title: str) -> list[Path]:
    return window.prompts.open_files(title, _LABELLED, many=True)


def _ask_folder(window: MainWindow, title: str) -> list[Path]:
    folder = window.prompts.folder(title)
    return [] if folder is None else [folder]


ATLAS_COMMANDS: Mapping[str, WindowCommand] = MappingProxyType(
    {
        "atlas.show": lambda window: window.set_step("atlas"),
        "atlas.open": Asking(ask_open_atlas),
        "atlas.fit_files": lambda window: fit_atlas(window, _ask_files(window, _FIT)),
        "atlas.fit_folder": lambda window: fit_atlas(window, _ask_folder(window, _FIT)),
        "atlas.save": Asking(ask_save_atlas),
        "atlas.reliability_files": lambda window: compare_labels(window, _ask_files(window, _COMPARE)),
        "atlas.reliability_folder": lambda window: compare_labels(window, _ask_folder(window, _COMPARE)),
        "atlas.save_reliability": Asking(ask_save_reliability),
    }
)
