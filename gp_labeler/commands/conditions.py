"""Conditions under which commands of several menus are enabled or checked."""

from __future__ import annotations

from gp_labeler.commands.action import Test
from gp_labeler.models.workspace import Workspace

__all__ = ["always", "has_scan", "has_tool"]


def always(workspace: Workspace) -> bool:
    """Return True."""
    return True


def has_scan(workspace: Workspace) -> bool:
    """Whether a scan is open."""
    return workspace.scan.volume is not None


def has_tool(tool: str) -> Test:
    """Return whether a tool of the mouse is in use, as a condition."""
    return lambda workspace: workspace.interaction.tool == tool
