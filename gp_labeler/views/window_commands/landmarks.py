"""What the menus Edit and Landmarks ask: exchanges, labellings, and first labels from labelled scans."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from gp_core.errors import GpError
from gp_core.landmarks.features import FEATURES, feature
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.label.labellings_dialog import LabellingsDialog
from gp_labeler.views.panels.label.suggestion_page_dialog import SuggestionPageDialog
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.window_commands.command import Asking, WindowCommand
from gp_labeler.views.window_commands.view import ask_reopen_mirrored

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["AS_THE_FILE", "FOLDER", "LANDMARK_COMMANDS"]

AS_BEFORE = "The same as for the head before"
LISTED, FOLDER, FILES = "From the list of specimens", "From a folder…", "From files…"
AS_THE_FILE, MIRRORED = "Left is correct", "The scan is mirrored…"
_LABELLED = "Labelled scans (*.gpspecimen.json *.mrk.json *.fcsv);;All files (*)"


def ask_swap(workspace: Workspace, prompts: Prompts) -> None:
    """Ask with which other point of the side the active one shall be exchanged."""
    active = workspace.labels.active
    if active.code is None:
        return
    others = [f for f in FEATURES if not (f.computed or f.shared or f.code == active.code)]
    if feature(active.code).shared:
        raise GpError(f"{active.code} is shared by both sides and cannot be exchanged")
    text = f"Exchange {active.code} {active.side.word} with"
    chosen = prompts.item("Exchange", text, [f"{f.code}  {f.name}" for f in others])
    if chosen:
        workspace.labels.swap(active.side, active.code, chosen.split()[0])


def show_labellings(window: MainWindow) -> None:
    """Show who labels, and all labellings of the specimen."""
    LabellingsDialog(window.workspace, window).open()


def label_again(window: MainWindow) -> None:
    """Begin the next round; ask first who labels where that is not known."""
    if window.workspace.document.author:
        window.workspace.label_again()
        window.set_step("label")
    else:
        show_labellings(window)


def check_in_pages(window: MainWindow) -> None:
    """Show the suggestions in pages of close views."""
    window.workspace.pages.begin()
    dialog = window.findChild(SuggestionPageDialog) or SuggestionPageDialog(window.workspace, window)
    dialog.show()
    dialog.raise_()
    dialog.activateWindow()


def place_by_click(window: MainWindow) -> None:
    """Let the next click place the active point."""
    if not window.workspace.interaction.is_labelling:
        window.set_step("label")
    window.workspace.interaction.set_tool("place")


def ask_suggest_like(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for labelled scans and for the left side, and suggest landmarks from them; stop where it runs."""
    model = workspace.first_labels
    if model.is_running:
        model.cancel()
        return
    labelled, asks_left = _ask_labelled(workspace, prompts), not model.knows_left
    if labelled and _knows_left(workspace, prompts):
        model.suggest(labelled, left_confirmed=asks_left)


def _ask_labelled(workspace: Workspace, prompts: Prompts) -> list[Path]:
    """Return the labelled scans that the user chooses; none where the user thinks better of it."""
    open_now = workspace.document.path
    listed = [
        row.path for row in workspace.specimens.every if sum(row.placed.values()) and row.path != open_now
    ]
    before = list(workspace.first_labels.labelled)
    answers = [AS_BEFORE] * bool(before) + [LISTED] * bool(listed) + [FOLDER, FILES]
    answer = prompts.choose(
        "Suggest from my scans",
        "Which labelled scans should the suggestions be based on?",
        answers,
        detail="Three to five heads of the same species are enough. The first run prepares "
        "each scan, which takes some minutes. A suggestion counts when you have confirmed it.",
    )
    if answer == FOLDER:
        folder = prompts.folder("A folder of labelled scans")
        return [] if folder is None else [folder]
    if answer == FILES:
        return prompts.open_files("Labelled scans", _LABELLED, many=True)
    return {AS_BEFORE: before, LISTED: listed}.get(answer, [])


def _knows_left(workspace: Workspace, prompts: Prompts) -> bool:
    """Return whether left is known, if need be by asking."""
    if workspace.first_labels.knows_left:
        return True
    answer = prompts.choose(
        "Left and right",
        "Is the animal's left side where the file says it is?",
        [AS_THE_FILE, MIRRORED],
        detail="A scan cannot prove it: a head and its mirror image look alike. Check it against "
        "a mark on the animal. A mirrored scan is reloaded with its slices reversed.",
    )
    if answer == MIRRORED:
        ask_reopen_mirrored(workspace, prompts)
        return False
    return bool(answer)


LANDMARK_COMMANDS: Mapping[str, WindowCommand] = MappingProxyType(
    {
        "edit.swap": Asking(ask_swap),
        "tool.place": place_by_click,
        "point.suggest_like": Asking(ask_suggest_like),
        "point.check_page": check_in_pages,
        "labelling.again": label_again,
        "labelling.show": show_labellings,
    }
)
