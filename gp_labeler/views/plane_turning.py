"""Turning the planes of the other views, or the head, by dragging the arms of the crosshair."""

from __future__ import annotations

import numpy as np

from gp_core.errors import GpError
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.crosshair_arms import CrosshairArms
from gp_labeler.scene.gestures import CLICK_PIXELS
from gp_labeler.scene.slice_viewport import SliceViewport

__all__ = ["PlaneTurning"]

_ARM_TOOLS = ("place", "turn")
"""Tools with which a plain drag means nothing else, so that an arm can be taken anywhere."""

_MIDDLE_PIXELS = 14.0
"""With the tool that turns the head, nearer to the crosshair than this a drag moves the crosshair."""


class PlaneTurning:
    """The left button over the arms of one view.

    Parameters
    ----------
    workspace : Workspace
        Whose planes are turned.
    name : str
        The view that it is dragged in: its own plane stays.
    """

    def __init__(self, workspace: Workspace, name: str) -> None:
        self._workspace, self._name = workspace, name
        self._start: tuple[float, float] | None = None
        self._angle = self._turned = 0.0
        self.is_turning = False
        """Whether the planes are being turned."""

    def arms(self, shown: SliceViewport, ratio: float) -> CrosshairArms:
        """Return where the arms lie now."""
        view = self._workspace.view
        return CrosshairArms.of(shown, view.crosshair, view.planes, self._name, ratio)

    def is_over(self, shown: SliceViewport, x: float, y: float, ratio: float) -> bool:
        """Whether a drag that begins at a pixel turns the planes."""
        arms, tool = self.arms(shown, ratio), self._workspace.interaction.tool
        if tool == "turn":
            return float(np.linalg.norm(arms.middle - [x, y])) > _MIDDLE_PIXELS * ratio
        found = arms.arm_at(x, y) if tool in _ARM_TOOLS else arms.handle_at(x, y)
        return found is not None

    def press(self, shown: SliceViewport, x: float, y: float, ratio: float) -> bool:
        """Take a press; return whether it is on an arm."""
        self._start, self.is_turning, self._turned = None, False, 0.0
        if not self.is_over(shown, x, y, ratio):
            return False
        self._start, self._angle = (x, y), self.arms(shown, ratio).angle_of(x, y)
        return True

    def move(self, shown: SliceViewport, x: float, y: float, ratio: float) -> bool:
        """Take a movement; return whether it belongs to an arm, which turns the planes once it is a drag."""
        if self._start is None:
            return False
        if max(abs(x - self._start[0]), abs(y - self._start[1])) >= CLICK_PIXELS:
            self.is_turning = True
            self._workspace.view.set_turning(True)
        if self.is_turning:
            angle = self.arms(shown, ratio).angle_of(x, y)
            self._workspace.view.rotate_planes(self._name, angle - self._angle)
            self._turned += angle - self._angle
            self._angle = angle
        return True

    def release(self) -> bool:
        """Take a release; return whether the planes were turned. What turns the head is one edit."""
        turned, self.is_turning, self._start = self.is_turning, False, None
        self._workspace.view.set_turning(False)
        if turned and self._workspace.interaction.tool != "turn":
            self._workspace.view.planes_turned.emit(self._name, self._turned)
        elif turned:
            try:
                self._workspace.head.take_planes()
            except GpError as error:
                self._workspace.say(str(error), "warning")
        return turned

    def is_on_handle(self, shown: SliceViewport, x: float, y: float, ratio: float) -> bool:
        """Whether a pixel is one where any tool turns the planes."""
        if self._workspace.interaction.tool == "turn":
            return self.is_over(shown, x, y, ratio)
        return self.arms(shown, ratio).handle_at(x, y) is not None
