"""A frame of the 3D view as a person sees it: what VTK draws, and what is painted over it."""

from __future__ import annotations

import numpy as np
from qtpy.QtGui import QImage, QPainter
from window_cases import image_bytes

from gp_labeler.scene.colours import DARK, SceneColours
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.views.painting.scene_overlay import SceneOverlay


def frame_of(
    scene: Scene3D, overlay: SceneOverlay | None = None, colours: SceneColours = DARK, *, names: bool = True
) -> np.ndarray:
    """Return the (h, w, 3) pixels of a frame; unless an overlay is given, without the scale bar."""
    if overlay is None:
        overlay = SceneOverlay()
        overlay.scale_bar_visible, overlay.names_visible = False, names
    pixels = np.ascontiguousarray(scene.image())
    height, width, _ = pixels.shape
    image = QImage(pixels.tobytes(), width, height, 3 * width, QImage.Format.Format_RGB888)
    image = image.convertToFormat(QImage.Format.Format_RGB32)
    overlay.place(scene, colours)
    painter = QPainter(image)
    overlay.paint(painter)
    painter.end()
    return pixels_of(image)


def pixels_of(image: QImage, channels: int = 3) -> np.ndarray:
    """Return the (h, w, channels) red, green, blue and opacity of a picture."""
    plain = image.convertToFormat(QImage.Format.Format_RGBA8888)
    return image_bytes(plain).reshape(plain.height(), plain.width(), 4)[..., :channels].copy()
