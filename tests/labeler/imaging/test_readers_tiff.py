"""TIFF files that hold a whole volume."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK
import tifffile
from PIL import Image
from scan_makers import Scan, cropped, load_mouse

from gp_labeler.imaging.readers import VolumeError, inspect_volume, read_volume

SPACING = 0.1411


def assert_same_values(path: Path, scan: Scan, **options: object) -> None:
    volume = read_volume(path, **options)
    np.testing.assert_array_equal(volume.array, scan.array)
    assert volume.array.dtype == scan.array.dtype
    assert volume.spacing == pytest.approx((SPACING,) * 3, rel=1e-5)


WRITERS = {
    "contiguous": {},
    "plain": {"metadata": None},
    "zlib": {"compression": "zlib"},
    "tiled": {"tile": (32, 32), "metadata": None},
    "big-endian": {"byteorder": ">", "metadata": None},
    "bigtiff": {"bigtiff": True},
    "miniswhite": {"photometric": "miniswhite", "metadata": None},
}


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("name", WRITERS)
def test_multi_page_files_give_their_values_but_no_voxel_size(name: str, dtype: str, tmp_path: Path) -> None:
    scan = cropped(dtype, 1 if dtype == "uint8" else 120)
    stored = scan.array
    if name == "miniswhite":
        stored = -stored if dtype == "float32" else np.iinfo(dtype).max - stored
    path = tmp_path / "a.tif"
    with tifffile.TiffWriter(
        path, bigtiff=name == "bigtiff", byteorder=WRITERS[name].get("byteorder")
    ) as writer:
        how = {key: value for key, value in WRITERS[name].items() if key not in ("bigtiff", "byteorder")}
        for plane in stored:
            writer.write(plane, contiguous=False, **how)
    plan = inspect_volume(path)
    assert [problem.code for problem in plan.errors] == ["spacing-missing"]
    assert not plan.sides_known
    with pytest.raises(VolumeError, match=r"a.tif: the voxel size is not in the file.*--spacing"):
        read_volume(plan)
    assert_same_values(path, scan, spacing=SPACING)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_a_file_written_in_one_go_or_by_another_library(dtype: str, tmp_path: Path) -> None:
    scan = cropped(dtype, 1 if dtype == "uint8" else 120)
    tifffile.imwrite(tmp_path / "a.tif", scan.array, photometric="minisblack")
    SimpleITK.WriteImage(scan.image(), str(tmp_path / "b.tif"))
    pages = [Image.fromarray(plane) for plane in scan.array]
    pages[0].save(tmp_path / "c.tif", save_all=True, append_images=pages[1:], compression="tiff_lzw")
    for name in "abc":
        assert_same_values(tmp_path / f"{name}.tif", scan, spacing=SPACING)


UNITS = {"um": 1e-3, "µm": 1e-3, "\\u00B5m": 1e-3, "micron": 1e-3, "mm": 1.0, "cm": 10.0, "inch": 25.4}


@pytest.mark.parametrize("unit", UNITS)
def test_imagej_units_are_honoured(unit: str, tmp_path: Path) -> None:
    scan = load_mouse() if unit == "um" else cropped()
    size = SPACING / UNITS[unit]
    meta = {"axes": "ZYX", "spacing": size, "unit": unit.replace("µ", "\\u00B5")}
    path = tmp_path / "ij.tif"
    tifffile.imwrite(path, scan.array, imagej=True, resolution=(1 / size, 1 / size), metadata=meta)
    assert inspect_volume(path).format == "ImageJ TIFF"
    assert_same_values(path, scan)


def test_imagej_without_a_unit_or_slice_distance_is_asked_for(tmp_path: Path) -> None:
    scan = cropped()
    for name, meta in {"pixel": {"unit": "pixel", "spacing": 1.0}, "depth": {"unit": "um"}}.items():
        path = tmp_path / f"{name}.tif"
        tifffile.imwrite(
            path, scan.array, imagej=True, resolution=(1 / 141.1, 1 / 141.1), metadata={"axes": "ZYX", **meta}
        )
        plan = inspect_volume(path)
        assert [problem.code for problem in plan.errors] == ["spacing-missing"]
    assert plan.suggested_spacing == pytest.approx((SPACING,) * 3, rel=1e-5)
    assert "ImageJ's description gives pixels of 0.1411 mm, but not the distance" in plan.errors[0].text


@pytest.mark.parametrize(
    ("unit", "factor"), [("µm", 1e-3), (None, 1e-3), ("mm", 1), ("nm", 1e-6), ("cm", 10)]
)
@pytest.mark.parametrize("how", [{}, {"compression": "zlib"}])
def test_ome_physical_sizes_are_honoured(
    unit: str | None, factor: float, how: dict[str, object], tmp_path: Path
) -> None:
    scan = cropped("uint16", 99)
    meta: dict[str, object] = {"axes": "ZYX"}
    for axis in "XYZ":
        meta[f"PhysicalSize{axis}"] = SPACING / factor
        if unit is not None:
            meta[f"PhysicalSize{axis}Unit"] = unit
    path = tmp_path / "scan.ome.tif"
    tifffile.imwrite(path, scan.array, ome=True, metadata=meta, **how)
    assert inspect_volume(path).format == "OME-TIFF"
    assert inspect_volume(path).name == "scan"
    assert_same_values(path, scan)


def test_a_micrometre_slip_in_ome_is_noticed(tmp_path: Path) -> None:
    size = {f"PhysicalSize{axis}": 141.1 for axis in "XYZ"} | {
        f"PhysicalSize{axis}Unit": "mm" for axis in "XYZ"
    }
    tifffile.imwrite(tmp_path / "a.ome.tif", cropped().array, ome=True, metadata={"axes": "ZYX", **size})
    with pytest.raises(VolumeError, match=r"10.2 m long.*--spacing 0.1411"):
        read_volume(tmp_path / "a.ome.tif")


@pytest.mark.parametrize("dpi", [72, 96, 300])
def test_screen_resolutions_are_not_believed(dpi: int, tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, cropped().array, resolution=(dpi, dpi), resolutionunit=2, photometric="minisblack")
    plan = inspect_volume(path)
    assert plan.suggested_spacing is None
    assert f"its {dpi} dpi are a screen's" in plan.errors[0].text


@pytest.mark.parametrize("kind", ["imagej", "ome"])
@pytest.mark.parametrize("compress", [None, "zlib"])
def test_of_several_channels_one_is_taken_knowingly(kind: str, compress: str | None, tmp_path: Path) -> None:
    scan = cropped()
    axes = "ZCYX" if kind == "imagej" else "CZYX"
    both = np.stack([scan.array, 255 - scan.array], axis=axes.index("C"))
    meta: dict[str, object] = {"axes": axes}
    path = tmp_path / "a.tif"
    how = {"imagej": True} if kind == "imagej" else {"ome": True}
    tifffile.imwrite(path, both, metadata=meta, compression=compress, **how)
    plan = inspect_volume(path)
    assert plan.size == (72, 66, 61)
    assert "channel" in [problem.code for problem in plan.warnings]
    assert_same_values(path, scan, spacing=SPACING)
    assert_same_values(path, Scan(255 - scan.array, scan.affine, scan.landmarks), spacing=SPACING, channel=1)
    with pytest.raises(VolumeError, match="channel must be 0 to 1, got 2"):
        read_volume(path, channel=2)


@pytest.mark.parametrize("planar", ["contig", "separate"])
def test_colour_pages_become_luminance_or_a_channel(planar: str, tmp_path: Path) -> None:
    scan = cropped()
    colour = np.stack([scan.array, scan.array // 2, scan.array // 4], axis=-1 if planar == "contig" else 1)
    path = tmp_path / "c.tif"
    tifffile.imwrite(path, colour, photometric="rgb", planarconfig=planar, metadata=None)
    assert "colour" in [problem.code for problem in inspect_volume(path).warnings]
    expected = np.moveaxis(colour, -1 if planar == "contig" else 1, 0).astype(float).T @ [0.299, 0.587, 0.114]
    assert np.abs(read_volume(path, spacing=SPACING).array - expected.T).max() <= 0.51
    halved = Scan(scan.array // 2, scan.affine, scan.landmarks)
    assert_same_values(path, halved, spacing=SPACING, channel=1)


def test_complex_pages_are_refused_by_name(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", np.zeros((12, 20, 20), np.complex64), photometric="minisblack")
    with pytest.raises(VolumeError, match=r"a\.tif: its voxels must be integers or floats.* Save the grey"):
        read_volume(tmp_path / "a.tif", spacing=SPACING)


def test_palette_pages_become_grey(tmp_path: Path) -> None:
    scan = cropped()
    ramp = np.stack([np.arange(256, dtype=np.uint16) * 257] * 3)
    tifffile.imwrite(tmp_path / "p.tif", scan.array, photometric="palette", colormap=ramp, metadata=None)
    assert_same_values(tmp_path / "p.tif", scan, spacing=SPACING)


def test_pages_of_another_size_are_left_out_and_counted(tmp_path: Path) -> None:
    scan = cropped()
    with tifffile.TiffWriter(tmp_path / "t.tif") as writer:
        writer.write(np.zeros((20, 20, 3), np.uint8), metadata=None)
        for plane in scan.array:
            writer.write(plane, metadata=None, contiguous=False)
    plan = inspect_volume(tmp_path / "t.tif")
    assert "1 pages of another size" in " ".join(problem.text for problem in plan.warnings)
    assert_same_values(tmp_path / "t.tif", scan, spacing=SPACING)


def test_one_file_in_a_folder_stands_for_the_folder(tmp_path: Path) -> None:
    scan = cropped()
    tifffile.imwrite(tmp_path / "a.tif", scan.array, photometric="minisblack")
    (tmp_path / "notes.txt").write_text("x")
    assert_same_values(tmp_path, scan, spacing=SPACING)
    tifffile.imwrite(tmp_path / "b.tif", scan.array, photometric="minisblack")
    with pytest.raises(VolumeError, match=r"holds several volumes: a.tif, b.tif.*Give one of them:"):
        read_volume(tmp_path)


@pytest.mark.parametrize("keep", [0.3, 0.9])
@pytest.mark.parametrize("how", [{"imagej": True}, {"compression": "zlib", "metadata": None}])
def test_a_file_that_ends_early_is_refused(keep: float, how: dict[str, object], tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    with tifffile.TiffWriter(path, imagej="imagej" in how) as writer:
        if "imagej" in how:
            writer.write(cropped().array)
        else:
            for plane in cropped().array:
                writer.write(plane, contiguous=False, **how)
    path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])
    with pytest.raises(VolumeError, match=r"a.tif"):
        read_volume(path, spacing=SPACING)


def test_a_text_under_the_name_of_a_tiff_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.tif").write_text("no image at all")
    with pytest.raises(VolumeError, match=r"a.tif: it cannot be read: not a TIFF"):
        read_volume(tmp_path / "a.tif")
    assert capfd.readouterr().err == ""
