"""Measure opening, meshing and memory of large scans against plain SimpleITK and VTK, in one interleaved run.

Run from the top of a checkout: ``python benchmarks/big_scans.py [CASE ...] [--runs 3] [--folder DIR]``. It
needs 4 GB of disk, and no display. Without a case it does all of them; ``--list`` names them. ``--types``
prints the memory that a surface takes by type of voxel instead.

Every figure is CPU seconds of a process of its own, all threads together, without imports; ours and the
peer's take turns, and the median counts. Memory is the peak of anonymous and shared memory over that after
the imports: pages of a mapped file are none, for the system takes them back.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT)]

import numpy as np  # noqa: E402

from gp_core.validation import FloatArray  # noqa: E402

SPACING, THRESHOLD = 0.03, 1000.0
HEAD_THRESHOLD = 21354.0
HEAD = 0
"""Stands for the synthetic head."""

HEAD_MM = float(os.environ.get("GP_HEAD_MM", "0.1"))
"""Its voxels; 0.2 for a machine that is busy."""

MB = 1e6


@dataclass(frozen=True)
class Case:
    """What is measured, against what, and the ratio aimed at."""

    title: str
    n: int
    ours: str
    peer: str
    goal: float
    at_least: bool = False


CASES = {
    "slices-2gb": Case("1000³, raw: three slices", 1000, "our_slices", "plain_slices", 0.2),
    "bone-2gb": Case("1000³, raw: first bone", 1000, "our_first_bone", "plain_bone", 0.4),
    "slices-512": Case("512³: three slices", 512, "our_slices", "plain_slices", 1.3),
    "bone-512": Case("512³: bone, overview", 512, "our_overview", "plain_bone", 1.2),
    "mesh": Case("surface for mesh and save", HEAD, "our_mesh", "flying_edges", 1.15),
    "islands": Case("islands dropped", HEAD, "our_islands", "flying_edges", 1.3),
    "pick": Case("islands dropped, search structure", HEAD, "our_first_pick", "flying_edges", 1.3),
    "clicks": Case("100 clicks refined, of 30 ms each", HEAD, "our_clicks", "waiting", 1.0),
    "skimage": Case("scikit-image's marching cubes", HEAD, "skimage", "our_mesh", 5.0, True),
    "pyvista": Case("pyvista's default contour", HEAD, "pyvista", "our_mesh", 3.0, True),
    "pyvista-same": Case("pyvista, normals, no scalars", HEAD, "pyvista_same", "our_mesh", 3.0, True),
    "mesh-edges": Case("edges: surface for mesh and save", 512, "our_mesh", "flying_edges", 1.15),
    "islands-edges": Case("edges: islands dropped", 512, "our_islands", "flying_edges", 1.3),
    "pick-edges": Case("edges: and search structure", 512, "our_first_pick", "flying_edges", 1.3),
    "skimage-edges": Case("edges: scikit-image", 512, "skimage", "our_mesh", 5.0, True),
    "pyvista-edges": Case("edges: pyvista's default", 512, "pyvista", "our_mesh", 3.0, True),
    "same-edges": Case("edges: pyvista, normals", 512, "pyvista_same", "our_mesh", 3.0, True),
}

TYPES = ("uint8", "int16", "uint16", "int32", "uint32", "int64", "float32", "float64")


# What is measured, each in a process of its own: the imports, then the work


def our_slices(path: str) -> Callable[[], Any]:
    """Cut three slices at full resolution, as 8-bit pictures."""
    import gp_labeler.imaging.readers.probe  # noqa: F401
    from gp_labeler.imaging.map_guard import maps_can_be_guarded
    from gp_labeler.imaging.readers import read_volume
    from gp_labeler.scene.planes import Plane
    from gp_labeler.scene.slices import VolumeSlicer
    from gp_labeler.scene.window_level import WindowLevel

    maps_can_be_guarded()

    def work() -> Any:
        volume = read_volume(path)
        window, slicer = WindowLevel.of(volume), VolumeSlicer(volume)
        middle, planes = volume.extent.mean(axis=0), [plane.in_scan for plane in Plane]
        return volume, [slicer.image(plane, plane.position_of(middle)).grey(window) for plane in planes]

    return work


def plain_slices(path: str) -> Callable[[], Any]:
    """Do the same as a short script would: SimpleITK reads, VTK cuts and maps the grey values."""
    read = _plain_reader(path)
    from vtkmodules.vtkImagingColor import vtkImageMapToWindowLevelColors
    from vtkmodules.vtkImagingCore import vtkImageReslice

    def work() -> Any:
        array, image = read()
        low, high = np.percentile(array[::8, ::8, ::8], (0.1, 99.9))
        pictures = []
        for axes in ((1, 0, 0, 0, 1, 0, 0, 0, 1), (1, 0, 0, 0, 0, 1, 0, -1, 0), (0, 1, 0, 0, 0, 1, 1, 0, 0)):
            reslice, grey = vtkImageReslice(), vtkImageMapToWindowLevelColors()
            reslice.SetInputData(image)
            reslice.SetOutputDimensionality(2)
            reslice.SetResliceAxesDirectionCosines(*axes)
            reslice.SetResliceAxesOrigin(*image.GetCenter())
            grey.SetInputConnection(reslice.GetOutputPort())
            grey.SetWindow(high - low)
            grey.SetLevel((low + high) / 2)
            grey.Update()
            pictures.append(grey.GetOutput())
        return array, pictures

    return work


def our_first_bone(path: str) -> Callable[[], Any]:
    """Make the bone that is shown first."""
    from gp_labeler.jobs.mesh import FIRST_LOOK_VOXELS

    return _our_bone(path, FIRST_LOOK_VOXELS)


def our_overview(path: str) -> Callable[[], Any]:
    """Make the bone that is turned."""
    from gp_labeler.imaging.surface import OVERVIEW_VOXELS

    return _our_bone(path, OVERVIEW_VOXELS)


def _our_bone(path: str, n_voxels: int) -> Callable[[], Any]:
    import pyvista  # noqa: F401 - imported before, as in the window

    import gp_labeler.imaging.islands
    import gp_labeler.imaging.readers.probe  # noqa: F401
    from gp_labeler.imaging import coarse
    from gp_labeler.imaging.map_guard import maps_can_be_guarded
    from gp_labeler.imaging.readers import read_volume
    from gp_labeler.imaging.surface import extract_isosurface, overview_stride

    maps_can_be_guarded()
    small = _cube_and_speck()
    for stride in (1, 2):
        extract_isosurface(small, THRESHOLD, stride=stride)
    coarse.means_of_cubes(np.asarray(small.array), 2)

    def work() -> Any:
        volume = read_volume(path)
        return volume, extract_isosurface(volume, THRESHOLD, stride=overview_stride(volume, n_voxels))

    return work


def _cube_and_speck() -> Any:
    """Return a small scan whose mesh loads all kernels from their cache: a first look does so before."""
    from gp_labeler.imaging.volume import Volume

    small = np.zeros((24, 24, 24), np.uint16)
    small[8:16, 8:16, 8:16] = small[2:4, 2:4, 2:4] = 2000
    return Volume.from_parts(small, [0.3] * 3)


def plain_bone(path: str) -> Callable[[], Any]:
    """Do it as a short script would: SimpleITK reads, VTK shrinks to our overview and contours."""
    read = _plain_reader(path)
    from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D
    from vtkmodules.vtkImagingCore import vtkImageShrink3D

    def work() -> Any:
        array, image = read()
        shrink, contour = vtkImageShrink3D(), vtkFlyingEdges3D()
        shrink.SetInputData(image)
        shrink.SetShrinkFactors(*[max(1, round(array.shape[0] / 256))] * 3)
        shrink.AveragingOn()
        contour.SetInputConnection(shrink.GetOutputPort())
        contour.SetValue(0, THRESHOLD)
        contour.Update()
        return array, contour.GetOutput()

    return work


def _plain_reader(path: str) -> Callable[[], Any]:
    import SimpleITK
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData

    def read() -> Any:
        scan = SimpleITK.ReadImage(path)
        array = SimpleITK.GetArrayViewFromImage(scan)
        image = vtkImageData()
        image.SetDimensions(array.shape[::-1])
        image.SetSpacing(scan.GetSpacing())
        image.GetPointData().SetScalars(numpy_to_vtk(array.reshape(-1)))
        image.scan = scan
        return array, image

    return read


def _volume(path: str) -> Any:
    from gp_labeler.imaging.readers import read_volume

    return read_volume(path, mapped=False)


def _threshold(path: str) -> float:
    """Return where bone begins in one of the scans."""
    name = Path(path).stem
    return HEAD_THRESHOLD if name.startswith("head") else THRESHOLD / (8 if name.endswith("uint8") else 1)


def our_mesh(path: str) -> Callable[[], Any]:
    """Make the whole surface at full resolution, as for a file."""
    return _our_surface(path, smallest_mm=0.0)


def our_islands(path: str) -> Callable[[], Any]:
    """Make the whole surface without its small parts."""
    return _our_surface(path, smallest_mm=1.0)


def our_first_pick(path: str) -> Callable[[], Any]:
    """Make it and the search structure, as before the window shows it; a first look loads kernels before."""
    from gp_labeler.imaging.surface import extract_isosurface

    extract_isosurface(_cube_and_speck(), THRESHOLD).prepare()
    surface = _our_surface(path, smallest_mm=1.0)
    return lambda: surface().prepare()


def _our_surface(path: str, **how: float) -> Callable[[], Any]:
    from gp_labeler.imaging.surface import extract_isosurface

    volume = _volume(path)
    extract_isosurface(_cube_and_speck(), THRESHOLD)
    return lambda: extract_isosurface(volume, _threshold(path), **how)


def flying_edges(path: str) -> Callable[[], Any]:
    """Plain `vtkFlyingEdges3D`, on as many threads as ours."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkSMPTools
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D

    volume = _volume(path)
    vtkSMPTools.SetBackend("STDThread")
    image = vtkImageData()
    image.SetDimensions(volume.size)
    image.SetSpacing(volume.spacing)
    image.GetPointData().SetScalars(numpy_to_vtk(volume.array.reshape(-1)))

    def work() -> Any:
        contour = vtkFlyingEdges3D()
        contour.SetInputData(image)
        contour.SetValue(0, _threshold(path) - 0.5)
        contour.ComputeScalarsOff()
        contour.Update()
        return contour.GetOutput()

    return work


