"""The isosurface: equal to the reference's, outward however the axes point, quick and right to pick."""

from __future__ import annotations

import gc
import json
import threading
import time
import weakref
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from vtkmodules.vtkCommonDataModel import vtkCellArray
from vtkmodules.vtkIOGeometry import vtkSTLReader
from vtkmodules.vtkIOPLY import vtkPLYReader
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from gp_core.errors import GeometryError, GpError
from gp_labeler.imaging.progress import Cancelled
from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.surface import METHODS, Surface, box_around, extract_isosurface, overview_stride
from gp_labeler.imaging.triangle_search import TriangleSearch
from gp_labeler.imaging.volume import Volume
from gp_labeler.imaging.vtk_arrays import to_numpy

OBLIQUE = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
DIRECTIONS = {
    "straight": np.eye(3),
    "flipped": np.diag([-1.0, -1.0, 1.0]),
    "mirrored": np.diag([1.0, 1.0, -1.0]),
    "permuted": np.eye(3)[[1, 0, 2]],
    "oblique": OBLIQUE,
    "oblique mirrored": OBLIQUE @ np.diag([-1.0, 1.0, 1.0]),
}
CENTRE, RADIUS = np.array([30.0, -20.0, 12.0]), 4.0


def ball(direction: np.ndarray, *, spacing: tuple[float, float, float] = (0.3, 0.25, 0.4)) -> Volume:
    """Make a volume whose surface at 0 is a ball of known centre and radius, in physical space."""
    size = np.array([36, 44, 30])
    origin = CENTRE - direction @ ((size - 1) / 2 * spacing)
    grid = np.moveaxis(np.indices(size[::-1]), 0, -1)[..., ::-1] * spacing
    points = grid @ direction.T + origin
    values = RADIUS - np.linalg.norm(points - CENTRE, axis=-1)
    return Volume.from_parts(values.astype(np.float32), spacing, origin, direction)


@pytest.fixture(scope="module")
def mouse(shared_data: Path) -> Volume:
    return read_volume(shared_data / "mouse_ct" / "C57BL6_J_.nii.gz")


def _signed_volume(surface: Surface) -> float:
    a, b, c = (surface.points[surface.triangles[:, n]].astype(float) - CENTRE for n in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("name", DIRECTIONS)
def test_a_ball_is_found_where_it_is_and_turned_outwards(name: str) -> None:
    surface = extract_isosurface(ball(DIRECTIONS[name]), 0.0, smallest_mm=0)
    away = surface.points - CENTRE
    assert np.abs(np.linalg.norm(away, axis=1) - RADIUS).max() < 0.02
    assert _signed_volume(surface) == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.02)
    normals = to_numpy(surface.mesh.GetPointData().GetNormals())
    assert (np.einsum("ij,ij->i", normals, away) / RADIUS).min() > 0.9


@pytest.mark.parametrize("name", DIRECTIONS)
def test_picking_finds_the_near_side_of_the_ball(name: str) -> None:
    surface = extract_isosurface(ball(DIRECTIONS[name]), 0.0)
    rng = np.random.default_rng(5)
    for _ in range(40):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        across = np.cross(direction, rng.normal(size=3))
        offset = rng.uniform(0, 0.9) * RADIUS * across / np.linalg.norm(across)
        eye = CENTRE + offset - 50 * direction
        seen = CENTRE + offset - np.sqrt(RADIUS**2 - offset @ offset) * direction
        hit = surface.pick(eye, 3 * direction)
        assert hit is not None
        assert np.linalg.norm(hit.point - seen) < 0.1 * 0.4
        assert hit.normal @ direction < 0  # it faces the eye
        assert surface.blocks(eye, CENTRE)
        assert not surface.blocks(eye, seen - 0.1 * direction)
        assert surface.pick(eye - 3 * offset / np.linalg.norm(offset) * RADIUS, direction) is None
        assert surface.pick(eye, -direction) is None


def test_projection_goes_to_the_nearest_point() -> None:
    surface = extract_isosurface(ball(OBLIQUE), 0.0)
    away = np.array([0.6, -0.48, 0.64])
    hit = surface.project(CENTRE + 6.5 * away)
    assert hit.point == pytest.approx(CENTRE + RADIUS * away, abs=0.06)
    assert np.linalg.norm(hit.point - CENTRE) == pytest.approx(RADIUS, abs=0.02)
    assert hit.normal @ away > 0.99


