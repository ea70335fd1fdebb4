"""MetaImage (MHA, MHD): the text header of MetaIO."""

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
from gp_labeler.imaging.readers.problems import Problem, VolumeError, warning
from gp_labeler.imaging.readers.raw_voxels import StoredVoxels, length_problems, voxels_in

__all__ = ["read_meta_header"]

_TYPES = {
    "MET_CHAR": "i1",
    "MET_UCHAR": "u1",
    "MET_SHORT": "i2",
    "MET_USHORT": "u2",
    "MET_INT": "i4",
    "MET_UINT": "u4",
    "MET_LONG": "i4",  # of four bytes on every machine, MetaIO's metaTypes.h
    "MET_ULONG": "u4",
    "MET_LONG_LONG": "i8",
    "MET_ULONG_LONG": "u8",
    "MET_FLOAT": "f4",
    "MET_DOUBLE": "f8",
}
_BYTE_ORDERS = ("binarydatabyteordermsb", "elementbyteordermsb")
_ORIGINS = ("offset", "position", "origin", "imageposition")
_MATRICES = ("transformmatrix", "rotation", "orientation")
_MOST_AXES = 4


def read_meta_header(path: Path, channel: int | None = None) -> Header:
    """Read the text header of an MHA or MHD file.

    Raises
    ------
    VolumeError
        Not MetaImage, the header makes no sense, or a file with voxels is missing.
    """
    with path.open("rb") as file:
        head = file.read(HEADER_BYTES)
    end = re.search(rb"^[ \t]*ElementDataFile[^\n]*\n?", head, re.MULTILINE)
    fields = text_fields(decoded(head[: end.end() if end else len(head)]), "=:")
    if end is None or not {"ndims", "dimsize", "elementtype", "elementdatafile"} <= fields.keys():
        raise not_a("MetaImage", path)
    if "list" in fields.get("kinds", "").lower().split() or b"Seq_Frame0" in head[: end.start()]:
        raise VolumeError(
            "it is a sequence of 2-D images, as recorded by tracking software, not a volume",
            remedy="Give a CT. Use gp-core pivot or gp-core touches for the poses in it.",
        )
    layout = _layout(fields)
    said = fields["elementdatafile"]
    local = said.upper() == "LOCAL"
    listed = decoded(head[end.end() :]).splitlines() if said.upper().startswith("LIST") else []
    files = [path] if local else file_series(path, said, listed, layout.n_planes) or [_beside(path, said)]
    stored = _stored(fields, end.end() if local else 0, packed=files[0].suffix == ".gz")
    source = voxels_in(files, stored, layout, layout.finish(channel))
    geometry, notes, found = _geometry(fields)
    return Header(
        size=layout.size,
        dtype=stored.dtype,
        source=source,
        files=tuple(dict.fromkeys((path, *files))),
        geometry=geometry,
        found=(*length_problems(source, stored), *found),
        notes=(*notes, *_unscaled(fields)),
        channels=layout.channels,
        n_volumes=layout.n_volumes,
    )


def _layout(fields: dict[str, str]) -> Layout:
    n = int(numbers(fields, "NDims", 1, whole=True)[0])
    if not 2 <= n <= _MOST_AXES:
        raise VolumeError(f"its NDims is {n}, where 3 must be", remedy="Correct its header.")
    sizes = [int(size) for size in numbers(fields, "DimSize", n, whole=True)]
    channels = int(
        numbers({"elementnumberofchannels": "1"} | fields, "ElementNumberOfChannels", 1, whole=True)[0]
    )
    if min(*sizes, channels) < 1:
        raise VolumeError(f"its DimSize is {fields['dimsize']!r}", remedy="Correct its header.")
    sizes += [1] * (3 - n)
    return Layout(tuple(sizes), (0, 1, 2)) if channels == 1 else Layout((channels, *sizes), (1, 2, 3))


def _beside(path: Path, said: str) -> Path:
    """Return the file with the voxels; MetaIO looks for a packed one too."""
    packed = path.parent / f"{said}.gz"
    return packed if packed.is_file() and not (path.parent / said).exists() else beside(path, said)


