"""A slice as a widget: grey values, bone's edge, points, crosshair; wheel, pan, zoom, window and level."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from qtpy.QtCore import QEvent, Qt, QTimer, Signal
from qtpy.QtGui import QEnterEvent, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QWheelEvent
from qtpy.QtWidgets import QWidget

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.document.state import How
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.imaging.volume import Volume
from gp_labeler.models.view import GREY_WINDOW
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.bone_edge import BoneEdge
from gp_labeler.scene.gestures import Button, Modifier, SliceControl
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.slice_viewport import SliceViewport
from gp_labeler.scene.slices import VolumeSlicer
from gp_labeler.scene.window_level import WindowLevel
from gp_labeler.views.drawn import drawn_marks, point_of
from gp_labeler.views.drawn_measurements import handle_of, mark_or_handle
from gp_labeler.views.focus_ring import FocusRing
from gp_labeler.views.mouse import button_of, modifiers_of, notches_of, painted, pixel_of, zoom_of
from gp_labeler.views.painting.slice_layers import SliceLayer
from gp_labeler.views.painting.slice_painter import SlicePainter, reach_of
from gp_labeler.views.placement_tool import PlacementTool, nudge
from gp_labeler.views.plane_turning import PlaneTurning
from gp_labeler.views.signals import follow
from gp_labeler.views.slice_window_level import drag_window_level, window_level_of

__all__ = ["SliceView"]

_ARROWS = {
    Qt.Key.Key_Left: (-1.0, 0.0),
    Qt.Key.Key_Right: (1.0, 0.0),
    Qt.Key.Key_Up: (0.0, -1.0),
    Qt.Key.Key_Down: (0.0, 1.0),
}
_FREES = Modifier.ALT | Modifier.SHIFT
"""Held while a point is dragged, either lets it leave the bone."""

_REST_MS = 200
"""A plane that a hand turns is drawn at full resolution when it pauses for so long."""

_NEAR_EDGE_PIXELS = 48.0
_NEAR_PIXELS = 8.0
"""A mark is meant by a click within so many logical pixels."""

_STEPS = {Qt.Key.Key_F: 1, Qt.Key.Key_PageUp: 1, Qt.Key.Key_B: -1, Qt.Key.Key_PageDown: -1}
_FAR = 10
"""Voxels that the crosshair moves at once with Ctrl."""


class SliceView(QWidget):
    """Shows the slice through the crosshair in one plane, and takes clicks on it.

    Parameters
    ----------
    workspace : Workspace
        What is shown.
    plane : Plane
        Which of the three; `slice_plane` is the plane that it shows now.
    parent : QWidget, optional
        Qt's parent.
    """

    hovered = Signal(object)
    """(3,) scan position under the pointer, or None."""
    moved = Signal(float)
    """The position of the slice along the normal of its plane, mm."""
    maximise_asked = Signal()

    def __init__(self, workspace: Workspace, plane: Plane, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setMinimumSize(120, 90)
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(f"{plane.value} slice")
        FocusRing(self)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.plane = plane
        self._workspace = workspace
        self.source: VolumeSlicer | None = None
        self.shown: SliceViewport | None = None
        self._whole: SliceViewport | None = None
        self._painted: SliceViewport | None = None  # what is on the screen, if all of it is up to date
        self.layers: list[SliceLayer] = []
        self._control, self._placement = SliceControl(), PlacementTool(workspace)
        self.turning = PlaneTurning(workspace, plane.value)
        self.slice_painter = SlicePainter(workspace, self)
        self._level_drag: tuple[float, float] | None = None
        self._pointer: tuple[float, float] | None = None
        self._grip = np.zeros(3)
        self._edge: BoneEdge | None = None
        self._has_bone = False
        self._at_rest = QTimer(self, interval=_REST_MS, singleShot=True)
        self._at_rest.timeout.connect(self.update)
        self._listen()

    # What is shown

    @property
    def slice_plane(self) -> SlicePlane:
        """The plane that it shows."""
        return self._workspace.view.planes[self.plane.value]

    def reset(self) -> None:
        """Show the whole slice."""
        if self.source is not None:
            self._whole = self._fitted(self.source)
            self._take(self._whole.at(self._position()))

    def go_to(self, position: FloatArray) -> None:
        """Bring a (3,) scan position into view."""
        if self.shown is not None:
            self._take(self.shown.showing(position, 0.2))

    @property
    def across_mm(self) -> float:
        """How much it shows across its shorter side, mm; infinite without a scan."""
        return np.inf if self.shown is None else self.shown.mm_per_pixel * min(self.shown.size)

    def zoom_to(self, position: FloatArray, across_mm: float) -> None:
        """Show so many mm, across the shorter side, around a (3,) scan position."""
        if self.shown is not None:
            centred = self.shown.centred(position).at(self._position())
            self._take(centred.zoomed(centred.mm_per_pixel * min(centred.size) / across_mm))

    def step(self, n: int) -> None:
        """Go so many slices on."""
        if self.source is not None:
            self.move_to(self._position() + n * self.source.step(self.slice_plane))

    def voxel_pixels(self, position: FloatArray, voxel_mm: float) -> float:
        """Return how many logical pixels a voxel is wide at a (3,) scan position; 0 where it is not seen."""
        if self.shown is None or self.source is None:
            return 0.0
        x, y = self.pixel_at(position)
        off = float(np.abs(self.shown.off_slice(np.reshape(position, (1, 3))))[0])
        in_view = 0 <= x < self.width() and 0 <= y < self.height()
        if not in_view or off > 0.75 * self.source.step(self.slice_plane):
            return 0.0
        return voxel_mm / (self.shown.mm_per_pixel * self.devicePixelRatioF())

    @property
    def is_up_to_date(self) -> bool:
        """Whether what it shows now, with the points as they are now, has been painted."""
        return self.shown is not None and self._painted is self.shown

    def pixel_at(self, position: FloatArray) -> tuple[float, float]:
        """Return the logical pixel over which a (3,) scan position lies, for tests and scripts."""
        if self.shown is None:
            raise GpError("no scan is open")
        x, y = self.shown.scan_to_pixel(np.reshape(position, (1, 3)))[0]
        point = painted(self, x, y)
        return point.x(), point.y()

    def window_level(self) -> WindowLevel:
        """Return the grey scale: what the user set, else what suits the volume."""
        return window_level_of(self._workspace)

    def _listen(self) -> None:
        workspace = self._workspace
        follow(self, workspace.scan.opened, self._on_volume)
        follow(self, workspace.document.reset, self._on_reset)
        follow(self, workspace.view.crosshair_changed, self._on_crosshair)
        follow(self, workspace.view.planes_changed, self._on_planes)
        follow(self, workspace.view.turning_changed, self._on_turning)
        follow(self, workspace.bone.surfaces_changed, self._on_surfaces)
        follow(self, workspace.view.point_shown, self.go_to)
        for signal in (
            workspace.interaction.replacing_changed,
            workspace.interaction.tool_changed,
            workspace.labels.active_changed,
        ):
            follow(self, signal, self._show_cursor)
        for signal in (
            workspace.document.landmarks_changed,
            workspace.labels.active_changed,
            workspace.labels.ghosts_changed,
            workspace.labels.problems_changed,
            workspace.scan.threshold_changed,
            workspace.scan.threshold_previewed,
            workspace.interaction.dragged,
            workspace.pose.overlay_changed,
        ):
            follow(self, signal, self._repaint)
        follow(self, workspace.view.changed, self._on_view_changed)

    def _take(self, shown: SliceViewport) -> None:
        """Show another part of the scan, and tell what now lies under the pointer, which may rest."""
        self.shown = shown
        self.update()
        if self._pointer is not None:
            self.hovered.emit(shown.pixel_to_scan([self._pointer])[0])

    def _repaint(self, *_: object) -> None:
        self.slice_painter.forget_points()
        self._painted = None
        self.update()

    def _on_view_changed(self, changed: frozenset[str]) -> None:
        if changed <= GREY_WINDOW:  # a drag changes it with every movement: the points stay as they are
            self._painted = None
            self.update()
        else:
            self._repaint()

    def _on_volume(self, volume: Volume) -> None:
        self.source = VolumeSlicer(volume)
        self.reset()
        self._on_crosshair(self._workspace.view.crosshair)

    def _on_reset(self) -> None:
        self.slice_painter.forget()  # also where it is not painted: else it would keep the scan before
        self.update()
        if self._workspace.scan.volume is None:
            self.source = self.shown = self._edge = None
            if self._pointer is not None:
                self.hovered.emit(None)

    def _on_crosshair(self, position: FloatArray) -> None:
        if self.shown is not None:
            there = self.shown.at(self._position())
            self._take(there.showing(position, 0.02) if self._is_inside(position) else there)
            self.moved.emit(there.position)

    def _on_planes(self) -> None:
        """Show the new plane at the same zoom, with the crosshair where it is on the screen."""
        shown = self.shown
        if self.source is None or shown is None or shown.plane is self.slice_plane:
            self.update()
            return
        turning = self._workspace.view.is_turning
        if turning:
            self._at_rest.start()
        if self._whole is not None and shown.looks_like(self._whole) and not turning:
            self.reset()
        else:
            on_screen = shown.plane.flat(self._workspace.view.crosshair[None])[0] - shown.centre
            centre = self.slice_plane.flat(self._workspace.view.crosshair[None])[0] - on_screen
            self._take(replace(shown, plane=self.slice_plane, position=self._position(), centre=centre))
        self.moved.emit(self._position())

    def _fitted(self, source: VolumeSlicer) -> SliceViewport:
        """Return the view of the whole slice; of one that is cut askew, of what lies around bone."""
        around = self._workspace.bone.some_points if source.is_oblique(self.slice_plane) else None
        return SliceViewport.fitted(source, self.slice_plane, self._size(), around=around)

    def _on_surfaces(self) -> None:
        """Fit a whole oblique slice to the bone, once there is some."""
        had_bone, self._has_bone = self._has_bone, len(self._workspace.bone.some_points) > 0
        whole, shown = self._whole, self.shown
        if self.source is not None and whole is not None and shown is not None:
            oblique = self.source.is_oblique(self.slice_plane)
            if oblique and self._has_bone and not had_bone and shown.looks_like(whole):
                self.reset()

    @property
    def draws_coarsely(self) -> bool:
        """Whether it shall paint quickly: a hand is turning its plane, and has not paused."""
        return self._at_rest.isActive()

    def _on_turning(self, on: bool) -> None:
        if not on and self._at_rest.isActive():
            self._at_rest.stop()
            self.update()

    def _position(self) -> float:
        return self.slice_plane.position_of(self._workspace.view.crosshair)

    def move_to(self, position: float) -> None:
        """Show the slice nearest to a position along the plane's normal, mm; the crosshair goes with it."""
        if self.source is not None:
            there = self.source.snap(self.slice_plane, position)
            self._workspace.view.set_crosshair(
                self.slice_plane.moved_to(self._workspace.view.crosshair, there)
            )

    def _resized(self, shown: SliceViewport) -> SliceViewport:
        """Return the view at the widget's size: the whole slice if it was whole, else the same, larger."""
        whole = self._whole
        if self.source is not None and whole is not None and shown.looks_like(whole):
            self._whole = self._fitted(self.source)
            return self._whole.at(shown.position)
        return shown.resized(*self._size()).zoomed(min(self._size()) / min(shown.size))

    def _size(self) -> tuple[int, int]:
        ratio = self.devicePixelRatioF()
        return max(round(self.width() * ratio), 1), max(round(self.height() * ratio), 1)

    def paintEvent(self, _: QPaintEvent) -> None:  # noqa: D102, N802
        if self.shown is not None and self.shown.size != self._size():
            self.shown = self._resized(self.shown)
        painter = QPainter(self)
        self.slice_painter.paint(painter)
        painter.end()
        self._painted = self.shown

    # Mouse and keys

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        button, held = button_of(event), modifiers_of(event)
        if button is None or self.shown is None:
            return
        x, y = pixel_of(self, event.position())
        if self._control.press(button, x, y, held) or button is not Button.LEFT:
            return
        mark = self.mark_at(x, y)
        self._placement.press(mark, x, y)
        if mark is not None and self._placement.holds:
            self._edge = self._edge_for(mark)
            self._grip = self._position_of(mark) - self.shown.pixel_to_scan([[x, y]])[0]
        elif mark is None and self.turning.press(self.shown, x, y, self.devicePixelRatioF()):
            return
        elif self._workspace.interaction.tool == "grey":
            self._level_drag = (x, y)
        elif self._workspace.interaction.tool == "look":
            self._workspace.view.set_crosshair(self.shown.pixel_to_scan([[x, y]])[0])

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        if self.shown is None:
            return
        x, y = self._pointer = pixel_of(self, event.position())
        here = self.shown.pixel_to_scan([[x, y]])[0]
        self.hovered.emit(here)
        if event.buttons() == Qt.MouseButton.NoButton:
            if Modifier.SHIFT in modifiers_of(event):
                self._workspace.view.set_crosshair(here)
            self._workspace.measure.point_at(here if self._is_inside(here) else None)
            self._show_cursor()
            return
        view = self._control.move(self.shown, x, y)
        if view is not self.shown:
            self._take(view)
        elif self.turning.move(self.shown, x, y, self.devicePixelRatioF()):
            return
        elif self._placement.move(x, y):
            self._drag_to(here, free=bool(modifiers_of(event) & _FREES))
        elif self._level_drag is not None:
            self._change_window_level(x, y)
        elif (
            self._workspace.interaction.tool in ("look", "turn")
            and event.buttons() == Qt.MouseButton.LeftButton
        ):
            self._workspace.view.set_crosshair(here)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        if self.shown is None:
            return
        x, y = pixel_of(self, event.position())
        turned = self.turning.release()
        clicked = self._control.release(x, y) and not turned
        self._level_drag = None
        dragged = self._placement.holds and not self._placement.is_click
        mark = self._placement.release()
        if clicked and event.button() == Qt.MouseButton.RightButton:
            self._placement.open_menu(self, self.mark_at(x, y), event.globalPosition().toPoint())
        held = modifiers_of(event)
        plain = event.button() == Qt.MouseButton.LeftButton and held in (Modifier.NONE, Modifier.CTRL)
        here = self.shown.pixel_to_scan([[x, y]])[0]
        if (
            clicked
            and plain
            and not dragged
            and (self._workspace.interaction.tool != "grey" or mark or self._workspace.interaction.replacing)
        ):
            where = here if self._is_inside(here) else None
            self._placement.click(where, How.SLICE, mark, replace=held == Modifier.CTRL)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        if event.button() == Qt.MouseButton.LeftButton:
            self._placement.take_back()
            self.maximise_asked.emit()

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: D102, N802
        event.accept()
        if self.shown is None or self.source is None:
            return
        x, y = pixel_of(self, event.position())
        held, step = modifiers_of(event), self.source.step(self.slice_plane)
        view = self._control.wheel(self.shown, notches_of(event), x, y, held, step)
        if Modifier.CTRL in held:
            self._take(view)
        else:
            self.move_to(view.position)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102, N802
        key, held, zoom = Qt.Key(event.key()), modifiers_of(event), zoom_of(event)
        if key == Qt.Key.Key_Escape and self._placement.escape():
            event.accept()
        elif key in _ARROWS and held is Modifier.NONE and self.source is not None:
            self._nudge(*_ARROWS[key])
        elif key in _ARROWS and held in (Modifier.SHIFT, Modifier.SHIFT | Modifier.CTRL):
            self._move_crosshair(*_ARROWS[key], voxels=_FAR if Modifier.CTRL in held else 1)
        elif key in _STEPS and held is Modifier.NONE:
            self.step(_STEPS[key])
        elif zoom is not None and self.shown is not None:
            self._take(self.shown.zoomed(zoom, about=self._crosshair_pixel()))
        else:
            super().keyPressEvent(event)

    def leaveEvent(self, event: QEvent) -> None:  # noqa: D102, N802
        self._pointer = None
        self._workspace.measure.point_at(None)
        self.update()
        self.hovered.emit(None)
        super().leaveEvent(event)

    def enterEvent(self, event: QEnterEvent) -> None:  # noqa: D102, N802
        self._placement.take_focus(self)
        self.update()
        super().enterEvent(event)

    @property
    def handles_visible(self) -> bool:
        """Whether the handles are painted by which the crosshair's arms can be taken."""
        return self._pointer is not None or self._workspace.interaction.tool == "turn"

    def _show_cursor(self, *_: object) -> None:
        """Show the pointer that says what a click here does."""
        if self.shown is not None and self._pointer is not None:
            here, mark = self.shown.pixel_to_scan([self._pointer])[0], self.mark_at(*self._pointer)
            ratio = self.devicePixelRatioF()
            if mark is None and self.turning.is_on_handle(self.shown, *self._pointer, ratio):
                self.setCursor(Qt.CursorShape.PointingHandCursor)
            else:
                self.setCursor(self._placement.cursor(self._is_inside(here), mark))

    def _nudge(self, right: float, down: float) -> None:
        """Move the chosen point, or the one placed last, by a voxel; without one, the crosshair."""
        assert self.source is not None
        direction = right * self.slice_plane.right + down * self.slice_plane.down
        nudge(self._workspace, self.source.step_along(direction) * direction)

    def _move_crosshair(self, right: float, down: float, *, voxels: int) -> None:
        """Move the crosshair along the slice, whichever point is chosen."""
        if self.source is not None:
            direction = right * self.slice_plane.right + down * self.slice_plane.down
            there = self._workspace.view.crosshair + voxels * self.source.step_along(direction) * direction
            if self._is_inside(there):
                self._workspace.view.set_crosshair(there)

    def _crosshair_pixel(self) -> FloatArray | None:
        """Return the (2,) pixel of the crosshair; None where it is out of sight."""
        assert self.shown is not None
        pixel: FloatArray = self.shown.scan_to_pixel(self._workspace.view.crosshair[None])[0]
        return pixel if bool(((pixel >= 0) & (pixel < self.shown.size)).all()) else None

    def _edge_for(self, mark: str) -> BoneEdge | None:
        """Return the edge of bone, on which a point stays that was placed on bone; None for other points."""
        if handle_of(mark) is not None:
            return None
        provenance = self._workspace.document.state.landmark(*point_of(mark)).provenance
        on_bone = provenance is not None and provenance.how is How.MESH
        threshold = self._workspace.scan.threshold
        if not on_bone or self.source is None or threshold is None:
            return None
        return BoneEdge(self.source, self.slice_plane, threshold)

    def _drag_to(self, here: FloatArray, *, free: bool) -> None:
        drag, to = self._workspace.interaction.drag, here + self._grip
        measure = self._workspace.measure
        moved = measure.dragged_position if drag is None else drag.position
        if moved is not None:
            to = self.slice_plane.moved_to(to, self.slice_plane.position_of(moved))  # the slice follows it
        if measure.dragged is not None:
            if self._is_inside(to):
                measure.drag_to(to)
            return
        if self._edge is not None and self.shown is not None and not free:
            within = _NEAR_EDGE_PIXELS * self.devicePixelRatioF() * self.shown.mm_per_pixel
            edge = self._edge.nearest(to, within)
            if edge is not None:  # far from bone it stays where it was, as in the 3D view
                self._workspace.interaction.drag_to(edge, How.MESH)
        elif self._workspace.scan.volume is not None and bool(
            self._workspace.scan.volume.contains(to[None])[0]
        ):
            self._workspace.interaction.drag_to(to, How.SLICE)

    def _change_window_level(self, x: float, y: float) -> None:
        assert self._level_drag is not None
        ratio = self.devicePixelRatioF()
        drag_window_level(
            self._workspace, (x - self._level_drag[0]) / ratio, (y - self._level_drag[1]) / ratio
        )
        self._level_drag = (x, y)

    def _is_inside(self, position: FloatArray) -> bool:
        return self._workspace.scan.volume is not None and bool(
            self._workspace.scan.volume.contains(position[None])[0]
        )

    def _position_of(self, key: str | None) -> FloatArray:
        if (handle := handle_of(key)) is not None:
            return np.array(self._workspace.document.state.measurement(handle[0]).points[handle[1]])
        marks = {mark.key: mark.position for mark in drawn_marks(self._workspace)}
        return marks[key or ""]

    def mark_at(self, x: float, y: float) -> str | None:
        """Return the key of the nearest mark, or handle, that is drawn within 8 logical pixels."""
        within = _NEAR_PIXELS * self.devicePixelRatioF()
        return mark_or_handle(self._workspace, self._landmark_at(x, y), self._drawn_pixels, (x, y), within)

    def _drawn_pixels(self, points: FloatArray) -> FloatArray:
        """Return the (N, 2) pixels of (N, 3) scan positions, NaN where they are too far off the slice."""
        if self.shown is None or self.source is None:
            return np.full((len(points), 2), np.nan)
        pixels = self.shown.scan_to_pixel(points)
        pixels[np.abs(self.shown.off_slice(points)) > reach_of(self.source, self.slice_plane)] = np.nan
        return pixels

    def _landmark_at(self, x: float, y: float) -> str | None:
        if self.shown is None or self.source is None:
            return None
        marks = drawn_marks(self._workspace)
        if not marks:
            return None
        positions = np.array([mark.position for mark in marks])
        away = np.linalg.norm(self.shown.scan_to_pixel(positions) - [x, y], axis=1)
        away[np.abs(self.shown.off_slice(positions)) > reach_of(self.source, self.slice_plane)] = np.inf
        nearest = int(away.argmin())
        return marks[nearest].key if away[nearest] <= _NEAR_PIXELS * self.devicePixelRatioF() else None

    def release(self) -> None:
        """Let go of the voxels."""
        self.slice_painter.forget()
        if self.source is not None:
            self.source.close()
        self.source = self.shown = None