def test_same_surface_as_lorensen_marching_cubes(mouse: Volume) -> None:
    """Of 9 voxels at a time, since both give float32: its steps are well below 1e-6 there."""
    from skimage.measure import marching_cubes

    rng = np.random.default_rng(11)
    bone = np.argwhere(mouse.array[10:-10, 10:-10, 10:-10] > 60) + 5
    n_faces = 0
    for k, j, i in rng.choice(bone, 60):
        crop = mouse.array[k : k + 9, j : j + 9, i : i + 9]
        expected, faces, *_ = marching_cubes(crop.astype(np.float32), 38.5, method="lorensen")
        surface = extract_isosurface(Volume(crop, np.eye(4)), 39, smallest_mm=0)
        assert surface.level == 38.5
        assert surface.n_triangles == len(faces)
        n_faces += len(faces)
        corners, found = expected[:, ::-1].astype(float), surface.points.astype(float)
        assert cKDTree(found).query(corners)[0].max() < 1e-6
        assert cKDTree(corners).query(found)[0].max() < 1e-6
        centres = found[surface.triangles].mean(axis=1)
        assert cKDTree(corners[faces].mean(axis=1)).query(centres)[0].max() < 1e-6
    assert n_faces > 5000


def test_same_physical_surface_however_the_voxels_are_stored(mouse: Volume) -> None:
    crop = mouse.array[70:110, 60:110, 60:120]
    T = mouse.T_scan_voxel.copy()
    T[:3, 3] = mouse.voxel_to_scan([[60, 60, 70]])[0]
    plain = extract_isosurface(Volume(crop, T), 39)
    swap = np.array(
        [[0, 0, -1, 59], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float
    )  # (i, j, k) of (j, k, -i)
    stored = np.ascontiguousarray(crop[:, :, ::-1].transpose(2, 0, 1)).astype(">i2")
    turned = extract_isosurface(Volume(stored, T @ swap), 39)
    assert Volume(stored, T @ swap).is_mirrored
    assert turned.n_triangles == plain.n_triangles
    assert cKDTree(plain.points).query(turned.points)[0].max() < 1e-5
    assert _signed_volume(turned) == pytest.approx(
        _signed_volume(plain), rel=5e-3
    )  # ambiguous cubes are cut otherwise


def test_mouse_landmarks_lie_on_the_bone(mouse: Volume, shared_data: Path) -> None:
    markups = json.loads((shared_data / "mouse_ct" / "C57BL6_J_.mrk.json").read_text())["markups"]
    points = [point["position"] for point in markups[0]["controlPoints"]]
    surface = extract_isosurface(mouse, 32)
    away = [np.linalg.norm(surface.project(p).point - p) for p in points]
    assert np.median(away) < 0.05
    assert max(away) < 0.2


def test_islands_go_and_the_largest_parts_stay() -> None:
    array = np.zeros((40, 40, 40), np.uint8)
    array[5:30, 5:30, 5:30] = 100
    array[33:38, 10:30, 10:30] = 100
    array[35, 35, 35] = array[2, 35, 2] = 100
    volume = Volume(array, np.diag([0.2, 0.2, 0.2, 1]))
    everything = extract_isosurface(volume, 50, smallest_mm=0)
    kept = extract_isosurface(volume, 50)
    largest = extract_isosurface(volume, 50, largest=1)
    assert everything.n_triangles == kept.n_triangles + 2 * 8
    assert kept.bounds[1, 2] == pytest.approx(37.5 * 0.2, abs=0.01)
    assert largest.bounds[1, 2] == pytest.approx(29.5 * 0.2, abs=0.01)
    assert len(largest.points) == largest.triangles.max() + 1


def test_a_box_is_the_same_surface_cut_out(mouse: Volume) -> None:
    whole = extract_isosurface(mouse, 39, smallest_mm=0)
    box = box_around([12.0, 12.0, 9.0], 1.5)
    fine = extract_isosurface(mouse, 39, box=box, smallest_mm=0)
    assert (fine.bounds[0] <= box[0] + 0.2).all()
    assert (fine.bounds[1] >= box[1] - 0.2).all()
    assert np.ptp(fine.bounds, axis=0).max() < 3.0 + 2 * 0.15
    assert cKDTree(whole.points).query(fine.points)[0].max() < 1e-5
    rest = whole.outside(fine.region)
    assert rest.n_triangles + fine.n_triangles == whole.n_triangles


@pytest.mark.parametrize("name", DIRECTIONS)
def test_an_overview_ends_at_the_face_of_a_box_without_teeth(name: str) -> None:
    scan = ball(DIRECTIONS[name])
    whole = extract_isosurface(scan, 0.0, stride=3, smallest_mm=0)
    rest = whole.outside(np.array([[20.0, -9.0, -9.0], [99.0, 99.0, 99.0]]))
    index = rest.points @ scan.T_voxel_scan[:3, :3].T + scan.T_voxel_scan[:3, 3]
    assert index[:, 0].max() < 20.0 + 1e-3
    a, b, c = (rest.points[rest.triangles[:, k]].astype(float) for k in range(3))
    facing = np.cross(b - a, c - a)
    zone = 2 * np.pi * RADIUS * (RADIUS + (20.0 - 17.5) * 0.3)
    assert np.linalg.norm(facing, axis=1).sum() / 2 == pytest.approx(zone, rel=0.04)
    assert (np.einsum("ij,ij->i", facing, (a + b + c) / 3 - CENTRE) > -1e-9).all()
    _, number = np.unique(np.round(rest.points, 4), axis=0, return_inverse=True)
    edges = np.sort(np.concatenate([number[rest.triangles[:, k]] for k in ([0, 1], [1, 2], [2, 0])]), axis=1)
    edges, count = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0, return_counts=True)
    place = np.zeros(number.max() + 1)
    place[number] = index[:, 0]
    np.testing.assert_allclose(place[edges[count == 1]], 20.0, atol=2e-3)
    normals = to_numpy(rest.mesh.GetPointData().GetNormals())
    assert (np.einsum("ij,ij->i", normals, rest.points - CENTRE) > 0).all()


