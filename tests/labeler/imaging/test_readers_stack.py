"""Stacks: one image file for each slice, as scanners and their users leave them."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
import tifffile
from PIL import Image
from scan_makers import Scan, cropped, load_mouse, write_image_stack, write_tiff_stack

from gp_labeler.imaging.readers import VolumeError, inspect_volume, read_preview, read_volume
from gp_labeler.imaging.readers.naming import group_slices, number_slices

SPACING = 0.1411


def codes(plan: object) -> tuple[list[str], list[str]]:
    """Codes of errors and warnings, without what every stack has."""
    errors = [problem.code for problem in plan.errors]
    return errors, [problem.code for problem in plan.warnings if problem.code != "sides-unknown"]


def assert_same_values(path: Path, scan: Scan, **options: object) -> None:
    volume = read_volume(path, **{"spacing": SPACING, **options})
    np.testing.assert_array_equal(volume.array, scan.array)
    assert volume.array.dtype == scan.array.dtype
    np.testing.assert_allclose(volume.T_scan_voxel, np.diag([SPACING] * 3 + [1]))


def test_a_stack_of_the_real_scan_shows_its_landmarks_at_their_place(tmp_path: Path) -> None:
    scan = load_mouse()
    write_tiff_stack(scan, tmp_path / "stack")
    volume = read_volume(tmp_path / "stack", spacing=scan.spacing)
    there = scan.landmarks - scan.affine[:3, 3]  # a stack has no origin
    np.testing.assert_array_equal(volume.values_at(there), scan.values(scan.landmarks))
    assert volume.name == "stack"


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int16", "uint32", "float32"])
@pytest.mark.parametrize("how", [{}, {"compression": "zlib"}, {"byteorder": ">"}, {"bigtiff": True}])
def test_tiff_slices_of_every_depth(dtype: str, how: dict[str, object], tmp_path: Path) -> None:
    scan = cropped(dtype, 1 if dtype == "uint8" else 120)
    write_tiff_stack(scan, tmp_path / "s", **how)
    assert_same_values(tmp_path / "s", scan)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_lzw_slices_are_read(dtype: str, tmp_path: Path) -> None:
    scan = cropped(dtype, 1 if dtype == "uint8" else 120)
    write_image_stack(scan, tmp_path / "s", "{:03d}.tif", compression="tiff_lzw")
    assert_same_values(tmp_path / "s", scan)


@pytest.mark.parametrize("suffix", ["bmp", "png", "BMP", "jp2"])
def test_image_slices(suffix: str, tmp_path: Path) -> None:
    scan = cropped()
    if suffix == "jp2":
        write_image_stack(scan, tmp_path / "s", "a{:03d}.jp2", irreversible=False)
    else:
        write_image_stack(scan, tmp_path / "s", f"a{{:03d}}.{suffix}")
    assert_same_values(tmp_path / "s", scan)


def test_sixteen_bit_png_slices_of_another_writer(tmp_path: Path) -> None:
    scan = cropped("uint16", 200)
    for n, plane in enumerate(scan.array):
        imageio.imwrite(tmp_path / f"p{n}.png", plane)
    assert_same_values(tmp_path, scan)


def test_jpeg_slices_are_close(tmp_path: Path) -> None:
    scan = cropped()
    write_image_stack(scan, tmp_path / "s", "a{:03d}.jpg", quality=97)
    volume = read_volume(tmp_path / "s", spacing=SPACING)
    assert np.abs(volume.array.astype(int) - scan.array).mean() < 3


# Voxel size ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("how", "suggested", "words"),
    [
        ({}, None, "the voxel size is not in the file"),
        ({"resolution": (72, 72), "resolutionunit": 2}, None, "72 dpi are a screen's"),
        ({"resolution": (96, 96), "resolutionunit": 2}, None, "96 dpi are a screen's"),
        ({"resolution": (300, 300), "resolutionunit": 2}, None, "300 dpi are a screen's"),
        ({"resolution": (720, 720), "resolutionunit": 2}, 25.4 / 720, "pixels of 0.0352778 mm, but not"),
        (
            {"resolution": (250, 250), "resolutionunit": 3},
            0.04,
            "pixels of 0.04 mm, but not the distance",
        ),
        ({"resolution": (1, 1), "resolutionunit": 2}, None, "not in the file"),
    ],
)
def test_tiff_slices_never_give_the_slice_distance(
    how: dict[str, object], suggested: float | None, words: str, tmp_path: Path
) -> None:
    write_tiff_stack(cropped(), tmp_path / "s", **how)
    plan = inspect_volume(tmp_path / "s")
    assert codes(plan) == (["spacing-missing"], [])
    assert plan.suggested_spacing == (None if suggested is None else pytest.approx((suggested,) * 3))
    with pytest.raises(VolumeError, match=f"{words}.*--spacing"):
        read_volume(plan)


def test_bmp_and_png_resolutions_are_hints_only(tmp_path: Path) -> None:
    scan = cropped()
    write_image_stack(scan, tmp_path / "bmp", "{:03d}.bmp", dpi=(719.983, 719.983))  # 28345 pixels a metre
    write_image_stack(scan, tmp_path / "png", "{:03d}.png", dpi=(72, 72))
    plan = inspect_volume(tmp_path / "bmp")
    assert plan.suggested_spacing == pytest.approx((0.03528,) * 3, rel=1e-4)
    assert codes(plan)[0] == ["spacing-missing"]
    assert codes(inspect_volume(tmp_path / "png"))[0] == ["spacing-missing"]
    assert inspect_volume(tmp_path / "png").suggested_spacing is None


def test_imagej_and_ome_slices_give_their_whole_voxel_size(tmp_path: Path) -> None:
    scan = cropped()
    how = {"imagej": True, "resolution": (1 / 141.1, 1 / 141.1), "metadata": {"spacing": 141.1, "unit": "um"}}
    write_tiff_stack(scan, tmp_path / "ij", **how)
    size = {f"PhysicalSize{axis}": 141.1 for axis in "XYZ"}
    write_tiff_stack(scan, tmp_path / "ome", "s{:03d}.ome.tif", ome=True, metadata={"axes": "YX", **size})
    for folder in ("ij", "ome"):
        volume = read_volume(tmp_path / folder)
        assert volume.spacing == pytest.approx((SPACING,) * 3, rel=1e-6)
        np.testing.assert_array_equal(volume.array, scan.array)


# Names and order ----------------------------------------------------------------------------------


def test_unpadded_numbers_are_counted_not_spelled(tmp_path: Path) -> None:
    scan = cropped()
    write_tiff_stack(scan, tmp_path / "s", "s{}.tif")
    assert_same_values(tmp_path / "s", scan)
    assert [file.name for file in inspect_volume(tmp_path / "s").files][:3] == ["s0.tif", "s1.tif", "s2.tif"]


def test_a_stack_says_that_its_sides_are_unknown_and_can_be_reversed(tmp_path: Path) -> None:
    scan = cropped()
    write_tiff_stack(scan, tmp_path / "s")
    plan = inspect_volume(tmp_path / "s")
    assert not plan.sides_known
    assert "which side is left" in plan.warnings[-1].text
    forward, backward = read_volume(plan, spacing=SPACING), read_volume(plan, spacing=SPACING, reverse=True)
    np.testing.assert_array_equal(backward.array, forward.array[::-1])
    np.testing.assert_array_equal(backward.T_scan_voxel, forward.T_scan_voxel)
    assert backward.choices == {"spacing": [SPACING] * 3, "reverse": True}
    assert any("reversed" in note for note in backward.notes)
    np.testing.assert_array_equal(read_volume(tmp_path / "s", **backward.choices).array, backward.array)


def test_a_missing_number_is_named_and_can_be_filled(tmp_path: Path) -> None:
    scan = cropped()
    folder = write_tiff_stack(scan, tmp_path / "s")
    for number in (20, 21):
        (folder / f"slice_{number:04d}.tif").unlink()
    plan = inspect_volume(folder)
    assert plan.size == (72, 66, 61)
    with pytest.raises(VolumeError, match=r"the numbers 20, 21 are missing \(2 slices\).*--accept gap"):
        read_volume(plan, spacing=SPACING)
    volume = read_volume(plan, spacing=SPACING, accept=["gap"])
    expected = scan.array.copy()
    expected[20], expected[21] = scan.array[19], scan.array[22]
    np.testing.assert_array_equal(volume.array, expected)
    assert any("20, 21 are missing" in note for note in volume.notes)
    assert volume.choices["accept"] == ["gap"]


def test_regular_steps_are_no_gaps(tmp_path: Path) -> None:
    scan = cropped()
    folder = write_tiff_stack(scan, tmp_path / "s", resolution=(250, 250), resolutionunit=3)
    for number in range(1, 61, 2):
        (folder / f"slice_{number:04d}.tif").unlink()
    plan = inspect_volume(folder)
    assert codes(plan) == (["spacing-missing"], ["step"])
    assert plan.size == (72, 66, 31)
    assert plan.suggested_spacing == pytest.approx((0.04, 0.04, 0.08))


def test_a_number_that_is_there_twice_is_named(tmp_path: Path) -> None:
    scan = cropped()
    folder = write_tiff_stack(scan, tmp_path / "s", "slice_{:03d}.tif")
    tifffile.imwrite(folder / "slice_0010.tif", np.zeros_like(scan.array[0]))
    with pytest.raises(VolumeError, match=r"there twice: slice_010.tif.*--accept doubled"):
        read_volume(folder, spacing=SPACING)


def test_other_numbers_in_the_name_make_other_stacks(tmp_path: Path) -> None:
    scan = cropped()
    write_tiff_stack(scan, tmp_path, "ear2_z{:03d}_c0.tif", first=7)
    write_tiff_stack(
        Scan(255 - scan.array, scan.affine, scan.landmarks), tmp_path, "ear2_z{:03d}_c1.tif", first=7
    )
    plan = inspect_volume(tmp_path)
    assert codes(plan)[0] == ["several-series", "spacing-missing"]
    assert [choice.id for choice in plan.choices] == ["ear2_z#_c0.tif", "ear2_z#_c1.tif"]
    with pytest.raises(
        VolumeError, match=r"2 scans: ear2_z#_c0.tif \(61 slices\), ear2_z#_c1.tif \(61 .*--series"
    ):
        read_volume(plan, spacing=SPACING)
    assert_same_values(tmp_path, scan, series="_c0")
    np.testing.assert_array_equal(read_volume(plan, series="C1", spacing=SPACING).array, 255 - scan.array)
    picked = read_volume(tmp_path / "ear2_z010_c1.tif", spacing=SPACING)
    assert picked.choices["series"] == "ear2_z#_c1.tif"
    np.testing.assert_array_equal(read_volume(picked.path, **picked.choices).array, 255 - scan.array)
    for vague in ("ear2", "c9"):
        with pytest.raises(
            VolumeError, match=f"series '{vague}' fits . of its scans.*Give one of: .ear2_z#_c0.tif"
        ):
            read_volume(tmp_path, series=vague)


def test_a_much_smaller_stack_is_no_rival_but_can_be_asked_for(tmp_path: Path) -> None:
    scan = cropped()
    write_image_stack(scan, tmp_path, "bone{:03d}.png")
    write_image_stack(Scan(scan.array[:5], scan.affine, scan.landmarks), tmp_path, "calibration{:03d}.png")
    plan = inspect_volume(tmp_path)
    assert codes(plan) == (["spacing-missing"], ["stray"])
    assert len(plan.choices) == 2
    assert_same_values(tmp_path, scan)
    assert inspect_volume(plan, series="calib").size == (72, 66, 5)


def test_a_slice_stands_for_its_stack(tmp_path: Path) -> None:
    scan = cropped()
    folder = write_image_stack(scan, tmp_path / "s", "{:03d}.bmp")
    assert_same_values(folder / "031.bmp", scan)


def test_a_folder_that_holds_only_a_folder_of_slices_stands_for_it(tmp_path: Path) -> None:
    scan = cropped()
    (tmp_path / "export" / "deep").mkdir(parents=True)
    write_image_stack(scan, tmp_path / "export" / "deep" / "est", "{:03d}.bmp")
    assert_same_values(tmp_path / "export", scan)


def test_naming_by_hand() -> None:
    files = [Path(f"A_{n}.tif") for n in (9, 10, 11, 1, 2)] + [Path("notes.tif"), Path("a_5.png")]
    groups = group_slices(files)
    assert [group.pattern for group in groups] == ["A_#.tif", "a_#.png", "notes.tif"]
    numbering = number_slices(groups[0])
    assert numbering.missing == (3, 4, 5, 6, 7, 8)
    assert [file and file.stem for file in numbering.files] == [
        "A_1",
        "A_2",
        *[None] * 6,
        "A_9",
        "A_10",
        "A_11",
    ]


# Mixtures, strays, colours ------------------------------------------------------------------------


def test_mixed_bit_depth_is_named_and_never_cast_down(tmp_path: Path) -> None:
    scan = cropped()
    folder = write_tiff_stack(scan, tmp_path / "s")
    deep = scan.array[30].astype(np.uint16) * 250
    tifffile.imwrite(folder / "slice_0030.tif", deep)
    with pytest.raises(
        VolumeError, match=r"differ in bit depth from the others' uint8: slice_0030.tif \(uint16\)"
    ):
        read_volume(folder, spacing=SPACING)
    volume = read_volume(folder, spacing=SPACING, accept=["mixed-depth"])
    assert volume.array.dtype == np.uint16
    np.testing.assert_array_equal(volume.array[30], deep)
    np.testing.assert_array_equal(volume.array[29], scan.array[29])


def test_one_colour_slice_in_a_grey_stack_is_named(tmp_path: Path) -> None:
    scan = cropped()
    folder = write_tiff_stack(scan, tmp_path / "s")
    tifffile.imwrite(folder / "slice_0030.tif", np.stack([scan.array[30]] * 3, axis=-1), photometric="rgb")
    with pytest.raises(
        VolumeError, match=r"some are grey; the exceptions are slice_0030.tif.*--accept mixed-colour"
    ):
        read_volume(folder, spacing=SPACING)
    assert_same_values(folder, scan, accept=["mixed-colour"])


def test_a_slice_of_another_size_is_named(tmp_path: Path) -> None:
    scan = cropped()
    folder = write_image_stack(scan, tmp_path / "s", "slice_{:04d}.png")
    Image.fromarray(scan.array[30][:50]).save(folder / "slice_0030.png")
    with pytest.raises(VolumeError, match=r"from the others' 72 x 66 pixels: slice_0030.png \(72 x 50\)"):
        read_volume(folder, spacing=SPACING)
    volume = read_volume(folder, spacing=SPACING, accept=["slice-size"])
    np.testing.assert_array_equal(volume.array[30], scan.array[29])


def test_stray_images_are_named_and_left_out(tmp_path: Path) -> None:
    scan = cropped()
    folder = write_image_stack(scan, tmp_path / "s", "slice_{:04d}.png")
    Image.fromarray(scan.array[0][:20, :20]).save(folder / "thumbnail.png")
    Image.fromarray(scan.array[0][:20, :20]).save(folder / "slice_0099.png")
    (folder / "notes.txt").write_text("not a slice")
    (folder / ".DS_Store").write_text("not a slice")
    plan = inspect_volume(folder)
    assert codes(plan) == (["spacing-missing"], ["stray", "stray"])
    texts = " ".join(problem.text for problem in plan.warnings)
    assert "thumbnail.png" in texts
    assert "slice_0099.png (20 x 20)" in texts
    assert_same_values(folder, scan)


def as_palette(plane: np.ndarray, table: np.ndarray) -> Image.Image:
    image = Image.fromarray(plane).convert("L")
    image = Image.frombytes("P", image.size, image.tobytes())
    image.putpalette(table.astype(np.uint8).tobytes())
    return image


@pytest.mark.parametrize("suffix", ["bmp", "png"])
def test_a_grey_palette_becomes_grey_exactly(suffix: str, tmp_path: Path) -> None:
    scan = cropped()
    inverted = np.repeat(np.arange(255, -1, -1)[:, None], 3, axis=1)
    for n, plane in enumerate(scan.array):
        as_palette(255 - plane, inverted).save(tmp_path / f"p{n:03d}.{suffix}")
    plan = inspect_volume(tmp_path)
    assert codes(plan) == (["spacing-missing"], ["palette"])
    assert plan.dtype == np.uint8
    assert_same_values(tmp_path, scan)


def test_a_colour_palette_becomes_luminance(tmp_path: Path) -> None:
    scan = cropped()
    table = np.stack([np.arange(256), np.arange(256) // 2, np.zeros(256)], axis=1).astype(np.uint8)
    for n, plane in enumerate(scan.array):
        as_palette(plane, table).save(tmp_path / f"p{n:03d}.png")
    volume = read_volume(tmp_path, spacing=SPACING)
    expected = table[scan.array].astype(float) @ [0.299, 0.587, 0.114]
    assert np.abs(volume.array - expected).max() <= 0.51
    np.testing.assert_array_equal(read_volume(tmp_path, spacing=SPACING, channel=0).array, scan.array)


def test_tiff_palettes_and_inverted_scales_become_grey(tmp_path: Path) -> None:
    scan = cropped()
    ramp = np.stack([np.arange(256, dtype=np.uint16) * 257] * 3)
    write_tiff_stack(scan, tmp_path / "p", photometric="palette", colormap=ramp)
    assert_same_values(tmp_path / "p", scan)
    flipped = Scan(255 - scan.array, scan.affine, scan.landmarks)
    write_tiff_stack(flipped, tmp_path / "w", photometric="miniswhite")
    assert_same_values(tmp_path / "w", scan)


@pytest.mark.parametrize("suffix", ["tif", "png", "bmp"])
def test_colour_slices_become_luminance_or_a_channel(suffix: str, tmp_path: Path) -> None:
    scan = cropped()
    colour = np.stack([scan.array, scan.array // 2, scan.array // 4], axis=-1)
    for n, plane in enumerate(colour):
        Image.fromarray(plane).save(tmp_path / f"c{n:03d}.{suffix}")
    assert codes(inspect_volume(tmp_path)) == (["spacing-missing"], ["colour"])
    expected = colour.astype(float) @ [0.299, 0.587, 0.114]
    assert np.abs(read_volume(tmp_path, spacing=SPACING).array - expected).max() <= 0.51
    np.testing.assert_array_equal(read_volume(tmp_path, spacing=SPACING, channel=2).array, colour[..., 2])
    with pytest.raises(VolumeError, match="channel must be 0 to 2, got 7"):
        read_volume(tmp_path, channel=7)


# SkyScan ------------------------------------------------------------------------------------------

LOG = """[System]
Scanner=Skyscan1176
[Acquisition]
Filename Prefix=gp04_head_
Camera Pixel Size (um)=    74.80
Image Pixel Size (um)=   17.60
Scaled Image Pixel Size (um)=   17.60
Object to Source (mm)=121.0
[Reconstruction]
Reconstruction Program=NRecon
Sections Count=61
Result File Type=BMP
Result Image Width (pixels)=72
Result Image Height (pixels)=66
Pixel Size (um)=141.10000
Filename Prefix=gp04_head__rec
Filename Index Length=8
First Section=100
Last Section=160
Smoothing kernel=2 (Gaussian) \u00b5
[File name convention]
Pixel Size (um)=9.9
"""


def write_skyscan(tmp_path: Path, log: str = LOG, encoding: str = "latin-1") -> Path:
    folder = write_image_stack(cropped(), tmp_path / "rec", "gp04_head__rec{:08d}.bmp", first=100)
    (folder / "gp04_head__rec.log").write_bytes(log.encode(encoding))
    Image.fromarray(np.zeros((30, 40), np.uint8)).save(folder / "gp04_head__rec_spr.bmp")
    return folder


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_a_skyscan_folder_reads_by_its_log(encoding: str, tmp_path: Path) -> None:
    folder = write_skyscan(tmp_path, encoding=encoding)
    plan = inspect_volume(folder)
    assert codes(plan) == ([], ["scout"])
    assert plan.format == "SkyScan stack"
    assert "gp04_head__rec_spr.bmp" in plan.warnings[0].text
    volume = read_volume(plan)
    assert volume.spacing == pytest.approx((SPACING,) * 3)
    np.testing.assert_array_equal(volume.array, cropped().array)
    assert volume.name == "gp04_head__rec"
    np.testing.assert_array_equal(read_volume(folder / "gp04_head__rec.log").array, volume.array)


def test_a_log_without_a_reconstruction_does_not_count(tmp_path: Path) -> None:
    folder = write_skyscan(tmp_path, LOG[: LOG.index("[Reconstruction]")])
    assert codes(inspect_volume(folder))[0] == ["spacing-missing"]


def test_a_log_with_a_broken_number_does_not_count(tmp_path: Path) -> None:
    folder = write_skyscan(tmp_path, LOG.replace("141.10000", "n/a"))
    assert codes(inspect_volume(folder))[0] == ["spacing-missing"]


def test_a_log_that_disagrees_with_the_slices_is_named(tmp_path: Path) -> None:
    folder = write_skyscan(
        tmp_path, LOG.replace("Last Section=160", "Last Section=161").replace("_rec\n", "_rac\n")
    )
    assert codes(inspect_volume(folder)) == ([], ["scout", "log-prefix", "log-sections"])
    (folder / "gp04_head__rec.log").write_text(LOG.replace("(pixels)=72", "(pixels)=144"), "latin-1")
    with pytest.raises(
        VolumeError, match=r"states 144 x 66 pixels, the slices have 72 x 66.*--spacing 0.1411"
    ):
        read_volume(folder)


def test_the_log_of_the_right_scan_is_taken(tmp_path: Path) -> None:
    folder = write_skyscan(tmp_path)
    (folder / "other_rec.log").write_text(
        LOG.replace("gp04_head__rec", "other_rec").replace("141.1", "35"), "latin-1"
    )
    assert inspect_volume(folder).spacing == pytest.approx((SPACING,) * 3)


# Damaged and empty --------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["tif", "png", "bmp"])
@pytest.mark.parametrize("content", [b"", b"no image", bytes(range(256))])
def test_a_broken_slice_is_named(suffix: str, content: bytes, tmp_path: Path) -> None:
    folder = write_image_stack(cropped(), tmp_path / "s", f"a{{:03d}}.{suffix}")
    (folder / f"a030.{suffix}").write_bytes(content)
    with pytest.raises(
        VolumeError, match=rf"a030.{suffix}: it is (not an image|empty).*remove it from the stack"
    ):
        read_volume(folder, spacing=SPACING)


@pytest.mark.parametrize("suffix", ["tif", "png", "bmp"])
def test_a_slice_that_ends_early_is_refused(suffix: str, tmp_path: Path) -> None:
    folder = write_image_stack(cropped(), tmp_path / "s", f"a{{:03d}}.{suffix}")
    file = folder / f"a030.{suffix}"
    file.write_bytes(file.read_bytes()[:-2000])
    with pytest.raises(VolumeError, match=f"a030.{suffix}"):
        read_volume(folder, spacing=SPACING)


def test_a_folder_without_a_scan_says_what_it_holds(tmp_path: Path) -> None:
    with pytest.raises(VolumeError, match=r"it holds no scan, nothing.*Readable are NRRD"):
        inspect_volume(tmp_path)
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(VolumeError, match=r"it holds no scan, only notes.txt"):
        inspect_volume(tmp_path)
    Image.fromarray(np.zeros((5, 5), np.uint8)).save(tmp_path / "photo.png")
    with pytest.raises(VolumeError, match=r"holds no stack of slices, but photo.png"):
        inspect_volume(tmp_path / "photo.png")


def test_several_scans_in_subfolders_are_named(tmp_path: Path) -> None:
    for name in ("left", "right"):
        write_image_stack(cropped(), tmp_path / name, "{:03d}.bmp")
    with pytest.raises(VolumeError, match=r"the scans are in its folders left, right.*Give one"):
        inspect_volume(tmp_path)


def test_a_preview_is_coarse_and_needs_no_voxel_size(tmp_path: Path) -> None:
    scan = load_mouse()
    write_tiff_stack(scan, tmp_path / "s")
    plan = inspect_volume(tmp_path / "s")
    assert plan.errors
    preview = read_preview(plan, reverse=True)
    np.testing.assert_array_equal(preview.array, scan.array[::-1][::2, ::2, ::2])
    assert preview.spacing == (2.0, 2.0, 2.0)


NAMES = {
    "hexadecimal": lambda k: f"im_{k + 3:04x}.tif",
    "hexadecimal, capital": lambda k: f"face{k:04X}.tif",
    "hexadecimal, every one with a letter": lambda k: f"im_{k + 200:04x}.tif",
    "two spellings of the suffix": lambda k: f"im_{k:03d}.{'tif' if k % 3 else 'TIFF'}",
    "position": lambda k: f"head_z{0.3 * k:.2f}.tif",
    "position in the middle": lambda k: f"head_{0.125 * k:07.3f}mm.tif",
    "time": lambda k: f"2024-05-03_12-{k // 60:02d}-{k % 60:02d}_slice{k:04d}.tif",
    "time to the second alone": lambda k: f"rec 12-{10 + k // 60:02d}-{k % 60:02d} no {k}.tif",
    "of": lambda k: f"slice {k + 1} of 61.tif",
}


@pytest.mark.parametrize("name", NAMES)
def test_slices_are_counted_however_they_are_named(name: str, tmp_path: Path) -> None:
    scan = cropped()
    for k, plane in enumerate(scan.array):
        tifffile.imwrite(tmp_path / NAMES[name](k), plane, metadata=None)
    assert codes(inspect_volume(tmp_path)) == (["spacing-missing"], [])
    assert_same_values(tmp_path, scan)


def test_a_counter_that_goes_on_does_not_join_two_stacks() -> None:
    files = [Path(f"ear{1 + k // 20}_{k:03d}.tif") for k in range(40)]
    assert [len(group.files) for group in group_slices(files)] == [20, 20]
    files = [Path(f"v{1 + k // 20}.{k % 20:03d}.tif") for k in range(40)]
    assert [len(group.files) for group in group_slices(files)] == [20, 20]


def test_numbers_too_far_apart_are_no_stack_and_cost_nothing(tmp_path: Path) -> None:
    for number in (1, 2, 3, 10**13):
        tifffile.imwrite(tmp_path / f"s{number}.tif", np.zeros((9, 9), np.uint8), photometric=1)
    with pytest.raises(
        VolumeError, match=r"4 images named s#.tif run from 1 to 10000000000000, too far apart"
    ):
        read_volume(tmp_path, spacing=SPACING)


def test_a_hexadecimal_slice_that_is_missing_is_named() -> None:
    files = [Path(f"im_{k:03x}.tif") for k in range(40) if k != 27]
    (group,) = group_slices(files)
    assert number_slices(group).missing == (27,)


def test_two_copies_of_a_stack_under_two_suffixes_stay_two() -> None:
    files = [Path(f"im_{k:03d}{suffix}") for k in range(20) for suffix in (".tif", ".tiff")]
    assert [len(group.files) for group in group_slices(files)] == [20, 20]


def test_letters_that_name_a_stack_are_no_digits() -> None:
    files = [Path(f"{letter}{k:02d}.tif") for letter in "ab" for k in range(20)]
    assert [len(group.files) for group in group_slices(files)] == [20, 20]
