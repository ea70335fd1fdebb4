"""The tags of DICOM files that say what a slice is, where it lies, and how its pixels are stored."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
from pydicom.errors import InvalidDicomError
from pydicom.uid import DeflatedExplicitVRLittleEndian, MediaStorageDirectoryStorage

from gp_core.validation import FloatArray
from gp_labeler.imaging.progress import Report

__all__ = [
    "DicomFile",
    "DicomSlice",
    "StoredPixels",
    "has_preamble",
    "is_dicom",
    "is_dicomdir",
    "same_pixel_size",
    "scan_dicom",
]

_TAGS = [
    "SOPClassUID", "ImageType", "SeriesInstanceUID", "SeriesNumber", "SeriesDescription", "InstanceNumber",
    "ConcatenationUID", "AcquisitionNumber", "TriggerTime", "ConvolutionKernel",
    "TemporalPositionIdentifier", "EchoNumbers", "SliceLocation",
    "ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "SliceThickness",
    "NominalScannedPixelSpacing", "GridFrameOffsetVector", "SpacingBetweenSlices", "Rows", "Columns",
    "NumberOfFrames", "SamplesPerPixel", "PhotometricInterpretation", "PixelPaddingValue",
    "PixelPaddingRangeLimit",
    "BitsAllocated", "BitsStored", "HighBit", "PixelRepresentation", "RescaleSlope", "RescaleIntercept",
    "ModalityLUTSequence", "SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence",
]  # fmt: skip
_NUMBERS = {
    (8, 0): "u1", (8, 1): "i1", (16, 0): "u2", (16, 1): "i2", (32, 0): "u4", (32, 1): "i4",
    (64, 0): "u8", (64, 1): "i8",
}  # fmt: skip
_PIXEL_DATA = {0x0010: "", 0x0008: "f4", 0x0009: "f8"}
"""Elements of group 7FE0, and the type of the floats in them."""

_DIRECTORY_HEAD = 400
"""Bytes in which group 2 says what a file is."""

_LARGEST_SKEW = 0.1
_SAME_SIZE = 1e-3
_FIRST_VRS = (b"UL", b"UI", b"OB", b"CS", b"DA", b"TM", b"SH", b"LO", b"DT")


@dataclass(frozen=True)
class StoredPixels:
    """Where the unpacked pixels of a file begin, and how they are stored.

    Of each number of `dtype`, which has its byte order, `bits` count, up to the bit `high`. In `exchanged`
    data the bytes of each pair are exchanged: 8-bit pixels that were written as big-endian words.
    """

    offset: int
    dtype: np.dtype[Any]
    bits: int
    high: int
    exchanged: bool = False


@dataclass(frozen=True, eq=False)
class DicomFile:
    """What holds for all slices of a file.

    Parameters
    ----------
    path : Path
        File.
    series, description : str
        Series UID, and what people call it.
    volume : str
        Parts the slices of a series that cannot be one volume: the file, where it holds many frames.
    number : int
        Instance number.
    shape : (2,) int
        Rows and columns.
    n_frames, channels : int
        Frames, and samples of a pixel.
    between, thickness : float, mm, optional
        SpacingBetweenSlices, and SliceThickness, which is no distance.
    stored_range : (2,) float
        Lowest and highest number that a pixel can be stored as.
    bits : int
        Of a stored number.
    syntax : str
        How the pixels are packed: the transfer syntax.
    integral : bool
        Whether pixels are stored as whole numbers.
    inverted : bool
        Whether low numbers are bright (MONOCHROME1).
    localizer : bool
        Whether it calls itself a scout image.
    stored : StoredPixels, optional
        Where its pixels lie; None where they are packed or in colour.
    padding : (2,) float, optional
        Lowest and highest stored number that stands for no measurement (PixelPaddingValue).
    """

    path: Path
    series: str
    description: str
    volume: str
    number: int
    shape: tuple[int, int]
    n_frames: int
    channels: int
    between: float | None
    thickness: float | None
    stored_range: tuple[float, float]
    bits: int
    syntax: str
    integral: bool
    inverted: bool
    localizer: bool
    stored: StoredPixels | None
    padding: tuple[float, float] | None


@dataclass(frozen=True, eq=False)
class DicomSlice:
    """One slice: a file, or a frame of one.

    Parameters
    ----------
    file : DicomFile
        What it shares with the other frames.
    frame, number : int
        Which frame it is, and which number it counts by.
    position : (3,) array, mm, optional
        Centre of the first pixel, LPS.
    file_position : (3,) array, mm, optional
        The one position that a file gives for all of its frames: that of the first.
    axes : (3, 3) array, optional
        Columns: where x, y of the image and its normal point in LPS.
    skew : float
        Cosine between rows and columns as the file gives them; 0 but for rounding.
    pixel : (2,) float, mm, optional
        Pixel size along x, y.
    location : float, optional
        SliceLocation.
    slope, intercept : float
        From stored numbers to values.
    trouble : str
        What is wrong with these two.
    scaled : bool
        Whether the file says a slope.
    parts : dict
        Tags by which slices at one place may differ.
    """

    file: DicomFile
    frame: int
    number: int
    position: FloatArray | None
    file_position: FloatArray | None
    axes: FloatArray | None
    skew: float
    pixel: tuple[float, float] | None
    location: float | None
    slope: float
    intercept: float
    trouble: str
    scaled: bool
    parts: dict[str, str]

    @property
    def name(self) -> str:
        """What people call it."""
        name = self.file.path.name
        return name if self.file.n_frames == 1 else f"frame {self.frame + 1} of {name}"


def same_pixel_size(one: DicomSlice, other: DicomSlice) -> bool:
    """Return whether two slices have pixels of one size, but for rounding."""
    if one.pixel is None or other.pixel is None:
        return one.pixel is other.pixel
    return bool(np.allclose(one.pixel, other.pixel, rtol=_SAME_SIZE))


def has_preamble(path: Path) -> bool:
    """Return whether a file begins with the preamble of DICOM, whatever its name says."""
    return _head(path)[128:] == b"DICM"


def is_dicom(path: Path) -> bool:
    """Return whether a file begins as DICOM files do, or as their data do without the preamble."""
    head = _head(path)
    return head[128:] == b"DICM" or _begins_bare(head)


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(132)


def is_dicomdir(path: Path) -> bool:
    """Return whether a file is the directory of a DICOM disc, by its name or by what it says it is."""
    if path.name.upper() == "DICOMDIR":
        return True
    with path.open("rb") as file:
        head = file.read(_DIRECTORY_HEAD)
    return head[128:132] == b"DICM" and MediaStorageDirectoryStorage.encode() in head


def _begins_bare(head: bytes) -> bool:
    """Return whether the first element is one of those that a data set begins with."""
    if len(head) < 16:
        return False
    for order in "<>":
        group, element, length = struct.unpack(order + "2HI", head[:8])
        if group in (0x0002, 0x0008) and element <= 0x0018:
            return head[4:6] in _FIRST_VRS or (order == "<" and 0 < length <= 64)
    return False


def scan_dicom(files: Iterable[Path], report: Report) -> tuple[list[DicomSlice], list[Path], list[Path]]:
    """Read the tags of all DICOM images; what is none comes back as junk, what is damaged by itself."""
    every = [file for file in files if not is_dicomdir(file)]
    slices: list[DicomSlice] = []
    junk: list[Path] = []
    damaged: list[Path] = []
    for n, file in enumerate(every):
        report(n / max(len(every), 1))
        if not is_dicom(file):
            junk.append(file)
            continue
        try:
            slices += _read(file)
        except (InvalidDicomError, EOFError, OSError, ValueError, KeyError, TypeError, NotImplementedError):
            damaged.append(file)
    return slices, junk, damaged


def _read(path: Path) -> list[DicomSlice]:
    with path.open("rb") as file:
        tags = pydicom.dcmread(file, stop_before_pixels=True, specific_tags=_TAGS, force=True)
        pixel_header = file.read(12)
        offset = file.tell()
    if not _whole(tags, "Rows") or not _whole(tags, "Columns"):
        if "SOPClassUID" not in tags:
            raise InvalidDicomError("it has neither pixels nor a class")
        return []  # a report: no image
    each = list(tags.get("PerFrameFunctionalGroupsSequence") or [])
    shared = _first(tags.get("SharedFunctionalGroupsSequence"))
    measures = _group("PixelMeasuresSequence", _first(each), shared, tags)
    known = _file(path, tags, measures, pixel_header, offset)
    if len(each) != known.n_frames:
        each = [None] * known.n_frames
    positions = _positions(tags, known)
    return [
        _slice(known, n, tags, frame, shared, position)
        for n, (frame, position) in enumerate(zip(each, positions, strict=True))
    ]


def _file(path: Path, tags: Any, measures: Any, pixel_header: bytes, offset: int) -> DicomFile:
    n_frames = max(1, _whole(tags, "NumberOfFrames"))
    element = _element(tags, pixel_header)
    bits = _whole(tags, "BitsStored") or _whole(tags, "BitsAllocated") or 16
    signed = _whole(tags, "PixelRepresentation") == 1
    low, high = (-(2.0 ** (bits - 1)), 2.0 ** (bits - 1) - 1) if signed else (0.0, 2.0**bits - 1)
    palette = str(tags.get("PhotometricInterpretation", "")).startswith("PALETTE")
    alone = n_frames > 1 and not tags.get("ConcatenationUID")
    return DicomFile(
        path=path,
        series=str(tags.get("SeriesInstanceUID", "")),
        description=_description(tags),
        volume=str(path) if alone else str(tags.get("ConcatenationUID", "")),
        number=_whole(tags, "InstanceNumber"),
        shape=(_whole(tags, "Rows"), _whole(tags, "Columns")),
        n_frames=n_frames,
        channels=max(3 if palette else 1, _whole(tags, "SamplesPerPixel")),
        between=_length(measures, "SpacingBetweenSlices") or _length(tags, "SpacingBetweenSlices"),
        thickness=_length(measures, "SliceThickness"),
        stored_range=(low, high),
        bits=bits,
        syntax=str(_syntax(tags) or ""),
        integral=not _PIXEL_DATA.get(element, ""),
        inverted=str(tags.get("PhotometricInterpretation", "")).strip() == "MONOCHROME1",
        localizer="LOCALIZER" in [str(word).upper() for word in _listed(tags.get("ImageType"))],
        stored=_stored(tags, element, pixel_header, offset),
        padding=_padding(tags, signed=signed),
    )


def _slice(
    file: DicomFile, n: int, tags: Any, frame: Any, shared: Any, position: FloatArray | None
) -> DicomSlice:
    """Put together what the frame's own groups, the shared ones and the plain tags say of a slice."""
    measures = _group("PixelMeasuresSequence", frame, shared, tags)
    # A secondary capture, as SimpleITK writes it, keeps its pixel size under another name.
    pixel = _numbers(measures, "PixelSpacing", 2) or _numbers(tags, "NominalScannedPixelSpacing", 2)
    place = _first(frame.get("PlanePositionSequence")) if frame is not None else None
    own = None if place is None else _numbers(place, "ImagePositionPatient", 3)
    common = _numbers(_group("PlanePositionSequence", None, shared, tags), "ImagePositionPatient", 3)
    plane = _group("PlaneOrientationSequence", frame, shared, tags)
    axes, skew = _axes(_numbers(plane, "ImageOrientationPatient", 6))
    rescale = _group("PixelValueTransformationSequence", frame, shared, tags)
    slope, intercept, trouble = _rescaling(rescale, tags)
    content = _first(frame.get("FrameContentSequence")) if frame is not None else None
    return DicomSlice(
        file=file,
        frame=n,
        number=(_whole(content, "InStackPositionNumber") or n) if file.n_frames > 1 else file.number,
        position=position if own is None else np.array(own),
        file_position=None if common is None else np.array(common),
        axes=axes,
        skew=skew,
        pixel=(pixel[1], pixel[0]) if pixel is not None and min(pixel) > 0 else None,  # rows come first
        location=(_numbers(tags, "SliceLocation", 1) or (None,))[0] if file.n_frames == 1 else None,
        slope=slope,
        intercept=intercept,
        trouble=trouble,
        scaled="RescaleSlope" in rescale,
        parts=_parts(tags, content),
    )