def test_an_overview_is_coarser_and_near(mouse: Volume) -> None:
    assert overview_stride(mouse) == 1
    assert overview_stride(mouse, 64**3) == 3
    fine, coarse = (extract_isosurface(mouse, 39, stride=s, smallest_mm=2) for s in (1, 2))
    assert coarse.n_triangles < 0.3 * fine.n_triangles
    assert coarse.voxel_mm == pytest.approx(2 * fine.voxel_mm)
    away = [np.linalg.norm(fine.project(p).point - p) for p in coarse.points[::500]]
    assert np.median(away) < 0.15


def test_progress_and_cancel(mouse: Volume) -> None:
    told: list[float] = []
    extract_isosurface(mouse, 39, stride=2, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0
    for steps in range(3):
        told.clear()
        with pytest.raises(Cancelled):
            extract_isosurface(
                mouse, 39, stride=2, progress=told.append, cancel=lambda n=steps: len(told) > n
            )
        assert told[-1] < 1.0


def _longest_wait_of_another_thread(call: Callable[[], object]) -> float:
    """Return the longest time that a thread waits for its turn, as a share of the call's time."""
    turns, over = [time.perf_counter()], threading.Event()

    def take_turns() -> None:
        while not over.wait(0.001):
            turns.append(time.perf_counter())

    thread = threading.Thread(target=take_turns)
    thread.start()
    begun = time.perf_counter()
    call()
    ended = time.perf_counter()
    over.set()
    thread.join()
    during = [turn for turn in turns if begun <= turn <= ended]
    return float(np.diff([begun, *during, ended]).max() / (ended - begun))


def test_building_the_search_structure_lets_other_threads_run(mouse: Volume) -> None:
    surface = extract_isosurface(mouse, 20.5).prepare()
    triangles = np.tile(surface.triangles, (40, 1))  # as many as a large scan has: a build takes 0.1 s
    tries = (
        _longest_wait_of_another_thread(lambda: TriangleSearch.of(surface.points, triangles))
        for _ in range(20)  # a busy machine may give the other thread no turn at first
    )
    assert any(share < 0.4 for share in tries), "where nobody else may run, others wait for 0.65 of it"


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".vtp"])
def test_saved_meshes_come_back_and_say_lps(tmp_path: Path, suffix: str) -> None:
    surface = extract_isosurface(ball(np.eye(3)), 0.0)
    path = tmp_path / f"bone{suffix}"
    surface.save(path)
    reader = {".ply": vtkPLYReader, ".stl": vtkSTLReader, ".vtp": vtkXMLPolyDataReader}[suffix]()
    reader.SetFileName(str(path))
    reader.Update()
    mesh = reader.GetOutput()
    assert mesh.GetNumberOfPolys() == surface.n_triangles
    assert pytest.approx(surface.bounds, abs=1e-5) == np.reshape(mesh.GetBounds(), (3, 2)).T
    if suffix == ".vtp":
        assert mesh.GetFieldData().GetAbstractArray("SPACE").GetValue(0) == "LPS"
    else:
        assert b"SPACE=LPS" in path.read_bytes()[:200]
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_user_can_do_wrong_is_said(tmp_path: Path) -> None:
    volume = ball(np.eye(3))
    surface = extract_isosurface(volume, 0.0)
    with pytest.raises(GpError, match=r"no surface in the volume at threshold 300; the volume's values are"):
        extract_isosurface(volume, 300)
    with pytest.raises(GpError, match="lies outside the volume"):
        extract_isosurface(volume, 0.0, box=[[900, 900, 900], [910, 910, 910]])
    with pytest.raises(GpError, match=r"meshes are written as .ply, .* got '.off'"):
        surface.save(tmp_path / "bone.off")
    with pytest.raises(GpError, match=r"bone.ply: cannot be written .*Check the folder"):
        surface.save(tmp_path / "nowhere" / "bone.ply")
    empty = surface.outside(np.array([[-1e4] * 3, [1e4] * 3]))
    with pytest.raises(GeometryError, match="empty"):
        empty.project([0, 0, 0])
    assert empty.pick([0, 0, 0], [1, 0, 0]) is None


