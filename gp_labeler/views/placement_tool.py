"""What the left button does in any view: place on release, drag a point at once, choose one by a click."""

from __future__ import annotations

from qtpy.QtCore import QPoint, Qt
from qtpy.QtWidgets import QAbstractSpinBox, QApplication, QLineEdit, QPlainTextEdit, QTextEdit, QWidget

from gp_core.errors import GpError
from gp_core.landmarks.features import feature
from gp_core.validation import FloatArray
from gp_labeler.document.state import How, Landmark
from gp_labeler.document.touches import TouchHow
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.gestures import CLICK_PIXELS
from gp_labeler.views.drawn import point_of
from gp_labeler.views.drawn_measurements import handle_of, snapped
from gp_labeler.views.panels.label.landmark_menu import landmark_menu
from gp_labeler.views.panels.measure.menu import measurement_menu

__all__ = ["PlacementTool", "nudge"]

_TYPED_INTO = (QLineEdit, QTextEdit, QPlainTextEdit, QAbstractSpinBox)


class PlacementTool:
    """The left button over one view.

    Parameters
    ----------
    workspace : Workspace
        What it works on.
    """

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._mark: str | None = None
        self._under: str | None = None
        self._start = (0.0, 0.0)
        self._placed = self._measured = False
        self.is_click = True

    @property
    def holds(self) -> bool:
        """Whether the button went down on a point."""
        return self._mark is not None

    def press(self, mark: str | None, x: float, y: float) -> None:
        """Take a press, on the mark of this key or on none."""
        self._mark = mark if mark is not None and self._can_drag(mark) else None
        self._start, self._under = (x, y), mark
        self.is_click, self._placed, self._measured = True, False, False

    def move(self, x: float, y: float) -> bool:
        """Take a movement; return whether a point is being dragged."""
        if self._mark is None:
            return False
        if max(abs(x - self._start[0]), abs(y - self._start[1])) >= CLICK_PIXELS and self.is_click:
            self.is_click = False
            handle = handle_of(self._mark)
            if handle is None:
                self._workspace.interaction.begin_drag(*point_of(self._mark))
            else:
                self._workspace.measure.begin_drag(*handle)
        return self._workspace.interaction.drag is not None or self._workspace.measure.dragged is not None

    def release(self) -> str | None:
        """Take a release; return the mark it all began on."""
        mark, self._mark = self._mark, None
        if self._workspace.interaction.drag is not None:
            try:
                self._workspace.interaction.end_drag()
            except GpError as error:
                self._workspace.say(str(error), "warning")
        if self._workspace.measure.dragged is not None:
            self._workspace.measure.end_drag()
        return mark

    def escape(self) -> bool:
        """Take back what was begun last, as the key Escape does; return whether there was anything.

        A dragged point goes back; the next click replaces no point; a measurement is taken back by one step;
        the head is no longer turned by hand.
        """
        interaction = self._workspace.interaction
        if interaction.drag is not None:
            self._cancel_drag()
            return True
        if interaction.replacing:
            interaction.arm_replacing(False)
            return True
        if self._take_back_measurement():
            return True
        if interaction.tool == "turn":
            interaction.leave_turning()
            return True
        return False

    def _cancel_drag(self) -> None:
        """Let a dragged point go back to where it was, and the crosshair with it."""
        self._mark, drag = None, self._workspace.interaction.drag
        self._workspace.interaction.end_drag(keep=False)
        if drag is not None:
            where = self._workspace.labels.place_of(drag.side, drag.code)
            if where is not None:
                self._workspace.view.set_crosshair(where)

    def _take_back_measurement(self) -> bool:
        """Take back what is being measured, a step at a time; return whether there was anything."""
        if self._workspace.measure.dragged is None:
            return self._workspace.measure.take_back()
        self._mark = None
        self._workspace.measure.end_drag(keep=False)
        return True

    def click(
        self, position: FloatArray | None, how: How, mark: str | None, *, replace: bool = False
    ) -> None:
        """Take a click at a scan position (None: it missed) and on a mark (None: on none).

        A point that is to do is placed, one that shall be re-placed moves here; else a mark is chosen, or the
        crosshair comes here. A click never moves a placed or suggested point just because its row is chosen;
        with Ctrl held (`replace`) it does.
        """
        if replace and not self._armed():
            return
        effect, workspace = self._effect(mark), self._workspace
        if effect == "measure":
            self._measure(position)
        elif effect == "choose" and (handle := handle_of(mark)) is not None:
            workspace.measure.select(handle[0])
        elif effect == "choose" and mark is not None:
            workspace.labels.go_to(*point_of(mark))
        elif position is not None and effect == "look":
            workspace.view.set_crosshair(position)
        elif position is not None:
            try:
                (self._touch if effect == "touch" else self._place)(position, how)
            except GpError as error:
                workspace.say(str(error), "warning")
            workspace.interaction.arm_replacing(False)

    def _armed(self) -> bool:
        """Let this click move the chosen point, if that has a place; False where it must not be moved."""
        mark = self._chosen()
        if (
            self._workspace.interaction.tool == "place"
            and mark is not None
            and mark.shown_position is not None
        ):
            try:
                self._workspace.interaction.arm_replacing()
            except GpError as error:
                self._workspace.say(str(error), "warning")
                return False
        return True

    def _effect(self, mark: str | None) -> str:
        """Return what a click does: ``place``, ``measure``, ``touch``, ``choose`` or ``look``."""
        interaction = self._workspace.interaction
        if interaction.replacing:
            return "place"
        if self._workspace.measure.kind is not None:
            return "measure"
        if interaction.tool == "touch":
            return "touch"
        places = interaction.tool == "place" and self._is_to_place()
        if mark is not None and not (places and self._is_to_do()):
            return "choose"
        return "place" if places else "look"

    def _is_to_place(self) -> bool:
        """Whether a point is chosen that is neither placed nor suggested anywhere."""
        mark = self._chosen()
        return mark is not None and mark.shown_position is None

    def _is_to_do(self) -> bool:
        """Whether a point is chosen of which nothing is known: it may lie where another is placed."""
        mark = self._chosen()
        return mark is not None and mark.shown_position is None and not mark.unseen

    def _chosen(self) -> Landmark | None:
        active, state = self._workspace.labels.active, self._workspace.document.state
        return None if active.code is None else state.landmark(active.side, active.code)

    def take_back(self) -> None:
        """Take back the point that the first click of a double click placed."""
        if self._measured:
            self._measured = False
            self._workspace.measure.take_back()
        if self._placed:
            self._placed = False
            self._workspace.document.undo()

    def open_menu(self, view: QWidget, mark: str | None, where: QPoint) -> None:
        """Offer what can be done with the point of a mark, at a position on the screen."""
        if (handle := handle_of(mark)) is not None:
            measurement_menu(self._workspace, *handle, view).popup(where)
        elif mark is not None:
            landmark_menu(self._workspace, *point_of(mark), view).popup(where)

    def cursor(self, on_target: bool, mark: str | None) -> Qt.CursorShape:
        """Return the pointer that says what a click would do: a cross where it places, moves or touches."""
        writes = self._workspace.interaction.tool == "touch" or (
            self._workspace.interaction.tool == "place" and self._is_to_place()
        )
        if self._workspace.interaction.replacing:
            return Qt.CursorShape.CrossCursor if on_target else Qt.CursorShape.ForbiddenCursor
        if self._workspace.measure.kind is not None:
            aims = on_target or mark is not None
            return Qt.CursorShape.CrossCursor if aims else Qt.CursorShape.ForbiddenCursor
        if mark is not None and self._can_drag(mark):
            return Qt.CursorShape.OpenHandCursor
        if self._workspace.interaction.tool == "grey":
            return Qt.CursorShape.SizeAllCursor
        return Qt.CursorShape.CrossCursor if on_target and writes else Qt.CursorShape.ArrowCursor

    def take_focus(self, view: QWidget) -> None:
        """Let keys go to the view under the pointer, unless somebody is typing."""
        if not isinstance(QApplication.focusWidget(), _TYPED_INTO) and view.isActiveWindow():
            view.setFocus(Qt.FocusReason.MouseFocusReason)

    def _place(self, position: FloatArray, how: How) -> bool:
        self._workspace.view.set_crosshair(position)
        self._placed = self._workspace.labels.place(position, how)
        return self._placed

    def _touch(self, position: FloatArray, _: How) -> None:
        self._workspace.view.set_crosshair(position)
        self._workspace.pose.record(position, TouchHow.SCAN)
        self._placed = True

    def _measure(self, position: FloatArray | None) -> None:
        """Place the next point of a ruler or an angle, on the landmark or handle that was hit if any."""
        where = snapped(self._workspace, self._under, position)
        if where is None:
            return
        try:
            self._placed = self._workspace.measure.click(where)
            self._measured = not self._placed
        except GpError as error:
            self._workspace.say(str(error), "warning")

    def _can_drag(self, mark: str) -> bool:
        if self._workspace.measure.kind is not None:
            return False
        if handle_of(mark) is not None:
            return self._workspace.interaction.tool != "touch"
        return self._workspace.interaction.tool != "touch" and not feature(point_of(mark)[1]).computed


def nudge(workspace: Workspace, offset: FloatArray) -> None:
    """Move the chosen point, or the one placed last, by a (3,) offset, mm; without one, the crosshair."""
    document = workspace.document
    if workspace.interaction.nudged_point() is None:
        workspace.view.set_crosshair(workspace.view.crosshair + offset)
        return
    try:
        moved = workspace.interaction.nudge(offset)
    except GpError as error:
        workspace.say(str(error), "warning")
        return
    if moved is not None:
        side, code = moved
        workspace.view.set_crosshair(document.landmarks(side)[code])
