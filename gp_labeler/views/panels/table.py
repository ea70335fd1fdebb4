"""The panels of the steps: those that are built in, and those that installed packages add."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QWidget

from gp_core.errors import GpError
from gp_core.extensions import Extensions
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.action_button import Actions
from gp_labeler.views.panels.atlas.panel import AtlasPanel
from gp_labeler.views.panels.label.panel import LabelPanel
from gp_labeler.views.panels.pose.panel import PosePanel
from gp_labeler.views.panels.scan.panel import ScanPanel

__all__ = ["PANELS", "added_panels", "fault_text", "panel_at_fault"]

PANELS: Extensions[Callable[[Workspace, Actions], QWidget]] = Extensions(
    "gp_labeler.panels", {"scan": ScanPanel, "label": LabelPanel, "atlas": AtlasPanel, "pose": PosePanel}
)
"""What makes the panel of a step: of what it shows, and of the actions that its buttons do."""


def added_panels(workspace: Workspace, actions: Actions) -> Iterator[tuple[str, QWidget | GpError]]:
    """Make the panels that installed packages add.

    Yields
    ------
    tuple of str and (QWidget or GpError)
        The name of each, and the panel or what hinders it; the error names the package.
    """
    for name, make in PANELS.added.items():
        try:
            panel = make(workspace, actions)
            if not isinstance(panel, QWidget):
                raise TypeError("it made no widget")
        except Exception as error:  # whatever a package does
            yield name, PANELS.failure(name, error)
        else:
            panel.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
            panel.setProperty("role", "panel")  # the ground of all panels
            yield name, panel


def panel_at_fault(error: BaseException) -> str | None:
    """Return the name of the added panel whose package raised an error, or the cause of one."""
    packages = {make.__module__.partition(".")[0]: name for name, make in PANELS.added.items()}
    cause: BaseException | None = error
    while cause is not None and packages:
        for frame, _ in traceback.walk_tb(cause.__traceback__):
            package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
            if package in packages:
                return packages[package]
        cause = cause.__cause__ or cause.__context__
    return None


def fault_text(error: BaseException) -> str:
    """Say what went wrong in the program; the panel of an installed package that is at fault is named."""
    panel = panel_at_fault(error)
    if panel is None or not isinstance(error, Exception):
        return f"{type(error).__name__}: {error}"
    return str(PANELS.failure(panel, error))
