"""What the menu View does to the views on the screen, and asks: positions, the canvas, left and right."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

from qtpy.QtCore import Qt

from gp_core.errors import GpError
from gp_core.landmarks.features import feature
from gp_labeler.document.specimen_file import SUFFIX
from gp_labeler.models.typed_position import typed_position
from gp_labeler.models.view import CUTS
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.canvas_question import ask_canvas
from gp_labeler.views.fonts import nearest_text_size
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.status_line import where_text
from gp_labeler.views.view_grid import CLOSE_MM
from gp_labeler.views.window_commands.command import Asking, WindowCommand
from gp_labeler.views.window_commands.file import resolve_unsaved

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["VIEW_COMMANDS", "ask_reopen_mirrored"]

_OPEN_MM = 16.0
"""Across the 3D view once bone is cut open at a feature."""


def reset_view_here(window: MainWindow) -> None:
    """Show everything in the view under the pointer, and leave the others as they are."""
    window.grid.frames[window.grid.name_here].view.reset()


def zoom_to_point(window: MainWindow) -> None:
    """Look closely at the chosen point, or at where it is expected."""
    workspace, active = window.workspace, window.workspace.labels.active
    if active.code is not None:
        workspace.labels.go_to(active.side, active.code)
    for view in window.grid.views:
        view.zoom_to(workspace.view.crosshair, CLOSE_MM)


def ask_straighten_like(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for a straightened head of the same species, and straighten this one with it as the template."""
    for file in prompts.open_files("Straighten like which head?", f"Specimens (*{SUFFIX})"):
        workspace.head.straighten(like=file)


def ask_position(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for a scan position, and bring it into every view."""
    view, volume = workspace.view, workspace.scan.volume
    here = where_text(view.crosshair).removesuffix(" mm")
    text = prompts.text("Go to", "Position in the scan, mm (LPS)", here)
    if text is None or volume is None:
        return
    position = typed_position(text)
    if not volume.contains(position[None])[0]:
        low, high = (where_text(corner) for corner in volume.extent)
        problem = f"{where_text(position)} lies outside the scan"
        raise GpError(problem, remedy=f"It reaches from {low} to {high}.")
    view.show_point(position)


def go_to_next_view(window: MainWindow) -> None:
    """Give the keyboard to the next view that is shown; from elsewhere, to the first."""
    views = [window.grid.frames[name].view for name in window.grid.shown]
    here = next((n for n, view in enumerate(views) if view.hasFocus()), -1)
    views[(here + 1) % len(views)].setFocus(Qt.FocusReason.ShortcutFocusReason)


def go_to_step(window: MainWindow, step: str) -> None:
    """Show a step, and give the keyboard to its panel."""
    window.set_step(step)
    panel = window.steps[step] if window.steps[step].isVisible() else window.welcome
    panel.setFocus(Qt.FocusReason.ShortcutFocusReason)


def look_from(window: MainWindow, letter: str) -> None:
    """Look at the bone from ``A``, ``P``, ``L``, ``R``, ``S`` or ``I``."""
    window.grid.scene_view.view_from(letter)


def toggle_projection(window: MainWindow) -> None:
    """Change between parallel and perspective."""
    view = window.grid.scene_view
    view.scene.camera.parallel = not view.scene.camera.parallel
    view.redraw()


def toggle_cut(window: MainWindow, plane: str) -> None:
    """Cut the bone open by a plane through the crosshair, or leave it whole where that plane cuts it."""
    cut = window.workspace.view.state.cut
    if cut is not None and cut.plane == plane:
        window.workspace.view.update(cut=None)
    else:
        window.grid.scene_view.cut(plane)


def cut_open(window: MainWindow) -> None:
    """Cut the bone open so that the active point, or where it is expected, is seen."""
    labels = window.workspace.labels
    active = labels.active
    where = None if active.code is None else labels.place_of(active.side, active.code)
    if active.code is None or where is None:
        raise GpError(
            "the position of the feature is not known yet", remedy="Place it, or three others first."
        )
    best = feature(active.code).view.lower()
    window.grid.scene_view.cut_open(where, best if best in CUTS else "view", _OPEN_MM)


def toggle_theme(window: MainWindow) -> None:
    """Change between dark and light."""
    window.set_theme("light" if window.theme_name == "dark" else "dark")


def change_text_size(window: MainWindow, step: int) -> None:
    """Draw text larger (1) or smaller (-1), or as large as the desktop's (0)."""
    window.set_text_size(nearest_text_size(window.text_size, step=step) if step else 100)


def ask_reopen_mirrored(workspace: Workspace, prompts: Prompts) -> None:
    """Ask whether to read the scan again with its slices in reverse order, as a new specimen."""
    volume = workspace.scan.volume
    if volume is None or volume.path is None:
        raise GpError("only a scan in a file can be read again", remedy="Mirror it where it was made.")
    text = "Read the scan again, mirrored?"
    detail = (
        "Its slices are taken in reverse order, which exchanges left and right. It is opened as a new "
        "specimen: labels that were placed on the mirrored head do not fit it. Positions are then those "
        "of the mirrored scan."
    )
    if prompts.choose("Left and right", text, ["Read it mirrored"], detail=detail) and (
        resolve_unsaved(workspace, prompts)
    ):
        workspace.head.reopen_mirrored()


VIEW_COMMANDS: Mapping[str, WindowCommand] = MappingProxyType(
    {
        "view.fit_here": reset_view_here,
        "view.next_view": go_to_next_view,
        "view.step_scan": partial(go_to_step, step="scan"),
        "view.step_label": partial(go_to_step, step="label"),
        "view.step_atlas": partial(go_to_step, step="atlas"),
        "view.step_pose": partial(go_to_step, step="pose"),
        "view.zoom_to_point": zoom_to_point,
        "view.go_to": Asking(ask_position),
        "view.from_anterior": partial(look_from, letter="A"),
        "view.from_posterior": partial(look_from, letter="P"),
        "view.from_left": partial(look_from, letter="L"),
        "view.from_right": partial(look_from, letter="R"),
        "view.from_superior": partial(look_from, letter="S"),
        "view.from_inferior": partial(look_from, letter="I"),
        "view.projection": toggle_projection,
        "view.cut_axial": partial(toggle_cut, plane="axial"),
        "view.cut_sagittal": partial(toggle_cut, plane="sagittal"),
        "view.cut_coronal": partial(toggle_cut, plane="coronal"),
        "view.cut_view": partial(toggle_cut, plane="view"),
        "view.cut_open": cut_open,
        "view.theme": toggle_theme,
        "view.text_larger": partial(change_text_size, step=1),
        "view.text_smaller": partial(change_text_size, step=-1),
        "view.text_normal": partial(change_text_size, step=0),
        "view.canvas": lambda window: ask_canvas(window, window.prompts),
        "head.like": Asking(ask_straighten_like),
        "head.left_is_right": Asking(ask_reopen_mirrored),
    }
)
