"""The one-page report as a file, HTML or PDF, with pictures of the estimate over bone and slices."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from qtpy.QtCore import QBuffer, QIODevice, QMarginsF, QSizeF, QUrl
from qtpy.QtGui import QImage, QPageLayout, QPageSize, QPdfWriter, QTextDocument

from gp_core.disk import write_bytes, write_text
from gp_core.errors import GpError
from gp_labeler.models.estimate import SideEstimate
from gp_labeler.models.pose_report import PoseReport
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.pose_camera import CameraPlacement, along_axis, place_camera, through_round_window
from gp_labeler.scene.pose_data import DrawnPose
from gp_labeler.views.drawn_pose import pose_scene
from gp_labeler.views.pictures import picture, picture_bytes

if TYPE_CHECKING:
    from gp_labeler.models.workspace import Workspace
    from gp_labeler.views.main_window import MainWindow

__all__ = ["report_of", "report_pictures", "reported_estimate", "save_report"]

_PICTURE_SIZE = (720, 520)
_SLICE_MM = 24.0
_LOOKS: Mapping[str, Callable[[DrawnPose], CameraPlacement]] = {
    "Along the axis": along_axis,
    "Through the round window": through_round_window,
}
_BARE = {"labels_visible": False, "mesh_opacity": 0.45}
"""In a small picture the estimate must be seen through the bone, and names of forty points hide it."""

_DPI = 96
_MARGINS_MM = (14.0, 12.0, 14.0, 12.0)


def report_of(window: MainWindow) -> PoseReport:
    """Make the report of the estimate a window shows; raises `GpError` where there is none."""
    estimate, document = reported_estimate(window.workspace), window.workspace.document
    return PoseReport(
        document.state, estimate, report_pictures(window), document.now(), window.workspace.pose.ears
    )


def reported_estimate(workspace: Workspace) -> SideEstimate:
    """Return the estimate a report would be of; raises `GpError` where there is none."""
    pose = workspace.pose
    if pose.estimate is None or pose.estimate.pose is None:
        raise GpError("there is no estimate to report", remedy=pose.waiting_text or None)
    return pose.estimate


def report_pictures(window: MainWindow) -> dict[str, bytes]:
    """Take pictures of the estimate, PNG by caption; none where it does not lie in a scan.

    The window looks as before afterwards.
    """
    poses = pose_scene(window.workspace).poses
    if not poses or window.workspace.scan.volume is None:
        return {}
    view, scene_view = window.workspace.view, window.grid.scene_view
    before = {name: getattr(view.state, name) for name in _BARE}
    looked = scene_view.scene.camera.state()
    view.update(**_BARE)
    found = {**_bone_pictures(window, poses[0]), **_slice_pictures(window, poses[0])}
    view.update(**before)
    scene_view.scene.camera.restore(looked)  # last: a crosshair that leaves the view takes the camera along
    scene_view.redraw()
    return found


def save_report(report: PoseReport, path: Path) -> Path:
    """Write a report as ``.html`` or ``.pdf``, by the file's name.

    Raises
    ------
    GpError
        Another ending, or the file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix in (".html", ".htm"):
        write_text(path, report.html())
    elif suffix == ".pdf":
        _save_pdf(report, path)
    else:
        raise GpError("has no ending of a report", file=path, remedy="End it with .html or .pdf.")
    return path


def _save_pdf(report: PoseReport, path: Path) -> None:
    drawn = QBuffer()
    drawn.open(QIODevice.OpenModeFlag.WriteOnly)
    document, writer = QTextDocument(), QPdfWriter(drawn)
    writer.setTitle(f"{report.state.specimen}: pose of the {report.estimate.side.word} cochlea")
    writer.setResolution(_DPI)
    writer.setPageSize(QPageSize(QPageSize.PageSizeId.A4))
    writer.setPageMargins(QMarginsF(*_MARGINS_MM), QPageLayout.Unit.Millimeter)
    for n, png in enumerate(report.pictures.values()):
        image = QImage.fromData(png)
        document.addResource(QTextDocument.ResourceType.ImageResource, QUrl(f"picture-{n}.png"), image)
    document.documentLayout().setPaintDevice(writer)
    document.setDocumentMargin(0)
    document.setHtml(report.html(embed=False))
    document.setPageSize(QSizeF(writer.width(), writer.height()))
    document.print_(writer)
    del writer  # which ends the file
    write_bytes(path, bytes(drawn.data().data()))


def _bone_pictures(window: MainWindow, pose: DrawnPose) -> dict[str, bytes]:
    view = window.grid.scene_view
    camera, found = view.scene.camera, {}
    camera.view_from(pose.side.value)
    view.scene.fit()
    found[f"From the {pose.side.word}"] = picture_bytes(picture(window, "3d", _PICTURE_SIZE))
    for caption, placement in _LOOKS.items():
        place_camera(camera, placement(pose))
        found[caption] = picture_bytes(picture(window, "3d", _PICTURE_SIZE))
    return found


def _slice_pictures(window: MainWindow, pose: DrawnPose) -> dict[str, bytes]:
    found = {}
    crosshair, views = window.workspace.view.crosshair, window.grid.slice_views
    before = {plane: views[plane].shown for plane in Plane}
    window.workspace.view.set_crosshair(pose.origin)
    for plane in Plane:
        views[plane].zoom_to(pose.origin, _SLICE_MM)
        found[plane.value.capitalize()] = picture_bytes(picture(window, plane.value, _PICTURE_SIZE))
    window.workspace.view.set_crosshair(crosshair)
    for plane in Plane:
        views[plane].shown = before[plane]
        views[plane].update()
    return found
