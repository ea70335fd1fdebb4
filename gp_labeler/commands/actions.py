"""Every command of the window, as one table that menus, buttons, the sheet of shortcuts and scripts read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from gp_core.errors import GpError
from gp_labeler.commands.action import MENUS, Action
from gp_labeler.commands.atlas_rows import atlas_rows
from gp_labeler.commands.frame_rows import frame_rows
from gp_labeler.commands.labelling_rows import labelling_rows
from gp_labeler.commands.measure_rows import measure_rows
from gp_labeler.commands.pose_rows import pose_rows
from gp_labeler.commands.rows import edit_rows, file_rows, help_rows, landmark_rows, view_rows
from gp_labeler.commands.slab_rows import slab_rows
from gp_labeler.commands.view_rows import cut_rows
from gp_labeler.models.workspace import Workspace

__all__ = ["ACTIONS", "MENUS", "Action", "InWindow", "action", "gestures", "run"]

ACTIONS: Mapping[str, Action] = MappingProxyType(
    {
        row.id: row
        for rows in (
            file_rows,
            edit_rows,
            view_rows,
            cut_rows,
            slab_rows,
            frame_rows,
            landmark_rows,
            labelling_rows,
            measure_rows,
            atlas_rows,
            pose_rows,
            help_rows,
        )
        for row in rows()
    }
)


def action(id: str) -> Action:
    """Return an action by its id.

    Raises
    ------
    GpError
        There is none of this name.
    """
    if id not in ACTIONS:
        raise GpError(f"unknown action {id!r}", remedy=f"There are {', '.join(ACTIONS)}.")
    return ACTIONS[id]


InWindow = Callable[[str], Callable[[], object]]
"""Returns what a window does for an action, by its id; see `gp_labeler.views.window_commands`."""


def _without_window(id: str) -> Callable[[], object]:
    raise GpError(f"{id} needs a window")


def run(id: str, workspace: Workspace, in_window: InWindow = _without_window) -> bool:
    """Do an action; where it cannot be done, the user is told why.

    Parameters
    ----------
    id : str
        Its name.
    workspace : Workspace
        What it acts on.
    in_window : callable
        What a window does for the actions that need one.

    Returns
    -------
    bool
        Whether it was done.
    """
    row = action(id)
    if not row.enabled(workspace):
        return False
    try:
        in_window(id)() if row.run is None else row.run(workspace)
    except GpError as error:
        workspace.say(str(error), "warning")
        return False
    return True


def gestures() -> tuple[tuple[str, tuple[tuple[str, str], ...]], ...]:
    """Return what the mouse and the arrow keys do, by where: for the sheet of shortcuts."""
    return (
        (
            "In the 3D view",
            (
                ("Click on bone", "Place the active feature"),
                ("Drag a point", "Move it, on the bone"),
                ("Ctrl+click", "Move the chosen point here"),
                ("Left drag", "Rotate (Ctrl: spin)"),
                ("Middle drag, Shift+drag", "Pan"),
                ("Wheel, right drag", "Zoom"),
                ("Alt+wheel", "Move the cut through bone"),
                ("Shift+move", "Move the crosshair"),
                ("Drag an end of a ruler", "Move it, on the bone"),
                ("Arrow keys", "Rotate"),
                ("Shift+arrow keys", "Pan"),
                ("+ and −", "Zoom"),  # noqa: RUF001 - as on the keyboard
                ("Right click on a point", "Open the menu of the point"),
                ("Double click", "Maximise or restore"),
            ),
        ),
        (
            "On a slice",
            (
                ("Click", "Place the active feature"),
                ("Drag a point", "Move it, on bone if placed there (Alt: freely)"),
                ("Ctrl+click", "Move the chosen point here"),
                ("Drag an end of a ruler", "Move it"),
                ("Arrow keys", "Move the point a voxel"),
                ("Shift+arrow keys", "Move the crosshair (Ctrl: ten voxels)"),
                ("+ and −", "Zoom"),  # noqa: RUF001 - as on the keyboard
                ("Wheel, F and B", "Next and previous slice"),
                ("Right drag, Ctrl+wheel", "Zoom"),
                ("Middle drag, Shift+drag", "Pan"),
                ("Shift+move", "Move the crosshair"),
                ("Right click on a point", "Open the menu of the point"),
                ("Double click", "Maximise or restore"),
            ),
        ),
        (
            "On a page of close views",
            (
                ("Ctrl+click", "Correct the suggestion"),
                ("Wheel", "Next and previous slice"),
                ("Click, Space", "Look at it in the views"),
                ("Enter", "Confirm the others"),
            ),
        ),
    )
