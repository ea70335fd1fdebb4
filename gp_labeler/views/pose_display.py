"""Keeps the drawn estimate in every view in step with the workbench."""

from __future__ import annotations

from PySide6.QtCore import QObject

from gp_labeler.scene.planes import Plane
from gp_labeler.scene.pose_data import DrawnTip
from gp_labeler.views.bind import follow
from gp_labeler.views.drawn_pose import pose_scene
from gp_labeler.views.pose_overlay import PoseOverlay
from gp_labeler.views.view_grid import ViewGrid
from gp_labeler.workbench import Workbench

__all__ = ["PoseDisplay"]


class PoseDisplay(QObject):
    """Draws the estimate over bone and slices whenever it, or what is shown of it, changes.

    Parameters
    ----------
    workbench : Workbench
        Whose estimate.
    grid : ViewGrid
        The views, which own it.
    """

    def __init__(self, workbench: Workbench, grid: ViewGrid) -> None:
        super().__init__(grid)
        self._desk, self._grid = workbench, grid
        self._overlays = [PoseOverlay(grid.slice_views[plane]) for plane in Plane]
        self._tip: DrawnTip | None = None
        follow(self, workbench.pose.changed, self.show)
        follow(self, workbench.pose.overlay_changed, self.show)
        self.show()

    def set_tip(self, tip: DrawnTip | None) -> None:
        """Draw a tracked probe there, or none."""
        self._tip = tip
        self.show()

    def show(self, *_: object) -> None:
        """Draw everything as it is now."""
        drawn = pose_scene(self._desk, tip=self._tip)
        view = self._grid.scene_view
        view.scene.pose.show(drawn)
        view.redraw()
        for overlay in self._overlays:
            overlay.show(drawn)
