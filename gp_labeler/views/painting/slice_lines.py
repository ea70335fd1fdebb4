"""The modiolar axis and its companions on a slice: the part of each that lies near it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from qtpy.QtCore import QPointF, Qt
from qtpy.QtGui import QColor, QPainter, QPen

from gp_core.validation import FloatArray
from gp_labeler.scene.segments import Segment
from gp_labeler.scene.slice_viewport import SliceViewport

__all__ = ["near_part", "paint_lines"]


def near_part(
    start: FloatArray, end: FloatArray, depths: tuple[float, float], reach: float
) -> FloatArray | None:
    """Return the (2, 3) ends of the part of a line within `reach` of a slice, or None.

    Parameters
    ----------
    start, end : (3,) float array
        The line, mm.
    depths : (2,) tuple of float
        How far each of them lies from the slice, mm, signed.
    reach : float
        How far off a line is still drawn, mm.
    """
    first, last = depths
    if abs(last - first) < 1e-9:
        return np.stack([start, end]) if abs(first) <= reach else None
    low, high = sorted(((-reach - first) / (last - first), (reach - first) / (last - first)))
    low, high = max(low, 0.0), min(high, 1.0)
    return np.stack([start + low * (end - start), start + high * (end - start)]) if low < high else None


def paint_lines(
    painter: QPainter,
    segments: Sequence[Segment],
    shown: SliceViewport,
    *,
    reach: float,
    colour: str,
    ratio: float,
) -> None:
    """Paint the near parts of lines."""
    for segment in segments:
        before, after = shown.off_slice(np.stack([segment.start, segment.end])).tolist()
        part = near_part(segment.start, segment.end, (before, after), reach)
        if part is None:
            continue
        a, b = (QPointF(*pixel) for pixel in shown.scan_to_pixel(part) + 0.5)
        pen = QPen(QColor(colour), 0.7 * segment.width * ratio)
        pen.setCapStyle(Qt.PenCapStyle.RoundCap)
        painter.setPen(pen)
        painter.drawLine(a, b)
