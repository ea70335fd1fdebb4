"""Scanco files: a header made by hand, and what itk-ioscanco makes of the same where it is installed."""

from __future__ import annotations

import importlib.util
import struct
from pathlib import Path

import numpy as np
import pytest
from scan_makers import Scan, cropped

from gp_labeler.imaging.readers import VolumeError, inspect_volume, read_volume

EXTENT_UM = (10_160, 9_313, 8_607)


def write_isq(scan: Scan, path: Path, *, blocks: int = 0, extent: tuple[int, int, int] = EXTENT_UM) -> Path:
    head = bytearray(512 * (blocks + 1))
    head[:16] = b"CTDATA-HEADER_V1"
    struct.pack_into("<i", head, 16, 3)
    struct.pack_into("<6i", head, 44, *scan.array.shape[::-1], *extent)
    struct.pack_into("<4i", head, 80, 0, -100, 30_000, 4096)
    struct.pack_into("<i", head, 508, blocks)
    path.write_bytes(bytes(head) + scan.array.astype("<i2").tobytes())
    return path


@pytest.mark.parametrize("name", ["C0001.ISQ", "C0001.ISQ;1", "scan.rsq", "nameless"])
@pytest.mark.parametrize("blocks", [0, 7])
def test_isq_is_read_in_mm(name: str, blocks: int, tmp_path: Path) -> None:
    scan = cropped("int16", 100)
    path = write_isq(scan, tmp_path / name, blocks=blocks)
    plan = inspect_volume(path)
    assert plan.format == "Scanco ISQ"
    assert not plan.errors
    volume = read_volume(plan)
    np.testing.assert_array_equal(volume.array, scan.array)
    assert volume.spacing == pytest.approx(tuple(np.array(EXTENT_UM) / scan.array.shape[::-1] / 1000))
    assert volume.name == name.partition(".")[0]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # an error while SWIG sets up its types ends the interpreter
def test_itk_ioscanco_sees_the_same(tmp_path: Path) -> None:
    itk = pytest.importorskip("itk", reason="itk-ioscanco is not installed")
    if not hasattr(itk, "ScancoImageIO"):
        pytest.skip("itk-ioscanco is not installed")
    scan = cropped("int16", 100)
    path = write_isq(scan, tmp_path / "C1.isq", blocks=3)
    image = itk.imread(str(path), imageio=itk.ScancoImageIO.New())
    volume = read_volume(path)
    assert volume.spacing == pytest.approx(tuple(image.GetSpacing()))
    np.testing.assert_allclose(volume.origin, list(image.GetOrigin()))
    theirs = np.asarray(image).astype(float)
    slope, shift = np.polyfit(volume.array.ravel(), theirs.ravel(), 1)
    np.testing.assert_allclose(volume.array * slope + shift, theirs, atol=1)


def test_a_short_or_broken_isq_is_refused(tmp_path: Path) -> None:
    path = write_isq(cropped("int16"), tmp_path / "C1.isq")
    whole = path.read_bytes()
    path.write_bytes(whole[:-2])
    with pytest.raises(VolumeError, match=r"C1.isq: holds [\d,]+ bytes, but [\d,]+ are needed"):
        read_volume(path)
    path.write_bytes(whole[:200])
    with pytest.raises(VolumeError, match="its header is incomplete"):
        read_volume(path)
    path.write_bytes(whole[:44] + bytes(12) + whole[56:])
    with pytest.raises(VolumeError, match="0 x 0 x 0 voxels"):
        read_volume(path)


def test_an_isq_without_its_size_in_mm_is_asked_for(tmp_path: Path) -> None:
    path = write_isq(cropped("int16"), tmp_path / "C1.isq", extent=(0, 0, 0))
    with pytest.raises(VolumeError, match=r"the voxel size is not in the file.*--spacing"):
        read_volume(path)


def test_aim_without_its_package_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.aim").write_bytes(b"AIMDATA_V030   \0" + bytes(1000))

    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr("gp_labeler.imaging.readers.scanco.importlib.import_module", missing)
    with pytest.raises(
        VolumeError, match=r"needs the package itk-ioscanco.*pip install gp-labeler\[scanco\]"
    ):
        inspect_volume(tmp_path / "a.aim")


@pytest.mark.skipif(importlib.util.find_spec("itk") is None, reason="itk-ioscanco is not installed")
@pytest.mark.filterwarnings("ignore")
def test_a_broken_aim_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.aim").write_bytes(b"AIMDATA_V030   \0" + bytes(1000))
    with pytest.raises(VolumeError, match=r"a.aim: "):
        inspect_volume(tmp_path / "a.aim")
