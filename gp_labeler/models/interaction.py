"""What the mouse and the keys do next, and a point that is being dragged."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_core.validation import FloatArray
from gp_labeler.document.edits import point_text, require_free
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import How, Landmark, point_key
from gp_labeler.models.labels import LabelsModel
from gp_labeler.models.messages import Messages
from gp_labeler.models.view import ViewModel
from gp_labeler.models.workflow import Active

__all__ = ["TOOLS", "InteractionModel", "PointDrag", "VisibleArea"]

TOOLS = ("place", "look", "grey", "touch", "ruler", "angle", "turn")
"""What a left click or drag over a slice does: place, move the crosshair, grey window, touch, measure, turn
the head by hand."""


class VisibleArea(Protocol):
    """What the window knows of what the user sees."""

    def can_judge(self, position: FloatArray) -> bool:
        """Whether a painted view shows a (3,) scan position with voxels at least two screen pixels wide."""

    def bring_close(self, position: FloatArray) -> None:
        """Show a (3,) scan position so closely that it can be judged."""

    def hides(self, position: FloatArray) -> bool:
        """Whether bone hides a (3,) scan position in the 3D view."""


class PointDrag:
    """A placed or suggested point that is being dragged: shown where the pointer is, and not yet an edit."""

    def __init__(self, side: Side, code: str, position: FloatArray, how: How) -> None:
        self.side, self.code, self.position, self.how = side, code, position, how


class InteractionModel:
    """Keeps the tool, the point that is dragged or will be re-placed, and the one that arrow keys move.

    Parameters
    ----------
    document : SpecimenDocument
        Where points are placed.
    labels : LabelsModel
        Says which point is active.
    view : ViewModel
        Its crosshair follows a dragged point.
    messages : Messages
        What the user is told by.
    """

    tool_changed = Signal(str)
    replacing_changed = Signal(bool)
    """Whether the next click moves the active point, which is placed or suggested already."""
    dragged = Signal(object)
    """The `PointDrag` that goes on; None when it is over."""

    def __init__(
        self, document: SpecimenDocument, labels: LabelsModel, view: ViewModel, messages: Messages
    ) -> None:
        self._document, self._labels, self._view, self._messages = document, labels, view, messages
        self.tool = "place"
        self.is_labelling = True
        """Whether a plain click may place."""
        self.replacing = False
        """Whether the next click moves the active point."""
        self.drag: PointDrag | None = None
        self.visible_area: VisibleArea | None = None
        """Of the window, if there is one."""
        self._last: tuple[Side, str] | None = None
        self._choices_since_edit = 0
        document.reset.connect(self._on_reset)
        document.landmarks_changed.connect(self._on_landmarks)
        labels.active_changed.connect(self._on_active)

    # The tool

    def set_tool(self, tool: str) -> None:
        """Choose what a left click over a slice does, one of `TOOLS`."""
        if tool not in TOOLS:
            raise GpError(f"tool must be one of {', '.join(TOOLS)}, got {tool!r}")
        if tool != self.tool:
            self.tool = tool
            self.tool_changed.emit(tool)

    def leave_turning(self) -> None:
        """Go back to the tool that the step begins with, once the head is turned."""
        if self.tool == "turn":
            self.set_tool("place" if self.is_labelling else "look")

    def begin_labelling(self) -> None:
        """Let a click place points."""
        self.is_labelling = True
        if self.tool != "grey":
            self.set_tool("place")

    def begin_looking(self, *, keep_touching: bool = False) -> None:
        """Let clicks look, not place: outside the step Label, a click is not meant for a landmark."""
        self.is_labelling = False
        self.arm_replacing(False)
        if self.tool == "place" or (self.tool == "touch" and not keep_touching):
            self.set_tool("look")

    def arm_replacing(self, on: bool = True) -> None:
        """Let the next click, and no other, move the active point, or give that up.

        Raises
        ------
        GpError
            No placed or suggested point is active, or it is locked.
        """
        if on:
            active, mark = self._labels.active, self.active_landmark()
            if active.code is None or mark is None or mark.shown_position is None:
                raise GpError("no placed point is selected", remedy="Choose one in the table.")
            require_free(self._document.state, [point_key(active.side, active.code)])
        if on != self.replacing:
            self.replacing = on
            self.replacing_changed.emit(on)

    def active_landmark(self) -> Landmark | None:
        """Return what is known of the active point; None where no point is active."""
        active = self._labels.active
        return None if active.code is None else self._document.state.landmark(active.side, active.code)

    # Confirming and nudging what was seen

    def confirm(self, side: Side, code: str) -> bool:
        """Confirm a suggestion, or a ghost, that was drawn where it can be judged; else bring it there first.

        Returns
        -------
        bool
            Whether it is confirmed. Where not, the view shows it now, for the user to judge and confirm it.

        Raises
        ------
        GpError
            Nothing suggests where the point is, or it is locked.
        """
        is_ghost = code in self._labels.ghosts(side)
        where = self._labels.place_of(side, code)
        if where is None or self._document.state.landmark(side, code).decided:
            point = point_text(side, code)
            raise GpError(f"{point} is not suggested, so there is nothing to confirm", landmark=code)
        if self._had_to_come_close(side, code, where):
            return False
        if is_ghost:
            self._labels.accept_ghost(side=side, code=code)
        return self._labels.confirm(side=side, code=code)

    def nudged_point(self) -> tuple[Side, str] | None:
        """Return the point that arrow keys move: the active one, or the one of the last edit.

        That one is meant where the active one has no place, or is a suggestion that came up by itself.
        """
        active, last, mark = self._labels.active, self._last, self.active_landmark()
        is_last_placed = last is not None and self._document.state.landmark(*last).position is not None
        came_by_itself = mark is not None and mark.suggestion is not None and self._choices_since_edit <= 1
        has_place = mark is not None and mark.shown_position is not None
        if active.code is not None and has_place and not (came_by_itself and is_last_placed):
            return active.side, active.code
        return last if is_last_placed else None

    def nudge(self, offset: FloatArray) -> tuple[Side, str] | None:
        """Move that point by a (3,) offset, mm, scan frame; a suggestion only where it can be judged.

        Returns what was moved, None where nothing was; raises `GpError` where the point is locked.
        """
        target = self.nudged_point()
        if target is None:
            return None
        mark = self._document.state.landmark(*target)
        if mark.suggestion and self._had_to_come_close(*target, np.array(mark.suggestion.position)):
            return None
        self._labels.nudge(offset, side=target[0], code=target[1])
        return target

    def _had_to_come_close(self, side: Side, code: str, where: FloatArray) -> bool:
        """Whether a suggestion could not be judged where it was seen, and so is shown from close by now."""
        area = self.visible_area
        if area is None or (self._labels.active == Active(side, code) and area.can_judge(where)):
            return False
        self._labels.choose(side, code)
        area.bring_close(where)
        self._messages.say(
            f"Is {point_text(side, code)} correct? Press Enter to confirm it, or drag it to its position"
        )
        return True

    # Dragging

    def begin_drag(self, side: Side, code: str) -> bool:
        """Take up a placed or suggested point; False where it cannot be moved."""
        mark = self._document.state.landmark(side, code)
        if mark.shown_position is None or mark.locked:
            return False
        is_placed = mark.position is not None and mark.provenance is not None
        how = mark.provenance.how if is_placed and mark.provenance else How.SLICE
        self.drag = PointDrag(side, code, np.array(mark.shown_position), how)
        self.dragged.emit(self.drag)
        return True

    def drag_to(self, position: FloatArray, how: How) -> None:
        """Show the point that is dragged somewhere else, (3,) mm, scan frame."""
        if self.drag is not None:
            self.drag.position, self.drag.how = np.array(position, dtype=np.float64), how
            self._view.set_crosshair(position)
            self.dragged.emit(self.drag)

    def end_drag(self, *, keep: bool = True) -> bool:
        """Let go of the point: one edit, or none where it was not moved or shall go back."""
        drag, self.drag = self.drag, None
        self.dragged.emit(None)
        if drag is None or not keep:
            return False
        here = self._document.state.landmark(drag.side, drag.code).shown_position
        if here is not None and np.allclose(here, drag.position, atol=1e-9):
            return False
        return self._labels.place(drag.position, drag.how, side=drag.side, code=drag.code)

    # Inside

    def _on_reset(self) -> None:
        self.drag = self._last = None
        self.arm_replacing(False)

    def _on_landmarks(self, changed: frozenset[tuple[Side, str]]) -> None:
        placed = [point for point in changed if not feature(point[1]).computed]
        self._last = placed[0] if len({code for _, code in placed}) == 1 else None
        self._choices_since_edit = 0
        self.arm_replacing(False)

    def _on_active(self, _: Active) -> None:
        self._choices_since_edit += 1
        self.arm_replacing(False)