def skimage(path: str) -> Callable[[], Any]:
    """`skimage.measure.marching_cubes`."""
    from skimage import measure

    array, find = _volume(path).array.astype(np.float32), measure.marching_cubes  # its own type
    find(np.asarray(array[:24, :24, :24]), float(array[:24, :24, :24].mean()))
    return lambda: find(array, _threshold(path) - 0.5)  # type: ignore[no-untyped-call]


def pyvista(path: str) -> Callable[[], Any]:
    """`pyvista.ImageData.contour` as it is by default: without normals, with scalars."""
    image = _volume(path).to_pyvista()
    return lambda: image.contour([_threshold(path) - 0.5])


def pyvista_same(path: str) -> Callable[[], Any]:
    """Let it make what ours makes: with normals, without scalars."""
    image = _volume(path).to_pyvista()
    return lambda: image.contour([_threshold(path) - 0.5], compute_normals=True, compute_scalars=False)


def our_clicks(path: str) -> Callable[[], Any]:
    """Bring 100 clicks on the overview to the surface of the full data."""
    from gp_labeler.imaging.refined_pick import refined_hit
    from gp_labeler.imaging.surface import extract_isosurface, overview_stride

    volume, rng = _volume(path), np.random.default_rng(0)
    overview = extract_isosurface(volume, HEAD_THRESHOLD, stride=overview_stride(volume)).prepare()
    rays: list[Any] = []
    while len(rays) < 100:
        towards = rng.normal(size=3)
        towards /= np.linalg.norm(towards)
        start = volume.extent.mean(axis=0) - 200 * towards + rng.uniform(-8, 8, 3)
        if (hit := overview.pick(start, towards)) is not None:
            rays.append((hit, towards))
    refined_hit(volume, HEAD_THRESHOLD, *rays[0])
    return lambda: [refined_hit(volume, HEAD_THRESHOLD, *ray) for ray in rays]


