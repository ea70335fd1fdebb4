"""Arrays of pixels as Qt's polygons and lines, many times faster than with a call for each point."""

from __future__ import annotations

import numpy as np
from qtpy import PYSIDE6
from qtpy.QtCore import QByteArray, QDataStream, QIODevice, QLineF
from qtpy.QtGui import QPainter, QPainterPath, QPolygonF

from gp_core.validation import FloatArray

if PYSIDE6:
    from shiboken6 import wrapInstance  # noqa: TID251 - qtpy has no such function

__all__ = ["draw_segments", "polygon"]

_ELEMENT = np.dtype([("kind", ">i4"), ("x", ">f8"), ("y", ">f8")])
_PATH_END = bytes(8)
"""Where the last subpath begins, and how areas are filled."""


def polygon(points: FloatArray) -> QPolygonF:
    """Return (N, 2) pixels as Qt has them."""
    made = QPolygonF()
    _read(made, len(points), points.astype(">f8").tobytes())
    return made


def draw_segments(painter: QPainter, segments: FloatArray) -> None:
    """Draw (M, 2, 2) line segments with the pen of a painter.

    PySide6 lets Qt take them from the array, which lies in memory like an array of `QLineF`. PyQt6 does not;
    there, Qt reads them as a path.
    """
    lines = np.ascontiguousarray(segments, dtype=np.float64)
    if not len(lines):
        return
    if PYSIDE6:
        first: QLineF = wrapInstance(lines.ctypes.data, QLineF)  # type: ignore[assignment]
        painter.drawLines(first, len(lines))
    else:
        painter.drawPath(_path(lines))


def _path(segments: FloatArray) -> QPainterPath:
    path = QPainterPath()
    elements = np.zeros(2 * len(segments), dtype=_ELEMENT)
    elements["kind"][1::2] = 1  # move, line, move, line ...
    elements["x"], elements["y"] = segments.reshape(-1, 2).T
    _read(path, len(elements), elements.tobytes() + _PATH_END)
    return path


def _read(into: QPolygonF | QPainterPath, n: int, elements: bytes) -> None:
    """Let Qt read so many elements in the form in which it writes them."""
    data = QByteArray(n.to_bytes(4, "big") + elements)  # the stream only points to it
    stream = QDataStream(data, QIODevice.OpenModeFlag.ReadOnly)
    stream >> into
