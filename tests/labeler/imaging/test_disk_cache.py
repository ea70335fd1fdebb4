"""Packed scans that the memory cannot hold: unpacked into a file that leaves nothing behind."""

from __future__ import annotations

import gc
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import SimpleITK
import tifffile

from gp_core.errors import GpError
from gp_labeler.imaging import disk_cache
from gp_labeler.imaging.progress import Cancelled
from gp_labeler.imaging.readers import VolumeError, inspect_volume, read_volume
from gp_labeler.imaging.voxels import ArrayVoxels, GreyArray, MappedVoxels

SPACING = (0.5, 0.5, 0.6)


def scan(dtype: str = "int16") -> GreyArray:
    grey = np.random.default_rng(0).normal(300, 100, (30, 26, 24))
    grey[10:20, 8:18, 8:18] += 2000
    return grey.clip(0).astype(dtype)


def packed(folder: Path, name: str) -> Path:
    """Write the scan as a packed file, or as a folder of slices."""
    path = folder / name
    if name.endswith(".tif"):
        tifffile.imwrite(path, scan(), compression="zlib", metadata=None)
    elif name == "stack":
        path.mkdir()
        for n, plane in enumerate(scan("uint16")):
            tifffile.imwrite(path / f"slice_{n:03}.tif", plane)
    else:
        image = SimpleITK.GetImageFromArray(scan("float64" if name.startswith("wide") else "int16"))
        image.SetSpacing(SPACING)
        SimpleITK.WriteImage(image, str(path), True)
    return path


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of the cache, on a machine of little memory."""
    monkeypatch.setenv("GP_LABELER_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(disk_cache, "available_memory", lambda: 1000.0)
    return tmp_path / "cache"


@pytest.mark.parametrize("name", ["a.nrrd", "a.nii.gz", "a.mha", "a.tif", "stack", "wide.nrrd"])
@pytest.mark.parametrize("options", [{}, {"reverse": True, "region": ((2, 20), (0, 26), (3, 29))}], ids=str)
def test_an_unpacked_scan_is_the_scan(name: str, options: dict, folder: Path, tmp_path: Path) -> None:
    path = packed(tmp_path, name)
    unpacked, held = (read_volume(path, spacing=SPACING, mapped=m, **options) for m in (None, False))
    assert isinstance(unpacked.voxels, MappedVoxels)
    assert isinstance(held.voxels, ArrayVoxels)
    assert unpacked.dtype == held.dtype
    np.testing.assert_array_equal(unpacked.array, held.array)
    assert unpacked.checksum == held.checksum
    assert any("unpacked" in note for note in unpacked.notes)


@pytest.mark.skipif(sys.platform == "win32", reason="the file goes with the scan there")
def test_nothing_is_left_behind(folder: Path, tmp_path: Path) -> None:
    volume = read_volume(packed(tmp_path, "a.nrrd"))
    assert list(folder.iterdir()) == []  # it has no name while it is open either
    held = _open_files(folder)
    assert len(held) == 1
    del volume
    gc.collect()
    assert _open_files(folder) == []


def _open_files(folder: Path) -> list[str]:
    links = Path("/proc/self/fd")
    if not links.is_dir():
        pytest.skip("no /proc")
    found = (str(link.readlink()) for link in links.iterdir() if link.is_symlink())
    return sorted({name for name in found if name.startswith(str(folder))})


def test_size_place_and_time_are_said_first(folder: Path, tmp_path: Path) -> None:
    plan = inspect_volume(packed(tmp_path, "a.nrrd"))
    assert plan.is_unpacked_to_disk
    (text,) = (problem.text for problem in plan.warnings if problem.code == "unpacked")
    for words in ("0.0 GB", str(folder), "1 min", "cancelled"):
        assert words in text
    assert not inspect_volume(packed(tmp_path, "a.tif"), stride=8).is_unpacked_to_disk  # it fits then


def test_cancelling_leaves_nothing(folder: Path, tmp_path: Path) -> None:
    path, told = packed(tmp_path, "a.nrrd"), []
    with pytest.raises(Cancelled):
        read_volume(path, progress=told.append, cancel=lambda: len(told) > 10)
    assert list(folder.iterdir()) == []
    assert _open_files(folder) == []


def test_a_limit_and_a_disk_without_room_are_said_before(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = packed(tmp_path, "a.nrrd")
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=10_000))
    (problem,) = inspect_volume(path).errors
    assert problem.code == "no-room"
    assert "GB free" in problem.text
    with pytest.raises(VolumeError, match=r"GB free.*cache_gb"):
        read_volume(path)
    monkeypatch.setattr(disk_cache, "_DEFAULT_GB", 1e-6)
    with pytest.raises(VolumeError, match="the limit of the cache"):
        read_volume(path)


@pytest.mark.skipif(sys.platform == "win32", reason="limits of file sizes are POSIX")
def test_a_disk_that_fills_up_meanwhile_ends_in_one_sentence(folder: Path, tmp_path: Path) -> None:
    import resource

    path = packed(tmp_path, "a.nrrd")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(GpError, match=r"cannot hold the unpacked scan.*setting cache"):
            read_volume(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(folder.iterdir()) == []


def test_a_folder_that_cannot_be_made_ends_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("GP_LABELER_CACHE", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(disk_cache, "available_memory", lambda: 1000.0)
    with pytest.raises(GpError, match="cannot hold the unpacked scan"):
        read_volume(packed(tmp_path, "a.nrrd"))


def test_a_stack_that_breaks_off_half_way_leaves_nothing(folder: Path, tmp_path: Path) -> None:
    path = packed(tmp_path, "stack")
    broken = path / "slice_017.tif"
    broken.write_bytes(broken.read_bytes()[:700])
    with pytest.raises(VolumeError, match=r"slice_017\.tif"):
        read_volume(path, spacing=SPACING)
    assert not folder.exists() or list(folder.iterdir()) == []