def waiting(path: str) -> Callable[[], Any]:
    """Use 3 s of CPU: what 100 clicks may take, at 30 ms each."""

    def work() -> Any:
        end = time.process_time() + 3.0
        while time.process_time() < end:
            pass

    return work


# Measuring


def measured(name: str, path: str) -> dict[str, float]:
    """Do one thing in this process; return its CPU seconds, seconds and peak of memory, MB."""
    work = globals()[name](path)
    before, begun, used = anonymous_mb(), time.perf_counter(), _cpu()
    peak, done = [before], threading.Event()

    def watch() -> None:
        while not done.wait(0.01):
            peak[0] = max(peak[0], anonymous_mb())

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    kept = work()
    done.set()
    watcher.join()
    cpu, seconds = _cpu() - used, time.perf_counter() - begun
    peak[0] = max(peak[0], anonymous_mb())
    mesh = getattr(kept, "mesh", None)
    mesh_mb = 0.0 if mesh is None else mesh.GetActualMemorySize() * 1024 / MB
    del kept
    return {"cpu": cpu, "seconds": seconds, "mb": peak[0] - before, "mesh_mb": mesh_mb}


def _cpu() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def anonymous_mb() -> float:
    """Return the anonymous and shared memory of this process."""
    status = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    lines = [line.split() for line in status if line.startswith(("RssAnon", "RssShmem"))]
    return sum(int(line[1]) for line in lines) * 1024 / MB


