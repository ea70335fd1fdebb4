"""Whether a PLY file is whole: VTK's reader crashes on one that is cut off (9.7)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

__all__ = ["is_whole_ply"]

_END = b"end_header"
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class _Element:
    """So many rows of single numbers and lists; a list is the types of its length and of its entries."""

    count: int
    properties: list[tuple[str, ...]] = field(default_factory=list)


def is_whole_ply(path: Path) -> bool:
    """Return whether a PLY file holds all the rows that its header promises, and nothing else."""
    raw = path.read_bytes()
    header, mark, rest = raw.partition(_END)
    line_end = rest.find(b"\n") + 1
    try:
        order, elements = _parsed(header.decode("latin-1"))
        if not (mark and line_end and header.startswith(b"ply")):
            return False
        if order is None:
            return _text_is_whole(rest[line_end:], elements)
        body, at = rest[line_end:], 0
        for element in elements:
            at = _end_of(element, body, at, order)
    except (ValueError, KeyError, IndexError):
        return False
    return at == len(body)


def _parsed(header: str) -> tuple[str | None, list[_Element]]:
    """Return the byte order, None for text, and the elements."""
    order: str | None = None
    elements: list[_Element] = []
    for words in (line.split() for line in header.splitlines()):
        if words[:1] == ["format"]:
            order = None if words[1] == "ascii" else _ORDERS[words[1]]
        elif words[:1] == ["element"]:
            elements.append(_Element(int(words[2])))
        elif words[:1] == ["property"]:
            names = words[2:4] if words[1] == "list" else words[1:2]
            elements[-1].properties.append(tuple(_TYPES[name] for name in names))
    return order, elements


def _text_is_whole(body: bytes, elements: list[_Element]) -> bool:
    rows = [line for line in body.splitlines() if line.strip()]
    return body.endswith((b"\n", b"\r")) and len(rows) == sum(element.count for element in elements)


def _end_of(element: _Element, body: bytes, at: int, order: str) -> int:
    """Return where an element ends that begins at a byte of the body."""
    lists = [kinds for kinds in element.properties if len(kinds) == 2]
    fixed = sum(np.dtype(kinds[0]).itemsize for kinds in element.properties if len(kinds) == 1)
    if not lists:
        return at + element.count * fixed
    if len(element.properties) == 1:
        triangles = _end_of_triangles(element, body, at, order)
        if triangles is not None:
            return triangles
    for _ in range(element.count):
        for kinds in element.properties:
            if len(kinds) == 2:
                length = int(np.frombuffer(body, order + kinds[0], 1, at)[0])
                at += np.dtype(kinds[0]).itemsize + max(length, 0) * np.dtype(kinds[1]).itemsize
            else:
                at += np.dtype(kinds[0]).itemsize
    return at


def _end_of_triangles(element: _Element, body: bytes, at: int, order: str) -> int | None:
    """Return where an element of triangles alone ends, or None if there are other faces: it is quick."""
    length, entry = element.properties[0]
    row = np.dtype([("n", order + length), ("corners", order + entry, 3)])
    end = at + element.count * row.itemsize
    if end > len(body):
        return None
    lengths = np.frombuffer(body, row, element.count, at)["n"]
    return end if bool((lengths == 3).all()) else None
