"""What holds for every reader: part of a volume, progress, cancelling, the record of choices."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tifffile
from scan_makers import Scan, load_mouse, write_nifti, write_sitk, write_tiff_stack

from gp_core.errors import GpError
from gp_labeler.imaging import disk_cache
from gp_labeler.imaging.progress import Cancelled
from gp_labeler.imaging.readers import ImportOptions, inspect_volume, is_readable_name, read_volume
from gp_labeler.imaging.readers.problems import Problem, VolumeError


def write_paged(scan: Scan, path: Path) -> Path:
    tifffile.imwrite(
        path, scan.array, compression="zlib", photometric="minisblack", rowsperstrip=999, tile=(64, 64)
    )
    return path


FORMATS: dict[str, Callable[[Scan, Path], Path]] = {
    "raw": lambda scan, folder: write_sitk(scan, folder / "a.mha"),
    "packed": lambda scan, folder: write_sitk(scan, folder / "a.nrrd", compress=True),
    "gzip": lambda scan, folder: write_nifti(scan, folder / "a.nii.gz"),
    "itk": lambda scan, folder: write_sitk(scan, folder / "a.vtk"),
    "stack": lambda scan, folder: write_tiff_stack(scan, folder / "stack"),
    "pages": lambda scan, folder: write_paged(scan, folder / "a.tif"),
}


@pytest.mark.parametrize("name", FORMATS)
def test_a_part_of_a_volume_lies_where_it_lies_in_the_whole(name: str, tmp_path: Path) -> None:
    path = FORMATS[name](load_mouse(), tmp_path)
    whole = read_volume(path, spacing=0.14)
    part = read_volume(path, spacing=0.14, stride=3, region=((10, 60), (7, 150), (20, 147)))
    assert part.size == (17, 48, 43)
    np.testing.assert_array_equal(part.array, whole.array[20:147:3, 7:150:3, 10:60:3])
    index = np.array([[0, 0, 0], [16, 47, 42], [3, 4, 5]])
    np.testing.assert_allclose(
        part.voxel_to_scan(index), whole.voxel_to_scan(index * 3 + [10, 7, 20]), atol=1e-9
    )
    np.testing.assert_allclose(part.spacing, 0.42)
    both = read_volume(path, spacing=0.14, stride=3, region=((10, 60), (7, 150), (20, 147)), reverse=True)
    np.testing.assert_array_equal(both.array, whole.array[::-1][20:147:3, 7:150:3, 10:60:3])
    np.testing.assert_array_equal(both.T_scan_voxel, part.T_scan_voxel)


@pytest.mark.parametrize("name", FORMATS)
def test_progress_rises_to_one_and_cancel_stops(name: str, tmp_path: Path) -> None:
    path = FORMATS[name](load_mouse(), tmp_path)
    seen: list[float] = []
    read_volume(path, spacing=0.14, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    assert len(seen) > 100
    calls = iter(range(100))
    with pytest.raises(Cancelled):
        read_volume(path, spacing=0.14, cancel=lambda: next(calls) >= 10)


def test_looking_into_a_stack_tells_progress_and_can_be_cancelled(tmp_path: Path) -> None:
    path = FORMATS["stack"](load_mouse(), tmp_path)
    seen: list[float] = []
    inspect_volume(path, progress=seen.append)
    assert len(seen) == 147
    with pytest.raises(Cancelled):
        inspect_volume(path, cancel=lambda: True)


def test_nothing_big_is_loaded_before_all_is_decided(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = FORMATS["stack"](load_mouse(), tmp_path)
    monkeypatch.setattr("gp_labeler.imaging.readers.assemble", lambda *_: pytest.fail("it was loaded"))
    with pytest.raises(GpError, match="--spacing"):
        read_volume(path)


@pytest.mark.parametrize("name", FORMATS)
def test_the_checksum_is_that_of_the_scan_not_of_its_file(name: str, tmp_path: Path) -> None:
    scan = load_mouse()
    straight = Scan(scan.array, np.diag([0.14, 0.14, 0.14, 1]), scan.landmarks)
    first = read_volume(write_sitk(straight, tmp_path / "first.mha")).checksum
    path = FORMATS[name](straight, tmp_path)
    assert read_volume(path, spacing=0.14).checksum == first
    assert read_volume(path, spacing=0.14, reverse=True).checksum != first


def test_choices_read_the_same_again(tmp_path: Path) -> None:
    path = FORMATS["stack"](load_mouse(), tmp_path)
    options = {"spacing": 0.14, "reverse": True, "stride": 2, "region": ((0, 50), (3, 70), (5, 99))}
    volume = read_volume(path, **options)
    again = read_volume(path, **volume.choices)
    assert again.checksum == volume.checksum
    assert again.choices == volume.choices
    assert volume.path == path.resolve()
    assert volume.choices["region"] == [[0, 50], [3, 70], [5, 99]]
    plan = inspect_volume(inspect_volume(path, spacing=0.14), reverse=True)
    assert (plan.options.spacing, plan.options.reverse) == ((0.14,) * 3, True)


def test_a_large_volume_is_announced_with_its_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disk_cache, "available_memory", lambda: 1e12)
    header = bytearray(write_nifti(load_mouse(), tmp_path / "a.nii").read_bytes()[:352])
    header[40:48] = np.array([3, 1500, 1500, 2000], "<i2").tobytes()
    header[70:74] = np.array([512, 16], "<i2").tobytes()
    header[76:92] = np.array([1, 0.035, 0.035, 0.035], "<f4").tobytes()
    header[252:256] = bytes(4)
    (tmp_path / "huge.nii.gz").write_bytes(gzip.compress(bytes(header)))
    plan = inspect_volume(tmp_path / "huge.nii.gz")
    assert plan.n_bytes == 9_000_000_000
    assert "it takes 8.4 GB of memory" in " ".join(problem.text for problem in plan.warnings)
    assert inspect_volume(plan, stride=2).n_bytes == 9_000_000_000 // 8
    assert plan.preview_stride == 13


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"spacing": -1}, "positive lengths in mm, got -1"),
        ({"spacing": "wide"}, "one length in mm, or three"),
        ({"spacing": (1, 2)}, "one length in mm, or three"),
        ({"spacing": float("nan")}, "positive lengths"),
        ({"stride": 0}, "stride must be a whole number from 1, got 0"),
        ({"stride": 1.5}, "stride must be a whole number"),
        ({"region": ((0, 5), (0, 5))}, "region must be"),
        ({"region": ((5, 5), (0, 5), (0, 5))}, "ranges of voxels from 0"),
        ({"region": ((0, 500), (0, 5), (0, 5))}, "i is 0 to 170, got 0 to 500"),
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, object], words: str, tmp_path: Path) -> None:
    path = FORMATS["raw"](load_mouse(), tmp_path)
    with pytest.raises(GpError, match=words):
        read_volume(path, **options)


def test_options_say_only_what_differs_from_the_defaults() -> None:
    assert ImportOptions.make().as_json() == {}
    assert ImportOptions.make(accept="gap", channel=0).as_json() == {"channel": 0, "accept": ["gap"]}


def test_names_of_scans_are_known_without_opening_them() -> None:
    for name in ("a.nii.gz", "a.NRRD", "a.dcm", "a.tif", "C1.ISQ;1", "a.mhd", "a.bmp"):
        assert is_readable_name(Path(name)), name
    for name in ("a.gz", "a.txt", "a.mrk.json", "a"):
        assert not is_readable_name(Path(name)), name


def test_each_problem_of_a_file_comes_before_its_remedy() -> None:
    problems = [
        Problem("short-file", "a.nrrd holds 9 bytes, but 20 are needed", remedy="Copy it again."),
        Problem("extent", "the scan would be 1 mm long", remedy="Give the voxel size."),
        Problem("scaling", "it has no slope.", remedy="Copy it again."),
    ]
    said = str(VolumeError.of(problems, "scans/a.nrrd"))
    assert said == (
        "scans/a.nrrd: holds 9 bytes, but 20 are needed; it has no slope. Copy it again. "
        "The scan would be 1 mm long. Give the voxel size."
    )
    assert str(VolumeError.of(problems[1:2], "a.nrrd")) == (
        "a.nrrd: the scan would be 1 mm long. Give the voxel size."
    )
    assert str(VolumeError.of([Problem("odd", "it is odd")], "a.nrrd")) == "a.nrrd: it is odd"
