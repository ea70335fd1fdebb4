"""Voxels in memory and voxels left in their file are one scan: the same values, slices and surfaces."""

from __future__ import annotations

import ctypes
import mmap
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import SimpleITK
import tifffile

from gp_core.errors import GpError
from gp_labeler.imaging import readers, voxels
from gp_labeler.imaging.bone_distance import bone_distances
from gp_labeler.imaging.histogram import histogram_of
from gp_labeler.imaging.mapped_file import MappedFile
from gp_labeler.imaging.progress import Cancelled, Report
from gp_labeler.imaging.readers import VolumeError, read_volume
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.threshold import propose_threshold
from gp_labeler.imaging.volume import Volume
from gp_labeler.imaging.voxels import ArrayVoxels, GreyArray, MappedVoxels
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.slices import VolumeSlicer

SIZE, SPACING = (44, 38, 33), (0.5, 0.5, 0.6)
TURNED = (0.8, -0.6, 0.0, 0.6, 0.8, 0.0, 0.0, 0.0, 1.0)
"""A head that was scanned askew: slices along the body are cut across the voxels."""


def ball(dtype: str = "int16") -> GreyArray:
    """A ball of bone in air with a little noise; outside the scanner's circle stands -2000, where it fits."""
    k, j, i = np.indices(SIZE[::-1])
    away = np.sqrt((i - 21) ** 2 + (j - 19) ** 2 + (k - 16) ** 2)
    grey = np.random.default_rng(1).normal(0, 8, away.shape) + np.where(away < 11, 900, 40)
    if np.dtype(dtype).kind != "u":
        grey[:, np.hypot(i[0] - 21.5, j[0] - 18.5) > 18] = -2000
    return grey.clip(0 if np.dtype(dtype).kind == "u" else None, None).astype(dtype)


def written(path: Path, array: GreyArray, *, packed: bool = False, turned: bool = False) -> Path:
    image = SimpleITK.GetImageFromArray(array)
    image.SetSpacing(SPACING)
    image.SetOrigin((-2.0, 1.0, 3.0))
    if turned:
        image.SetDirection(TURNED)
    SimpleITK.WriteImage(image, str(path), packed)
    return path


def big_endian(path: Path, array: GreyArray) -> Path:
    """Write a raw NRRD whose numbers have their high byte first."""
    head = (
        f"NRRD0004\ntype: int16\ndimension: 3\nspace: left-posterior-superior\n"
        f"sizes: {' '.join(map(str, SIZE))}\nspace directions: (0.5,0,0) (0,0.5,0) (0,0,0.6)\n"
        "space origin: (-2,1,3)\nkinds: domain domain domain\nendian: big\nencoding: raw\n\n"
    )
    path.write_bytes(head.encode() + array.astype(">i2").tobytes())
    return path


def assert_same_scan(mapped: Volume, held: Volume) -> None:
    """Everything that is measured and shown is the same."""
    assert isinstance(mapped.voxels, MappedVoxels)
    assert isinstance(held.voxels, ArrayVoxels)
    assert (mapped.size, mapped.dtype, mapped.fill) == (held.size, held.dtype, held.fill)
    assert mapped.checksum == held.checksum
    assert mapped.intensity_range == held.intensity_range
    np.testing.assert_array_equal(mapped.array, held.array)
    np.testing.assert_array_equal(histogram_of(mapped).heights, histogram_of(held).heights)
    threshold = propose_threshold(held)
    assert propose_threshold(mapped) == threshold
    points = {"CA": held.voxel_to_scan([[20.0, 18, 15]])[0], "IN": held.voxel_to_scan([[2.0, 18, 15]])[0]}
    assert bone_distances(mapped, threshold, points) == bone_distances(held, threshold, points)
    for stride in (1, 2):
        one, other = (extract_isosurface(v, threshold, stride=stride).points for v in (mapped, held))
        np.testing.assert_array_equal(one, other)
    for plane in (plane.in_scan for plane in Plane):
        position = plane.position_of(held.extent.mean(axis=0))
        one, other = (VolumeSlicer(v).image(plane, position) for v in (mapped, held))
        np.testing.assert_allclose(one.values, other.values, atol=1)
        np.testing.assert_array_equal(one.edges, other.edges)


@pytest.mark.parametrize("dtype", ["int16", "uint8", "uint16", "float32"])
@pytest.mark.parametrize("suffix", [".nrrd", ".mha", ".mhd", ".nii"])
def test_a_mapped_file_is_the_scan_that_is_read(suffix: str, dtype: str, tmp_path: Path) -> None:
    path = written(tmp_path / f"ball{suffix}", ball(dtype))
    assert_same_scan(read_volume(path, mapped=True), read_volume(path, mapped=False))


