"""DICOM series as pydicom and SimpleITK write them, whole and broken."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pydicom
import pytest
import SimpleITK
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import CTImageStorage, EnhancedCTImageStorage, ExplicitVRLittleEndian, generate_uid
from scan_makers import Scan, load_mouse
from scipy.spatial.transform import Rotation

from gp_labeler.imaging.readers import VolumeError, inspect_volume, read_volume

Change = Callable[[FileDataset, int], None]


def small(dtype: str = "uint8", factor: float = 1.0) -> Scan:
    """25 slices of 60 x 24 pixels: pydicom takes its time to write."""
    return load_mouse().crop((60, 24, 25)).as_type(dtype, factor)


def new_dataset(path: Path, series: str, sop_class: str = CTImageStorage) -> FileDataset:
    meta = FileMetaDataset()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    meta.MediaStorageSOPClassUID = sop_class
    meta.MediaStorageSOPInstanceUID = generate_uid()
    data = FileDataset(str(path), {}, file_meta=meta, preamble=b"\0" * 128)
    data.SOPClassUID, data.SOPInstanceUID = sop_class, meta.MediaStorageSOPInstanceUID
    data.Modality, data.PatientName, data.PatientID = "CT", "gp", "1"
    data.StudyInstanceUID, data.SeriesInstanceUID = "1.2.3", series
    return data


def put_pixels(data: FileDataset, pixels: np.ndarray) -> None:
    data.Rows, data.Columns = pixels.shape[-2:]
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated = data.BitsStored = 8 * pixels.dtype.itemsize
    data.HighBit = data.BitsStored - 1
    data.PixelRepresentation = int(pixels.dtype.kind == "i")
    data.PixelData = np.ascontiguousarray(pixels).tobytes()


def write_series(
    scan: Scan,
    folder: Path,
    *,
    series: str = "1.2.3.4",
    name: str = "IM{:04d}.dcm",
    change: Change | None = None,
    description: str = "head",
) -> Path:
    folder.mkdir(exist_ok=True)
    axes, spacing = scan.affine[:3, :3] / scan.spacing, scan.spacing
    for n, plane in enumerate(scan.array):
        data = new_dataset(folder / name.format(n), series)
        put_pixels(data, plane)
        data.SeriesDescription, data.SeriesNumber, data.InstanceNumber = description, 3, n + 1
        data.ImagePositionPatient = [f"{v:.9g}" for v in scan.affine[:3, 3] + n * scan.affine[:3, 2]]
        data.ImageOrientationPatient = [f"{v:.9g}" for v in axes[:, :2].T.ravel()]
        data.PixelSpacing = [f"{spacing[1]:.9g}", f"{spacing[0]:.9g}"]
        data.SliceThickness = f"{spacing[2]:.9g}"
        if change is not None:
            change(data, n)
        data.save_as(folder / name.format(n), enforce_file_format=True)
    return folder


def assert_same_scan(path: Path, scan: Scan, **options: object) -> None:
    volume = read_volume(path, **options)
    np.testing.assert_array_equal(volume.array, scan.array)
    assert volume.array.dtype == scan.array.dtype
    np.testing.assert_allclose(volume.T_scan_voxel, scan.affine, atol=2e-6)


def codes(path: Path) -> list[str]:
    return [problem.code for problem in inspect_volume(path).problems]


def test_the_real_scan_comes_back_with_its_landmarks(tmp_path: Path) -> None:
    scan = load_mouse()
    write_series(scan, tmp_path / "dcm")
    plan = inspect_volume(tmp_path / "dcm")
    assert not plan.problems
    assert plan.sides_known
    volume = read_volume(plan)
    np.testing.assert_array_equal(volume.values_at(scan.landmarks), scan.values(scan.landmarks))
    assert_same_scan(tmp_path / "dcm" / "IM0007.dcm", scan)


@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint16"])
def test_a_series_that_simpleitk_wrote(dtype: str, tmp_path: Path) -> None:
    scan = small(dtype, 1 if dtype == "uint8" else 100)
    image, writer = scan.image(), SimpleITK.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    for n in range(image.GetDepth()):
        plane = image[:, :, n]
        plane.SetMetaData("0020|000e", "1.2.826.7")
        plane.SetMetaData("0020|0037", "1\\0\\0\\0\\1\\0")
        plane.SetMetaData("0020|0032", "\\".join(map(str, image.TransformIndexToPhysicalPoint((0, 0, n)))))
        writer.SetFileName(str(tmp_path / f"{n}.dcm"))
        writer.Execute(plane)
    assert_same_scan(tmp_path, scan)


def test_non_square_pixels_are_not_exchanged(tmp_path: Path) -> None:
    scan = small()
    affine = np.diag([0.15, 0.2, 0.3, 1.0])
    assert_same_scan(
        write_series(Scan(scan.array, affine, scan.landmarks), tmp_path / "a"),
        Scan(scan.array, affine, scan.landmarks),
    )


def test_oblique_series_lie_as_simpleitk_has_them(tmp_path: Path) -> None:
    scan = small()
    affine = scan.affine.copy()
    affine[:3, :3] = Rotation.from_euler("xyz", [15, -40, 70], degrees=True).as_matrix() @ affine[:3, :3]
    turned = Scan(scan.array, affine, scan.landmarks)
    folder = write_series(turned, tmp_path / "a")
    assert_same_scan(folder, turned)
    image = SimpleITK.ReadImage(SimpleITK.ImageSeriesReader.GetGDCMSeriesFileNames(str(folder)))
    volume = read_volume(folder)
    np.testing.assert_array_equal(volume.array, SimpleITK.GetArrayFromImage(image))
    for index in ([0, 0, 0], [50, 20, 20]):
        expected = image.TransformIndexToPhysicalPoint(index)
        np.testing.assert_allclose(volume.voxel_to_scan([index])[0], expected, atol=1e-4)


def test_slices_named_in_reverse_are_sorted_by_place(tmp_path: Path) -> None:
    scan = small()
    folder = write_series(scan, tmp_path / "a")
    for n in range(25):
        (folder / f"IM{n:04d}.dcm").rename(folder / f"z{24 - n}.dcm")
    assert_same_scan(folder, scan)


def test_junk_and_directories_are_named_and_left_out(tmp_path: Path) -> None:
    scan = small()
    folder = write_series(scan, tmp_path / "a", name="IM{:04d}")
    (folder / "readme.txt").write_text("x")
    (folder / "DICOMDIR").write_bytes(b"\0" * 200)
    assert codes(folder) == ["junk"]
    assert "readme.txt" in inspect_volume(folder).warnings[0].text
    assert_same_scan(folder, scan)


def test_a_damaged_file_is_no_junk(tmp_path: Path) -> None:
    scan = small()
    folder = write_series(scan, tmp_path / "a")
    (folder / "IM0024.dcm").write_bytes(b"\0" * 128 + b"DICM" + b"\x07" * 50)
    with pytest.raises(VolumeError, match=r"damaged: IM0024.dcm.*--accept damaged"):
        read_volume(folder)
    assert read_volume(folder, accept=["damaged"]).size == (60, 24, 24)


def test_several_series_are_to_be_chosen_from(tmp_path: Path) -> None:
    scan = small()
    other = Scan(255 - scan.array[:20], scan.affine, scan.landmarks)
    write_series(scan, tmp_path, series="1.2.9", description="bone kernel")
    write_series(other, tmp_path, series="1.2.10", name="soft{:03d}.dcm", description="soft kernel")
    plan = inspect_volume(tmp_path)
    assert [problem.code for problem in plan.errors] == ["several-series"]
    assert [choice.id for choice in plan.choices] == ["1.2.9", "1.2.10"]
    assert plan.choices[0].text == "series 3 bone kernel: 25 slices, 60 x 24 pixels of 0.1411 mm"
    with pytest.raises(VolumeError, match=r"2 scans: series 3 bone kernel: 25 slices.*--series"):
        read_volume(tmp_path)
    assert_same_scan(tmp_path, scan, series="1.2.9")
    np.testing.assert_array_equal(read_volume(plan, series="SOFT").array, other.array)
    picked = read_volume(tmp_path / "soft003.dcm")
    assert picked.choices == {"series": "1.2.10"}
    np.testing.assert_array_equal(read_volume(picked.path, **picked.choices).array, other.array)
    with pytest.raises(
        VolumeError, match=r"series 'kernel' fits 2 of its scans.*1\.2\.9 \(series 3 bone kernel"
    ):
        read_volume(plan, series="kernel")


@pytest.mark.parametrize("same_uid", [False, True])
def test_scouts_are_left_out(same_uid: bool, tmp_path: Path) -> None:
    scan = small()
    folder = write_series(scan, tmp_path / "a")
    scout = new_dataset(folder / "scout.dcm", "1.2.3.4" if same_uid else "1.2.3.5")
    put_pixels(scout, scan.array[0][:14])
    scout.ImageType = ["ORIGINAL", "PRIMARY", "LOCALIZER"]
    scout.save_as(folder / "scout.dcm", enforce_file_format=True)
    assert codes(folder) == ["scout"]
    assert "scout.dcm" in inspect_volume(folder).warnings[0].text
    assert_same_scan(folder, scan)


@pytest.mark.parametrize("spacing", [0.0049, 0.1411])
def test_a_gap_is_named_however_fine_the_slices(
    spacing: float, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scan = small()
    fine = Scan(scan.array, np.diag([0.1411, 0.1411, spacing, 1]), scan.landmarks)
    folder = write_series(fine, tmp_path / "a")
    for n in (10, 11, 16):
        (folder / f"IM{n:04d}.dcm").unlink()
    plan = inspect_volume(folder)
    assert [problem.code for problem in plan.errors] == ["gap"]
    assert plan.spacing == pytest.approx((0.1411, 0.1411, spacing), rel=1e-4)
    with pytest.raises(
        VolumeError, match=r"3 of its slices.*IM0009.dcm \(.*IM0012.dcm.*IM0017.dcm.*--accept gap"
    ):
        read_volume(plan)
    volume = read_volume(plan, accept=["gap"])
    expected = scan.array.copy()
    expected[10], expected[11], expected[16] = scan.array[9], scan.array[12], scan.array[15]
    np.testing.assert_array_equal(volume.array, expected)
    assert capfd.readouterr().err == ""


def test_doubled_positions_are_named(tmp_path: Path) -> None:
    scan = small()
    folder = write_series(scan, tmp_path / "a")
    write_series(Scan(scan.array[:15] // 2, scan.affine, scan.landmarks), folder, name="copy{:04d}.dcm")
    with pytest.raises(VolumeError, match=r"15 slices lie where another one lies: .*dcm.*--accept doubled"):
        read_volume(folder)
    assert inspect_volume(folder).spacing == pytest.approx(tuple(scan.spacing), rel=1e-5)
    assert inspect_volume(folder).size == (60, 24, 25)


def test_uneven_positions_are_named(tmp_path: Path) -> None:
    def shift(data: FileDataset, n: int) -> None:
        data.ImagePositionPatient[2] = float(data.ImagePositionPatient[2]) + (0.06 if n % 3 == 1 else 0)

    folder = write_series(small(), tmp_path / "a", change=shift)
    with pytest.raises(VolumeError, match=r"lie unevenly: their distances run from 0\.08\d* to 0\.20\d* mm"):
        read_volume(folder)


def test_rounded_positions_are_even(tmp_path: Path) -> None:
    def rounded(data: FileDataset, _: int) -> None:
        data.ImagePositionPatient = [f"{float(v):.2f}" for v in data.ImagePositionPatient]

    folder = write_series(small(), tmp_path / "a", change=rounded)
    assert codes(folder) == []
    assert inspect_volume(folder).spacing[2] == pytest.approx(0.14087, rel=2e-3)


def test_a_tilted_gantry_is_named(tmp_path: Path) -> None:
    def tilt(data: FileDataset, n: int) -> None:
        data.ImagePositionPatient[1] = float(data.ImagePositionPatient[1]) + 0.05 * n

    with pytest.raises(VolumeError, match=r"shifted sideways by 1\.2 mm"):
        read_volume(write_series(small(), tmp_path / "a", change=tilt))


def test_micrometres_are_noticed(tmp_path: Path) -> None:
    scan = small()
    large = Scan(scan.array, np.diag([141.1, 141.1, 141.1, 1]), scan.landmarks)
    large.affine[:3, 3] = [10, 20, 30_000]
    folder = write_series(large, tmp_path / "a")
    with pytest.raises(VolumeError, match=r"8\.47 m long.*--spacing 0\.1411"):
        read_volume(folder)
    volume = read_volume(folder, spacing=0.1411)
    np.testing.assert_allclose(volume.origin, [0.01, 0.02, 30], atol=1e-9)


@pytest.mark.parametrize("value", [None, [0, 0], ["", ""]])
def test_without_pixel_spacing_it_is_asked_for(value: list[object] | None, tmp_path: Path) -> None:
    def strip(data: FileDataset, _: int) -> None:
        del data.PixelSpacing
        if value == [0, 0]:
            data.PixelSpacing = value

    folder = write_series(small(), tmp_path / "a", change=strip)
    plan = inspect_volume(folder)
    assert [problem.code for problem in plan.errors] == ["spacing-missing"]
    assert "no PixelSpacing" in plan.errors[0].text
    assert plan.suggested_spacing == pytest.approx((0.14087,) * 3, rel=1e-4)


def test_without_positions_the_numbers_count_and_the_thickness_is_a_hint(tmp_path: Path) -> None:
    def strip(data: FileDataset, _: int) -> None:
        del data.ImagePositionPatient
        del data.ImageOrientationPatient

    scan = small()
    folder = write_series(scan, tmp_path / "a", change=strip)
    for n in range(25):
        (folder / f"IM{n:04d}.dcm").rename(folder / f"z{24 - n:04d}.dcm")
    assert codes(folder) == ["no-positions", "spacing-missing", "sides-unknown"]
    plan = inspect_volume(folder)
    assert "SliceThickness of 0.1409 mm need not be it" in plan.errors[0].text
    assert plan.suggested_spacing == pytest.approx(tuple(scan.spacing))
    volume = read_volume(plan, spacing=plan.suggested_spacing)
    np.testing.assert_array_equal(volume.array, scan.array)


def test_with_one_position_for_all_slices_the_numbers_count(tmp_path: Path) -> None:
    def same(data: FileDataset, _: int) -> None:
        data.ImagePositionPatient = [0, 0, 0]
        data.SpacingBetweenSlices = 0.2

    scan = small()
    volume = read_volume(write_series(scan, tmp_path / "a", change=same))
    np.testing.assert_array_equal(volume.array, scan.array)
    assert volume.spacing[2] == pytest.approx(0.2)


def test_with_neither_positions_nor_thickness_the_distance_is_asked_for(tmp_path: Path) -> None:
    def strip(data: FileDataset, _: int) -> None:
        del data.ImagePositionPatient
        del data.SliceThickness

    plan = inspect_volume(write_series(small(), tmp_path / "a", change=strip))
    assert [problem.code for problem in plan.errors] == ["spacing-missing"]
    assert "neither positions nor SpacingBetweenSlices" in plan.errors[0].text


@pytest.mark.parametrize(
    ("slope", "intercept", "dtype"),
    [(1, -1000, "int32"), (0.5, -10, "float32"), (2, 0, "int32"), (1, 0.25, "float32")],
)
def test_rescaled_values_take_no_more_than_32_bits(
    slope: float, intercept: float, dtype: str, tmp_path: Path
) -> None:
    def rescale(data: FileDataset, _: int) -> None:
        data.RescaleSlope, data.RescaleIntercept = slope, intercept

    scan = small("uint16", 100)
    volume = read_volume(write_series(scan, tmp_path / "a", change=rescale))
    assert volume.array.dtype == dtype
    np.testing.assert_allclose(volume.array, scan.array.astype(float) * slope + intercept)
    assert any("rescale slope" in note for note in volume.notes) is (dtype == "float32")


def test_twelve_stored_bits_with_an_offset_stay_in_sixteen(tmp_path: Path) -> None:
    def rescale(data: FileDataset, _: int) -> None:
        data.BitsStored, data.HighBit = 12, 11
        data.RescaleSlope, data.RescaleIntercept = 1, -1024

    scan = small("uint16", 10)
    volume = read_volume(write_series(scan, tmp_path / "a", change=rescale))
    assert volume.array.dtype == np.int16
    np.testing.assert_array_equal(volume.array, scan.array.astype(int) - 1024)


@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize("positions", [True, False])
def test_a_file_of_many_frames(backward: bool, positions: bool, tmp_path: Path) -> None:
    scan = small("uint16", 100)
    path = tmp_path / "enhanced.dcm"
    data = new_dataset(path, "1.2.3.9", EnhancedCTImageStorage)
    order = range(24, -1, -1) if backward else range(25)
    put_pixels(data, scan.array[list(order)])
    data.NumberOfFrames = 25
    shared, measures, plane = Dataset(), Dataset(), Dataset()
    measures.PixelSpacing = [f"{scan.spacing[1]:.9g}", f"{scan.spacing[0]:.9g}"]
    measures.SpacingBetweenSlices = f"{scan.spacing[2]:.9g}"
    plane.ImageOrientationPatient = [1, 0, 0, 0, 1, 0]
    shared.PixelMeasuresSequence, shared.PlaneOrientationSequence = Sequence([measures]), Sequence([plane])
    data.SharedFunctionalGroupsSequence = Sequence([shared])
    frames = []
    for n in order if positions else ():
        frame, position = Dataset(), Dataset()
        position.ImagePositionPatient = [f"{v:.9g}" for v in scan.affine[:3, 3] + n * scan.affine[:3, 2]]
        frame.PlanePositionSequence = Sequence([position])
        frames.append(frame)
    if positions:
        data.PerFrameFunctionalGroupsSequence = Sequence(frames)
    data.save_as(path, enforce_file_format=True)
    volume = read_volume(path)
    assert volume.spacing == pytest.approx(tuple(scan.spacing), rel=1e-5)
    assert inspect_volume(path).format == "DICOM multi-frame"
    if positions:
        index = np.random.default_rng(1).integers(0, [60, 24, 25], (50, 3)) @ scan.affine[:3, :3].T
        points = index + scan.affine[:3, 3]
        np.testing.assert_array_equal(volume.values_at(points), scan.values(points))
        assert not volume.is_mirrored  # frames are sorted by their positions, as slices are
    else:
        assert not inspect_volume(path).sides_known


def test_a_damaged_slice_is_named(tmp_path: Path) -> None:
    folder = write_series(small(), tmp_path / "a")
    file = folder / "IM0012.dcm"
    file.write_bytes(file.read_bytes()[:-700])
    with pytest.raises(VolumeError, match=r"IM0012.dcm"):
        read_volume(folder)


def test_dicom_without_images_is_refused(tmp_path: Path) -> None:
    report = new_dataset(tmp_path / "report.dcm", "1.2.3")
    report.save_as(tmp_path / "report.dcm", enforce_file_format=True)
    (tmp_path / "x.dcm").write_text("no DICOM at all")
    with pytest.raises(VolumeError, match=r"no DICOM image can be read in report.dcm, x.dcm"):
        inspect_volume(tmp_path / "x.dcm")
    with pytest.raises(VolumeError, match="no DICOM image can be read"):
        inspect_volume(tmp_path)


def test_broken_tags_stop_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scan = small()
    folder = write_series(scan, tmp_path / "a")
    for n, file in enumerate(sorted(folder.iterdir())):
        raw = file.read_bytes()
        number = f"{n + 1} "[:2].encode()
        assert b"IS\x02\x00" + number in raw
        file.write_bytes(raw.replace(b"IS\x02\x00" + number, b"IS\x02\x00x "))  # the instance number
    assert_same_scan(folder, scan)
    assert capfd.readouterr().err == ""
    assert pydicom.dcmread(folder / "IM0003.dcm", stop_before_pixels=True).SeriesDescription == "head"
