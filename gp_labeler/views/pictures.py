"""Pictures of the window and its views, of any size."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from qtpy.QtCore import QBuffer, QIODevice, QSize
from qtpy.QtGui import QImage, QPainter, QPixmap
from qtpy.QtWidgets import QApplication, QWidget

from gp_core.disk import write_bytes
from gp_core.errors import GpError
from gp_labeler.scene.planes import Plane
from gp_labeler.views.feature_picture import FeaturePicture
from gp_labeler.views.scene_view import SceneView
from gp_labeler.views.slice_view import SliceView

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["PICTURES", "grab", "picture", "picture_bytes", "write_picture"]

PICTURES = ("window", "views", "slices", "3d", *(plane.value for plane in Plane))

_GAP = 4


def picture(window: MainWindow, what: str, size: tuple[int, int] | None = None) -> QImage:
    """Draw one of `PICTURES`.

    Parameters
    ----------
    window : MainWindow
        What is drawn; it looks as before afterwards.
    what : str
        Which picture.
    size : (width, height), optional
        In pixels; by default as on the screen. A view shows the same middle at a zoom to match.
    """
    grid = window.grid
    grid.scene_view.redraw()  # not the coarse preview mesh of a moving camera
    if what == "slices":
        return _slices(list(grid.slice_views.values()), size)
    if what == "3d":
        return _grabbed(grid.scene_view, size)
    if what in (plane.value for plane in Plane):
        return _slice(grid.slice_views[Plane(what)], size)
    return _resized(window, grid if what == "views" else window, size)


def _resized(window: QWidget, part: QWidget, size: tuple[int, int] | None) -> QImage:
    """Draw a part of the window, the window resized until the part has its size."""
    before = window.size()
    if size is not None:
        window.resize(before + QSize(*size) - part.size())
        QApplication.processEvents()
    image = grab(part).toImage()
    image.setDevicePixelRatio(1.0)
    if size is not None:
        window.resize(before)
        QApplication.processEvents()
    return image if size is None or image.size() == QSize(*size) else image.scaled(*size)


def _grabbed(view: QWidget, size: tuple[int, int] | None) -> QImage:
    before = view.size()
    if size is not None:
        ratio = view.devicePixelRatioF()
        view.resize(round(size[0] / ratio), round(size[1] / ratio))
    image = grab(view).toImage()
    image.setDevicePixelRatio(1.0)  # pixels are pixels from here on
    view.resize(before)
    return image


def _slice(view: SliceView, size: tuple[int, int] | None) -> QImage:
    before = view.shown
    if before is not None and size is not None:
        factor = min(size[0] / before.size[0], size[1] / before.size[1])
        view.shown = before.resized(*size).zoomed(factor)
    image = _grabbed(view, size)
    view.shown = before
    return image


def _slices(views: list[SliceView], size: tuple[int, int] | None) -> QImage:
    width, height = size or (3 * 480 + 2 * _GAP, 480)
    each = (width - 2 * _GAP) // 3
    whole = QImage(width, height, QImage.Format.Format_RGB32)
    whole.fill(0)
    painter = QPainter(whole)
    for n, view in enumerate(views):
        painter.drawImage(n * (each + _GAP), 0, _slice(view, (each, height)))
    painter.end()
    return whole


def grab(part: QWidget) -> QPixmap:
    """Return what a part of the window shows, with all that is drawn a moment later."""
    for view in [part, *part.findChildren(QWidget)]:
        if isinstance(view, SceneView | FeaturePicture) and view.isVisible():
            view.finish()
    return part.grab()


def picture_bytes(image: QImage | QPixmap, suffix: str = ".png") -> bytes:
    """Return a picture as the content of a file with this suffix; nothing where Qt knows no such pictures."""
    buffer = QBuffer()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    image.save(buffer, suffix[1:].upper())  # type: ignore[call-overload]  # the stubs know no buffers
    return bytes(buffer.data().data())


def write_picture(image: QImage | QPixmap, path: Path) -> None:
    """Write a picture, whole or not at all, in the format that the file's name says.

    Raises
    ------
    GpError
        There is no such format, or the file cannot be written.
    """
    content = picture_bytes(image, path.suffix)
    if not content:
        raise GpError("cannot be written as a picture", file=path, remedy="Give a path that ends with .png.")
    write_bytes(path, content)
