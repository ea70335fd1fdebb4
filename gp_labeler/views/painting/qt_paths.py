"""Many line segments as one Qt path, made at once instead of point by point."""

from __future__ import annotations

import numpy as np
from qtpy.QtCore import QByteArray, QDataStream, QIODevice
from qtpy.QtGui import QPainterPath

from gp_core.validation import FloatArray

__all__ = ["segments_path"]

_ELEMENT = np.dtype([("kind", ">i4"), ("x", ">f8"), ("y", ">f8")])


def segments_path(segments: FloatArray) -> QPainterPath:
    """Return (M, 2, 2) line segments as a path.

    It is written as Qt's own serialised form and read by Qt: a hundred times faster than a call a point.
    """
    path = QPainterPath()
    if not len(segments):
        return path
    elements = np.zeros(2 * len(segments), dtype=_ELEMENT)
    elements["kind"][1::2] = 1  # move, line, move, line ...
    elements["x"], elements["y"] = segments.reshape(-1, 2).T
    count, ends = np.array([len(elements)], dtype=">i4"), np.zeros(2, dtype=">i4")
    data = QByteArray(count.tobytes() + elements.tobytes() + ends.tobytes())
    stream = QDataStream(data, QIODevice.OpenModeFlag.ReadOnly)
    stream >> path
    return path
