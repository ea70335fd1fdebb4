"""A folder stands for its only scan; where there are several, all are named, and none is read unasked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pydicom
import pytest
import SimpleITK
import tifffile
from PIL import Image
from pydicom.dataset import FileDataset, FileMetaDataset
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid

from gp_labeler.imaging.readers import VolumeError, inspect_volume, read_volume

SPACING = (0.2, 0.2, 0.3)


def body(n: int = 40) -> np.ndarray:
    return np.random.default_rng(2).integers(0, 3000, (n, 50, 60)).astype(np.uint16)


def write_volume(file: Path, array: np.ndarray) -> None:
    image = SimpleITK.GetImageFromArray(array)
    image.SetSpacing(SPACING)
    SimpleITK.WriteImage(image, str(file))


def write_images(folder: Path, n: int, name: str = "Screenshot {}.png") -> None:
    for k in range(n):
        Image.fromarray(np.full((90, 120), 10 * k, np.uint8)).save(folder / name.format(k))


def write_dicom(folder: Path, array: np.ndarray) -> None:
    series = generate_uid()
    for k, plane in enumerate(array):
        meta = FileMetaDataset()
        meta.MediaStorageSOPClassUID, meta.TransferSyntaxUID = CTImageStorage, ExplicitVRLittleEndian
        meta.MediaStorageSOPInstanceUID = generate_uid()
        slice_ = FileDataset(None, {}, file_meta=meta, preamble=b"\0" * 128)
        slice_.SOPClassUID, slice_.SOPInstanceUID = CTImageStorage, meta.MediaStorageSOPInstanceUID
        slice_.SeriesInstanceUID, slice_.StudyInstanceUID, slice_.Modality = series, "1.2", "CT"
        slice_.InstanceNumber, slice_.ImagePositionPatient = k + 1, [0, 0, 0.3 * k]
        slice_.ImageOrientationPatient, slice_.PixelSpacing = [1, 0, 0, 0, 1, 0], [0.2, 0.2]
        slice_.Rows, slice_.Columns = plane.shape
        slice_.SamplesPerPixel, slice_.PhotometricInterpretation = 1, "MONOCHROME2"
        slice_.BitsAllocated = slice_.BitsStored = 16
        slice_.HighBit, slice_.PixelRepresentation = 15, 0
        slice_.PixelData = plane.tobytes()
        pydicom.dcmwrite(folder / f"im{k:03d}.dcm", slice_, enforce_file_format=True)


@pytest.mark.parametrize("name", ["Screenshot {}.png", "head_{:03d}.jpg", "s{}.bmp"])
def test_a_volume_beside_images_that_may_be_a_stack_is_a_question(name: str, tmp_path: Path) -> None:
    write_volume(tmp_path / "head.nrrd", body())
    write_images(tmp_path, 6, name)
    for options in ({}, {"spacing": 0.2}):
        with pytest.raises(VolumeError, match=r"several scans: head.nrrd; 6 images \(.*Give one of them"):
            read_volume(tmp_path, **options)
    np.testing.assert_array_equal(read_volume(tmp_path / "head.nrrd").array, body())
    assert inspect_volume(tmp_path / name.format(3)).size == (120, 90, 6)


@pytest.mark.parametrize("kind", ["nrrd", "tif", "dicom"])
def test_a_few_screenshots_beside_a_scan_are_named_and_left_out(kind: str, tmp_path: Path) -> None:
    if kind == "dicom":
        write_dicom(tmp_path, body())
    elif kind == "tif":
        tifffile.imwrite(tmp_path / "head.tif", body(), metadata=None)
    else:
        write_volume(tmp_path / "head.nrrd", body())
    write_images(tmp_path, 3)
    plan = inspect_volume(tmp_path)
    assert plan.size == (60, 50, 40)
    stray = [problem.text for problem in plan.warnings if problem.code == "stray"]
    assert stray == ["images beside it are left out: Screenshot 0.png, Screenshot 1.png, Screenshot 2.png"]


def test_images_with_unlike_names_are_no_stack(tmp_path: Path) -> None:
    write_volume(tmp_path / "head.mha", body(8))
    for name in ("preview.png", "front.png", "left.jpg"):
        write_images(tmp_path, 1, name)
    assert inspect_volume(tmp_path).size == (60, 50, 8)


def test_slices_beside_a_mask_are_a_question(tmp_path: Path) -> None:
    for k, plane in enumerate(body()):
        tifffile.imwrite(tmp_path / f"slice{k:03d}.tif", plane, metadata=None)
    write_volume(tmp_path / "mask.nii.gz", body())
    with pytest.raises(
        VolumeError, match=r"several scans: mask.nii.gz; 40 images \(slice000.tif and 39 more"
    ):
        read_volume(tmp_path, spacing=0.2)
    assert inspect_volume(tmp_path / "slice004.tif").size == (60, 50, 40)


def test_dicom_beside_a_volume_is_a_question(tmp_path: Path) -> None:
    write_dicom(tmp_path, body(12))
    write_volume(tmp_path / "head.nrrd", body())
    with pytest.raises(
        VolumeError, match=r"several scans: head.nrrd; 12 DICOM files \(im000.dcm and 11 more"
    ):
        read_volume(tmp_path)
    assert inspect_volume(tmp_path / "im003.dcm").size == (60, 50, 12)


def test_dicom_beside_a_stack_is_a_question(tmp_path: Path) -> None:
    write_dicom(tmp_path, body(12))
    write_images(tmp_path, 20, "slice{:03d}.png")
    with pytest.raises(VolumeError, match=r"several scans: 12 DICOM files .*; 20 images \(slice000.png"):
        read_volume(tmp_path, spacing=0.2)


def test_two_stacks_are_a_question_that_names_both(tmp_path: Path) -> None:
    write_images(tmp_path, 12, "head_{:03d}.png")
    write_images(tmp_path, 9, "jaw_{:03d}.png")
    plan = inspect_volume(tmp_path)
    assert plan.errors[0].code == "several-series"
    assert "head_#.png (12 slices), jaw_#.png (9 slices)" in plan.errors[0].text
    assert inspect_volume(tmp_path, series="jaw").size[2] == 9


def test_a_stack_of_files_that_are_volumes_is_refused(tmp_path: Path) -> None:
    for k in range(22):
        tifffile.imwrite(tmp_path / f"part{k:02d}.tif", body(4), photometric="minisblack", metadata=None)
    with pytest.raises(
        VolumeError, match=r"part00.tif: it holds 4 slices; a stack has one slice in each file"
    ):
        read_volume(tmp_path, spacing=0.2)
