"""The same body in DICOM of many kinds: the same surface to 0.1 voxel, or one question that names the tag."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import imagecodecs
import numpy as np
import pytest
import SimpleITK
from bodies import LEVEL, ORIGIN, SPACING, affine, off_by, voxels
from dicom_makers import Change, dataset, decimal, enhanced, group, put_pixels, slices, write
from pydicom.dataset import Dataset, FileDataset
from pydicom.encaps import encapsulate
from pydicom.fileset import FileSet
from pydicom.uid import (
    DeflatedExplicitVRLittleEndian,
    ExplicitVRBigEndian,
    ImplicitVRLittleEndian,
    JPEG2000Lossless,
    JPEGLosslessSV1,
    JPEGLSLossless,
    RLELossless,
)
from scipy.spatial.transform import Rotation

from gp_labeler.imaging.readers import VolumeError, inspect_volume, read_volume

Make = Callable[[Path], Path]
RAW = voxels()
N = len(RAW)
SHUFFLED = np.random.default_rng(3).permutation(N)
TURNED = affine(Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix())


def changed(change: Change, **how: object) -> Make:
    return lambda folder: write(folder, slices(**how), change)


def one_file(**how: object) -> Make:
    def make(folder: Path) -> Path:
        enhanced(**how).save_as(folder / "a.dcm", enforce_file_format=True)
        return folder / "a.dcm"

    return make


def setting(**tags: object) -> Change:
    def change(data: FileDataset, n: int) -> None:
        for name, value in tags.items():
            setattr(data, name, value(n) if callable(value) else value)

    return change


def without(*names: str, **tags: object) -> Change:
    def change(data: FileDataset, n: int) -> None:
        setting(**tags)(data, n)
        for name in names:
            delattr(data, name)

    return change


def rescaled(slope: Callable[[int], float], intercept: Callable[[int], float]) -> Make:
    """Slices whose stored numbers differ, and whose values do not."""

    def change(data: FileDataset, n: int) -> None:
        put_pixels(data, np.rint((RAW[n].astype(float) - intercept(n)) / slope(n)).astype("int16"))
        data.RescaleSlope, data.RescaleIntercept = f"{slope(n)}", f"{intercept(n)}"

    return changed(change)


def inverted(bits: int = 16, signed: bool = False, **tags: object) -> Make:
    def change(data: FileDataset, n: int) -> None:
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
        put_pixels(data, (low + high - RAW[n].astype(int)).astype("int16" if signed else "uint16"))
        data.BitsStored, data.HighBit, data.PhotometricInterpretation = bits, bits - 1, "MONOCHROME1"
        setting(**tags)(data, n)

    return changed(change)


def packed(change: Change = lambda *_: None) -> Make:
    def pack(data: FileDataset, n: int) -> None:
        change(data, n)
        data.compress(RLELossless, generate_instance_uid=False)

    return changed(pack)


def bare(*, meta: bool, syntax: str = ImplicitVRLittleEndian) -> Make:
    """Files without the preamble, and perhaps without the group that says how they are written."""

    def make(folder: Path) -> Path:
        write(folder, slices(syntax=syntax))
        for file in folder.iterdir():
            raw = file.read_bytes()
            file.write_bytes(raw[132:] if meta else raw[144 + int.from_bytes(raw[140:144], "little") :])
        return folder

    return make


def disc(given: str = "") -> Make:
    def make(folder: Path) -> Path:
        (folder / "in").mkdir()
        files = FileSet()
        for file in sorted(write(folder / "in", slices()).iterdir()):
            files.add(file)
        (folder / "disc").mkdir()
        files.write(folder / "disc")
        (folder / "disc" / "AUTORUN.INF").write_text("x")
        return folder / "disc" / given

    return make


def nested(folder: Path) -> Path:
    """Put every slice into a folder of its own."""
    for n, data in enumerate(slices()):
        (folder / f"s{n}").mkdir()
        data.save_as(folder / f"s{n}" / "image", enforce_file_format=True)
    return folder


def named(pattern: str, given: int | None = None) -> Make:
    """Name slices as some programs do: as if they were images, or volumes."""

    def make(folder: Path) -> Path:
        for n, data in enumerate(slices()):
            data.save_as(folder / pattern.format(n), enforce_file_format=True)
        return folder if given is None else folder / pattern.format(given)

    return make


def itk_frames(folder: Path) -> Path:
    image = SimpleITK.GetImageFromArray(RAW)
    image.SetSpacing(SPACING.tolist())
    image.SetOrigin(ORIGIN.tolist())
    SimpleITK.WriteImage(image, str(folder / "a.dcm"))
    return folder / "a.dcm"


def words_of_bytes(data: FileDataset, n: int) -> None:
    """Write 8-bit pixels as big-endian words: the bytes of each pair are exchanged."""
    put_pixels(data, voxels(dtype="uint8")[n])
    data.PixelData = np.frombuffer(data.PixelData, np.uint8).reshape(-1, 2)[:, ::-1].tobytes()
    data["PixelData"].VR = "OW"


def jittered(by: float) -> Change:
    """Orientations that differ in their last digits, about an edge at which a rounding would part them."""

    def change(data: FileDataset, n: int) -> None:
        turn = Rotation.from_euler("z", np.arccos(0.985) + (by if n % 2 else -by)).as_matrix()
        data.ImageOrientationPatient = decimal(turn[:, :2].T.ravel())

    return change


def nudged(axis: int, by: Callable[[int], float]) -> Change:
    def change(data: FileDataset, n: int) -> None:
        position = [float(v) for v in data.ImagePositionPatient]
        position[axis] += by(n)
        data.ImagePositionPatient = decimal(position)

    return change


GRID_985 = affine(Rotation.from_euler("z", np.arccos(0.985)).as_matrix())
HALF = RAW // 2


def one_position(folder: Path, *, shared: bool) -> Path:
    """Write frames of one file that gives one position, orientation and SpacingBetweenSlices for all."""
    data = enhanced()
    place = data.PerFrameFunctionalGroupsSequence[0].PlanePositionSequence
    groups = data.SharedFunctionalGroupsSequence[0]
    groups.PixelMeasuresSequence[0].SpacingBetweenSlices = "0.3"
    for frame in data.PerFrameFunctionalGroupsSequence:
        del frame.PlanePositionSequence
    if shared:
        groups.PlanePositionSequence = place
    else:
        del data.PerFrameFunctionalGroupsSequence
        data.ImagePositionPatient = place[0].ImagePositionPatient
    data.save_as(folder / "a.dcm", enforce_file_format=True)
    return folder / "a.dcm"


def renamed_directory(folder: Path) -> Path:
    disc("DICOMDIR")(folder).rename(folder / "disc" / "index.dat")
    return folder / "disc"


def noisy_pixel_size(data: FileDataset, n: int) -> None:
    data.PixelSpacing = [f"{0.25 + 1e-7 * (n % 3):.9f}"] * 2


EIGHT_BIT = LEVEL * 250 / 1900

READ: dict[str, tuple[Make, dict[str, object]]] = {
    "plain": (changed(lambda *_: None), {}),
    "turned": (changed(lambda *_: None, grid=TURNED), {"grid": TURNED}),
    "implicit": (changed(lambda *_: None, syntax=ImplicitVRLittleEndian), {}),
    "big endian": (changed(lambda *_: None, syntax=ExplicitVRBigEndian), {}),
    "deflated": (changed(lambda *_: None, syntax=DeflatedExplicitVRLittleEndian), {}),
    "8-bit words, big endian": (
        changed(words_of_bytes, syntax=ExplicitVRBigEndian),
        {"level": EIGHT_BIT},
    ),
    "32 bits": (changed(lambda data, n: put_pixels(data, RAW[n].astype("int32"))), {}),
    "thickness is no distance": (changed(setting(SliceThickness="1.2")), {}),
    "distance contradicts positions": (changed(setting(SpacingBetweenSlices="0.6")), {}),
    "file names shuffled": (lambda folder: write(folder, [slices()[n] for n in SHUFFLED]), {}),
    "numbers shuffled": (changed(setting(InstanceNumber=lambda n: int(SHUFFLED[n]))), {}),
    "a uid for each slice": (changed(setting(SeriesInstanceUID=lambda n: f"1.2.{n}")), {}),
    "all uids for each slice": (
        changed(
            setting(SeriesInstanceUID=lambda n: f"1.2.{n}", StudyInstanceUID=lambda n: f"1.3.{n}")
        ),
        {},
    ),
    "a uid for every two slices": (changed(setting(SeriesInstanceUID=lambda n: f"1.2.{n // 2}")), {}),
    "a uid for each slice, pixel sizes with noise": (
        changed(
            lambda data, n: (noisy_pixel_size(data, n), setattr(data, "SeriesInstanceUID", f"1.2.{n}"))
        ),
        {},
    ),
    "pixel sizes with noise": (changed(noisy_pixel_size), {}),
    "a directory of another name": (renamed_directory, {}),
    "no uid": (changed(without("SeriesInstanceUID")), {}),
    "jitter in the last digits": (changed(jittered(1e-6), grid=GRID_985), {"grid": GRID_985}),
    "positions with two decimals": (
        changed(
            lambda data, _: setattr(
                data, "ImagePositionPatient", [f"{float(v):.2f}" for v in data.ImagePositionPatient]
            )
        ),
        {},
    ),
    "MONOCHROME1": (inverted(), {}),
    "MONOCHROME1, 12 bits": (inverted(12), {}),
    "MONOCHROME1, signed": (inverted(signed=True), {}),
    "MONOCHROME1, packed": (
        packed(
            lambda data, n: (
                put_pixels(data, 65535 - RAW[n]),
                setattr(data, "PhotometricInterpretation", "MONOCHROME1"),
            )
        ),
        {},
    ),
    "a slope for each slice": (rescaled(lambda n: 1 + 0.25 * (n % 4), lambda n: 0.0), {}),
    "an intercept for each slice": (rescaled(lambda n: 2.0, lambda n: -100.0 * (n % 5)), {}),
    "signed, with intercept": (rescaled(lambda n: 1.0, lambda n: 1024.0), {}),
    "packed, a slope for each slice": (
        packed(
            lambda data, n: (
                put_pixels(data, np.rint(RAW[n] / (1 + n % 3)).astype("uint16")),
                setting(RescaleSlope=str(1 + n % 3), RescaleIntercept="0")(data, n),
            )
        ),
        {},
    ),
    "12 bits above overlays": (
        changed(
            lambda data, n: (
                put_pixels(data, (RAW[n] | np.uint16(0x5000))),
                setting(BitsStored=12, HighBit=11)(data, n),
            )
        ),
        {},
    ),
    "12 bits at the top": (
        changed(
            lambda data, n: (
                put_pixels(data, (RAW[n] << 4) | np.uint16(0x5)),
                setting(BitsStored=12, HighBit=15)(data, n),
            )
        ),
        {},
    ),
    "packed": (packed(), {}),
    "no preamble": (bare(meta=True), {}),
    "no preamble, no group 2": (bare(meta=False), {}),
    "no preamble, explicit": (bare(meta=False, syntax="1.2.840.10008.1.2.1"), {}),
    "disc": (disc(), {}),
    "DICOMDIR": (disc("DICOMDIR"), {}),
    "a folder for each slice": (nested, {}),
    "named as TIFF": (named("I{:03d}.tif"), {}),
    "named as PNG, one given": (named("I{:03d}.png", 3), {}),
    "named as one of a pair, one given": (named("I{:03d}.img", 3), {}),
    "named as NIfTI": (named("I{:03d}.nii"), {}),
    "frames": (one_file(), {}),
    "frames backwards": (one_file(order=range(N - 1, -1, -1)), {}),
    "frames shuffled": (one_file(order=SHUFFLED), {}),
    "frames of two packets": (one_file(order=[*range(0, N, 2), *range(1, N, 2)]), {}),
    "a slope for each frame": (
        one_file(
            order=SHUFFLED,
            planes=np.stack([np.rint(RAW[n] / (1 + n % 3)) for n in range(N)]).astype("uint16"),
            frame=lambda one, n: setattr(
                one,
                "PixelValueTransformationSequence",
                [group(RescaleSlope=str(1 + n % 3), RescaleIntercept="0", RescaleType="US")],
            ),
        ),
        {},
    ),
    "one enhanced file a slice": (
        lambda folder: write(folder, [enhanced(order=[n]) for n in range(N)]),
        {},
    ),
    "SimpleITK frames": (itk_frames, {}),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", READ)
def test_dicom(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    make, how = READ[name]
    path = make(tmp_path)
    capfd.readouterr()
    allowed = 0.1 if "decimals" not in name else 0.15
    assert off_by(path, **how) < allowed
    assert inspect_volume(path).sides_known
    assert capfd.readouterr() == ("", "")


ASKED: dict[str, tuple[Make, str]] = {
    "thickness alone": (
        changed(without("ImagePositionPatient")),
        "SliceThickness of 0.6 mm need not be it.*--spacing 0.25 0.25 0.6",
    ),
    "a rounded orientation": (
        changed(setting(ImageOrientationPatient=[0.97, 0.26, 0, -0.26, 0.96, 0])),
        "ImageOrientationPatient of i000.dcm is rounded.*--accept orientation",
    ),
    "orientations that differ": (
        changed(jittered(0.004)),
        "ImageOrientationPatient differs.*--accept orientation",
    ),
    "a gap": (changed(nudged(2, lambda n: 0.3 * (n > 12))), r"1 of its slices.*--accept gap"),
    "uneven": (changed(nudged(2, lambda n: 0.05 * (n % 3 == 0))), "lie unevenly.*--accept uneven"),
    "a tilted gantry": (
        changed(nudged(1, lambda n: 0.01 * n)),
        "shifted sideways by 0.33 mm.*--accept tilted",
    ),
    "a slice beside the others": (
        changed(nudged(0, lambda n: 0.2 * (n == 9))),
        "shifted sideways.*--accept tilted",
    ),
    "pixel sizes that differ": (
        changed(setting(PixelSpacing=lambda n: ["0.25", "0.25"] if n < 20 else ["0.26", "0.26"])),
        "PixelSpacing of i020.dcm differs from that of i000.dcm.*--accept pixel-size",
    ),
    "slope NaN": (changed(setting(RescaleSlope="nan", RescaleIntercept="0")), "RescaleSlope is nan"),
    "slope infinite": (changed(setting(RescaleSlope="inf", RescaleIntercept="0")), "RescaleSlope is inf"),
    "slope 0": (changed(setting(RescaleSlope="0", RescaleIntercept="0")), "RescaleSlope is 0"),
    "intercept NaN, of one": (
        changed(setting(RescaleIntercept=lambda n: "nan" if n == 7 else "0")),
        "of i007.dcm, RescaleIntercept is nan.*--accept scaling",
    ),
    "a table of values": (
        changed(setting(ModalityLUTSequence=lambda n: [group(LUTDescriptor=[2, 0, 16])])),
        "ModalityLUTSequence",
    ),
    "a slope in some slices": (
        changed(lambda data, n: n < 9 or setting(RescaleSlope="2", RescaleIntercept="0")(data, n)),
        "i000.dcm has no RescaleSlope, other slices have.*--accept scaling",
    ),
    "one slice without a position": (
        changed(
            lambda data, n: (
                setting(SpacingBetweenSlices="0.6")(data, n),
                n != 7 or delattr(data, "ImagePositionPatient"),
                n != 7 or delattr(data, "PixelSpacing"),
            )
        ),
        "PixelSpacing of i007.dcm differs",
    ),
    "kernels": (
        lambda folder: write(
            folder, [*slices(), *slices(HALF)], setting(ConvolutionKernel=lambda n: "BS"[n // N])
        ),
        "2 scans: series 1, kernel B: 34 slices",
    ),
    "time points": (
        lambda folder: write(
            folder,
            [*slices(), *slices(HALF)],
            setting(TemporalPositionIdentifier=lambda n: 1 + n // N),
        ),
        "2 scans: series 1, time point 1: 34 slices.*--series",
    ),
    "acquisitions": (
        lambda folder: write(
            folder, [*slices(), *slices(HALF)], setting(AcquisitionNumber=lambda n: 1 + n // N)
        ),
        "2 scans: series 1, acquisition 1: 34 slices.*--series",
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", ASKED)
def test_dicom_that_is_asked_about(name: str, tmp_path: Path) -> None:
    make, words = ASKED[name]
    with pytest.raises(VolumeError, match=words) as refused:
        read_volume(make(tmp_path))
    assert "\n" not in str(refused.value)
    assert refused.value.file


def test_what_is_asked_can_be_answered(tmp_path: Path) -> None:
    path = ASKED["thickness alone"][0](tmp_path)
    at_home = affine()
    at_home[:3, 3] = 0
    assert off_by(path, at_home, spacing=SPACING.tolist()) < 0.1


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_of_time_points_one_can_be_chosen(tmp_path: Path) -> None:
    path = ASKED["time points"][0](tmp_path)
    assert off_by(path, series="time point 1") < 0.1
    plan = inspect_volume(path)
    assert [choice.id for choice in plan.choices] == ["1.2.3.4 time point 1", "1.2.3.4 time point 2"]
    np.testing.assert_array_equal(read_volume(path, series="time point 2").array, HALF)


@pytest.mark.parametrize("tag", ["StackID", "TemporalPositionIndex"])
def test_frames_at_the_same_places_are_several_scans(tag: str, tmp_path: Path) -> None:
    both = enhanced(order=range(2 * N), planes=np.concatenate([RAW, HALF]))
    for n, frame in enumerate(both.PerFrameFunctionalGroupsSequence):
        place = affine() @ [0, 0, n % N, 1]
        frame.PlanePositionSequence[0].ImagePositionPatient = decimal(place[:3])
        value = 1 + n // N
        setattr(frame.FrameContentSequence[0], tag, str(value) if tag == "StackID" else value)
    both.save_as(tmp_path / "a.dcm", enforce_file_format=True)
    with pytest.raises(VolumeError, match=r"holds 2 scans.*--series"):
        read_volume(tmp_path / "a.dcm")
    word = "stack 1" if tag == "StackID" else "temporal position 1"
    assert off_by(tmp_path / "a.dcm", series=word) < 0.1


def test_a_scan_cut_into_files_of_many_frames_is_put_together(tmp_path: Path) -> None:
    for name, order in (("a", range(15, N)), ("b", range(15))):
        part = enhanced(order=order)
        part.ConcatenationUID = "1.2.9"
        part.save_as(tmp_path / f"{name}.dcm", enforce_file_format=True)
    assert off_by(tmp_path) < 0.1


def test_two_series_with_one_size_are_not_mixed(tmp_path: Path) -> None:
    write(tmp_path, [*slices(), *slices(HALF)], setting(SeriesInstanceUID=lambda n: f"1.2.{n // N}"))
    with pytest.raises(VolumeError, match="holds 2 scans"):
        read_volume(tmp_path)
    assert off_by(tmp_path / "i003.dcm") < 0.1


def test_two_scouts_beside_a_series_of_single_uids_are_left_out(tmp_path: Path) -> None:
    write(tmp_path, slices(), setting(SeriesInstanceUID=lambda n: f"1.2.{n}"))
    scout = dataset()
    put_pixels(scout, RAW[0][:30])
    scout.SeriesInstanceUID = "1.2.99"
    scout.save_as(tmp_path / "scout.dcm", enforce_file_format=True)
    assert off_by(tmp_path) < 0.1
    codes = [problem.code for problem in inspect_volume(tmp_path).warnings]
    assert sorted(codes) == ["scout", "uid-per-slice"]


def test_without_an_orientation_positions_give_the_distance_and_sides_are_unknown(tmp_path: Path) -> None:
    plan = inspect_volume(changed(without("ImageOrientationPatient"))(tmp_path))
    assert plan.spacing == pytest.approx(tuple(SPACING))
    assert [problem.code for problem in plan.warnings] == ["no-orientation", "sides-unknown"]


def test_without_positions_slice_locations_give_the_distance(tmp_path: Path) -> None:
    change = without("ImagePositionPatient", SliceLocation=lambda n: f"{0.3 * n:.6g}")
    plan = inspect_volume(changed(change)(tmp_path))
    assert plan.spacing == pytest.approx(tuple(SPACING))
    assert [problem.code for problem in plan.warnings] == ["no-positions", "sides-unknown"]
    assert "SliceLocation" in plan.warnings[0].text


def test_frames_with_offsets_from_one_position(tmp_path: Path) -> None:
    dose = enhanced(sop_class="1.2.840.10008.5.1.4.1.1.481.2")
    del dose.PerFrameFunctionalGroupsSequence, dose.SharedFunctionalGroupsSequence
    dose.ImagePositionPatient, dose.ImageOrientationPatient = decimal(ORIGIN), [1, 0, 0, 0, 1, 0]
    dose.PixelSpacing = decimal(SPACING[1::-1])
    dose.GridFrameOffsetVector = decimal(SPACING[2] * np.arange(N))
    dose.save_as(tmp_path / "a.dcm", enforce_file_format=True)
    assert off_by(tmp_path / "a.dcm") < 0.1


@pytest.mark.parametrize("shared", [False, True])
def test_frames_with_one_position_follow_it_along_the_normal(shared: bool, tmp_path: Path) -> None:
    path = one_position(tmp_path, shared=shared)
    assert off_by(path) < 0.1
    plan = inspect_volume(path)
    assert not plan.sides_known
    assert "one position, taken for the first" in plan.warnings[0].text


def test_what_a_directory_names_and_the_disc_has_not_is_said(tmp_path: Path) -> None:
    directory = disc("DICOMDIR")(tmp_path)
    slices_there = [file for file in directory.parent.rglob("IM*") if file.is_file()]
    assert not inspect_volume(directory).warnings
    sorted(slices_there)[0].unlink()
    (lost,) = inspect_volume(directory).warnings
    assert "DICOMDIR names images that are not there: PT000000/ST000000/SE000000/IM000000" in lost.text


PADDED: dict[str, Change] = {
    "signed": lambda data, n: put_pixels(data, framed(RAW[n].astype("int16") - 1024, -3024)),
    "unsigned, written as signed": lambda data, n: put_pixels(data, framed(RAW[n], 63536)),
    "below the stored bits": lambda data, n: (
        put_pixels(data, framed((RAW[n].astype("int16") - 1024), -3024)),
        setting(BitsStored=12, HighBit=11)(data, n),
    ),
    "a slope for each slice": lambda data, n: (
        put_pixels(data, framed(np.rint(RAW[n] / (1 + n % 2)).astype("int16"), -2000)),
        setting(RescaleSlope=str(1 + n % 2), RescaleIntercept="-1024")(data, n),
    ),
    "packed": lambda data, n: (
        put_pixels(data, framed(RAW[n].astype("int16") - 1024, -3024)),
        data.compress(RLELossless, generate_instance_uid=False),
    ),
}


PACKINGS: dict[str, tuple[str, Callable[[np.ndarray], bytes]]] = {
    "JPEG 2000": (JPEG2000Lossless, lambda plane: imagecodecs.jpeg2k_encode(plane, reversible=True, level=0)),
    "JPEG-LS": (JPEGLSLossless, lambda plane: imagecodecs.jpegls_encode(plane.view("uint16"))),
    "lossless JPEG": (JPEGLosslessSV1, lambda plane: imagecodecs.ljpeg_encode(plane.view("uint16"))),
}


def packed_as(name: str, folder: Path, *, signed: bool = False) -> Path:
    syntax, encode = PACKINGS[name]

    def change(data: FileDataset, n: int) -> None:
        plane = RAW[n].astype("int16") - 1024 if signed else RAW[n]
        put_pixels(data, plane)
        data.RescaleSlope, data.RescaleIntercept = "1", "1024" if signed else "0"
        data.file_meta.TransferSyntaxUID = syntax
        data.PixelData = encapsulate([bytes(encode(plane))])
        data["PixelData"].VR, data["PixelData"].is_undefined_length = "OB", True

    return write(folder, slices(), change)


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("name", PACKINGS)
def test_packed_slices(name: str, signed: bool, tmp_path: Path) -> None:
    assert off_by(packed_as(name, tmp_path, signed=signed)) < 0.1


@pytest.mark.parametrize("name", PACKINGS)
def test_a_damaged_packed_slice_is_named_in_one_line(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = packed_as(name, tmp_path) / "i009.dcm"
    raw = file.read_bytes()
    at = raw.index(b"\xe0\x7f\x10\x00") + 30
    file.write_bytes(raw[:at] + b"\x07" * 40 + raw[at + 40 :])
    with pytest.raises(VolumeError, match=r"i009\.dcm: it cannot be read"):
        read_volume(tmp_path)
    assert capfd.readouterr() == ("", "")


def framed(plane: np.ndarray, value: int) -> np.ndarray:
    padded = plane.copy()
    padded[:3], padded[-3:], padded[:, :4] = value, value, value
    return padded


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", PADDED)
def test_padding_is_one_fill_below_all_values(name: str, tmp_path: Path) -> None:
    def change(data: FileDataset, n: int) -> None:
        value = -2000 if "slope" in name or "unsigned" in name else -3024
        data.add_new("PixelPaddingValue", "SS", value)
        PADDED[name](data, n)

    volume = read_volume(write(tmp_path, slices(), change))
    assert volume.fill is not None
    padded = np.zeros(volume.array.shape, bool)
    padded[:, :3], padded[:, -3:], padded[..., :4] = True, True, True
    np.testing.assert_array_equal(volume.array == volume.fill, padded)
    shift = 0 if "unsigned" in name else 1024
    np.testing.assert_allclose(volume.array[~padded] + shift, RAW[~padded], atol=1)


def test_floats(tmp_path: Path) -> None:
    data: Dataset = enhanced()
    del data.PixelData
    data.FloatPixelData = RAW.astype("<f4").tobytes()
    data.BitsAllocated = 32
    data.save_as(tmp_path / "a.dcm", enforce_file_format=True)
    assert off_by(tmp_path / "a.dcm") < 0.1
