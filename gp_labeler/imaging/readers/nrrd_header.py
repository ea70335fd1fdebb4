"""NRRD and NHDR: the text header of Teem, https://teem.sourceforge.net/nrrd/format.html."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.imaging.readers.headers import (
    HEADER_BYTES,
    Header,
    Layout,
    beside,
    decoded,
    file_series,
    in_latin,
    lengths_in_mm,
    not_a,
    numbers,
    text_fields,
)
from gp_labeler.imaging.readers.options import Spacing
from gp_labeler.imaging.readers.plan import Geometry
from gp_labeler.imaging.readers.problems import VolumeError
from gp_labeler.imaging.readers.raw_voxels import StoredVoxels, length_problems, voxels_in

__all__ = ["read_nrrd_header"]

_TYPES = {
    "i1": ("signed char", "int8", "int8_t"),
    "u1": ("uchar", "unsigned char", "uint8", "uint8_t"),
    "i2": ("short", "short int", "signed short", "signed short int", "int16", "int16_t"),
    "u2": ("ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"),
    "i4": ("int", "signed int", "int32", "int32_t"),
    "u4": ("uint", "unsigned int", "uint32", "uint32_t"),
    "i8": (
        "longlong",
        "long long",
        "long long int",
        "signed long long",
        "signed long long int",
        "int64",
        "int64_t",
    ),
    "u8": ("ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"),
    "f4": ("float",),
    "f8": ("double",),
}
_PACKING = {
    "raw": "none",
    "gz": "gzip",
    "gzip": "gzip",
    "bz2": "bzip2",
    "bzip2": "bzip2",
    "txt": "text",
    "text": "text",
    "ascii": "text",
    "hex": "hex",
}
_TO_LPS = {
    "left-posterior-superior": (1, 1, 1),
    "lps": (1, 1, 1),
    "right-anterior-superior": (-1, -1, 1),
    "ras": (-1, -1, 1),
    "left-anterior-superior": (1, -1, 1),
    "las": (1, -1, 1),
}
_TIMED = {"lpst": "lps", "rast": "ras", "last": "las"}
_IN_FOUR = re.compile(r"\([^(),]+,[^(),]+,[^(),]+,[^(),]+\)")
_SYNONYMS = {"centers": "centerings"}
_SPATIAL = ("domain", "space", "???", "none")
_LISTS = ("list", "time")
_MOST_COLOURS = 4


def read_nrrd_header(path: Path, channel: int | None = None) -> Header:
    """Read the text header of an NRRD or NHDR file.

    Raises
    ------
    VolumeError
        Not NRRD, the header makes no sense, or a file with voxels is missing.
    """
    with path.open("rb") as file:
        head = file.read(HEADER_BYTES)
    if not head.startswith(b"NRRD"):
        raise not_a("NRRD", path)
    end = re.search(rb"\r?\n\r?\n", head)
    text = decoded(head[: end.start() if end else len(head)])
    fields = _without_time(_with_one_spelling(text_fields(text, ":")))
    layout, axes = _layout(fields)
    files = _files(path, text, fields, layout)
    header_bytes = (end.end() if end else len(head)) if files == [path] else 0
    stored = _stored(fields, header_bytes)
    source = voxels_in(files, stored, layout, layout.finish(channel))
    geometry, notes = _geometry(fields, layout, axes)
    return Header(
        size=layout.size,
        dtype=stored.dtype,
        source=source,
        files=tuple(dict.fromkeys((path, *files))),
        geometry=geometry,
        found=length_problems(source, stored),
        notes=notes,
        channels=1 if layout.listed else layout.channels,
        n_volumes=layout.channels if layout.listed else layout.n_volumes,
    )


def _with_one_spelling(fields: dict[str, str]) -> dict[str, str]:
    """Return the fields with the one name of those that Teem writes under another."""
    return {_SYNONYMS.get(name, name): value for name, value in fields.items()}


def _without_time(fields: dict[str, str]) -> dict[str, str]:
    """Return the fields of a space that has a time as those of the space alone."""
    space = fields.get("space", "").lower()
    bare = _TIMED.get(space, space.removesuffix("-time"))
    if bare == space:
        return fields
    directions, origin = (fields.get(name, "") for name in ("spacedirections", "spaceorigin"))
    axes = _IN_FOUR.sub(lambda found: _axis_in_space(found[0]), directions)
    begin = _IN_FOUR.sub(lambda found: _first_three(found[0]), origin)
    changed = {"spacedirections": axes, "spaceorigin": begin}
    return fields | {"space": bare} | {name: text for name, text in changed.items() if text}


def _axis_in_space(text: str) -> str:
    """Return an axis in three numbers; ``none`` for that of the time, and one of both as it is."""
    *place, time = numbers({"axis": text}, "axis", 4)
    if not any(place):
        return "none"
    return text if time else _first_three(text)


def _first_three(text: str) -> str:
    return f"{text.rpartition(',')[0]})"


def _layout(fields: dict[str, str]) -> tuple[Layout, list[str | None]]:
    """Find the three axes of space, and what `space directions` says of every axis."""
    sizes = [int(n) for n in numbers(fields, "sizes", whole=True)]
    n = len(sizes)
    if numbers(fields, "dimension", 1, whole=True) != [n] or min(sizes) < 1:
        raise VolumeError(
            f"its sizes, {fields['sizes']}, do not fit its dimension, {fields['dimension']}",
            remedy="Correct its header.",
        )
    said = fields.get("spacedirections")
    axes: list[str | None] = [None] * n if said is None else re.findall(r"\([^)]*\)|none", said)
    axes = ["none" if axis is not None and "nan" in axis.lower() else axis for axis in axes]
    if len(axes) != n:
        raise VolumeError(f"its space directions are {said!r}, for {n} axes", remedy="Correct its header.")
    kinds = _words(fields, "kinds", n, "???")
    spacings = _words(fields, "spacings", n, "1")
    space = [
        axis
        for axis in range(n)
        if kinds[axis].lower() in _SPATIAL
        and axes[axis] != "none"
        and (n == 3 or axes[axis] is not None or spacings[axis].lower() != "nan")
    ]
    if len(space) == 2 and n == 2:
        return Layout((*sizes, 1), (0, 1, 2)), [*axes, None]
    if len(space) != 3 or space[2] > 3:
        raise VolumeError(
            f"it has {len(space)} axes of space among {n}, and three are needed",
            remedy="Say which they are in its header (kinds: domain domain domain), or save one volume.",
        )
    others = [axis for axis in range(space[2]) if axis not in space]
    listed = any(kinds[axis].lower() in _LISTS or sizes[axis] > _MOST_COLOURS for axis in others)
    return Layout(tuple(sizes), (space[0], space[1], space[2]), listed), axes


def _files(path: Path, text: str, fields: dict[str, str], layout: Layout) -> list[Path]:
    said = fields.get("datafile")
    if said is None:
        return [path]
    listed = re.split(r"^data ?file:.*\n", text, maxsplit=1, flags=re.MULTILINE | re.IGNORECASE)
    return file_series(path, said, listed[-1].splitlines(), layout.n_planes) or [beside(path, said)]


def _stored(fields: dict[str, str], header_bytes: int) -> StoredVoxels:
    code = next((code for code, words in _TYPES.items() if fields.get("type", "").lower() in words), None)
    packing = _PACKING.get(fields.get("encoding", "").lower())
    if code is None or packing is None:
        name = "type" if code is None else "encoding"
        raise VolumeError(
            f"its {name} is {fields.get(name, '')!r}, which is not read", remedy="Save it as raw grey values."
        )
    order = {"little": "<", "big": ">"}.get(fields.get("endian", "").lower())
    if order is None and code[1] != "1" and packing != "text":
        raise VolumeError(
            "it does not say its byte order (endian)",
            remedy="Add a line to its header: endian: little, or big.",
        )
    lines, skip = (
        int(numbers({"lineskip": "0", "byteskip": "0"} | fields, f"{what} skip", 1, whole=True)[0])
        for what in ("line", "byte")
    )
    if lines < 0 or (skip < 0 and packing != "none"):
        raise VolumeError(
            f"its line skip is {lines}, its byte skip {skip}: backwards works for raw bytes only",
            remedy="Correct its header.",
        )
    return StoredVoxels(
        np.dtype((order or "<") + code),
        packing,
        header_bytes,
        lines,
        max(skip, 0),
        tail=-skip - 1 if skip < 0 else None,
    )


def _geometry(
    fields: dict[str, str], layout: Layout, axes: list[str | None]
) -> tuple[Geometry, tuple[str, ...]]:
    """Return where voxels lie: by directions in a space, or else by the spacing along each axis."""
    flips = _TO_LPS.get(fields.get("space", "").lower())
    directions = [axes[axis] for axis in layout.space]
    if None in directions:
        return _by_spacings(fields, layout)
    units, unknown, note = lengths_in_mm(_space_units(fields, layout))
    to_lps = np.diag(np.array(flips or (1, 1, 1)) * units)
    matrix = to_lps @ np.column_stack([_vector("space directions", text or "") for text in directions])
    origin = to_lps @ _vector("space origin", fields.get("spaceorigin", "(0,0,0)"))
    lengths = np.linalg.norm(matrix, axis=0)
    if not (np.isfinite(lengths).all() and lengths.min() > 0):
        raise VolumeError(
            f"its space directions, {fields['spacedirections']}, are not three axes",
            remedy="Correct its header.",
        )
    spacing = _three(lengths)
    return _with_units(
        Geometry(spacing, _three(origin), matrix / lengths, sides_known=flips is not None), unknown
    ), note


def _space_units(fields: dict[str, str], layout: Layout) -> list[str]:
    """Return the unit of each axis of space; some writers give one for all axes of the grid instead."""
    if "spaceunits" in fields:
        return _quoted(fields, "spaceunits", 3)
    of_grid = {_quoted(fields, "units", len(layout.sizes))[axis] for axis in layout.space}
    return [of_grid.pop() if len(of_grid) == 1 else ""] * 3


def _by_spacings(fields: dict[str, str], layout: Layout) -> tuple[Geometry, tuple[str, ...]]:
    n = len(layout.sizes)
    units, unknown, note = lengths_in_mm([_quoted(fields, "units", n)[axis] for axis in layout.space])
    spacing, thickness = (_along(fields, name, layout, units) for name in ("spacings", "thicknesses"))
    if spacing is not None and _positive(spacing):
        origin = _first_centre(fields, layout, units, spacing)
        return _with_units(Geometry(spacing, origin, sides_known=False), unknown), note
    reason = "its header has neither spacings nor space directions for all axes"
    return Geometry(None, sides_known=False, suggested=_positive(thickness), reason=reason), note


def _first_centre(fields: dict[str, str], layout: Layout, units: list[float], spacing: Spacing) -> Spacing:
    """Return the centre of the first voxel, if the axes say where they begin: a cell at its edge."""
    begins = _along(fields, "axis mins", layout, units)
    if begins is None or not np.isfinite(begins).all():
        return 0.0, 0.0, 0.0
    words = _words(fields, "centerings", len(layout.sizes), "cell")
    half = [0.0 if words[axis].lower() == "node" else 0.5 for axis in layout.space]
    return _three(np.array(begins) + np.array(half) * spacing)


def _with_units(geometry: Geometry, unknown: str) -> Geometry:
    if not unknown:
        return geometry
    return Geometry(
        None,
        geometry.origin,
        geometry.direction,
        geometry.sides_known,
        suggested=geometry.spacing,
        reason=f"the unit of its lengths, {in_latin(unknown)!r}, is not known",
    )


def _along(fields: dict[str, str], name: str, layout: Layout, units: list[float]) -> Spacing | None:
    words = _words(fields, "".join(name.split()), len(layout.sizes), "nan")
    try:
        values = [float(words[axis]) for axis in layout.space]
    except ValueError:
        raise VolumeError(f"its {name} are {' '.join(words)}", remedy="Correct its header.") from None
    return _three(np.array(values) * units)


def _positive(lengths: Spacing | None) -> Spacing | None:
    return lengths if lengths is not None and np.isfinite(lengths).all() and min(lengths) > 0 else None


def _words(fields: dict[str, str], name: str, n: int, missing: str) -> list[str]:
    words = fields.get(name, "").split() or [missing] * n
    if len(words) != n:
        raise VolumeError(f"its {name} are {fields[name]!r}, for {n} axes", remedy="Correct its header.")
    return words


def _quoted(fields: dict[str, str], name: str, n: int) -> list[str]:
    """Return the words of a field like ``"um" "um" "um"``; none at all are empty words."""
    said = in_latin(fields.get(name, ""))
    words = re.findall(r'"([^"]*)"', said) or said.split()
    return [*words, *[""] * n][: max(n, 0)]


def _vector(name: str, text: str) -> FloatArray:
    return np.array(numbers({name.replace(" ", ""): text}, name, 3))


def _three(values: FloatArray) -> Spacing:
    x, y, z = (float(value) for value in values)
    return x, y, z
