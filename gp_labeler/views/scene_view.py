"""The 3D view as a widget: the scene on a canvas, painted or native (`views.canvas`).

What follows the pointer (the ring where a click would land, a dragged point, the crosshair) is painted over
the last frame; points are drawn over a kept picture of the bone. While the bone is drawn again, a little at a
time, a coarse preview mesh is shown. A picture of the widget (`grab`) always shows the finished frame.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from qtpy.QtCore import QEvent, QRect, Qt, QTimer, Signal
from qtpy.QtGui import (
    QEnterEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPixmap,
    QWheelEvent,
)
from qtpy.QtWidgets import QWidget

from gp_core.validation import FloatArray
from gp_labeler.document.state import How
from gp_labeler.imaging.mesh import SurfaceHit
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.models.interaction import PointDrag
from gp_labeler.models.view import Cut
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.cut import CutPlane
from gp_labeler.scene.gestures import Button, Modifier
from gp_labeler.scene.marks import GlyphSize
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.scene.slices import SliceImage, VolumeSlicer
from gp_labeler.views.canvas import Canvas
from gp_labeler.views.canvas_choice import make_canvas
from gp_labeler.views.drawn import (
    drawn_free_points,
    drawn_ghosts,
    drawn_marks,
    drawn_references,
    drawn_segments,
    key_of,
)
from gp_labeler.views.drawn_measurements import kept_measurements, mark_or_handle, moving_measurements
from gp_labeler.views.focus_ring import FocusRing
from gp_labeler.views.fonts import TEXT, text_scale
from gp_labeler.views.mouse import button_of, modifiers_of, notches_of, painted, pixel_of, zoom_of
from gp_labeler.views.painting.scene_overlay import (
    SceneOverlay,
    paint_crosshair,
    paint_cut,
    paint_pointer,
)
from gp_labeler.views.placement_tool import PlacementTool
from gp_labeler.views.signals import follow
from gp_labeler.views.slice_window_level import window_level_of
from gp_labeler.views.theme import theme_of

__all__ = ["SceneView"]

_FINE_AFTER_MS = 180
_SLICE_SECONDS = 0.02
"""How long bone is drawn finely before the window answers again."""

_WARM_AFTER_MS = 150
"""The window has been painted by then, and nothing is open in it yet."""

_FIRST_LOOK = (-0.45, 0.75, -0.48)
"""Direction of the first look: from the front, the left and above."""

_FAR_TURN = 1 + 2 * float(np.cos(np.radians(30)))
"""Trace of a rotation by 30 degrees: where the frame turns farther, everything is shown again."""

_MIDDLE = 0.6
_NEAR_PIXELS = 8.0
"""A mark is meant by a click within so many logical pixels."""

_ARROWS = {
    Qt.Key.Key_Left: (-24.0, 0.0),
    Qt.Key.Key_Right: (24.0, 0.0),
    Qt.Key.Key_Up: (0.0, -24.0),
    Qt.Key.Key_Down: (0.0, 24.0),
}


class SceneView(QWidget):
    """Shows bone and points in 3D, and takes clicks on them.

    Parameters
    ----------
    workspace : Workspace
        What is shown.
    parent : QWidget, optional
        Qt's parent.
    canvas : callable
        Makes what shows it; by default the kind that was chosen at the start.
    """

    hovered = Signal(object)
    """(3,) scan position where a click would land, or None."""
    maximise_asked = Signal()
    frame_drawn = Signal()
    """A frame has been drawn; what only lies over it may be painted without."""

    def __init__(
        self,
        workspace: Workspace,
        parent: QWidget | None = None,
        canvas: Callable[[QWidget], Canvas] = make_canvas,
    ) -> None:
        super().__init__(parent)
        self.setMinimumSize(120, 90)
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("3D view")
        FocusRing(self)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self._workspace = workspace
        self.canvas = canvas(self)
        self.scene = Scene3D(self.canvas.target)
        self.overlay = SceneOverlay()
        workspace.meshes.scene = self.scene
        self._placement = PlacementTool(workspace)
        self._finished = False
        self._stale, self._points_old, self._fitted = True, True, False
        self._source: VolumeSlicer | None = None
        self._slices_old = False
        self._hover: FloatArray | None = None
        self._pointer: tuple[float, float] | None = None
        self._dragging = self._on_target = False
        self._fine_timer = QTimer(self, interval=_FINE_AFTER_MS, singleShot=True)
        self._fine_timer.timeout.connect(self._refine)
        self._warm_timer = QTimer(self, interval=_WARM_AFTER_MS, singleShot=True)
        self._warm_timer.timeout.connect(self._warm_up)
        self._warm_timer.start()
        self.scene.camera.look(_FIRST_LOOK, (0, 0, 1))
        self._listen()
        self.take_theme()

    # What is shown

    def redraw(self, *, quick: bool = False) -> None:
        """Draw the scene again as soon as Qt paints.

        Parameters
        ----------
        quick : bool
            The camera is being moved: wait until it rests before the bone is drawn finely.
        """
        self._stale = True
        self._fine_timer.start(_FINE_AFTER_MS if quick else 0)
        self.canvas.ask()

    @property
    def is_stale(self) -> bool:
        """Whether the scene has changed since the frame that is shown was drawn."""
        return self._stale

    def reset(self) -> None:
        """Show everything, from the direction looked in now."""
        self.scene.fit()
        self.redraw()

    def view_from(self, letter: str) -> None:
        """Look from ``A``, ``P``, ``L``, ``R``, ``S`` or ``I``, as the frame of the views names them."""
        self.scene.camera.view_from(letter, self._workspace.view.frame.axes)
        self.redraw()

    def go_to(self, position: FloatArray) -> None:
        """Bring a (3,) scan position to the middle of the view, unless it is about there."""
        if not self._shows(position, _MIDDLE):
            self.scene.camera.focus_on(position)
            self.redraw()

    @property
    def across_mm(self) -> float:
        """How much it shows from top to bottom, at the depth of its middle, mm."""
        return self.scene.camera.across_mm

    def zoom_to(self, position: FloatArray, across_mm: float) -> None:
        """Show so many mm, from top to bottom, around a (3,) scan position."""
        self.scene.camera.focus_on(position, across_mm=across_mm)
        self.redraw()

    def cut(self, plane: str) -> None:
        """Cut the bone open through the crosshair, by one of `models.view.CUTS`; the nearer side goes."""
        normal = into = self.scene.camera.direction
        if plane != "view":
            axis = self._workspace.view.planes[plane].normal
            normal = axis if axis @ into >= 0 else -axis
        x, y, z = normal.tolist()
        cut = Cut(plane, (0.0, 0.0, 0.0), (x, y, z)).through(self._workspace.view.crosshair)
        self._workspace.view.update(cut=cut)

    def cut_open(self, position: FloatArray, plane: str, across_mm: float) -> None:
        """Cut the bone open through a (3,) scan position, and look at it from the open side.

        Parameters
        ----------
        position : (3,) float array
            Scan frame, mm.
        plane : str
            One of `models.view.CUTS`; with ``view`` the camera keeps its direction.
        across_mm : float
            How much is shown, from top to bottom.
        """
        self._workspace.view.set_crosshair(position)
        self.cut(plane)
        cut = self._workspace.view.state.cut
        if plane != "view" and cut is not None:
            self.scene.camera.look(cut.normal, -self._workspace.view.planes[plane].down)
        self.zoom_to(position, across_mm)

    def take_theme(self) -> None:
        """Draw in the colours of the window's theme."""
        self.scene.set_colours(theme_of(self).scene)
        self._show_points()

    def voxel_pixels(self, position: FloatArray, voxel_mm: float) -> float:
        """Return how many logical pixels a voxel is wide at a (3,) scan position; 0 where it is not seen."""
        if not self._shows(position, 1.0) or bool(self.scene.hidden(position)[0]):
            return 0.0
        pixel_mm = float(self.scene.camera.viewpoint().pixel_sizes(position[None])[0])
        return voxel_mm / (pixel_mm * self.devicePixelRatioF())

    @property
    def is_up_to_date(self) -> bool:
        """Whether the scene as it is now has been painted."""
        return not self._stale and self.canvas.is_shown

    def pixel_at(self, position: FloatArray) -> tuple[float, float]:
        """Return the logical pixel at which a (3,) scan position is seen, for tests and scripts."""
        x, y = self.scene.display_of(np.reshape(position, (1, 3)))[0]
        point = painted(self, x, y)
        return point.x(), point.y()

    def _listen(self) -> None:
        workspace = self._workspace
        follow(self, workspace.bone.surfaces_changed, self._show_bone)
        follow(self, workspace.document.reset, self._on_reset)
        for signal in (
            workspace.document.landmarks_changed,
            workspace.labels.active_changed,
            workspace.labels.ghosts_changed,
            workspace.labels.problems_changed,
        ):
            follow(self, signal, self._show_points)
        for signal in (
            workspace.interaction.replacing_changed,
            workspace.interaction.tool_changed,
            workspace.labels.active_changed,
        ):
            follow(self, signal, self._show_cursor)
        for signal in (workspace.pose.overlay_changed, workspace.references.changed, workspace.head.changed):
            follow(self, signal, self._show_points)
        follow(self, workspace.meshes.changed, self.redraw)
        follow(self, workspace.measure.changed, self._show_points)
        follow(self, workspace.measure.pointed, self._repaint_pointer)
        follow(self, workspace.view.crosshair_changed, self._on_crosshair)
        follow(self, workspace.view.planes_changed, self._on_planes)
        follow(self, workspace.scan.slice_read, self._show_slices)
        follow(self, workspace.view.point_shown, self.go_to)
        follow(self, workspace.interaction.dragged, self._on_dragged)
        follow(self, workspace.view.changed, self._on_view_changed)

    def _on_planes(self) -> None:
        self._take_frame()
        self._show_slices()
        self.canvas.ask_over()

    def _take_frame(self) -> None:
        """Turn with the frame of the views: what was seen from the front is seen from the front."""
        axes = self._workspace.view.frame.axes
        if not np.array_equal(axes, self.scene.cube.axes):
            turn, camera = axes @ self.scene.cube.axes.T, self.scene.camera
            camera.look(turn @ camera.direction, turn @ camera.up)
            self.scene.cube.axes = axes
            if np.trace(turn) < _FAR_TURN:
                self.scene.fit()
            self.redraw()

    def _show_slices(self, *_: object) -> None:
        """Show the slices through the crosshair, or none, when the next frame is drawn."""
        if self._workspace.view.state.slices_visible or self.scene.slices.images:
            self._slices_old = True
            self.redraw()

    def _take_slices(self) -> None:
        if not self._slices_old:
            return
        self._slices_old = False
        volume, shown = self._workspace.scan.volume, self._workspace.view.state.slices_visible
        if volume is None or not shown:
            self._source = None
        elif self._source is None or self._source.volume is not volume:
            self._source = VolumeSlicer(volume)
        planes = self._workspace.view.planes if self._source is not None else {}
        images = [self._slice_of(plane) for plane in planes.values()]
        colours = [Plane(name).colour for name in planes]
        self.scene.slices.show(images, window_level_of(self._workspace), colours)

    def _slice_of(self, plane: SlicePlane) -> SliceImage:
        """Return the slice through the crosshair, coarse where much of a file is to be read for it first."""
        assert self._source is not None
        image = self._source.image(plane, plane.position_of(self._workspace.view.crosshair), at_once=True)
        if image.unread is not None:
            self._workspace.scan.read_slice(image.unread)
        return image

    def _on_crosshair(self, position: FloatArray) -> None:
        self._show_slices()
        volume = self._workspace.scan.volume
        inside = volume is not None and bool(volume.contains(position[None])[0])
        if self._fitted and inside and not self._shows(position, 1.0):
            self.go_to(position)
        self.canvas.ask_over()

    def _shows(self, position: FloatArray, part: float) -> bool:
        """Whether a (3,) scan position lies in the middle part of the view, from 0 to 1."""
        size = np.array(self.scene.target.size)
        off = np.abs(self.scene.display_of(position[None])[0] - size / 2)
        return bool((off < part * size / 2).all())

    def _on_reset(self) -> None:
        self._fitted = False
        self._source = None
        self._take_frame()
        self._on_view_changed(frozenset({"mesh_opacity", "cut", "slices_visible"}))
        self._show_points()

    def _show_bone(self) -> None:
        self.scene.bone.show(self._workspace.bone.surfaces, self._workspace.bone.quick_surfaces)
        if self._workspace.bone.surfaces and not self._fitted:
            self._fitted = True
            self.scene.fit()
        self.redraw()

    def _show_points(self, *_: object) -> None:
        """Show points, lines and ghosts as they are when the next frame is drawn, however many changes on."""
        view = self._workspace.view.state
        self.scene.marks.size = GlyphSize() if view.glyph_mm is None else GlyphSize(view.glyph_mm, "mm")
        self.overlay.names_visible = view.labels_visible
        self.scene.marks.show_hidden = view.hidden_visible
        self._points_old = True
        self.redraw()

    def _repaint_pointer(self, *_: object) -> None:
        self.canvas.ask_over()

    def _take_points(self) -> None:
        if not self._points_old:
            return
        self._points_old = False
        drag = self._workspace.interaction.drag
        dragged = "" if drag is None else key_of(drag.side, drag.code)
        marks = drawn_references(self._workspace) + drawn_free_points(self._workspace)
        marks += drawn_marks(self._workspace)
        self.scene.marks.show([mark for mark in marks if mark.key != dragged])
        self.scene.ghosts.show(drawn_ghosts(self._workspace))
        self.overlay.measurements = kept_measurements(self._workspace.measure)
        self.scene.lines.show(drawn_segments(self._workspace, theme_of(self).scene))

    def mark_at(self, x: float, y: float) -> str | None:
        """Return the key of the nearest mark, or handle, that is drawn near a pixel."""
        self._take_points()
        mark, within = self.scene.mark_at(x, y, _NEAR_PIXELS), _NEAR_PIXELS * self.scene.scale
        return mark_or_handle(self._workspace, mark, self.scene.display_of, (x, y), within)

    def _on_view_changed(self, changed: frozenset[str]) -> None:
        if "mesh_opacity" in changed:
            self.scene.bone.opacity = self._workspace.view.state.mesh_opacity
        if "cut" in changed:
            cut = self._workspace.view.state.cut
            self.scene.bone.cut = None if cut is None else CutPlane(cut.origin, cut.normal)
            self.redraw(quick=True)
        if changed & {"slices_visible", "level", "width"}:
            self._show_slices()
        if changed - {"level", "width", "layout", "camera", "cut", "slices_visible"}:
            self._show_points()

    def _on_dragged(self, drag: PointDrag | None) -> None:
        if (drag is None) == self._dragging:  # the point leaves the picture, and is painted over it instead
            self._dragging = drag is not None
            self._show_points()
        self.canvas.ask_over()

    # Painting

    def paintEvent(self, _: QPaintEvent) -> None:  # noqa: D102, N802
        painter = QPainter(self)
        is_screen = self._is_screen(painter)
        if not is_screen:
            self.finish()
        elif self._stale and not (self.canvas.paints_itself or self.canvas.may_stay):
            self.draw_frame()
        self.canvas.paint(painter)
        painter.end()
        if is_screen and self._stale:
            self.canvas.ask()  # drawn by itself: other views are painted in the same breath as this one

    def paint_overlay(self, painter: QPainter) -> None:
        """Paint what lies over the frame and changes only with it."""
        painter.save()
        painter.scale(1 / self.scene.scale, 1 / self.scene.scale)
        self.overlay.paint(painter)
        painter.restore()

    def paint_pointer(self, painter: QPainter) -> None:
        """Paint what follows the pointer and the crosshair."""
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._workspace.scan.volume is not None:
            view = self._workspace.view
            paint_crosshair(painter, self, self.scene, view.crosshair, view.planes)
        self.overlay.paint_moving(painter, self.scene, moving_measurements(self._workspace.measure))
        paint_cut(painter, self, self._workspace.view)
        drag = self._workspace.interaction.drag
        paint_pointer(
            painter, self, self.scene, self._hover if drag is None else drag.position, drag is not None
        )

    def _is_screen(self, painter: QPainter) -> bool:
        """Whether a painter paints what is on the screen, and not a picture of it."""
        backing_store = getattr(self.window(), "backingStore", None)
        if backing_store is None:  # PyQt6 does not wrap it; who grabs the window there calls `finish` before
            return True
        store = backing_store()
        return store is not None and painter.paintEngine().paintDevice() is store.paintDevice()

    @property
    def pixels(self) -> tuple[int, int]:
        """Width and height, device pixels, rounded as Qt does."""
        ratio = self.devicePixelRatioF()
        return int(self.width() * ratio + 0.5), int(self.height() * ratio + 0.5)

    def finish(self) -> None:
        """Draw all that is still to be drawn, at once."""
        if (self._stale or not self._finished) and self.canvas.prepare():
            with self.canvas.unseen():
                self._draw(quick=False)

    def grab(self, rectangle: QRect | None = None) -> QPixmap:
        """Return a picture of the view, finished whichever binding Qt has."""
        self.finish()
        return super().grab() if rectangle is None else super().grab(rectangle)

    def draw_frame(self) -> None:
        """Draw the scene as it is now, the bone coarsely where it is new; called by the canvas."""
        if not (self._stale or self.canvas.paints_itself):
            return
        self._draw(quick=True)
        if self._pointer is not None:  # it may rest while what lies under it moves
            self._point_at(*self._pointer)

    def forget(self) -> None:
        """Draw everything again: what was kept on the graphics card is lost."""
        self.scene.forget()
        self._stale = True

    def _draw(self, *, quick: bool) -> None:
        self._take_points()
        self._take_slices()
        self.scene.scale = self.devicePixelRatioF()
        self.scene.target.resize(*self.pixels)
        self.scene.render(quick=quick)
        self.overlay.place(self.scene, theme_of(self).scene, TEXT * text_scale(self))
        self.canvas.take()
        self._stale, self._finished = False, self.scene.is_fine
        self.frame_drawn.emit()
        if not (self._finished or self._fine_timer.isActive()):
            self._fine_timer.start(0)

    def _refine(self) -> None:
        """Draw some more of the fine bone, behind what is shown; once it is done, show it."""
        if self._stale or not self.canvas.prepare():
            return  # the frame comes first; painting it goes on here
        with self.canvas.unseen():
            done = self.scene.advance(_SLICE_SECONDS)
        if not done:
            self._fine_timer.start(0)
        elif not self._finished:
            self._stale = True
            self.canvas.ask()

    def _warm_up(self) -> None:
        """Draw once before there is anything to see: OpenGL takes its time to prepare the first frame."""
        if self.scene.n_bone_frames == 0 and self.scene.target.is_ready and not self.canvas.paints_itself:
            self.scene.render()

    # Mouse and keys

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        button, held = button_of(event), modifiers_of(event)
        if button is None:
            return
        x, y = pixel_of(self, event.position())
        if button is Button.LEFT and held is Modifier.NONE:
            self._placement.press(self.mark_at(x, y), x, y)
        if not self._placement.holds:
            self.scene.control.press(button, x, y, held)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        x, y = pixel_of(self, event.position())
        if self._placement.holds:
            if self._placement.move(x, y):
                self._drag_to(x, y)
                self._point_at(x, y)
        elif event.buttons() == Qt.MouseButton.NoButton:
            self._look_at(x, y, modifiers_of(event))
        elif self.scene.control.move(x, y):
            self._leave_pointer()
            self.redraw(quick=True)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        x, y = pixel_of(self, event.position())
        clicked = self._placement.is_click if self._placement.holds else self.scene.control.release(x, y)
        mark = self._placement.release()
        if event.button() == Qt.MouseButton.LeftButton and clicked:
            self._click(x, y, mark, replace=modifiers_of(event) == Modifier.CTRL)
        elif event.button() == Qt.MouseButton.RightButton and clicked:
            self._placement.open_menu(self, self.mark_at(x, y), event.globalPosition().toPoint())
        self._look_at(x, y, Modifier.NONE)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        if event.button() == Qt.MouseButton.LeftButton:
            self._placement.take_back()
            self.maximise_asked.emit()

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: D102, N802
        view, volume = self._workspace.view, self._workspace.scan.volume
        if Modifier.ALT in modifiers_of(event):
            if view.state.cut is not None and volume is not None:
                view.update(cut=view.state.cut.moved(notches_of(event) * min(volume.spacing)))
        elif self.scene.control.wheel(notches_of(event)):
            self.redraw(quick=True)
        event.accept()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102, N802
        arrow, zoom, held = _ARROWS.get(Qt.Key(event.key())), zoom_of(event), modifiers_of(event)
        camera = self.scene.camera
        if event.key() == Qt.Key.Key_Escape and self._placement.escape():
            event.accept()
            return
        if arrow is not None and held is Modifier.NONE:
            camera.rotate(*arrow)
        elif arrow is not None and held is Modifier.SHIFT:
            camera.pan((0.0, 0.0), (-arrow[0], -arrow[1]))
        elif zoom is not None:
            camera.zoom(zoom)
        else:
            super().keyPressEvent(event)
            return
        self.redraw(quick=True)

    def leaveEvent(self, event: QEvent) -> None:  # noqa: D102, N802
        self._leave_pointer()
        super().leaveEvent(event)

    def enterEvent(self, event: QEnterEvent) -> None:  # noqa: D102, N802
        self._placement.take_focus(self)
        super().enterEvent(event)

    def _click(self, x: float, y: float, mark: str | None, *, replace: bool) -> None:
        point, how = self._aim(x, y)
        self._placement.click(point, how, mark, replace=replace)

    def _aim(self, x: float, y: float) -> tuple[FloatArray | None, How]:
        """Return what a pixel shows, bone or a slice's picture: the (3,) scan position, and which it is."""
        hit = self._hit(x, y)
        if hit is not None:
            return hit.point, How.MESH
        return self.scene.pick_slice(x, y), How.SLICE

    def _hit(self, x: float, y: float) -> SurfaceHit | None:
        """Return the point of the bone at full resolution that is seen at a pixel."""
        hit = self.scene.pick(x, y)
        return None if hit is None else self._workspace.bone.refine(hit, self.scene.ray(x, y)[1])

    def _drag_to(self, x: float, y: float) -> None:
        drag = self._workspace.interaction.drag
        hit = self._hit(x, y)
        if drag is None:
            self._drag_measurement(x, y, None if hit is None else hit.point)
            return
        if hit is not None:
            self._workspace.interaction.drag_to(hit.point, How.MESH)
        elif drag.how is not How.MESH:  # a point that is on no surface slides in the plane of the screen
            view = self.scene.camera.viewpoint()
            depth = view.display(drag.position[None])[0, 2]
            self._workspace.interaction.drag_to(view.scan([[x, y, depth]])[0], drag.how)

    def _drag_measurement(self, x: float, y: float, on_bone: FloatArray | None) -> None:
        """Move the handle that is dragged, on bone where there is some, else in the plane of the screen."""
        measure = self._workspace.measure
        if measure.dragged is None:
            return
        if on_bone is None:
            view = self.scene.camera.viewpoint()
            depth = view.display(np.array([measure.dragged_position]))[0, 2]
            on_bone = view.scan([[x, y, depth]])[0]
        measure.drag_to(on_bone)

    def _look_at(self, x: float, y: float, held: Modifier) -> None:
        point = self._point_at(x, y)
        if point is not None and Modifier.SHIFT in held:
            self._workspace.view.set_crosshair(point)
        self._workspace.measure.point_at(point)
        self._on_target = point is not None
        self._show_cursor()

    def _show_cursor(self, *_: object) -> None:
        """Show the pointer that says what a click here does."""
        if self._pointer is not None:
            self.setCursor(self._placement.cursor(self._on_target, self.mark_at(*self._pointer)))

    def _point_at(self, x: float, y: float) -> FloatArray | None:
        """Take where the pointer is; return the (3,) scan position where a click would land."""
        self._pointer = x, y
        point, _ = self._aim(x, y)
        self._set_hover(point)
        return point

    def _leave_pointer(self) -> None:
        self._pointer = None
        self._workspace.measure.point_at(None)
        self._set_hover(None)

    def _set_hover(self, point: FloatArray | None) -> None:
        if point is not None or self._hover is not None:
            self._hover = point
            self.hovered.emit(point)
            self.canvas.ask_over()

    # Life

    def resizeEvent(self, event: Any) -> None:  # noqa: D102, N802
        self.canvas.resize()
        self.redraw()
        super().resizeEvent(event)

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102, N802
        if event.type() == QEvent.Type.StyleChange:
            self.take_theme()
        super().changeEvent(event)

    def release(self) -> None:
        """Let go of the scene; the widget shows its last frame from then on."""
        self._stale, self._finished = False, True
        self._fine_timer.stop()
        if self._source is not None:
            self._source.close()
        if self._workspace.meshes.scene is self.scene:
            self._workspace.meshes.scene = None
        self.scene.close()
        self.canvas.release()
