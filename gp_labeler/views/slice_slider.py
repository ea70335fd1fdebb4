"""The slider in the header of a slice view: which slice is shown."""

from __future__ import annotations

from qtpy.QtCore import Qt
from qtpy.QtGui import QWheelEvent
from qtpy.QtWidgets import QSlider, QWidget

from gp_labeler.views.signals import blocked
from gp_labeler.views.slice_view import SliceView

__all__ = ["SliceSlider"]

_WIDTH = 110


class SliceSlider(QSlider):
    """Goes through the slices of one view, and follows it.

    Parameters
    ----------
    view : SliceView
        The view.
    """

    def __init__(self, view: SliceView, parent: QWidget | None = None) -> None:
        super().__init__(Qt.Orientation.Horizontal, parent)
        self._view = view
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # keys belong to the view
        self._has_room = True
        self.setFixedWidth(_WIDTH)
        self.setToolTip("Which slice is shown (wheel over the view)")
        self.setAccessibleName(f"{view.plane.value} slice")
        self.valueChanged.connect(self._on_value)
        view.moved.connect(self._on_moved)
        self.hide()

    def set_room(self, has_room: bool) -> None:
        """Say whether there is room for it; it shows itself once there is a scan, too."""
        self._has_room = has_room
        self.setVisible(has_room and self._view.source is not None)

    def _on_value(self, n: int) -> None:
        source, plane = self._view.source, self._view.slice_plane
        if source is not None:
            self._view.move_to(source.limits(plane)[0] + n * source.step(plane))

    def _on_moved(self, position: float) -> None:
        source, plane = self._view.source, self._view.slice_plane
        if source is None:
            return
        low, high = source.limits(plane)
        with blocked(self):
            self.setRange(0, round((high - low) / source.step(plane)))
            self.setValue(round((position - low) / source.step(plane)))
        self.setVisible(self._has_room)

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: D102, N802
        self._view.step(1 if event.angleDelta().y() > 0 else -1)
        event.accept()
