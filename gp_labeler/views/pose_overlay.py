"""An estimated cochlea over a slice: the axis as it is seen in that plane, and where it is with 95 %."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QEvent, QObject, QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

from gp_core.checks import FloatArray
from gp_labeler.scene.colours import DARK
from gp_labeler.scene.ghosts import ellipse
from gp_labeler.scene.pose_data import DrawnPose, PoseScene
from gp_labeler.scene.slice_view import SliceView as Shown
from gp_labeler.views.slice_view import SliceView

__all__ = ["PoseOverlay"]

_FADE_MM = 4.0
"""A cochlea whose origin lies farther off the slice is drawn faintly: it says where to scroll."""

_FAINT = 0.35


class PoseOverlay(QWidget):
    """Lies over a slice view, as large as it, and takes no events.

    Parameters
    ----------
    view : SliceView
        The view, which owns it.
    """

    def __init__(self, view: SliceView) -> None:
        super().__init__(view)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._view = view
        self._poses: tuple[DrawnPose, ...] = ()
        view.installEventFilter(self)
        self.resize(view.size())
        self.setVisible(True)

    def show(self, scene: PoseScene) -> None:  # type: ignore[override]
        """Draw this in place of what was before."""
        self._poses = scene.poses
        self.update()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: D102, N802
        if event.type() == QEvent.Type.Resize:
            self.resize(self._view.size())
        return False

    def paintEvent(self, _: QPaintEvent) -> None:  # noqa: D102, N802
        shown = self._view.shown
        if shown is None or not self._poses:
            return
        ratio = self._view.devicePixelRatioF()
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.scale(1 / ratio, 1 / ratio)
        for pose in self._poses:
            off = abs(float(shown.off_slice(pose.origin[None])[0]))
            painter.setOpacity(1.0 if off < _FADE_MM else _FAINT)
            _draw(painter, shown, pose, ratio)
        painter.end()


def _draw(painter: QPainter, shown: Shown, pose: DrawnPose, ratio: float) -> None:
    colour = QColor(DARK.states["pose"])
    fill = QColor(colour.red(), colour.green(), colour.blue(), 46)
    points = shown.scan_to_pixel(np.stack([pose.origin, pose.tail, pose.tip])) + 0.5
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(fill)
    painter.drawPolygon(_polygon(_hull(np.concatenate([points[:1], shown.scan_to_pixel(pose.rim) + 0.5]))))
    axes = np.stack([shown.plane.right, shown.plane.down])
    spread = axes @ pose.covariance[:3, :3] @ axes.T / shown.mm_per_pixel**2
    painter.setPen(QPen(colour, 1.8 * ratio))
    painter.drawPolygon(_polygon(ellipse(points[0], spread)))
    painter.setPen(QPen(colour, 2.6 * ratio, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
    painter.drawLine(QPointF(*points[1]), QPointF(*points[2]))
    painter.setBrush(colour)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.drawPolygon(_polygon(_arrow_head(points[1], points[2], 9 * ratio)))
    painter.drawEllipse(QPointF(*points[0]), 4.0 * ratio, 4.0 * ratio)


def _arrow_head(start: FloatArray, end: FloatArray, length: float) -> FloatArray:
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    across = np.array([-along[1], along[0]])
    shape = np.array([[0.4, 0.0], [-0.7, 0.45], [-0.7, -0.45]])
    head: FloatArray = end + length * shape @ np.stack([along, across])
    return head


def _hull(points: FloatArray) -> FloatArray:
    """Return the corners of the convex hull of (N, 2) points, in order (Andrew's monotone chain)."""
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]
    chains = []
    for run in (ordered, ordered[::-1]):
        chain: list[FloatArray] = []
        for point in run:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        chains += chain[:-1]
    return np.array(chains)


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _polygon(points: FloatArray) -> QPolygonF:
    return QPolygonF([QPointF(x, y) for x, y in points.tolist()])
