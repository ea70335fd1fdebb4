"""Window and level of the slices, as the view model has them."""

from __future__ import annotations

from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.window_level import WindowLevel

__all__ = ["drag_window_level", "window_level_of"]

_DRAG_FOR_RANGE = 400.0
"""Logical pixels of a drag that change window or level by as much as the whole range of grey values."""


def window_level_of(workspace: Workspace) -> WindowLevel:
    """Return the grey scale: what the user set, else what suits the volume."""
    view, volume = workspace.view.state, workspace.scan.volume
    if view.level is not None and view.width is not None:
        return WindowLevel(view.level - view.width / 2, view.level + view.width / 2)
    return WindowLevel(0.0, 1.0) if volume is None else WindowLevel.of(volume)


def drag_window_level(workspace: Workspace, dx: float, dy: float) -> None:
    """Change the grey scale as a drag by so many logical pixels does: right is wider, down is brighter."""
    if workspace.scan.volume is None:
        return
    per_pixel = WindowLevel.of(workspace.scan.volume).width / _DRAG_FOR_RANGE
    scale = window_level_of(workspace).moved(dx * per_pixel, -dy * per_pixel, smallest=per_pixel)
    workspace.view.update(level=scale.level, width=scale.width)
