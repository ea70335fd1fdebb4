"""Read the arrays of a MATLAB file of version 5 to 7.

SciPy reads these too, but a damaged file can crash its process; here every length is checked before use.

References
----------
MathWorks, MAT-File Format, chapter "Level 5 MAT-File Format".
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from os import PathLike

import numpy as np

from gp_core.disk import read_bytes
from gp_core.errors import FileFormatError
from gp_core.validation import FloatArray

__all__ = ["read_mat5"]

_HEADER_BYTES = 128
_MAX_BYTES = 100_000_000
_NUMBER_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_INT32 = 5
_MATRIX, _COMPRESSED = 14, 15
_NUMERIC_CLASSES = range(6, 16)
_COMPLEX = 0x0800


def read_mat5(path: str | PathLike[str]) -> dict[str, FloatArray | None]:
    """Read the variables of a MATLAB file.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    dict of str to array
        Real numeric arrays as float64; None for a variable of any other kind.

    Raises
    ------
    FileFormatError
        Not such a file, or a damaged one.
    """
    content = read_bytes(path, what="MATLAB file")
    try:
        return dict(_variables(content))
    except (ValueError, OverflowError, struct.error, zlib.error):
        raise FileFormatError(
            "is not a MATLAB file of version 5 to 7, or is damaged",
            file=path,
            remedy="Save it in MATLAB with -v7.",
        ) from None


def _variables(content: bytes) -> Iterator[tuple[str, FloatArray | None]]:
    mark = content[_HEADER_BYTES - 2 : _HEADER_BYTES]
    order = {b"IM": "<", b"MI": ">"}.get(mark)
    if order is None:
        raise ValueError("no byte order")
    for kind, data in _elements(content[_HEADER_BYTES:], order):
        inner = [(kind, data)]
        if kind == _COMPRESSED:
            inner = list(_elements(zlib.decompressobj().decompress(data, _MAX_BYTES), order))
        yield from (_matrix(body, order) for kind, body in inner if kind == _MATRIX)


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield tagged elements: type and length in 8 bytes, then the data, padded to 8."""
    at = 0
    while at < len(data):
        kind, size = struct.unpack_from(order + "II", data, at)
        start = at + 8
        if kind >> 16:  # a short element: both halves in 4 bytes, the data in the other 4
            kind, size, start = kind & 0xFFFF, min(kind >> 16, 4), at + 4
        end = start + size
        if end > len(data):
            raise ValueError("an element reaches beyond the file")
        yield kind, data[start:end]
        at = end if kind == _COMPRESSED else end + -end % 8


def _matrix(body: bytes, order: str) -> tuple[str, FloatArray | None]:
    (_, flags), (_, dimensions), (_, name), *parts = _elements(body, order)
    (bits,) = struct.unpack_from(order + "I", flags)
    label = name.decode("latin-1")
    if bits & 0xFF not in _NUMERIC_CLASSES or bits & _COMPLEX:
        return label, None
    if len(parts) != 1 or parts[0][0] not in _NUMBER_TYPES:
        raise ValueError("no real numbers")
    kind, numbers = parts[0]
    shape = np.frombuffer(dimensions, order + _NUMBER_TYPES[_INT32]).tolist()
    with np.errstate(invalid="ignore"):  # a damaged float may be a signalling NaN
        values = np.frombuffer(numbers, order + _NUMBER_TYPES[kind]).astype(np.float64)
    return label, values.reshape(shape, order="F")
