"""The grey values of DICOM slices: as they lie in the file or unpacked by a library, then scaled."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pydicom
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import MultiFrameGrayscaleWordSecondaryCaptureImageStorage, SecondaryCaptureImageStorage

from gp_labeler.imaging.readers.dicom_tags import DicomFile, DicomSlice, Stored
from gp_labeler.imaging.readers.grey import to_grey
from gp_labeler.imaging.readers.problems import VolumeError, failing_as_volume_error
from gp_labeler.imaging.readers.simpleitk import read_itk_planes
from gp_labeler.imaging.readers.source import Plane

__all__ = ["DicomSource", "value_dtype", "value_notes"]

_KEPT = (
    "Rows", "Columns", "SamplesPerPixel", "BitsAllocated", "BitsStored", "HighBit", "PixelRepresentation",
    "NumberOfFrames", "PixelData",
)  # fmt: skip


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
        unpacked, fill = lru_cache(maxsize=2)(_unpacked), self.fill
        for number in wanted:
            nearest = self.slices[there[np.abs(there - number).argmin()]]
            assert nearest is not None
            file = nearest.file
            with failing_as_volume_error(file.path):
                if file.channels > 1:
                    yield to_grey(unpacked(file)[nearest.frame], self.channel)
                    continue
                found = unpacked(file)[nearest.frame] if file.stored is None else _lying(nearest, file.stored)
                plane = _values(found if file.stored is None else _used_bits(found, file.stored), nearest)
                if file.padding is not None and fill is not None:
                    plane = _filled(plane, found, file.padding, fill)
                yield plane


def _lying(one: DicomSlice, stored: Stored) -> Plane:
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


def _used_bits(plane: Plane, stored: Stored) -> Plane:
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


def _unpacked(file: DicomFile) -> Plane:
    """Return all (frame, y, x) stored numbers of a packed file, or its (frame, y, x, channel) colours.

    Of grey pixels the library is given a copy without the tags that it would apply by its own lights: some
    are scaled, inverted and sorted by it, some are not.
    """
    if file.channels > 1:
        return read_itk_planes(file.path)
    tags = pydicom.dcmread(file.path, force=True)
    if not tags.file_meta.TransferSyntaxUID.is_compressed or "PixelData" not in tags:
        return _deflated(tags, file)
    bare = Dataset()
    for name in _KEPT:
        if name in tags:
            bare[name] = tags[name]
    bare.PhotometricInterpretation = "MONOCHROME2"
    single = file.n_frames == 1
    bare.SOPClassUID = (
        SecondaryCaptureImageStorage if single else MultiFrameGrayscaleWordSecondaryCaptureImageStorage
    )
    bare.SOPInstanceUID = "1.2.3"
    bare.file_meta = FileMetaDataset()
    bare.file_meta.TransferSyntaxUID = tags.file_meta.TransferSyntaxUID
    bare.file_meta.MediaStorageSOPClassUID = bare.SOPClassUID
    bare.file_meta.MediaStorageSOPInstanceUID = bare.SOPInstanceUID
    with TemporaryDirectory(prefix="gp-labeler-") as folder:
        copy = Path(folder, "pixels.dcm")
        pydicom.dcmwrite(copy, bare, enforce_file_format=True)
        with failing_as_volume_error(file.path):
            return read_itk_planes(copy)


def _deflated(tags: pydicom.FileDataset, file: DicomFile) -> Plane:
    planes: Plane = tags.pixel_array
    return planes.reshape(file.n_frames, *file.shape)


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