def _parts(tags: Any, content: Any) -> dict[str, str]:
    """Return the tags by which slices at one place may differ, with words for them."""
    of_frame = {
        "stack": "StackID",
        "temporal position": "TemporalPositionIndex",
        "frame acquisition": "FrameAcquisitionNumber",
    }
    of_file = {
        "time point": "TemporalPositionIdentifier",
        "acquisition": "AcquisitionNumber",
        "echo": "EchoNumbers",
        "trigger time": "TriggerTime",
        "kernel": "ConvolutionKernel",
        "image type": "ImageType",
    }
    parts = {word: "" if content is None else str(content.get(name, "")) for word, name in of_frame.items()}
    return parts | {word: str(tags.get(name, "")) for word, name in of_file.items()}


def _first(sequence: Any) -> Any:
    return sequence[0] if sequence else None


def _group(name: str, frame: Any, shared: Any, tags: Any) -> Any:
    """Return the frame's own functional group, the one that holds for all, or the plain tags."""
    for holder in (frame, shared):
        group = _first(holder.get(name)) if holder is not None else None
        if group is not None:
            return group
    return tags


def _positions(tags: Any, file: DicomFile) -> list[FloatArray | None]:
    """Return where frames lie by the plain tags: one position, and perhaps offsets along the normal."""
    first = _numbers(tags, "ImagePositionPatient", 3)
    if first is None:
        return [None] * file.n_frames
    if file.n_frames == 1:
        return [np.array(first)]
    offsets = _numbers(tags, "GridFrameOffsetVector", file.n_frames)
    axes, _ = _axes(_numbers(tags, "ImageOrientationPatient", 6))
    if offsets is None or axes is None:
        return [None] * file.n_frames
    return [np.array(first) + (offset - offsets[0]) * axes[:, 2] for offset in offsets]


