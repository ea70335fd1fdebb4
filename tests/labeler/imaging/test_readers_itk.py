"""NRRD, MetaImage and NIfTI as other libraries write them."""

from __future__ import annotations

import gzip
import shutil
from collections.abc import Callable
from pathlib import Path

import nibabel
import nrrd
import numpy as np
import pytest
import SimpleITK
from scan_makers import BONE, LPS_FROM_RAS, MOUSE_CT, Scan, cropped, load_mouse, write_nifti, write_sitk
from scipy.spatial.transform import Rotation

from gp_labeler.imaging.readers import VolumeError, inspect_volume, read_volume

pytestmark = pytest.mark.machine


def write_nrrd(scan: Scan, path: Path, space: str = "left-posterior-superior", **more: object) -> Path:
    flip = np.diag([-1, -1, 1.0]) if space == "right-anterior-superior" else np.eye(3)
    header = {
        "space": space,
        "space directions": (flip @ scan.affine[:3, :3]).T,
        "space origin": flip @ scan.affine[:3, 3],
        "kinds": ["domain"] * 3,
        "encoding": "raw",
        **more,
    }
    nrrd.write(str(path), np.asfortranarray(scan.array.T), header, index_order="F")
    return path


def write_nhdr(scan: Scan, path: Path) -> Path:
    scan.array.tofile(path.with_suffix(".raw"))
    axes = " ".join(f"({','.join(map(repr, axis))})" for axis in scan.affine[:3, :3].T.tolist())
    lines = [
        "NRRD0005",
        "# a comment: with a colon",
        "type: unsigned char",
        "dimension: 3",
        "space: left-posterior-superior",
        f"sizes: {' '.join(map(str, scan.array.shape[::-1]))}",
        f"space directions: {axes}",
        "encoding: raw",
        f"space origin: ({','.join(map(repr, scan.affine[:3, 3].tolist()))})",
        f"data file: {path.with_suffix('.raw').name}",
        "a key:=a value: with a colon",
    ]
    path.write_text("\n".join(lines) + "\n\n")
    return path


WRITERS: dict[str, Callable[[Scan, Path], Path]] = {
    "lps.nrrd": write_nrrd,
    "ras.nrrd": lambda scan, path: write_nrrd(scan, path, "right-anterior-superior"),
    "gzip.nrrd": lambda scan, path: write_nrrd(scan, path, encoding="gzip"),
    "bzip2.nrrd": lambda scan, path: write_nrrd(scan, path, encoding="bzip2"),
    "ascii.nrrd": lambda scan, path: write_nrrd(scan, path, encoding="ascii"),
    "pynrrd.nhdr": write_nrrd,
    "slicer.nrrd": lambda scan, path: write_sitk(scan, path, compress=True),
    "hand.nhdr": write_nhdr,
    "plain.mha": write_sitk,
    "packed.mha": lambda scan, path: write_sitk(scan, path, compress=True),
    "plain.mhd": write_sitk,
    "packed.mhd": lambda scan, path: write_sitk(scan, path, compress=True),
    "plain.nii": write_nifti,
    "packed.nii.gz": write_nifti,
    "PACKED.NII.GZ": write_nifti,
    "itk.nii.gz": write_sitk,
    "pair.hdr": write_sitk,
    "old.vtk": write_sitk,
}


def assert_same_scan(path: Path, scan: Scan, **options: object) -> None:
    volume = read_volume(path, **options)
    np.testing.assert_allclose(volume.T_scan_voxel, scan.affine, atol=2e-6)
    np.testing.assert_array_equal(volume.array, scan.array)
    assert volume.array.dtype == scan.array.dtype


@pytest.mark.parametrize("name", WRITERS)
def test_a_real_scan_reads_the_same_from_every_format(name: str, tmp_path: Path) -> None:
    scan = load_mouse() if name in ("lps.nrrd", "plain.mha", "packed.nii.gz") else cropped()
    path = WRITERS[name](scan, tmp_path / name)
    if name == "old.vtk":  # knows no direction; ours is the identity
        assert not inspect_volume(path).sides_known
    assert_same_scan(path, scan)
    if len(scan.landmarks):
        values = read_volume(path).values_at(scan.landmarks)
        np.testing.assert_array_equal(values, scan.values(scan.landmarks))