def _stored(fields: dict[str, str], header_bytes: int, *, packed: bool) -> StoredVoxels:
    code = _TYPES.get(fields["elementtype"].upper().removesuffix("_ARRAY"))
    if code is None:
        raise VolumeError(
            f"its ElementType is {fields['elementtype']!r}, which is not read",
            remedy="Save it as whole numbers or floats.",
        )
    orders = {_is_true(fields[name]) for name in _BYTE_ORDERS if fields.get(name)}
    if len(orders) > 1 and code[1] != "1":
        raise VolumeError(
            "its BinaryDataByteOrderMSB and its ElementByteOrderMSB contradict each other",
            remedy="Correct its header.",
        )
    skip = int(numbers({"headersize": "0"} | fields, "HeaderSize", 1, whole=True)[0])
    packing = "zlib" if packed or _is_true(fields.get("compresseddata", "")) else "none"
    if not _is_true(fields.get("binarydata", "true")):
        packing = "text"
    if skip < -1 or (skip == -1 and packing != "none"):
        raise VolumeError(f"its HeaderSize is {skip}", remedy="Correct its header.")
    offset = skip if skip > 0 else header_bytes
    return StoredVoxels(
        np.dtype((">" if True in orders else "<") + code), packing, offset, tail=0 if skip == -1 else None
    )


def _is_true(said: str) -> bool:
    return said[:1].lower() in ("t", "1", "y")


def _geometry(fields: dict[str, str]) -> tuple[Geometry, tuple[str, ...], tuple[Problem, ...]]:
    """Return where voxels lie, notes and warnings; a thickness (ElementSize) is no distance."""
    n = len(fields["dimsize"].split())
    units, unknown, notes = lengths_in_mm([in_latin(fields.get("distanceunits", ""))])
    origin = _three(_of(fields, _ORIGINS, n, [0.0] * n), 0.0, units[0])
    matrix = np.reshape(_of(fields, _MATRICES, n * n, np.eye(n).ravel().tolist()), (n, n))
    direction = np.eye(3)
    direction[: min(n, 3), : min(n, 3)] = matrix[:3, :3].T  # the file has an axis in each row
    spacing, reason, suggested = _spacing(fields, n, units[0])
    if unknown:
        spacing, suggested, reason = None, spacing, f"the unit of its lengths, {unknown!r}, is not known"
    oriented = any(name in fields for name in _MATRICES)
    letters = fields.get("anatomicalorientation", "").upper()
    geometry = Geometry(
        spacing,
        origin,
        direction,
        sides_known=oriented or letters == "RAI",
        suggested=suggested,
        reason=reason,
    )
    return geometry, notes, _contradictions(letters, direction if oriented else np.eye(3))


def _unscaled(fields: dict[str, str]) -> tuple[str, ...]:
    """Say so where the header scales values: ITK, and so every other program, takes them as stored."""
    slope, offset = (
        numbers({name.lower(): default} | fields, name, 1)[0]
        for name, default in (
            ("ElementToIntensityFunctionSlope", "1"),
            ("ElementToIntensityFunctionOffset", "0"),
        )
    )
    if (slope, offset) == (1.0, 0.0):
        return ()
    scale = f"ElementToIntensityFunction ({slope:g}, {offset:g})"
    return (f"its {scale} is not applied, as in ITK: values are as stored",)


def _spacing(fields: dict[str, str], n: int, unit: float) -> tuple[Spacing | None, str, Spacing | None]:
    if "elementspacing" in fields:
        return _three(numbers(fields, "ElementSpacing", n), 1.0, unit), "", None
    if "elementsize" in fields:
        reason = "it has ElementSize, which may be a slice thickness, but no ElementSpacing"
        return None, reason, _three(numbers(fields, "ElementSize", n), 1.0, unit)
    return None, "it has no ElementSpacing", None


def _of(fields: dict[str, str], synonyms: tuple[str, ...], n: int, missing: list[float]) -> list[float]:
    name = next((name for name in synonyms if name in fields), None)
    return missing if name is None else numbers(fields, name, n)


def _three(values: list[float], rest: float, unit: float) -> Spacing:
    x, y, z = [*values, rest, rest][:3]
    return x * unit, y * unit, z * unit


def _contradictions(letters: str, direction: FloatArray) -> tuple[Problem, ...]:
    """Say so where the letters fit the axes neither by where they come from, as MetaIO's do, nor go to."""
    if not re.fullmatch("[RLAPIS]{3}", letters) or not np.isfinite(direction).all():
        return ()
    main = [int(np.abs(axis).argmax()) for axis in direction.T]
    to = "".join(("RAI", "LPS")[int(direction[i, k] > 0)][i] for k, i in enumerate(main))
    come_from = to.translate(str.maketrans("LPSRAI", "RAILPS"))
    if letters in (to, come_from):
        return ()
    text = (
        f"its AnatomicalOrientation, {letters}, contradicts its TransformMatrix, which means {come_from}; "
        "the matrix is used"
    )
    return (warning("orientation", text),)