@lru_cache(maxsize=256)
def _axes(orientation: tuple[float, ...] | None) -> tuple[FloatArray | None, float]:
    """Return x, y and the normal as columns, at right angles, and the cosine between x and y in the file."""
    if orientation is None:
        return None, 0.0
    x, y = np.array(orientation[:3]), np.array(orientation[3:])
    if min(np.linalg.norm(x), np.linalg.norm(y)) < 0.5:
        return None, 0.0
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    skew = float(x @ y)
    if abs(skew) > _LARGEST_SKEW:
        return None, skew
    middle, across = (x + y) / np.linalg.norm(x + y), (x - y) / np.linalg.norm(x - y)
    x, y = (middle + across) / np.sqrt(2), (middle - across) / np.sqrt(2)
    return np.column_stack([x, y, np.cross(x, y)]), skew


def _element(tags: Any, header: bytes) -> int:
    """Return which element of group 7FE0 the pixels are, 0 where none follows."""
    if len(header) < 12:
        return 0
    group, element = struct.unpack(("<" if _encoding(tags)[1] else ">") + "2H", header[:4])
    return element if group == 0x7FE0 and element in _PIXEL_DATA else 0


def _encoding(tags: Any) -> tuple[bool, bool]:
    """Return whether a file has implicit VRs, and whether it is little-endian."""
    implicit, little = tags.original_encoding
    return bool(implicit), little is not False


