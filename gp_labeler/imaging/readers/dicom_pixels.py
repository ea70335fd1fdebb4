"""The grey values of DICOM slices: as they lie in the file or unpacked by a library, then scaled."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from threading import Lock
from typing import Any

import imagecodecs
import numpy as np
import pydicom
from pydicom.encaps import generate_frames
from pydicom.uid import (
    HTJ2K,
    JPEG2000,
    HTJ2KLossless,
    HTJ2KLosslessRPCL,
    JPEG2000Lossless,
    JPEGBaseline8Bit,
    JPEGExtended12Bit,
    JPEGLossless,
    JPEGLosslessSV1,
    JPEGLSLossless,
    JPEGLSNearLossless,
    RLELossless,
)

from gp_labeler.imaging.readers.dicom_tags import DicomFile, DicomSlice, StoredPixels
from gp_labeler.imaging.readers.grey import to_grey
from gp_labeler.imaging.readers.problems import VolumeError, failing_as_volume_error
from gp_labeler.imaging.readers.simpleitk import read_itk_planes
from gp_labeler.imaging.readers.source import Plane, in_threads

__all__ = ["DicomSource", "value_dtype", "value_notes"]

_DECODERS: dict[str, Callable[[bytes], Any]] = {
    **dict.fromkeys(
        (JPEG2000, JPEG2000Lossless, HTJ2K, HTJ2KLossless, HTJ2KLosslessRPCL), imagecodecs.jpeg2k_decode
    ),
    **dict.fromkeys((JPEGLSLossless, JPEGLSNearLossless), imagecodecs.jpegls_decode),
    **dict.fromkeys(
        (JPEGBaseline8Bit, JPEGExtended12Bit, JPEGLossless, JPEGLosslessSV1), imagecodecs.jpeg_decode
    ),
}

_Frames = Plane | tuple[bytes, ...]
"""The planes of a file, or its packed frames."""


@dataclass(frozen=True)
class DicomSource:
    """One plane a slice; a missing one is stood in for by its nearest neighbour.

    Parameters
    ----------
    slices : tuple of DicomSlice or None
        In slice order.
    channel : int, optional
        Which colour channel; without it colours become luminance.
    """

    slices: tuple[DicomSlice | None, ...]
    channel: int | None = None

    @property
    def fill(self) -> float | None:
        """The value that stands for no measurement, in all slices that of the first; None: they know none."""
        padded = next((one for one in self.slices if one is not None and one.file.padding), None)
        if padded is None or padded.file.padding is None:
            return None
        return float(_values(np.array(padded.file.padding[0]), padded))

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`, which rise."""
        there = np.array([n for n, one in enumerate(self.slices) if one is not None])
        nearest = [self.slices[there[np.abs(there - number).argmin()]] for number in wanted]
        lock, cached = Lock(), lru_cache(maxsize=2)(_frames_of)

        def frames_of(file: DicomFile) -> _Frames:
            with lock:
                return cached(file)

        return in_threads(partial(self._plane, frames_of=frames_of, fill=self.fill), nearest)

    def _plane(self, one: DicomSlice, frames_of: Callable[[DicomFile], _Frames], fill: float | None) -> Plane:
        file = one.file
        with failing_as_volume_error(file.path):
            if file.channels > 1:
                return to_grey(np.asarray(frames_of(file)[one.frame]), self.channel)
            if file.stored is not None:
                found = _lying(one, file.stored)
                plane = _values(_used_bits(found, file.stored), one)
            else:
                frame = frames_of(file)[one.frame]
                found = _unpacked(frame, file) if isinstance(frame, bytes) else frame
                plane = _values(found, one)
            if file.padding is None or fill is None:
                return plane
            return _filled(plane, found, file.padding, fill)


