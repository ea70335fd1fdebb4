"""Keeps the drawn estimate in every view in step with the workspace."""

from __future__ import annotations

from dataclasses import replace

from qtpy.QtCore import QObject

from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.pose_data import DrawnTip, PoseScene
from gp_labeler.views.drawn_pose import pose_scene
from gp_labeler.views.painting.pose_layer import PoseLayer
from gp_labeler.views.signals import follow
from gp_labeler.views.view_grid import ViewGrid

__all__ = ["PoseDisplay"]


class PoseDisplay(QObject):
    """Draws the estimate over bone and slices whenever it, or what is shown of it, changes.

    Parameters
    ----------
    workspace : Workspace
        Whose estimate.
    grid : ViewGrid
        The views, which own it.
    """

    def __init__(self, workspace: Workspace, grid: ViewGrid) -> None:
        super().__init__(grid)
        self._workspace, self._grid = workspace, grid
        self._overlays = [PoseLayer(grid.slice_views[plane]) for plane in Plane]
        self._tip: DrawnTip | None = None
        self._drawn = PoseScene()
        follow(self, workspace.pose.changed, self.show)
        follow(self, workspace.pose.overlay_changed, self.show)
        self.show()

    def set_tip(self, tip: DrawnTip | None) -> None:
        """Draw a tracked probe there, or none; all else stays as it is."""
        if tip is None and self._tip is None:
            return
        self._tip = tip
        self._drawn = replace(self._drawn, tip=tip if self._workspace.pose.overlay.visible else None)
        self._grid.scene_view.scene.pose.show_tip(self._drawn.tip)
        self._paint()

    def show(self, *_: object) -> None:
        """Draw everything as it is now."""
        self._drawn = pose_scene(self._workspace, tip=self._tip)
        self._grid.scene_view.scene.pose.show(self._drawn)
        self._paint()

    def _paint(self) -> None:
        self._grid.scene_view.redraw()
        for overlay in self._overlays:
            overlay.show(self._drawn)