@pytest.mark.parametrize("name", ["BALB_CJ_", "C57BL6_J_", "DBA_2J_"])
def test_the_landmarks_of_the_real_scans_lie_on_bone(name: str) -> None:
    scan = load_mouse(name)
    volume = read_volume(MOUSE_CT / f"{name}.nii.gz")
    assert len(scan.landmarks) == 45
    assert volume.contains(scan.landmarks).all()
    reach = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)]) * volume.spacing
    near = np.array([np.nanmax(volume.values_at(point + 1.5 * reach)) for point in scan.landmarks])
    assert (near > BONE).all()


def test_the_float_template_keeps_its_flipped_direction() -> None:
    scan = load_mouse("low_res_skull_only")
    volume = read_volume(MOUSE_CT / "low_res_skull_only.nii.gz")
    np.testing.assert_allclose(volume.direction, np.diag([-1, -1, 1]), atol=1e-6)
    np.testing.assert_allclose(volume.T_scan_voxel, scan.affine, atol=1e-6)
    np.testing.assert_array_equal(volume.array, scan.array)


@pytest.mark.parametrize("suffix", ["nrrd", "mha", "nii"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_oblique_and_mirrored_axes_are_kept(suffix: str, mirrored: bool, tmp_path: Path) -> None:
    scan = cropped()
    affine = scan.affine.copy()
    turn = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
    affine[:3, :3] = turn @ np.diag([1, 1, -1 if mirrored else 1]) @ affine[:3, :3]
    turned = Scan(scan.array, affine, scan.landmarks)
    path = tmp_path / f"scan.{suffix}"
    if suffix == "mha":
        write_sitk(turned, path)
    else:
        (write_nrrd if suffix == "nrrd" else write_nifti)(turned, path)
    assert_same_scan(path, turned)
    volume = read_volume(path)
    assert volume.is_mirrored is mirrored
    assert any("left-handed" in note for note in volume.notes) is mirrored
    image = SimpleITK.ReadImage(str(path))
    for index in ([0, 0, 0], [10, 20, 30], [71, 65, 60]):
        there = image.TransformIndexToPhysicalPoint(index)
        np.testing.assert_allclose(volume.voxel_to_scan([index])[0], there, atol=1e-5)


KEPT = ["uint8", "int16", "uint16", "int32", "uint32", "float32"]


@pytest.mark.parametrize("suffix", ["nrrd", "mha", "nii"])
@pytest.mark.parametrize("dtype", [*KEPT, "int8", "float64", "int64"])
def test_number_types_are_kept_or_changed_with_a_note(suffix: str, dtype: str, tmp_path: Path) -> None:
    scan = cropped(dtype, 0.5 if dtype == "int8" else 100 if dtype[-1] != "8" else 1)
    path = tmp_path / f"scan.{suffix}"
    write_sitk(scan, path) if suffix == "mha" else {"nrrd": write_nrrd, "nii": write_nifti}[suffix](
        scan, path
    )
    volume = read_volume(path)
    np.testing.assert_array_equal(volume.array, scan.array)
    assert volume.array.dtype.name == {"int8": "int16", "float64": "float32", "int64": "float32"}.get(
        dtype, dtype
    )
    assert any(f"{dtype} values were converted" in note for note in volume.notes) is (dtype not in KEPT)


def test_big_endian_voxels_come_out_native(tmp_path: Path) -> None:
    scan = cropped("uint16", 150)
    swapped = Scan(scan.array.astype(">u2"), scan.affine, scan.landmarks)
    assert_same_scan(write_nrrd(swapped, tmp_path / "big.nrrd", endian="big"), scan)
    header = nibabel.Nifti1Header(endianness=">")
    header.set_data_dtype(np.uint16)
    image = nibabel.Nifti1Image(scan.array.T, LPS_FROM_RAS @ scan.affine, header)
    nibabel.save(image, tmp_path / "big.nii")
    assert (tmp_path / "big.nii").read_bytes()[:4] == b"\0\0\1\\"
    assert_same_scan(tmp_path / "big.nii", scan)
    path = write_sitk(scan, tmp_path / "big.mhd")
    scan.array.astype(">u2").tofile(tmp_path / "big.raw")
    path.write_text(path.read_text().replace("ByteOrderMSB = False", "ByteOrderMSB = True"))
    assert_same_scan(path, scan)


def test_headers_of_unknown_length_are_counted_from_the_end(tmp_path: Path) -> None:
    scan = cropped()
    path = write_sitk(scan, tmp_path / "scan.mhd")
    raw = tmp_path / "scan.raw"
    raw.write_bytes(b"some scanner's own header" + raw.read_bytes())
    path.write_text(path.read_text().replace("ElementDataFile", "HeaderSize = -1\nElementDataFile"))
    assert_same_scan(path, scan)
    nhdr = write_nhdr(scan, tmp_path / "scan2.nhdr")
    raw2 = tmp_path / "scan2.raw"
    raw2.write_bytes(b"x" * 77 + raw2.read_bytes())
    nhdr.write_text(nhdr.read_text().replace("encoding: raw", "encoding: raw\nbyte skip: -1"))
    assert_same_scan(nhdr, scan)
    nhdr.write_text(nhdr.read_text().replace("byte skip: -1", "byte skip: 77"))
    assert_same_scan(nhdr, scan)


def test_nifti_values_are_scaled_as_the_header_says(tmp_path: Path) -> None:
    scan = cropped("int16", 10)
    path = write_nifti(scan, tmp_path / "scaled.nii.gz")
    raw = bytearray(gzip.decompress(path.read_bytes()))
    raw[112:120] = np.array([0.5, -100], "<f4").tobytes()
    path.write_bytes(gzip.compress(raw))
    volume = read_volume(path)
    np.testing.assert_allclose(volume.array, nibabel.load(path).get_fdata().T)
    assert volume.array.dtype == np.float32
    assert "scaled by 0.5 and shifted by -100" in " ".join(volume.notes)


@pytest.mark.parametrize("suffix", ["nrrd", "mha", "nii"])
def test_colours_become_luminance_or_the_channel_asked_for(suffix: str, tmp_path: Path) -> None:
    scan = cropped()
    colour = np.stack([scan.array, scan.array // 2, scan.array // 4], axis=-1)
    path = tmp_path / f"colour.{suffix}"
    if suffix == "nii":
        rgb = np.dtype([("R", "u1"), ("G", "u1"), ("B", "u1")])
        packed = np.ascontiguousarray(colour).view(rgb)[..., 0]
        nibabel.save(nibabel.Nifti1Image(packed.T, LPS_FROM_RAS @ scan.affine), path)
    else:
        image = SimpleITK.GetImageFromArray(colour, isVector=True)
        image.CopyInformation(scan.image())
        SimpleITK.WriteImage(image, str(path))
    plan = inspect_volume(path)
    assert [problem.code for problem in plan.warnings] == ["colour"]
    expected = colour.astype(float) @ [0.299, 0.587, 0.114]
    assert np.abs(read_volume(plan).array - expected).max() <= 0.51
    np.testing.assert_array_equal(read_volume(plan, channel=1).array, colour[..., 1])
    with pytest.raises(VolumeError, match="channel must be 0 to 2, got 3"):
        read_volume(path, channel=3)


def test_grey_kept_as_colour_stays_exactly_as_it_is(tmp_path: Path) -> None:
    scan = cropped()
    image = SimpleITK.GetImageFromArray(np.stack([scan.array] * 3, axis=-1), isVector=True)
    image.CopyInformation(scan.image())
    SimpleITK.WriteImage(image, str(tmp_path / "grey.nrrd"))
    assert_same_scan(tmp_path / "grey.nrrd", scan)


def test_of_several_volumes_in_a_file_the_first_is_taken(tmp_path: Path) -> None:
    scan = cropped()
    series = np.stack([scan.array.T, 255 - scan.array.T], axis=-1)
    nibabel.save(nibabel.Nifti1Image(series, LPS_FROM_RAS @ scan.affine), tmp_path / "two.nii")
    assert_same_scan(tmp_path / "two.nii", scan)
    assert [problem.code for problem in inspect_volume(tmp_path / "two.nii").warnings] == ["many-volumes"]


# Voxel sizes that cannot be believed --------------------------------------------------------------


def respaced(spacing: float, dtype: str = "uint8") -> Scan:
    scan = cropped(dtype)
    affine = scan.affine.copy()
    affine[:3, :3] = np.diag([spacing] * 3)
    affine[:3, 3] = np.array([3, 4, 5]) * spacing
    return Scan(scan.array, affine, scan.landmarks)


@pytest.mark.parametrize(
    ("spacing", "code", "words"),
    [
        (1.0, "spacing-unit", "1 mm, which programs write if it is unknown"),
        (25.4 / 72, "spacing-screen", "72 dpi"),
        (25.4 / 96, "spacing-screen", "96 dpi"),
        (25.4 / 300, "spacing-screen", "300 dpi"),
        (141.1, "extent", "10.2 m long.*factor of 1000.*10.2 mm.*--spacing 0.1411"),
        (0.0001411, "extent", "10.2 µm long|0.0102 mm long"),
        (4.0, "extent", "288 mm long"),
        (0.05, "extent", "3.6 mm long"),
    ],
)
@pytest.mark.parametrize("suffix", ["nrrd", "mha", "nii"])
def test_a_voxel_size_that_cannot_be_believed_is_asked_for(
    suffix: str, spacing: float, code: str, words: str, tmp_path: Path
) -> None:
    scan = respaced(spacing)
    path = tmp_path / f"scan.{suffix}"
    write_sitk(scan, path) if suffix == "mha" else {"nrrd": write_nrrd, "nii": write_nifti}[suffix](
        scan, path
    )
    plan = inspect_volume(path)
    assert [problem.code for problem in plan.errors] == [code]
    with pytest.raises(VolumeError, match=words) as refused:
        read_volume(path)
    assert "--spacing" in str(refused.value)
    assert refused.value.file == str(path)
    volume = read_volume(plan, spacing=0.1411)
    np.testing.assert_allclose(volume.spacing, 0.1411)
    np.testing.assert_allclose(volume.origin, np.array([3, 4, 5]) * 0.1411, rtol=1e-5)
    assert any("0.1411 mm was given; the file said" in note for note in volume.notes)


def test_one_millimetre_between_fine_slices_is_asked_for(tmp_path: Path) -> None:
    image = cropped().image()
    image.SetSpacing((0.14, 0.14, 1.0))
    SimpleITK.WriteImage(image, str(tmp_path / "z.mha"))
    assert [problem.code for problem in inspect_volume(tmp_path / "z.mha").errors] == ["spacing-unit"]


def test_a_small_scan_can_be_accepted_as_it_is(tmp_path: Path) -> None:
    path = write_sitk(respaced(0.05), tmp_path / "ear.mha")
    volume = read_volume(path, accept=["extent"])
    assert volume.spacing == pytest.approx((0.05, 0.05, 0.05))
    assert volume.choices == {"accept": ["extent"]}


def test_a_given_voxel_size_must_be_possible_too(tmp_path: Path) -> None:
    path = write_sitk(cropped(), tmp_path / "scan.mha")
    with pytest.raises(VolumeError, match=r"10.2 m long"):
        read_volume(path, spacing=141)
    plan = inspect_volume(path)
    assert not plan.errors
    assert [problem.code for problem in inspect_volume(plan, spacing=35).errors] == ["extent"]


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8"])
@pytest.mark.parametrize("unit", ['"um" "um" "um"', '"µm" "µm" "µm"', '"microns" "microns" "microns"'])
def test_nrrd_space_units_are_honoured(unit: str, encoding: str, tmp_path: Path) -> None:
    scan = respaced(141.1)
    path = write_nrrd(scan, tmp_path / "um.nrrd")
    head, body = path.read_bytes().split(b"\n\n", 1)
    path.write_bytes(head + b"\nspace units: " + unit.encode(encoding) + b"\n\n" + body)
    volume = read_volume(path)
    np.testing.assert_allclose(volume.spacing, 0.1411)
    np.testing.assert_allclose(volume.origin, np.array([3, 4, 5]) * 0.1411)
    assert any("converted from" in note for note in volume.notes)


def test_metaimage_distance_units_are_honoured(tmp_path: Path) -> None:
    path = write_sitk(respaced(141.1), tmp_path / "um.mhd")
    path.write_text(path.read_text().replace("ElementDataFile", "DistanceUnits = um\nElementDataFile"))
    np.testing.assert_allclose(read_volume(path).spacing, 0.1411)


@pytest.mark.parametrize(("code", "unit"), [(1, 1e3), (2, 1.0), (3, 1e-3), (0, 1.0)])
def test_nifti_units_are_honoured(code: int, unit: float, tmp_path: Path) -> None:
    path = write_nifti(respaced(0.1411 / unit), tmp_path / "units.nii.gz", xyzt_units=code)
    assert read_volume(path).spacing == pytest.approx((0.1411,) * 3, rel=1e-5)


def test_an_image_without_a_frame_says_that_its_sides_are_unknown(tmp_path: Path) -> None:
    scan = respaced(0.1411)
    nrrd.write(str(tmp_path / "bare.nrrd"), scan.array.T, {"spacings": [0.1411] * 3}, index_order="F")
    image = nibabel.Nifti1Image(scan.array.T, None)
    image.header.set_zooms([0.1411] * 3)
    nibabel.save(image, tmp_path / "bare.nii")
    for file in (tmp_path / "bare.nrrd", tmp_path / "bare.nii"):
        plan = inspect_volume(file)
        assert not plan.errors
        assert [problem.code for problem in plan.warnings] == ["sides-unknown"]
        assert any("left and right" in note for note in read_volume(plan).notes)


# Files that are not what they should be -----------------------------------------------------------


def test_a_nii_beside_a_nii_gz_is_not_read_in_its_place(tmp_path: Path) -> None:
    scan = cropped()
    right = write_nifti(scan, tmp_path / "head.nii.gz")
    decoy = Scan(np.full_like(scan.array, 7), np.diag([0.3, 0.3, 0.3, 1]), scan.landmarks)
    write_nifti(decoy, tmp_path / "head.nii")
    assert (SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(str(right))) == 7).all()  # what the guard is for
    assert_same_scan(right, scan)
    assert any("head.nii is beside it" in note for note in read_volume(right).notes)
    assert_same_scan(tmp_path / "head.nii", decoy)


def test_a_packed_nifti_under_an_unpacked_name_is_read(tmp_path: Path) -> None:
    scan = cropped()
    shutil.copy(write_nifti(scan, tmp_path / "a.nii.gz"), tmp_path / "b.nii")
    assert_same_scan(tmp_path / "b.nii", scan)
    shutil.copy(write_sitk(scan, tmp_path / "c.nrrd"), tmp_path / "volume")
    assert_same_scan(tmp_path / "volume", scan)


def test_a_sheared_grid_is_refused_in_plain_words(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scan = cropped()
    sheared = np.array([[-0.14, 0.05, 0, 0], [0, -0.14, 0, 0], [0, 0, 0.14, 0], [0, 0, 0, 1]])
    image = nibabel.Nifti1Image(scan.array.T, None)
    image.set_sform(sheared, 1)
    nibabel.save(image, tmp_path / "sheared.nii")
    with pytest.raises(VolumeError, match=r"sheared.nii: its voxel axes are sheared.*Resample"):
        inspect_volume(tmp_path / "sheared.nii")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("TransformMatrix", "1 0.3 0 0 1 0 0 0 1"),
        ("TransformMatrix", "0 0 0 0 0 0 0 0 0"),
        ("TransformMatrix", "1 0 0 1 0 0 0 0 1"),
        ("ElementSpacing", "0 0 0"),
        ("ElementSpacing", "-0.14 0.14 0.14"),
        ("DimSize", "0 66 61"),
        ("DimSize", "72 66"),
        ("ElementType", "MET_WHATEVER"),
        ("NDims", "7"),
    ],
)
def test_a_header_that_makes_no_sense_is_refused_before_loading(
    field: str, value: str, tmp_path: Path
) -> None:
    path = write_sitk(cropped(), tmp_path / "a.mhd")
    lines = [
        f"{field} = {value}" if line.startswith(field) else line for line in path.read_text().splitlines()
    ]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(VolumeError) as refused:
        read_volume(path)
    assert refused.value.file == str(path)
    assert refused.value.remedy


@pytest.mark.parametrize("name", ["plain.mhd", "plain.mha", "lps.nrrd", "plain.nii", "hand.nhdr"])
def test_a_short_file_is_named_with_its_bytes(name: str, tmp_path: Path) -> None:
    path = WRITERS[name](cropped(), tmp_path / name)
    raw = path.with_suffix(".raw") if name[-3:] in ("mhd", "hdr") else path
    raw.write_bytes(raw.read_bytes()[:-1000])
    with pytest.raises(
        VolumeError, match=rf"{raw.name}:? holds [\d,]+ bytes, but [\d,]+ are needed.*[Cc]opy it again"
    ):
        read_volume(path)


@pytest.mark.parametrize("name", ["packed.mha", "gzip.nrrd", "packed.nii.gz"])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_a_packed_file_in_which_bytes_changed_is_refused(name: str, share: float, tmp_path: Path) -> None:
    path = WRITERS[name](cropped(), tmp_path / name)
    content = bytearray(path.read_bytes())
    at = int(share * len(content))
    content[at : at + 40] = bytes(40)
    path.write_bytes(content)
    with pytest.raises(VolumeError, match=f"{name}: (it ends within slice|it cannot be read)"):
        read_volume(path)


@pytest.mark.parametrize("name", ["packed.mha", "gzip.nrrd", "packed.nii.gz"])
def test_a_packed_file_that_ends_early_is_refused(name: str, tmp_path: Path) -> None:
    path = WRITERS[name](cropped(), tmp_path / name)
    path.write_bytes(path.read_bytes()[:-20_000])
    with pytest.raises(VolumeError, match=f"{name}: (it ends within slice|it cannot be read)"):
        read_volume(path)


def test_damage_in_a_packed_file_is_noticed(tmp_path: Path) -> None:
    path = WRITERS["packed.nii.gz"](cropped(), tmp_path / "a.nii.gz")
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 0xFF
    path.write_bytes(raw)
    with pytest.raises(VolumeError, match=r"a.nii.gz: it cannot be read.*damaged"):
        read_volume(path)


def test_a_header_without_its_voxels_names_them(tmp_path: Path) -> None:
    path = WRITERS["plain.mhd"](cropped(), tmp_path / "plain.mhd")
    (tmp_path / "plain.raw").unlink()
    with pytest.raises(
        VolumeError, match=r"plain.mhd: the voxels should be in plain.raw.*Put plain.raw into"
    ):
        read_volume(path)
    (tmp_path / "lone.raw").write_bytes(b"12345")
    with pytest.raises(VolumeError, match="needs its header: give the MHD or NHDR"):
        read_volume(tmp_path / "lone.raw")


@pytest.mark.parametrize(
    "name", ["a.nii", "a.nii.gz", "a.nrrd", "a.nhdr", "a.mha", "a.mhd", "a.hdr", "a.vtk", "a.isq"]
)
@pytest.mark.parametrize("content", [b"", b"these are notes, no scan\n" * 40, bytes(range(256)) * 8])
def test_a_file_that_is_something_else_is_refused(
    name: str, content: bytes, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(VolumeError) as refused:
        read_volume(path)
    assert refused.value.file == str(path)
    assert refused.value.remedy
    assert ("empty" in refused.value.problem) is (not content)
    assert capfd.readouterr().err == ""


def test_a_text_in_gzip_is_no_nifti(tmp_path: Path) -> None:
    (tmp_path / "a.nii.gz").write_bytes(gzip.compress(b"no scan at all" * 100))
    with pytest.raises(VolumeError, match="it is not a NIfTI file"):
        read_volume(tmp_path / "a.nii.gz")


@pytest.mark.parametrize("name", ["scan.xyz", "scan.vol", "scan.stl"])
def test_an_unknown_format_says_what_can_be_read(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(b"something else altogether")
    with pytest.raises(
        VolumeError, match=f"{name}: its format is not known\\. (Readable are NRRD|Save it|This is a mesh)"
    ):
        read_volume(tmp_path / name)


PACKED, FROM_ITS_PROGRAM = "Unpack it first", "Save it as NRRD or OME-TIFF in the program that it comes from"


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        *((f"head.{ending}", PACKED) for ending in ("zip", "7z", "rar", "tar", "nrrd.gz", "nii.bz2")),
        *((f"head.{ending}", FROM_ITS_PROGRAM) for ending in ("h5", "ims", "am", "czi", "lif", "nd2", "MRC")),
        ("head.txm", "in the scanner's software"),
        ("head.mrb", "as NRRD in 3D Slicer"),
    ],
)
def test_what_is_not_read_says_what_to_do_with_it(name: str, remedy: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(b"something else altogether")
    for path in (tmp_path / name, tmp_path):  # also where a folder holds nothing else
        with pytest.raises(VolumeError, match=remedy):
            read_volume(path)


@pytest.mark.parametrize("description", [".zattrs", "zarr.json"])
def test_a_zarr_store_is_no_folder_of_slices(description: str, tmp_path: Path) -> None:
    store = tmp_path / "scans" / "head.ome.zarr"
    (store / "0" / "0").mkdir(parents=True)
    (store / description).write_text("{}")
    (store / "0" / "0" / "7").write_bytes(bytes(300))
    for path in (store, store / description, store.parent):
        with pytest.raises(VolumeError, match=FROM_ITS_PROGRAM) as refused:
            read_volume(path)
        assert "zarr" in str(refused.value).lower()


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(VolumeError, match=r"gone.nii: there is no such file or folder"):
        read_volume(tmp_path / "gone.nii")


def test_one_slice_is_no_volume(tmp_path: Path) -> None:
    image = SimpleITK.GetImageFromArray(cropped().array[:1])
    image.SetSpacing((0.2, 0.2, 0.2))
    SimpleITK.WriteImage(image, str(tmp_path / "flat.nrrd"))
    with pytest.raises(VolumeError, match="72 x 66 x 1 voxels, which is not a volume"):
        read_volume(tmp_path / "flat.nrrd")


def test_voxels_without_a_finite_value_become_the_lowest(tmp_path: Path) -> None:
    scan = cropped("float32")
    scan.array[0, 0, :3] = np.nan
    scan.array[5, 5, 5] = np.inf
    scan.array[6, 6, 6] = -50
    volume = read_volume(write_nifti(scan, tmp_path / "nan.nii"))
    assert volume.array[0, 0, 0] == volume.array[5, 5, 5] == -50
    assert any("4 voxels without a finite value" in note for note in volume.notes)


@pytest.mark.parametrize("word", ["centerings", "centers"])
@pytest.mark.parametrize("centering", ["cell", "node", "???"])
def test_nrrd_axes_that_say_where_they_begin_lie_where_itk_has_them(
    centering: str, word: str, tmp_path: Path
) -> None:
    path = tmp_path / "a.nrrd"
    header = {"spacings": [0.1, 0.2, 0.3], "axis mins": [-3.0, 4.0, 12.0], "centerings": [centering] * 3}
    nrrd.write(str(path), load_mouse().array[:8, :9, :10].transpose(2, 1, 0), header)
    path.write_bytes(path.read_bytes().replace(b"centerings:", word.encode() + b":"))
    accepted = read_volume(path, accept=["extent"])
    expected = SimpleITK.ReadImage(str(path)).GetOrigin()
    np.testing.assert_allclose(accepted.T_scan_voxel[:3, 3], expected, atol=1e-12)


def test_a_scale_of_metaimage_that_nobody_applies_is_said(tmp_path: Path) -> None:
    path = tmp_path / "a.mha"
    write_sitk(cropped(), path)
    content = path.read_bytes()
    path.write_bytes(content.replace(b"ElementType", b"ElementToIntensityFunctionSlope = 2\nElementType"))
    volume = read_volume(path)
    assert any("ElementToIntensityFunction (2, 0) is not applied" in note for note in volume.notes)
    np.testing.assert_array_equal(volume.array, SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(str(path))))


def test_a_vtk_mesh_is_no_scan(tmp_path: Path) -> None:
    path = tmp_path / "a.vtk"
    path.write_text("# vtk DataFile Version 3.0\nbone\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n0 0 0\n")
    with pytest.raises(VolumeError, match="it holds POLYDATA, which is not an image"):
        read_volume(path)