@pytest.mark.parametrize(
    "options",
    [{"reverse": True}, {"stride": 2}, {"region": ((4, 40), (2, 36), (3, 30)), "stride": 3, "reverse": True}],
    ids=str,
)
def test_parts_of_a_file_and_reversed_slices_can_be_mapped(options: dict, tmp_path: Path) -> None:
    path = written(tmp_path / "ball.nrrd", ball())
    one, other = (read_volume(path, mapped=mapped, **options) for mapped in (True, False))
    np.testing.assert_array_equal(one.array, other.array)
    assert one.checksum == other.checksum
    np.testing.assert_allclose(one.T_scan_voxel, other.T_scan_voxel)


def test_the_byte_order_of_another_machine_is_read_as_ours(tmp_path: Path) -> None:
    path = big_endian(tmp_path / "ball.nrrd", ball())
    assert_same_scan(read_volume(path, mapped=True), read_volume(path, mapped=False))


def test_slices_across_the_voxels_of_a_mapped_file_are_interpolated(tmp_path: Path) -> None:
    path = written(tmp_path / "ball.nrrd", ball(), turned=True)
    mapped, held = read_volume(path, mapped=True), read_volume(path, mapped=False)
    assert all(VolumeSlicer(held).is_oblique(plane.in_scan) for plane in Plane)
    assert_same_scan(mapped, held)


@pytest.mark.parametrize("name", ["packed.nrrd", "packed.mha", "packed.nii.gz", "scaled.nii"])
def test_what_cannot_be_mapped_is_refused_in_one_sentence(name: str, tmp_path: Path) -> None:
    path = written(tmp_path / name, ball(), packed=name.startswith("packed"))
    if name == "scaled.nii":
        raw = bytearray(path.read_bytes())
        raw[112:120] = np.array([2.0, 1.0], "<f4").tobytes()  # scl_slope, scl_inter
        path.write_bytes(raw)
    with pytest.raises(VolumeError, match=r"cannot be shown as they are stored.*raw NRRD"):
        read_volume(path, mapped=True)
    assert isinstance(read_volume(path).voxels, ArrayVoxels)


def test_large_scans_stay_in_their_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path / "ball.nrrd", ball())
    assert isinstance(read_volume(path).voxels, ArrayVoxels)
    monkeypatch.setattr(readers, "MAPPED_FROM", ball().nbytes)
    volume = read_volume(path)
    assert isinstance(volume.voxels, MappedVoxels)
    assert "its voxels stay in the file" in volume.notes
    assert not volume.known_checksum  # nobody has read all of it


TIFFS = {
    "one piece": {"metadata": None},
    "ImageJ": {"imagej": True},
    "strips": {"rowsperstrip": 7, "metadata": None},
    "big endian": {"byteorder": ">", "metadata": None},
}


@pytest.mark.parametrize("how", [*TIFFS, "page by page"])
def test_uncompressed_tiffs_are_mapped(how: str, tmp_path: Path) -> None:
    path, array = tmp_path / "ball.tif", ball("uint16")
    if how == "page by page":  # the tags of each page stand between it and the next
        with tifffile.TiffWriter(path) as writer:
            for plane in array:
                writer.write(plane, contiguous=False, metadata=None)
    else:
        tifffile.imwrite(path, array, **TIFFS[how])
    mapped = read_volume(path, spacing=SPACING, mapped=True)
    assert_same_scan(mapped, read_volume(path, spacing=SPACING, mapped=False))


@pytest.mark.parametrize("how", [{"compression": "zlib"}, {"photometric": "miniswhite"}], ids=str)
def test_tiffs_that_hold_other_values_are_not_mapped(how: dict, tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "ball.tif", ball("uint16"), metadata=None, **how)
    with pytest.raises(VolumeError, match="cannot be shown as they are stored"):
        read_volume(tmp_path / "ball.tif", spacing=SPACING, mapped=True)


_CUT = """
import os, sys
import numpy as np
from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.slices import VolumeSlicer

volume = read_volume(sys.argv[1], mapped=True)
held = volume.voxels.read(slice(None), slice(None), slice(None))
os.truncate(sys.argv[1], int(sys.argv[2]))
print(held.sum(), "still runs")
for plane in Plane:
    VolumeSlicer(volume).image(plane.in_scan, 3.0).values.sum()
volume.value_at(volume.voxel_to_scan([[10, 10, 30]])[0])
for work in (volume.check, lambda: extract_isosurface(volume, 500.0), lambda: volume.checksum):
    try:
        work()
    except Exception as problem:
        print(type(problem).__name__, problem)
"""