def _syntax(tags: Any) -> Any:
    return tags.file_meta.get("TransferSyntaxUID") if "file_meta" in tags.__dict__ else None


def _stored(tags: Any, element: int, header: bytes, offset: int) -> StoredPixels | None:
    """Find the pixels behind their tag and its length, if they are plain numbers."""
    syntax = _syntax(tags)
    packed = syntax is not None and (syntax.is_compressed or syntax == DeflatedExplicitVRLittleEndian)
    if packed or not element or _whole(tags, "SamplesPerPixel") > 1:
        return None
    implicit, little = _encoding(tags)
    order = "<" if little else ">"
    length = struct.unpack(order + "I", header[4:8] if implicit else header[8:12])[0]
    allocated, code = _whole(tags, "BitsAllocated"), _whole(tags, "PixelRepresentation")
    number = _PIXEL_DATA[element] or _NUMBERS.get((allocated, code))
    n_pixels = _whole(tags, "Rows") * _whole(tags, "Columns") * max(1, _whole(tags, "NumberOfFrames"))
    if number is None or str(tags.get("PhotometricInterpretation", "MONOCHROME2"))[:10] != "MONOCHROME":
        return None
    dtype = np.dtype(order + number)
    if length < n_pixels * dtype.itemsize:
        return None
    bits = _whole(tags, "BitsStored") or allocated
    high = _whole(tags, "HighBit") or bits - 1
    words = not little and allocated == 8 and header[4:6] == b"OW"
    return StoredPixels(offset - 4 if implicit else offset, dtype, bits, high, words)


