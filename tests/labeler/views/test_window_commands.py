"""Commands that need the window, and the questions that they ask."""

from __future__ import annotations

from pathlib import Path

import pytest
from qtpy.QtWidgets import QFileDialog

from gp_labeler.commands.actions import ACTIONS, run
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.window_commands.atlas import ATLAS_COMMANDS
from gp_labeler.views.window_commands.estimate import ESTIMATE_COMMANDS
from gp_labeler.views.window_commands.file import FILE_COMMANDS
from gp_labeler.views.window_commands.help import HELP_COMMANDS
from gp_labeler.views.window_commands.landmarks import LANDMARK_COMMANDS
from gp_labeler.views.window_commands.measure import MEASURE_COMMANDS
from gp_labeler.views.window_commands.table import WINDOW_COMMANDS
from gp_labeler.views.window_commands.view import VIEW_COMMANDS
from gp_labeler.views.window_state import WindowState


def test_the_window_does_every_command_that_the_models_cannot_and_no_other() -> None:
    assert WINDOW_COMMANDS.keys() == {id for id, row in ACTIONS.items() if row.run is None}
    tables = (
        *(FILE_COMMANDS, VIEW_COMMANDS, LANDMARK_COMMANDS, MEASURE_COMMANDS),
        *(ATLAS_COMMANDS, ESTIMATE_COMMANDS, HELP_COMMANDS),
    )
    assert sum(map(len, tables)) == len(WINDOW_COMMANDS), "none is in two tables"


def test_a_command_that_needs_a_window_says_so_without_one() -> None:
    workspace, said = Workspace(None), []
    workspace.messages.said.connect(lambda text, level: said.append(text))
    assert not run("help.about", workspace)
    assert said == ["help.about needs a window"]


@pytest.mark.parametrize("kind", ["open", "folder", "save"])
def test_the_next_dialog_begins_where_the_last_file_was(qapp, monkeypatch, tmp_path: Path, kind: str) -> None:
    chosen, began = [str(tmp_path / "heads" / "one.nrrd"), ""], []

    def choose(parent, title, folder, *filters):
        began.append(Path(folder))
        name = chosen.pop(0)
        return name if kind == "folder" else (name, "")

    name = {"open": "getOpenFileName", "folder": "getExistingDirectory", "save": "getSaveFileName"}[kind]
    monkeypatch.setattr(QFileDialog, name, choose)
    memory = WindowState(tmp_path / "window.json")
    prompts = Prompts(None, memory)
    ask = {
        "open": lambda: prompts.open_files("Open", "*"),
        "folder": lambda: prompts.folder("Folder"),
        "save": lambda: prompts.save_file("Save", "", "*"),
    }[kind]
    first, second = ask(), ask()
    assert first in (Path(tmp_path / "heads" / "one.nrrd"), [Path(tmp_path / "heads" / "one.nrrd")])
    assert not second
    assert began == [Path.home(), tmp_path / "heads"]
    memory.save()
    assert Prompts(None, WindowState(tmp_path / "window.json")).last_folder == tmp_path / "heads"
