"""The tags of DICOM files that say what a slice is and where it lies."""

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
from pydicom.uid import ExplicitVRBigEndian, ExplicitVRLittleEndian, ImplicitVRLittleEndian

from gp_core.checks import FloatArray
from gp_labeler.imaging.progress import Report

__all__ = ["Frame", "Pixels", "is_dicom", "scan_dicom"]

_TAGS = [
    "SOPClassUID", "ImageType", "SeriesInstanceUID", "SeriesNumber", "SeriesDescription", "InstanceNumber",
    "ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "SliceThickness",
    "NominalScannedPixelSpacing",
    "SpacingBetweenSlices", "Rows", "Columns", "NumberOfFrames", "SamplesPerPixel", "BitsAllocated",
    "BitsStored", "HighBit", "PixelRepresentation", "RescaleSlope", "RescaleIntercept",
    "SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence",
]  # fmt: skip


_NUMBERS = {(8, 0): "u1", (8, 1): "i1", (16, 0): "u2", (16, 1): "i2", (32, 0): "u4", (32, 1): "i4"}


@dataclass(frozen=True)
class Pixels:
    """Where the unpacked pixels of a file begin, and how they are stored: then no library need decode them.

    `dtype` has its byte order, `bits` of each number count; values are scaled and shifted.
    """

    offset: int
    dtype: np.dtype[Any]
    bits: int
    slope: float
    intercept: float


@dataclass(frozen=True, eq=False)
class Frame:
    """One slice, or one file of many frames.

    Parameters
    ----------
    path : Path
        File.
    series, description : str
        Series UID, and what people call it.
    number : int
        Instance number.
    shape : (2,) int
        Rows and columns.
    n_frames : int
        Frames in the file.
    positions : (n, 3) array, mm
        Centre of the first pixel of each frame; empty where the file does not say.
    axes : (3, 3) array, optional
        Columns: where x, y of the image and its normal point in LPS; None where the file does not say.
    pixel : (2,) float, mm, optional
        Pixel size along x, y.
    thickness : float, mm, optional
        Distance of slices if given, else their thickness.
    value_range : (2,) float
        Lowest and highest value that a pixel can have.
    integral : bool
        Whether all values are integers.
    channels : int
        Samples of a pixel.
    localizer : bool
        Whether it calls itself a scout image.
    pixels : Pixels, optional
        Where its pixels lie; None where they are packed or in colour.
    """

    path: Path
    series: str
    description: str
    number: int
    shape: tuple[int, int]
    n_frames: int
    positions: FloatArray
    axes: FloatArray | None
    pixel: tuple[float, float] | None
    thickness: float | None
    value_range: tuple[float, float]
    integral: bool
    channels: int
    localizer: bool
    pixels: Pixels | None


def is_dicom(path: Path) -> bool:
    """Return whether a file begins as DICOM files do."""
    with path.open("rb") as file:
        return file.read(132)[128:] == b"DICM"


def scan_dicom(files: Iterable[Path], report: Report) -> tuple[list[Frame], list[Path], list[Path]]:
    """Read the tags of all DICOM images; what is none comes back as junk, what is damaged by itself."""
    every = list(files)
    frames: list[Frame] = []
    junk: list[Path] = []
    damaged: list[Path] = []
    for n, file in enumerate(every):
        report(n / max(len(every), 1))
        if not is_dicom(file):
            junk.append(file)
            continue
        try:
            frame = _read(file)
        except (InvalidDicomError, EOFError, OSError, ValueError, KeyError, TypeError, NotImplementedError):
            damaged.append(file)
            continue
        if frame is not None:
            frames.append(frame)
    return frames, [file for file in junk if file.name.upper() != "DICOMDIR"], damaged


def _read(path: Path) -> Frame | None:
    with path.open("rb") as file:
        tags = pydicom.dcmread(file, stop_before_pixels=True, specific_tags=_TAGS)
        pixel_header = file.read(12)
        offset = file.tell()
    rows, columns = _whole(tags, "Rows"), _whole(tags, "Columns")
    if not rows or not columns:
        if "SOPClassUID" not in tags:
            raise InvalidDicomError("it has neither pixels nor a class")
        return None  # a report, a directory: no image
    shared = _first(tags.get("SharedFunctionalGroupsSequence"))
    each = list(tags.get("PerFrameFunctionalGroupsSequence") or [])
    measures = _group("PixelMeasuresSequence", shared, each, tags)
    # A secondary capture, as SimpleITK writes it, keeps its pixel size under another name.
    pixel = _numbers(measures, "PixelSpacing", 2) or _numbers(tags, "NominalScannedPixelSpacing", 2)
    distance = _numbers(measures, "SpacingBetweenSlices", 1) or _numbers(measures, "SliceThickness", 1)
    orientation = _numbers(
        _group("PlaneOrientationSequence", shared, each, tags), "ImageOrientationPatient", 6
    )
    rescale = _group("PixelValueTransformationSequence", shared, each, tags)
    values, integral = _values(tags, rescale)
    return Frame(
        path=path,
        series=str(tags.get("SeriesInstanceUID", "")),
        description=_description(tags),
        number=_whole(tags, "InstanceNumber"),
        shape=(rows, columns),
        n_frames=max(1, _whole(tags, "NumberOfFrames")),
        positions=_positions(tags, each),
        axes=None if orientation is None else _axes(orientation),
        pixel=None
        if pixel is None or min(pixel) <= 0
        else (float(pixel[1]), float(pixel[0])),  # rows come first
        thickness=None if distance is None or distance[0] <= 0 else float(distance[0]),
        value_range=values,
        integral=integral,
        channels=max(1, _whole(tags, "SamplesPerPixel")),
        pixels=_pixels(tags, rescale, pixel_header, offset),
        localizer="LOCALIZER" in [str(word).upper() for word in _listed(tags.get("ImageType"))],
    )