@pytest.mark.parametrize(("left", "options"), [(5000, ("-X", "faulthandler")), (60_000, ())], ids=str)
def test_a_file_that_is_cut_while_mapped_ends_no_program(
    left: int, options: tuple[str, ...], tmp_path: Path
) -> None:
    path = written(tmp_path / "ball.nrrd", ball())
    command = [sys.executable, *options, "-c", _CUT, str(path), str(left)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    first, *told = done.stdout.splitlines()
    assert "still runs" in first
    assert len(told) == 3
    for line in told:
        assert line.startswith("GpError")
        assert f"was truncated while it was open: {left:,} of its" in line
        assert "labels are kept" in line


@pytest.mark.skipif(sys.platform == "win32", reason="files in use cannot be cut")
def test_other_faults_are_left_to_whom_they_belong(tmp_path: Path) -> None:
    path = written(tmp_path / "ball.nrrd", ball())
    (tmp_path / "other").write_bytes(bytes(10_000))
    code = (
        "import os, sys, mmap\nfrom gp_labeler.imaging.readers import read_volume\n"
        "volume = read_volume(sys.argv[1], mapped=True)\nother = open(sys.argv[2], 'r+b')\n"
        "held = mmap.mmap(other.fileno(), 10_000)\nother.truncate(0)\nprint(held[9000])"
    )
    command = [sys.executable, "-c", code, str(path), str(tmp_path / "other")]
    done = subprocess.run(command, capture_output=True, check=False, timeout=120)
    assert done.returncode == -signal.SIGBUS


def test_a_file_that_is_written_to_while_mapped_is_noticed(tmp_path: Path) -> None:
    path = written(tmp_path / "ball.nrrd", ball())
    volume = read_volume(path, mapped=True)
    volume.check()
    with path.open("r+b") as file:
        file.seek(-2, os.SEEK_END)
        file.write(b"\1\1")
    os.utime(path, ns=(1, 1))  # clocks of file systems are coarse
    with pytest.raises(GpError, match="was changed while it was open"):
        volume.check()
    with pytest.raises(GpError, match="was changed while it was open"):
        _ = volume.checksum


def test_another_file_of_the_same_name_changes_nothing(tmp_path: Path) -> None:
    path = written(tmp_path / "ball.nrrd", ball())
    volume = read_volume(path, mapped=True)
    path.unlink()
    path.write_bytes(b"another")
    volume.check()
    np.testing.assert_array_equal(volume.array[:, 10:25, 10:25], ball()[:, 10:25, 10:25])


def test_values_that_are_not_finite_are_found_wherever_they_are(tmp_path: Path) -> None:
    array = ball("float32")
    array[array < -1000] = 0
    array[1, 20, 20] = np.nan  # a slice that is not looked at
    array[1, 20, 21] = np.inf
    path = written(tmp_path / "ball.nrrd", array)
    mapped = read_volume(path, mapped=True).array
    assert np.isfinite(mapped).all()
    assert mapped[1, 20, 20] <= mapped.min()


def test_a_slice_of_a_scan_larger_than_the_memory_reads_few_of_its_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    array = ball("uint8")
    volume = read_volume(written(tmp_path / "ball.nrrd", array), mapped=True)
    middle = volume.extent.mean(axis=0)
    whole = {
        plane: VolumeSlicer(volume).image(plane.in_scan, float(middle @ plane.in_scan.normal))
        for plane in Plane
    }
    monkeypatch.setattr(voxels, "_MOST_READ", array.nbytes / 4)
    volume = read_volume(volume.path, mapped=True)
    for plane, before in whole.items():
        image = VolumeSlicer(volume).image(plane.in_scan, float(middle @ plane.in_scan.normal))
        if plane is Plane.SAGITTAL:
            np.testing.assert_array_equal(image.values, before.values[::2, ::2])
            np.testing.assert_allclose(image.step, 2 * before.step)
        else:
            np.testing.assert_array_equal(image.values, before.values)
        np.testing.assert_allclose(image.origin, before.origin)


def test_a_slice_that_takes_long_is_coarse_at_first_and_whole_once_it_was_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    array = ball("int16")  # some of it was not measured: whole slices are looked through for that
    monkeypatch.setattr(voxels, "_MOST_AT_ONCE", 1)
    monkeypatch.setattr(voxels, "_GLANCE", array.nbytes / 25)
    volume = read_volume(written(tmp_path / "ball.nrrd", array), mapped=True)
    slicer, middle = VolumeSlicer(volume), volume.extent.mean(axis=0)
    planes = {plane: (plane.in_scan, float(middle @ plane.in_scan.normal)) for plane in Plane}
    whole = {plane: slicer.image(*where) for plane, where in planes.items()}
    first = {plane: slicer.image(*where, at_once=True) for plane, where in planes.items()}
    assert [plane for plane, image in first.items() if image.unread is not None] == [Plane.SAGITTAL]
    coarse, fine = first[Plane.SAGITTAL], whole[Plane.SAGITTAL]
    assert coarse.values.size < fine.values.size / 16
    at = fine.plane.scan(coarse.origin + coarse.step * np.indices((5, 5)).T.reshape(-1, 2), fine.position)
    np.testing.assert_array_equal(volume.values_at(at).reshape(5, 5), coarse.values[:5, :5])
    with pytest.raises(Cancelled):
        volume.voxels.read_ahead(coarse.unread, Report(None, lambda: True))
    assert volume.voxels.is_unread(coarse.unread)
    volume.voxels.read_ahead(coarse.unread, Report())
    after = slicer.image(*planes[Plane.SAGITTAL], at_once=True)
    assert after.unread is None
    np.testing.assert_array_equal(after.values, fine.values)


def pages_held(path: Path) -> int:
    """Return how many pages of a file the system has in memory."""
    held = np.memmap(path, np.uint8, "r")
    pages = np.zeros(-(-held.size // mmap.PAGESIZE), np.uint8)
    libc = ctypes.CDLL(None, use_errno=True)
    address, size, out = (
        ctypes.c_void_p(held.ctypes.data),
        ctypes.c_size_t(held.size),
        ctypes.c_void_p(pages.ctypes.data),
    )
    assert libc.mincore(address, size, out) == 0
    return int((pages & 1).sum())


def left_on_disk(path: Path) -> None:
    """Have the system forget what it holds of a file; skip where it cannot."""
    with path.open("rb") as file:
        os.fsync(file.fileno())
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    if pages_held(path):
        pytest.skip("this file system keeps files in memory")


@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux what it holds of a file")
@pytest.mark.parametrize("what", ["sample", "first look", "coronal"])
def test_a_few_rows_bring_no_more_of_a_file_than_their_own_pages(
    tmp_path: Path, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(voxels, "_MOST_AT_ONCE", 1)
    path, n_voxels = tmp_path / "scan.raw", 1 << 25
    path.write_bytes(bytes(2 * n_voxels))
    left_on_disk(path)
    file = MappedFile(path, 2 * n_voxels)
    scan = MappedVoxels(file.array(np.dtype(np.int16), 0, (128, 512, 512)), file=file)
    if what == "sample":
        n_rows = len(scan.rows(20_000)) // 512
    elif what == "first look":
        n_rows = scan.read(slice(None, None, 16), slice(None, None, 16), slice(100, 101)).copy().size
    else:
        n_rows = len(scan.read(slice(None), slice(200, 201), slice(None)).copy())
    assert n_rows <= pages_held(path) <= 2 * n_rows


class InParts(ArrayVoxels):
    """Refuses to be read as a whole, as a scan larger than the memory would."""

    def read(self, k: slice, j: slice, i: slice) -> GreyArray:
        part = super().read(k, j, i)
        if part.size > self.size / 4:
            raise MemoryError("somebody asks for the whole scan")
        return part


def test_slices_measures_and_surfaces_never_ask_for_the_whole_scan() -> None:
    rng = np.random.default_rng(0)
    array = rng.normal(0, 5, (170, 160, 150)).astype(np.float32)  # larger than every subsample
    array[60:100, 60:100, 60:100] += 500
    volume = Volume(InParts(array), np.diag([0.1, 0.1, 0.1, 1.0]))
    assert volume.intensity_range[0] < 0
    threshold = propose_threshold(volume)
    assert 100 < threshold < 400
    assert histogram_of(volume).high > threshold
    centre = volume.voxel_to_scan([[80.0, 80, 80]])[0]
    assert bone_distances(volume, threshold, {"CA": centre}) == {"CA": 0.0}
    assert volume.value_at(centre) > 400
    for plane in (plane.in_scan for plane in Plane):
        assert VolumeSlicer(volume).image(plane, plane.position_of(centre)).values.max() > 400
    box = np.stack([centre - 2.5, centre + 2.5])
    assert extract_isosurface(volume, threshold, box=box, smallest_mm=0).n_triangles


@pytest.mark.parametrize("n", [1, 5000, 10**4, 10**7])
def test_rows_are_the_same_however_they_are_read(n: int) -> None:
    array = ball()
    one, other = ArrayVoxels(array).rows(n), MappedVoxels(array).rows(n)
    np.testing.assert_array_equal(one, other)
    assert len(one) <= max(n, array.shape[2])
    if n > array.size:
        np.testing.assert_array_equal(one, array.reshape(-1))


def test_rows_come_from_everywhere() -> None:
    nz, ny, nx = 33, 38, 44
    numbers = np.broadcast_to(np.arange(nz * ny)[:, None], (nz * ny, nx)).reshape(nz, ny, nx)
    k, j = divmod(ArrayVoxels(numbers).rows(10**4).reshape(-1, nx)[:, 0], ny)
    assert set(k) == set(range(nz))
    assert len(set(j)) == ny