def test_a_contour_has_narrow_point_numbers_from_the_start_and_other_meshes_what_vtk_gives_them() -> None:
    image = ball(np.eye(3)).to_pyvista()
    image.set_active_scalars(image.array_names[0])
    contour = METHODS["flying-edges"](image, 0.0)
    assert contour.GetPolys().GetConnectivityArray().GetDataTypeSize() == 4
    assert vtkCellArray().IsStorage64Bit()
    with pytest.raises(TypeError):
        METHODS["flying-edges"](image, "bone")  # type: ignore[arg-type]
    assert vtkCellArray().IsStorage64Bit()


def test_a_surface_is_let_go_with_its_search_structure() -> None:
    surface = extract_isosurface(ball(np.eye(3)), 0.0)
    mesh, search = weakref.ref(surface.mesh), weakref.ref(surface.search)
    del surface
    gc.collect()
    assert mesh() is None
    assert search() is None


@pytest.mark.parametrize(
    "dtype", [bool, np.int8, np.uint8, np.uint16, np.int32, np.int64, np.float16, np.float64]
)
def test_every_voxel_type_is_meshed(dtype: type) -> None:
    array = np.zeros((12, 12, 12), dtype)
    array[3:9, 3:9, 3:9] = 1
    surface = extract_isosurface(Volume(array, np.eye(4)), 1)
    assert surface.level == 0.5
    assert surface.bounds == pytest.approx(np.array([[2.5] * 3, [8.5] * 3]))
    with pytest.raises(GpError, match="values are 0 to 1"):
        extract_isosurface(Volume(array, np.eye(4)), 3)


@pytest.mark.parametrize(
    ("dtype", "offset", "lowest"),
    [
        ("int8", -100, 0),
        ("uint8", 0, 0),
        ("int16", -32768, 0),
        ("uint16", 60000, 0),
        ("int32", -(2**31), 0),
        ("int32", 50, -100_000),
        ("uint32", 2**32 - 2000, 0),
        ("uint32", 2**31, -(2**31)),
        ("int64", -(2**40), 0),
        ("uint64", 2**45, 0),
        ("uint64", 2**45, -100_000),
        ("float32", -4096.0, 0),
        ("float64", 1e11, 0),
    ],
)
@pytest.mark.parametrize("stride", [1, 2])
def test_the_surface_is_right_for_every_voxel_type(
    dtype: str, offset: float, lowest: int, stride: int
) -> None:
    """Wide types hold differences that flying edges, and float32, would lose; some span a wide range."""
    from skimage.measure import marching_cubes

    shape = ball(np.eye(3)).array.astype(np.float64)
    steps = np.clip(np.rint(30 * shape), -100, 100) + 100
    steps = np.rint(steps * (1.0 if dtype in ("int8", "uint8") else 7.0))
    steps[0, 0, 0] += lowest
    values = (steps.astype(np.int64).astype(dtype) + np.array(offset).astype(dtype)).astype(dtype)
    level = 99.5 if dtype in ("int8", "uint8") else 699.5
    threshold = level + 0.5 + offset if np.dtype(dtype).kind in "iu" else float(level + offset)
    surface = extract_isosurface(Volume(values, np.eye(4)), threshold, smallest_mm=0, stride=stride)
    if stride == 2:
        nz, ny, nx = (n // 2 for n in steps.shape)
        steps = steps[: 2 * nz, : 2 * ny, : 2 * nx].reshape(nz, 2, ny, 2, nx, 2).mean(axis=(1, 3, 5))
    corners = marching_cubes(steps - level, 0.0)[0][:, ::-1] * stride + (stride - 1) / 2
    assert cKDTree(corners).query(surface.points)[0].max() < 0.01
    assert cKDTree(surface.points).query(corners)[0].max() < 0.01