def _lying(one: DicomSlice, stored: StoredPixels) -> Plane:
    """Read the numbers of a slice from the file, as they lie there."""
    n_pixels = one.file.shape[0] * one.file.shape[1]
    start = n_pixels * one.frame
    before, after = (start % 2, (start + n_pixels) % 2) if stored.exchanged else (0, 0)
    offset = stored.offset + (start - before) * stored.dtype.itemsize
    found = np.fromfile(one.file.path, stored.dtype, before + n_pixels + after, offset=offset)
    if found.size < before + n_pixels:
        raise VolumeError("it ends before its last pixel", file=one.file.path, remedy="Copy it again.")
    if stored.exchanged:
        found = found[: found.size // 2 * 2].reshape(-1, 2)[:, ::-1].ravel()[before : before + n_pixels]
    plane: Plane = found.reshape(one.file.shape)
    return plane


def _used_bits(plane: Plane, stored: StoredPixels) -> Plane:
    """Remove the unused bits, in which old files keep overlays."""
    size = 8 * stored.dtype.itemsize
    if stored.dtype.kind == "f" or stored.bits == size:
        return plane
    above = max(0, size - 1 - stored.high)
    return (plane.astype(stored.dtype.newbyteorder("=")) << above) >> (size - stored.bits)


def _filled(plane: Plane, stored: Plane, padding: tuple[float, float], fill: float) -> Plane:
    """Put one value where a slice was padded, whatever its own slope makes of the padding."""
    padded = (stored >= padding[0]) & (stored <= padding[1])
    return np.where(padded, fill, plane) if padded.any() else plane


def _frames_of(file: DicomFile) -> _Frames:
    """Return the packed frames of a file, or its planes where it is in colour or deflated as a whole."""
    if file.channels > 1:
        return read_itk_planes(file.path)
    tags = pydicom.dcmread(file.path, force=True)
    if not tags.file_meta.TransferSyntaxUID.is_compressed:
        planes: Plane = tags.pixel_array
        return planes.reshape(file.n_frames, *file.shape)
    frames = tuple(generate_frames(tags.PixelData, number_of_frames=file.n_frames))
    if len(frames) != file.n_frames:
        raise VolumeError(f"it holds {len(frames)} of {file.n_frames} frames", remedy="Copy it again.")
    return frames


def _unpacked(frame: bytes, file: DicomFile) -> Plane:
    """Return the stored numbers of a packed frame, of as many bits and of the sign that the tags say."""
    if file.syntax == RLELossless:
        dtype = f"<u{int.from_bytes(frame[:4], 'little')}"  # a segment for each byte of a number
        plane = np.frombuffer(imagecodecs.dicomrle_decode(frame, dtype), dtype)
    elif file.syntax in _DECODERS:
        plane = np.asarray(_DECODERS[file.syntax](frame))
    else:
        raise VolumeError(
            f"its pixels are packed as {file.syntax or 'an unknown codec'}, which is not read",
            remedy="Export it uncompressed.",
        )
    n, signed = 2**file.bits, file.stored_range[0] < 0
    values: Plane = plane.reshape(file.shape).astype(np.int64) & (n - 1)
    return np.where(values >= n // 2, values - n, values) if signed else values


def _values(stored: Plane, one: DicomSlice) -> Plane:
    """Return the values of stored numbers: bright where they are bright on a screen, scaled and shifted."""
    if one.file.inverted:
        low, high = one.file.stored_range
        stored = (low + high) - stored.astype(np.float64)
    if (one.slope, one.intercept) == (1.0, 0.0):
        return stored
    return stored * np.float64(one.slope) + one.intercept


def value_dtype(slices: Sequence[DicomSlice]) -> np.dtype[np.generic]:
    """Return the smallest type that holds every value the slices can have."""
    if not all(_is_whole(one) for one in slices):
        return np.dtype(np.float32)
    ends = [
        end * one.slope + one.intercept
        for one in slices
        for end in (*one.file.stored_range, *(one.file.padding or ()))
    ]
    for name in ("uint8", "int16", "uint16", "int32", "uint32"):
        if np.iinfo(name).min <= min(ends) and max(ends) <= np.iinfo(name).max:
            return np.dtype(name)
    return np.dtype(np.float32)


def _is_whole(one: DicomSlice) -> bool:
    return one.file.integral and float(one.slope).is_integer() and float(one.intercept).is_integer()


def value_notes(slices: Sequence[DicomSlice]) -> tuple[str, ...]:
    """Return what was done to the stored numbers."""
    notes = []
    if any(one.file.inverted for one in slices):
        notes.append("its pixels are MONOCHROME1, low numbers bright: they were inverted")
    if not all(_is_whole(one) for one in slices if one.file.integral):
        notes.append("values were scaled by the rescale slope of the slices and are held as float32")
    return tuple(notes)
