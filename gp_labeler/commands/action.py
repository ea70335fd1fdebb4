"""What a command of the window is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from gp_core.validation import FloatArray
from gp_labeler.models.workspace import Workspace

__all__ = ["MENUS", "Action", "Run", "Test", "Ui"]

MENUS = ("File", "Edit", "View", "Landmarks", "Measure", "Atlas", "Estimate", "Help")


class Ui(Protocol):
    """What actions need of the window: to ask, to show, and what belongs to the screen alone."""

    def open_path(self, path: Path) -> None: ...  # noqa: D102
    def begin(self) -> None: ...  # noqa: D102
    def ask_open_file(self) -> None: ...  # noqa: D102
    def ask_open_folder(self) -> None: ...  # noqa: D102
    def ask_find_scan(self) -> None: ...  # noqa: D102
    def ask_import(self) -> None: ...  # noqa: D102
    def ask_export(self) -> None: ...  # noqa: D102
    def ask_references(self) -> None: ...  # noqa: D102
    def ask_add_mesh(self) -> None: ...  # noqa: D102
    def ask_save_mesh(self) -> None: ...  # noqa: D102
    def ask_screenshot(self) -> None: ...  # noqa: D102
    def show_measurements(self) -> None: ...  # noqa: D102
    def ask_import_measurements(self) -> None: ...  # noqa: D102
    def ask_export_measurements(self) -> None: ...  # noqa: D102
    def ask_suggest_like(self) -> None: ...  # noqa: D102
    def ask_swap(self) -> None: ...  # noqa: D102
    def show_specimens(self) -> None: ...  # noqa: D102
    def open_next_specimen(self) -> None: ...  # noqa: D102
    def show_labellings(self) -> None: ...  # noqa: D102
    def ask_open_touches(self) -> None: ...  # noqa: D102
    def ask_open_skull(self) -> None: ...  # noqa: D102
    def judge_pose(self, verdict: str) -> None: ...  # noqa: D102
    def look_along_axis(self) -> None: ...  # noqa: D102
    def look_through_window(self) -> None: ...  # noqa: D102
    def ask_export_pose(self) -> None: ...  # noqa: D102
    def ask_report(self) -> None: ...  # noqa: D102
    def ask_path(self) -> None: ...  # noqa: D102
    def ask_save_path(self) -> None: ...  # noqa: D102
    def show_tracker(self) -> None: ...  # noqa: D102
    def show_guide(self) -> None: ...  # noqa: D102
    def show_physical(self) -> None: ...  # noqa: D102
    def ask_open_atlas(self) -> None: ...  # noqa: D102
    def ask_fit_atlas(self, *, folder: bool = False) -> None: ...  # noqa: D102
    def ask_reliability(self, *, folder: bool = False) -> None: ...  # noqa: D102
    def ask_save_reliability(self) -> None: ...  # noqa: D102
    def ask_save_atlas(self) -> None: ...  # noqa: D102
    def show_step(self, step: str) -> None: ...  # noqa: D102
    def open_demo(self) -> None: ...  # noqa: D102
    def save(self, *, ask: bool = False) -> bool: ...  # noqa: D102
    def close_window(self) -> None: ...  # noqa: D102
    def reset_views(self) -> None: ...  # noqa: D102
    def zoom_to_point(self) -> None: ...  # noqa: D102
    def look_closely(self, position: FloatArray | None) -> None: ...  # noqa: D102
    def ask_reopen_mirrored(self) -> None: ...  # noqa: D102
    def reset_view_here(self) -> None: ...  # noqa: D102
    def ask_position(self) -> None: ...  # noqa: D102
    def cut_open(self) -> None: ...  # noqa: D102
    def look_from(self, letter: str) -> None: ...  # noqa: D102
    def cut(self, plane: str) -> None: ...  # noqa: D102
    def toggle_theme(self) -> None: ...  # noqa: D102
    def ask_canvas(self) -> None: ...  # noqa: D102
    def change_text_size(self, step: int) -> None: ...  # noqa: D102
    def toggle_projection(self) -> None: ...  # noqa: D102
    def show_shortcuts(self) -> None: ...  # noqa: D102
    def show_about(self) -> None: ...  # noqa: D102
    def toggle_recording(self) -> None: ...  # noqa: D102


Run = Callable[[Workspace, Ui], object]
Test = Callable[[Workspace], bool]


@dataclass(frozen=True)
class Action:
    """One command.

    Parameters
    ----------
    id : str
        Its name in scripts, such as ``edit.undo``; never changes.
    menu : str
        One of `MENUS`.
    title : str
        What the menu says.
    shortcuts : tuple of str
        Keys, as Qt writes them; the first is shown.
    run : callable
        Does it.
    enabled : callable
        Whether it can be done now.
    checked : callable, optional
        For what is on or off: whether it is on.
    hint : str
        A sentence more, for tool tips and the sheet.
    group : str
        Neighbours of the same group stand between the same separators.
    icon : str
        Name of its icon.
    """

    id: str
    menu: str
    title: str
    shortcuts: tuple[str, ...]
    run: Run
    enabled: Test = lambda workspace: True
    checked: Test | None = None
    hint: str = ""
    group: str = ""
    icon: str = ""