def in_process(name: str, path: Path) -> dict[str, float]:
    """Do one thing in a new process."""
    command = [sys.executable, __file__, "--do", name, "--file", str(path)]
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode:
        raise SystemExit(done.stderr)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def scan_file(folder: Path, n: int) -> Path:
    """Write a raw NRRD of n³ 16-bit voxels: shells of bone in tissue, and noise; return its path."""
    path = folder / (f"scan-{n}.nrrd" if n else f"head-{HEAD_MM:g}.nrrd")
    if path.exists():
        return path
    if not n:
        return _head(path)
    head = (
        f"NRRD0004\ntype: uint16\ndimension: 3\nspace: left-posterior-superior\nsizes: {n} {n} {n}\n"
        f"space directions: ({SPACING},0,0) (0,{SPACING},0) (0,0,{SPACING})\nkinds: domain domain domain\n"
        "endian: little\nencoding: raw\nspace origin: (0,0,0)\n\n"
    )
    noise = np.random.default_rng(0).normal(0, 40, (n, n)).astype(np.float32)
    wave = np.cos(np.arange(n, dtype=np.float32) * (2 * np.pi * 4 / n))
    away = np.hypot(*np.meshgrid(*[np.linspace(-1, 1, n, dtype=np.float32)] * 2))
    with path.with_suffix(".part").open("wb") as file:
        file.write(head.encode())
        for k in range(n):
            plane = _plane(wave, away, wave[k], 2 * k / n - 1)
            file.write((plane + np.roll(noise, (37 * k, 11 * k), (0, 1))).clip(0).astype("<u2").tobytes())
    path.with_suffix(".part").rename(path)
    return path