def _first(sequence: Any) -> Any:
    return sequence[0] if sequence else None


def _group(name: str, shared: Any, each: list[Any], tags: Any) -> Any:
    """Return the functional group that holds for all frames, or the plain tags of a single-frame file."""
    for holder in (shared, _first(each)):
        group = _first(holder.get(name)) if holder is not None else None
        if group is not None:
            return group
    return tags


def _positions(tags: Any, each: list[Any]) -> FloatArray:
    if not each:
        position = _numbers(tags, "ImagePositionPatient", 3)
        return np.empty((0, 3)) if position is None else np.array([position])
    found = [_first(frame.get("PlanePositionSequence")) for frame in each]
    positions = [None if plane is None else _numbers(plane, "ImagePositionPatient", 3) for plane in found]
    known = [position for position in positions if position is not None]
    return np.array(known) if known and len(known) == len(each) else np.empty((0, 3))


@lru_cache(maxsize=64)
def _axes(orientation: tuple[float, ...]) -> FloatArray | None:
    x, y = np.array(orientation[:3]), np.array(orientation[3:])
    if min(np.linalg.norm(x), np.linalg.norm(y)) < 0.5 or abs(x @ y) > 1e-3:
        return None
    x = x / np.linalg.norm(x)
    y = y - (y @ x) * x
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def _pixels(tags: Any, rescale: Any, header: bytes, offset: int) -> Pixels | None:
    """Find the pixels behind the tag (7FE0,0010) and its length, if they are plain numbers."""
    syntax = tags.file_meta.get("TransferSyntaxUID")
    if syntax not in (ImplicitVRLittleEndian, ExplicitVRLittleEndian, ExplicitVRBigEndian):
        return None
    order = ">" if syntax == ExplicitVRBigEndian else "<"
    implicit = syntax == ImplicitVRLittleEndian
    start = offset - 4 if implicit else offset
    tag = struct.unpack(order + "2H", header[:4]) if len(header) == 12 else None
    length = struct.unpack(order + "I", header[4:8] if implicit else header[8:12])[0] if tag else 0
    allocated, code = _whole(tags, "BitsAllocated"), _whole(tags, "PixelRepresentation")
    number, bits = _NUMBERS.get((allocated, code)), _whole(tags, "BitsStored")
    n_pixels = _whole(tags, "Rows") * _whole(tags, "Columns") * max(1, _whole(tags, "NumberOfFrames"))
    plain = _whole(tags, "SamplesPerPixel") <= 1 and _whole(tags, "HighBit") == bits - 1
    if tag != (0x7FE0, 0x0010) or number is None or not plain or length < n_pixels * allocated // 8:
        return None
    slope, intercept = _rescaling(rescale)
    return Pixels(start, np.dtype(order + number), bits, slope, intercept)


def _rescaling(rescale: Any) -> tuple[float, float]:
    slope = (_numbers(rescale, "RescaleSlope", 1) or (1.0,))[0] or 1.0
    return slope, (_numbers(rescale, "RescaleIntercept", 1) or (0.0,))[0]


def _values(tags: Any, rescale: Any) -> tuple[tuple[float, float], bool]:
    bits = _whole(tags, "BitsStored") or _whole(tags, "BitsAllocated") or 16
    signed = _whole(tags, "PixelRepresentation") == 1
    low, high = (-(2.0 ** (bits - 1)), 2.0 ** (bits - 1) - 1) if signed else (0.0, 2.0**bits - 1)
    slope, shift = _rescaling(rescale)
    ends = sorted((low * slope + shift, high * slope + shift))
    return (ends[0], ends[1]), float(slope).is_integer() and float(shift).is_integer()


def _description(tags: Any) -> str:
    number, text = tags.get("SeriesNumber"), str(tags.get("SeriesDescription", "") or "").strip()
    return (
        " ".join(part for part in (f"series {number}" if number is not None else "", text) if part)
        or "series"
    )


def _whole(tags: Any, name: str) -> int:
    numbers = _numbers(tags, name, 1)
    return 0 if numbers is None else int(numbers[0])


def _numbers(tags: Any, name: str, n: int) -> tuple[float, ...] | None:
    """Return `n` finite numbers of a tag, or None where it is absent, empty or broken."""
    try:
        value = tags.get(name)
        numbers = tuple(float(part) for part in _listed(value))
    except (TypeError, ValueError, AttributeError):
        return None
    return numbers if len(numbers) == n and np.isfinite(numbers).all() else None


def _listed(value: Any) -> list[Any]:
    if value is None or value == "":
        return []
    return list(value) if hasattr(value, "__iter__") and not isinstance(value, str) else [value]
