"""The body as DICOM, by pydicom and by bytes: single slices and files of many frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from bodies import SPACING, affine, voxels
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.uid import (
    CTImageStorage,
    EnhancedCTImageStorage,
    ExplicitVRBigEndian,
    ExplicitVRLittleEndian,
    ImplicitVRLittleEndian,
    generate_uid,
)

Change = Callable[[FileDataset, int], Any]


def decimal(values: Sequence[float]) -> list[str]:
    return [f"{float(v):.10g}"[:16] for v in values]


def dataset(sop_class: str = CTImageStorage, syntax: str = ExplicitVRLittleEndian) -> FileDataset:
    meta = FileMetaDataset()
    meta.TransferSyntaxUID, meta.MediaStorageSOPClassUID = syntax, sop_class
    meta.MediaStorageSOPInstanceUID = generate_uid()
    data = FileDataset(
        None,
        {},
        file_meta=meta,
        preamble=b"\0" * 128,
        is_implicit_VR=syntax == ImplicitVRLittleEndian,
        is_little_endian=syntax != ExplicitVRBigEndian,
    )
    data.SOPClassUID, data.SOPInstanceUID = sop_class, meta.MediaStorageSOPInstanceUID
    data.Modality, data.PatientID, data.PatientName = "CT", "1", "gp"
    data.StudyInstanceUID, data.SeriesInstanceUID, data.SeriesNumber = "1.2.3", "1.2.3.4", 1
    data.StudyDate, data.StudyTime, data.StudyID, data.AccessionNumber = "20200101", "120000", "1", ""
    return data


def put_pixels(data: FileDataset, pixels: np.ndarray) -> None:
    data.Rows, data.Columns = pixels.shape[-2:]
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated = data.BitsStored = 8 * pixels.dtype.itemsize
    data.HighBit = data.BitsStored - 1
    data.PixelRepresentation = int(pixels.dtype.kind == "i")
    order = ">" if data.file_meta.TransferSyntaxUID == ExplicitVRBigEndian else "<"
    data.PixelData = pixels.astype(pixels.dtype.newbyteorder(order)).tobytes() + b"\0" * (pixels.nbytes % 2)
    data["PixelData"].VR = "OW" if data.BitsAllocated > 8 else "OB"


def slices(
    planes: np.ndarray | None = None, grid: np.ndarray | None = None, syntax: str = ExplicitVRLittleEndian
) -> list[FileDataset]:
    """One data set a slice, complete and right."""
    grid = affine() if grid is None else grid
    made = []
    for n, plane in enumerate(voxels(grid) if planes is None else planes):
        data = dataset(syntax=syntax)
        put_pixels(data, plane)
        data.InstanceNumber = n + 1
        data.ImagePositionPatient = decimal(grid[:3, 3] + n * grid[:3, 2])
        data.ImageOrientationPatient = decimal((grid[:3, :2] / SPACING[:2]).T.ravel())
        data.PixelSpacing, data.SliceThickness = decimal(SPACING[1::-1]), "0.6"
        made.append(data)
    return made


def write(folder: Path, made: Sequence[FileDataset], change: Change = lambda *_: None) -> Path:
    for n, data in enumerate(made):
        change(data, n)
        data.save_as(folder / f"i{n:03d}.dcm", enforce_file_format=True)
    return folder


def group(**tags: Any) -> Dataset:
    made = Dataset()
    for name, value in tags.items():
        setattr(made, name, value)
    return made


def enhanced(
    order: Sequence[int] | None = None,
    planes: np.ndarray | None = None,
    frame: Callable[[Dataset, int], Any] = lambda *_: None,
    sop_class: str = EnhancedCTImageStorage,
) -> FileDataset:
    """One file of many frames, in a given order, each with its position."""
    grid = affine()
    planes = voxels() if planes is None else planes
    order = list(range(len(planes))) if order is None else [int(n) for n in order]
    data = dataset(sop_class)
    put_pixels(data, planes[order])
    data.NumberOfFrames = len(order)
    shared = group(
        PixelMeasuresSequence=[group(PixelSpacing=decimal(SPACING[1::-1]), SliceThickness="0.6")],
        PlaneOrientationSequence=[group(ImageOrientationPatient=[1, 0, 0, 0, 1, 0])],
    )
    data.SharedFunctionalGroupsSequence = [shared]
    each = []
    for n in order:
        one = group(
            PlanePositionSequence=[group(ImagePositionPatient=decimal(grid[:3, 3] + n * grid[:3, 2]))],
            FrameContentSequence=[group(StackID="1", InStackPositionNumber=n + 1)],
        )
        frame(one, n)
        each.append(one)
    data.PerFrameFunctionalGroupsSequence = each
    return data