def typed_file(folder: Path, name: str) -> Path:
    """Write the scan of 256³ voxels as voxels of another type, and return its path."""
    plain = scan_file(folder, 256)
    path = folder / f"scan-256-{name}.nrrd"
    head, _, voxels = plain.read_bytes().partition(b"\n\n")
    values = np.frombuffer(voxels, "<u2") // (8 if name == "uint8" else 1)
    head = head.replace(str(SPACING).encode(), b"0.05")  # shorter than a head could be, else
    nrrd = {"float32": "float", "float64": "double"}.get(name, name)
    header = head.replace(b"type: uint16", f"type: {nrrd}".encode())
    path.write_bytes(header + b"\n\n" + values.astype(name).tobytes())
    return path


def show_types(folder: Path) -> None:
    """Print the memory above scan and mesh that a surface takes at most, by type of voxel."""
    print(f"{'voxels':<10}{'scan, MB':>10}{'mesh, MB':>10}{'peak, MB':>10}{'of scan':>10}{'besides':>10}")
    for name in TYPES:
        path = typed_file(folder, name)
        scan, found = path.stat().st_size / MB, in_process("our_islands", path)
        besides = found["mb"] - found["mesh_mb"]
        print(
            f"{name:<10}{scan:>10.0f}{found['mesh_mb']:>10.0f}{found['mb']:>10.0f}"
            f"{found['mb'] / scan:>10.2f}{besides:>10.0f}",
            flush=True,
        )
        path.unlink()


def _head(path: Path) -> Path:
    import SimpleITK

    from gp_labeler.phantom import make_phantom

    volume = make_phantom(0, spacing=HEAD_MM).volume
    scan = SimpleITK.GetImageFromArray(volume.array)
    scan.SetSpacing(volume.spacing)
    SimpleITK.WriteImage(scan, str(path), False)
    return path


def _plane(wave: FloatArray, away: FloatArray, at: float, z: float) -> FloatArray:
    field = np.abs(wave[:, None] + wave[None, :] + at)
    bone = (field < 0.35) & (away**2 + z**2 < 0.8)
    return np.where(bone, np.float32(1600), np.float32(400))


def show(name: str, folder: Path, runs: int) -> None:
    """Print a row: CPU seconds of ours and the peer's, their ratio, the goal, and memory."""
    case = CASES[name]
    path = scan_file(folder, case.n)
    ours, peers = [], []
    for _ in range(runs):
        ours.append(in_process(case.ours, path))
        peers.append(in_process(case.peer, path))
    mine, peer = (float(np.median([run["cpu"] for run in found])) for found in (ours, peers))
    volume_mb = path.stat().st_size / MB
    mb, their_mb = (float(np.median([run["mb"] for run in found])) for found in (ours, peers))
    goal = f"{'>=' if case.at_least else '<='} {case.goal:g}"
    print(
        f"{name:<15}{case.title:<34}{mine:>8.2f}{peer:>8.2f}{mine / peer:>8.2f}{goal:>9}"
        f"{mb:>9.0f}{mb / volume_mb:>8.2f}{their_mb / volume_mb:>8.2f}",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("cases", nargs="*", default=[], help="which; all by default")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--folder", type=Path, help="where the scans are kept; thrown away by default")
    parser.add_argument("--types", action="store_true", help="memory of a surface, by type of voxel")
    parser.add_argument("--list", action="store_true", help="name the cases")
    parser.add_argument("--do", help=argparse.SUPPRESS)
    parser.add_argument("--file", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.do:
        print(json.dumps(measured(options.do, options.file)))
        return
    if options.list:
        print(*(f"{name:<15}{case.title}" for name, case in CASES.items()), sep="\n")
        return
    with tempfile.TemporaryDirectory() as thrown_away:
        folder = options.folder or Path(thrown_away)
        if options.types:
            show_types(folder)
            return
        print(f"{os.cpu_count()} cores; CPU seconds, median of {options.runs}")
        print(f"{'':<49}{'ours':>8}{'peer':>8}{'ratio':>8}{'goal':>9}{'MB':>9}{'of scan':>8}{'peer':>8}")
        for name in options.cases or CASES:
            show(name, folder, options.runs)


if __name__ == "__main__":
    main()
