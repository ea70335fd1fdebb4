"""What SimpleITK does not say of NRRD, MetaImage and NIfTI files: units, and where the voxels begin."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gp_labeler.imaging.readers.grey import to_grey
from gp_labeler.imaging.readers.problems import VolumeError
from gp_labeler.imaging.readers.source import Compression, Plane, RawSource, open_stream
from gp_labeler.imaging.readers.spacing import unit_in_mm

__all__ = ["Header", "nifti_head", "read_meta_header", "read_nifti_header", "read_nrrd_header"]

_NRRD_TYPES = {
    "i1": ("signed char", "int8", "int8_t"),
    "u1": ("uchar", "unsigned char", "uint8", "uint8_t"),
    "i2": ("short", "short int", "signed short", "signed short int", "int16", "int16_t"),
    "u2": ("ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"),
    "i4": ("int", "signed int", "int32", "int32_t"),
    "u4": ("uint", "unsigned int", "uint32", "uint32_t"),
    "i8": ("longlong", "long long", "long long int", "signed long long", "int64", "int64_t"),
    "u8": ("ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"),
    "f4": ("float",),
    "f8": ("double",),
}
_NRRD_PACKING: dict[str, Compression] = {
    "raw": "none",
    "gz": "gzip",
    "gzip": "gzip",
    "bz2": "bzip2",
    "bzip2": "bzip2",
}
_META_TYPES = {
    "MET_CHAR": "i1",
    "MET_UCHAR": "u1",
    "MET_SHORT": "i2",
    "MET_USHORT": "u2",
    "MET_INT": "i4",
    "MET_UINT": "u4",
    "MET_LONG_LONG": "i8",
    "MET_ULONG_LONG": "u8",
    "MET_FLOAT": "f4",
    "MET_DOUBLE": "f8",
}
_NIFTI_TYPES = {
    2: "u1",
    4: "i2",
    8: "i4",
    16: "f4",
    64: "f8",
    256: "i1",
    512: "u2",
    768: "u4",
    1024: "i8",
    1280: "u8",
}
_NIFTI_COLOURS = {128: 3, 2304: 4}
_HEADER_BYTES = 1 << 20


@dataclass(frozen=True)
class Header:
    """What a header says beyond what SimpleITK reads from it.

    Parameters
    ----------
    source : RawSource, optional
        Where the voxels lie; None where only SimpleITK can tell.
    files : tuple of Path
        The file, and the one beside it that holds the voxels.
    unit_mm : float
        Length in mm of the unit of spacing and origin that SimpleITK leaves out of account.
    sides_known : bool
        Whether the header says how the grid lies in the head.
    notes : tuple of str
        What was decided.
    scaled : bool
        Whether the values are scaled while they are read, and so become floats.
    """

    source: RawSource | None
    files: tuple[Path, ...]
    unit_mm: float = 1.0
    sides_known: bool = True
    notes: tuple[str, ...] = ()
    scaled: bool = False


def read_nrrd_header(path: Path, channel: int | None = None) -> Header:
    """Read the text header of an NRRD or NHDR file.

    Raises
    ------
    VolumeError
        Not NRRD, or the file with the voxels is missing.
    """
    with path.open("rb") as file:
        head = file.read(_HEADER_BYTES)
    if not head.startswith(b"NRRD"):
        raise _not_a("NRRD", path)
    end = re.search(rb"\r?\n\r?\n", head)
    fields = _fields(_text(head[: end.start() if end else len(head)]), ":")
    data_file = fields.get("data file") or fields.get("datafile")
    source = _nrrd_source(path, fields, data_file, end.end() if end else len(head), channel)
    unit, notes = _stated_unit(fields.get("space units") or fields.get("units") or "")
    files = (path,) if source is None or source.path == path else (path, source.path)
    return Header(source, files, unit, "space" in fields, notes)


def _nrrd_source(
    path: Path, fields: dict[str, str], data_file: str | None, header_bytes: int, channel: int | None
) -> RawSource | None:
    sizes = [int(n) for n in fields.get("sizes", "").split()]
    code = next(
        (code for code, words in _NRRD_TYPES.items() if fields.get("type", "").lower() in words), None
    )
    packing = _NRRD_PACKING.get(fields.get("encoding", "").lower())
    odd = len(sizes) < 3 or fields.get("line skip", "0") != "0" or _is_many_files(data_file)
    if code is None or packing is None or odd:
        return None
    kinds = fields.get("kinds", "domain").split()
    colours = len(sizes) == 4 and sizes[0] <= 4 and kinds[0] not in ("domain", "space")
    channels = sizes.pop(0) if colours else 1
    skip = int(fields.get("byte skip", "0"))
    file = path if data_file is None else _beside(path, data_file)
    return _from_end(
        RawSource(
            path=file,
            offset=header_bytes if data_file is None else 0,
            dtype=np.dtype((">" if fields.get("endian", "").lower() == "big" else "<") + code),
            plane_shape=_plane_shape(sizes, channels),
            n_planes=sizes[2],
            compression=packing,
            finish=_picking(channel),
            skip=max(skip, 0),
        ),
        from_end=skip == -1,
    )


def read_meta_header(path: Path, channel: int | None = None) -> Header:
    """Read the text header of an MHA or MHD file.

    Raises
    ------
    VolumeError
        Not MetaImage, or the file with the voxels is missing.
    """
    with path.open("rb") as file:
        head = file.read(_HEADER_BYTES)
    end = re.search(rb"^[ \t]*ElementDataFile[^\n]*\n?", head, re.MULTILINE)
    fields = _fields(_text(head[: end.end() if end else len(head)]), "=")
    if end is None or not {"ndims", "dimsize", "elementtype"} <= fields.keys():
        raise _not_a("MetaImage", path)
    source = _meta_source(path, fields, end.end(), channel)
    unit, notes = _stated_unit(fields.get("distanceunits", ""))
    files = (path,) if source is None or source.path == path else (path, source.path)
    return Header(source, files, unit, True, notes)


def _meta_source(
    path: Path, fields: dict[str, str], header_bytes: int, channel: int | None
) -> RawSource | None:
    data_file = fields["elementdatafile"]
    sizes = [int(n) for n in fields.get("dimsize", "").split()]
    code = _META_TYPES.get(fields.get("elementtype", "").upper())
    text_data = fields.get("binarydata", "true").lower() != "true"
    if code is None or text_data or len(sizes) < 3 or _is_many_files(data_file):
        return None
    big = (
        fields.get("binarydatabyteordermsb") or fields.get("elementbyteordermsb") or "false"
    ).lower() == "true"
    local = data_file.upper() == "LOCAL"
    skip = int(fields.get("headersize", "0"))
    source = RawSource(
        path=path if local else _beside(path, data_file),
        offset=header_bytes if local else max(skip, 0),
        dtype=np.dtype((">" if big else "<") + code),
        plane_shape=_plane_shape(sizes, int(fields.get("elementnumberofchannels", "1"))),
        n_planes=sizes[2],
        compression="zlib" if fields.get("compresseddata", "false").lower() == "true" else "none",
        finish=_picking(channel),
    )
    return _from_end(source, from_end=skip == -1 and not local)


def read_nifti_header(path: Path, channel: int | None = None) -> Header:
    """Read the binary header of a NIfTI-1 file, packed or not.

    Raises
    ------
    VolumeError
        Not NIfTI-1.
    """
    head = nifti_head(path)
    order = next((o for o in "<>" if len(head) >= 348 and struct.unpack(o + "i", head[:4])[0] == 348), None)
    if order is None or head[344:348] not in (b"n+1\0", b"ni1\0"):
        raise _not_a("NIfTI", path)
    dim = struct.unpack(order + "8h", head[40:56])
    datatype = struct.unpack(order + "h", head[70:72])[0]
    offset, slope, intercept = struct.unpack(order + "3f", head[108:120])
    codes = struct.unpack(order + "2h", head[252:256])
    code = _NIFTI_TYPES.get(datatype, "u1" if datatype in _NIFTI_COLOURS else None)
    sides_known = any(codes)
    if code is None or head[344:348] == b"ni1\0" or dim[0] < 3:
        return Header(None, (path,), sides_known=sides_known)
    scaled = bool(np.isfinite(slope) and slope != 0 and (slope, intercept) != (1.0, 0.0))
    source = RawSource(
        path=path,
        offset=0,
        dtype=np.dtype(order + code),
        plane_shape=_plane_shape(list(dim[1:4]), _NIFTI_COLOURS.get(datatype, 1)),
        n_planes=dim[3],
        compression="gzip" if _is_gzip(path) else "none",
        finish=_scaling(slope, intercept) if scaled else _picking(channel),
        skip=int(offset),
    )
    notes = (f"values were scaled by {slope:g} and shifted by {intercept:g}",) if scaled else ()
    return Header(source, (path,), sides_known=sides_known, notes=notes, scaled=scaled)


def nifti_head(path: Path) -> bytes:
    """Return the header of a NIfTI file with its extensions, unpacked, up to 1 MB."""
    with open_stream(path, "gzip" if _is_gzip(path) else "none") as stream:
        head: bytes = _read(stream, 352)
        if len(head) == 352 and head[344:347] == b"n+1":
            order = "<" if struct.unpack("<i", head[:4])[0] == 348 else ">"
            more = int(struct.unpack(order + "f", head[108:112])[0]) - 352
            head += _read(stream, min(max(more, 0), _HEADER_BYTES))
    return head


def _read(stream: object, n: int) -> bytes:
    parts = b""
    while len(parts) < n and (part := stream.read(n - len(parts))):  # type: ignore[attr-defined]
        parts += part
    return parts


def _is_gzip(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(2) == b"\x1f\x8b"


def _text(raw: bytes) -> str:
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _fields(text: str, separator: str) -> dict[str, str]:
    """Return the fields of a text header, names in lower case."""
    fields: dict[str, str] = {}
    for line in text.splitlines():
        name, mark, value = line.partition(separator)
        if mark and not line.startswith("#") and not value.startswith("="):
            fields[name.strip().lower()] = value.strip()
    return fields


def _stated_unit(text: str) -> tuple[float, tuple[str, ...]]:
    """Return the unit in mm of a field like ``'"um" "um" "um"'`` and a note where it is not mm."""
    words = [word.strip('"') for word in text.split() if word.strip('"')]
    units = {unit_in_mm(word) for word in words} - {None}
    unit = units.pop() if len(units) == 1 else None
    if unit is None or unit == 1.0:
        return 1.0, ()
    return unit, (f"lengths were converted from {words[0]} to mm",)


def _plane_shape(sizes: list[int], channels: int) -> tuple[int, ...]:
    return (sizes[1], sizes[0]) if channels == 1 else (sizes[1], sizes[0], channels)


def _is_many_files(data_file: str | None) -> bool:
    return data_file is not None and (data_file.upper().startswith("LIST") or "%" in data_file)


def _picking(channel: int | None) -> Callable[[Plane], Plane]:
    return lambda plane: to_grey(plane, channel)


def _scaling(slope: float, intercept: float) -> Callable[[Plane], Plane]:
    def scale(plane: Plane) -> Plane:
        return (plane * np.float64(slope) + intercept).astype(np.float32)

    return scale


def _from_end(source: RawSource, *, from_end: bool) -> RawSource:
    """Let the voxels end where the file ends, for headers of unknown length."""
    if not from_end:
        return source
    return replace(
        source, offset=max(0, source.path.stat().st_size - source.plane_bytes * source.n_planes), skip=0
    )


def _beside(path: Path, name: str) -> Path:
    file = path.parent / name.replace("\\", "/")
    if not file.is_file():
        raise VolumeError(
            f"the voxels should be in {name}, which is not there",
            file=path,
            remedy=f"Put {Path(name).name} into the folder of the header.",
        )
    return file


def _not_a(kind: str, path: Path) -> VolumeError:
    return VolumeError(
        f"it is not a {kind} file, though its name says so", file=path, remedy="Check what it is."
    )