def _padding(tags: Any, *, signed: bool) -> tuple[float, float] | None:
    """Return the range of padding; its numbers may have been written with the other sign than the pixels."""
    said = [_numbers(tags, name, 1) for name in ("PixelPaddingValue", "PixelPaddingRangeLimit")]
    ends = [end[0] for end in said if end is not None]
    if not ends:
        return None
    n = 2.0 ** (_whole(tags, "BitsAllocated") or 16)
    shifted = [(end + n / 2) % n - n / 2 if signed else end % n for end in ends]
    return min(shifted), max(shifted)


def _rescaling(rescale: Any, tags: Any) -> tuple[float, float, str]:
    """Return slope and intercept, as 1 and 0 where they are not numbers, and what is wrong with them."""
    trouble = []
    values = []
    for name, missing in (("RescaleSlope", 1.0), ("RescaleIntercept", 0.0)):
        said = _listed(rescale.get(name))
        number = _number(said[0]) if len(said) == 1 else None
        wrong = bool(said) and (number is None or not np.isfinite(number) or (missing and number == 0))
        if wrong:
            trouble.append(f"{name} is {' '.join(map(str, said))}")
        values.append(missing if wrong or number is None else number)
    if "ModalityLUTSequence" in tags:
        trouble.append("it has a ModalityLUTSequence, which is not applied")
    return values[0], values[1], " and ".join(trouble)


def _number(said: Any) -> float | None:
    try:
        return float(said)
    except (TypeError, ValueError, OverflowError):
        return None


def _description(tags: Any) -> str:
    number, text = tags.get("SeriesNumber"), str(tags.get("SeriesDescription", "") or "").strip()
    return (
        " ".join(part for part in (f"series {number}" if number is not None else "", text) if part)
        or "series"
    )


def _length(tags: Any, name: str) -> float | None:
    length = _numbers(tags, name, 1)
    return abs(length[0]) if length is not None and length[0] != 0 else None


def _whole(tags: Any, name: str) -> int:
    numbers = None if tags is None else _numbers(tags, name, 1)
    return 0 if numbers is None else int(numbers[0])


def _numbers(tags: Any, name: str, n: int) -> tuple[float, ...] | None:
    """Return `n` finite numbers of a tag, or None where it is absent, empty or broken."""
    try:
        value = tags.get(name)
        numbers = tuple(float(part) for part in _listed(value))
    except (TypeError, ValueError, OverflowError, AttributeError):
        return None
    return numbers if len(numbers) == n and np.isfinite(numbers).all() else None


def _listed(value: Any) -> list[Any]:
    if value is None or value == "":
        return []
    return list(value) if hasattr(value, "__iter__") and not isinstance(value, str) else [value]
