"""Read a surface from an STL file, text or binary."""

from __future__ import annotations

from os import PathLike

import numpy as np

from gp_core.disk import read_bytes
from gp_core.errors import FileFormatError
from gp_core.registration.icp_targets import TriangleMesh
from gp_core.validation import FloatArray

__all__ = ["read_stl"]

_REMEDY = "Export the mesh as STL, in mm, in the frame of the landmarks."
_MAX_BYTES = 1_000_000_000  # 20 million triangles
_HEADER = 80
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: str | PathLike[str]) -> TriangleMesh:
    """Read a surface.

    Parameters
    ----------
    path : path-like
        STL; its coordinates are taken as mm.

    Returns
    -------
    TriangleMesh
        The triangles, mm.

    Raises
    ------
    FileFormatError
        Missing, not STL, damaged, or without a triangle.
    """
    raw = read_bytes(path, what="surface in STL", max_bytes=_MAX_BYTES)
    corners = _binary(raw)
    if corners is None:
        corners = _text(raw)
    if corners is None or not len(corners) or not np.isfinite(corners).all():
        raise FileFormatError("is no surface in STL", file=path, remedy=_REMEDY)
    return TriangleMesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def _binary(raw: bytes) -> FloatArray | None:
    """Return the corners (T, 3, 3) if the length matches the count; headers are unreliable."""
    count = int.from_bytes(raw[_HEADER : _HEADER + 4], "little")
    if len(raw) < _HEADER + 4 or len(raw) != _HEADER + 4 + count * _RECORD.itemsize:
        return None
    return np.frombuffer(raw, _RECORD, offset=_HEADER + 4)["corners"].astype(np.float64)


def _text(raw: bytes) -> FloatArray | None:
    words = raw.split()
    if words[:1] != [b"solid"]:
        return None
    rows = [words[i + 1 : i + 4] for i, word in enumerate(words) if word == b"vertex"]
    try:
        return np.array(rows, dtype=np.float64).reshape(-1, 3, 3)
    except ValueError:
        return None
