"""Arrays of pixels as Qt's polygons and paths.

They are written in Qt's own serialised form and read by Qt: many times faster than a call a point.
"""

from __future__ import annotations

import numpy as np
from qtpy.QtCore import QByteArray, QDataStream, QIODevice
from qtpy.QtGui import QPainterPath, QPolygonF

from gp_core.validation import FloatArray

__all__ = ["polygon", "segments_path"]

_ELEMENT = np.dtype([("kind", ">i4"), ("x", ">f8"), ("y", ">f8")])
_PATH_END = bytes(8)
"""Where the last subpath begins, and how areas are filled."""


def polygon(points: FloatArray) -> QPolygonF:
    """Return (N, 2) pixels as Qt has them."""
    made = QPolygonF()
    _read(made, len(points), points.astype(">f8").tobytes())
    return made


def segments_path(segments: FloatArray) -> QPainterPath:
    """Return (M, 2, 2) line segments as a path."""
    path = QPainterPath()
    if not len(segments):
        return path
    elements = np.zeros(2 * len(segments), dtype=_ELEMENT)
    elements["kind"][1::2] = 1  # move, line, move, line ...
    elements["x"], elements["y"] = segments.reshape(-1, 2).T
    _read(path, len(elements), elements.tobytes() + _PATH_END)
    return path


def _read(into: QPolygonF | QPainterPath, n: int, elements: bytes) -> None:
    """Let Qt read so many elements."""
    data = QByteArray(n.to_bytes(4, "big") + elements)  # the stream only points to it
    stream = QDataStream(data, QIODevice.OpenModeFlag.ReadOnly)
    stream >> into
