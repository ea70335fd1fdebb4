"""Slices show what lies where, in physical axes, on the right side of the screen."""

from __future__ import annotations

import itertools
import time

import numpy as np
import pytest
from scene_cases import DIRECTIONS, MIDDLE, scan_of
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from gp_core.errors import GeometryError
from gp_core.frames import RigidTransform
from gp_labeler.imaging.anatomical_frame import SCAN_FRAME, AnatomicalFrame, letter_of
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.volume import Volume
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.slice_viewport import SliceViewport, scale_bar_length
from gp_labeler.scene.slices import VolumeSlicer
from gp_labeler.scene.window_level import WindowLevel

AXIAL, SAGITTAL, CORONAL = PLANES = tuple(plane.in_scan for plane in Plane)
MARKER = MIDDLE + np.array([2.5, -1.7, 3.1])


def _painted(source: VolumeSlicer, view: SliceViewport) -> np.ndarray:
    """Sample a slice as a painter would: the value at the centre of each pixel of the view."""
    image = source.image(view.plane, view.position)
    width, height = view.size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    flat = view.plane.flat(view.pixel_to_scan(np.stack([x.ravel(), y.ravel()], axis=1)))
    column, row = np.rint((flat - image.origin) / image.step).astype(int).T
    inside = (row >= 0) & (row < image.values.shape[0]) & (column >= 0) & (column < image.values.shape[1])
    painted = np.zeros(len(flat))
    painted[inside] = image.values[row[inside], column[inside]]
    return painted.reshape(height, width)


@pytest.mark.parametrize("plane", PLANES, ids=[plane.value for plane in Plane])
@pytest.mark.parametrize("name", DIRECTIONS)
def test_a_bright_marker_appears_where_it_is(name: str, plane: SlicePlane) -> None:
    volume = scan_of([(MARKER, 0.8)], DIRECTIONS[name])
    source = VolumeSlicer(volume)
    assert source.is_oblique(plane) == name.startswith("oblique")
    view = SliceViewport.fitted(source, plane, (180, 150)).at(source.snap(plane, plane.position_of(MARKER)))
    painted = _painted(source, view)
    rows, columns = np.nonzero(painted > 100)
    expected = view.scan_to_pixel(MARKER[None])[0]
    assert np.array([columns.mean(), rows.mean()]) == pytest.approx(expected, abs=0.12 / view.mm_per_pixel)
    assert (
        abs(source.image(plane, view.position).position - plane.position_of(MARKER))
        <= 0.5 * source.step(plane) + 1e-9
    )
    elsewhere = view.at(source.snap(plane, plane.position_of(MARKER) + 3))
    assert _painted(source, elsewhere).max() < 20


@pytest.mark.parametrize("name", DIRECTIONS)
def test_patient_left_is_on_the_right_of_the_screen_and_the_nose_on_the_left(name: str) -> None:
    left, anterior, superior = (
        MIDDLE + np.array([4, 0, 0]),
        MIDDLE + np.array([0, -4, 0]),
        MIDDLE + np.array([0, 0, 4]),
    )
    source = VolumeSlicer(scan_of([(left, 1.0), (anterior, 0.7), (superior, 0.5)], DIRECTIONS[name]))
    seen = {}
    for plane in PLANES:
        view = SliceViewport.fitted(source, plane, (120, 120)).at(
            source.snap(plane, plane.position_of(MIDDLE))
        )
        painted = _painted(source, view) > 100
        seen[plane] = [painted[:, 70:].sum(), painted[:, :50].sum(), painted[:50].sum(), painted[70:].sum()]
    assert [bool(n) for n in seen[AXIAL]] == [True, False, True, False]  # left: right; anterior: top
    assert [bool(n) for n in seen[SAGITTAL]] == [
        False,
        True,
        True,
        False,
    ]  # anterior: left; superior: top
    assert [bool(n) for n in seen[CORONAL]] == [True, False, True, False]  # left: right; superior: top
    assert seen[AXIAL][0] > seen[AXIAL][2]
    assert SCAN_FRAME.edge_letters(AXIAL) == ("R", "L", "A", "P")
    assert SCAN_FRAME.edge_letters(CORONAL) == ("R", "L", "S", "I")
    assert SCAN_FRAME.edge_letters(SAGITTAL) == ("A", "P", "S", "I")


def test_straight_slices_are_the_voxels_themselves() -> None:
    rng = np.random.default_rng(2)
    array = rng.integers(0, 1000, (7, 8, 9)).astype(np.int16)
    directions = [
        np.eye(3)[list(p)] * signs
        for p in itertools.permutations(range(3))
        for signs in ([1, 1, 1], [1, -1, 1], [-1, -1, -1])
    ]
    for direction in directions:
        volume = Volume.from_parts(array, (0.1, 0.2, 0.3), (5, 6, 7), direction)
        source = VolumeSlicer(volume)
        for plane in PLANES:
            low, high = source.limits(plane)
            image = source.image(plane, low + 0.4 * (high - low))
            if abs(direction[:, 0] @ plane.normal) < 0.5:  # else single voxels all over it, gathered once
                assert np.shares_memory(image.values, volume.array)
            row, column = len(image.values) - 2, 1
            flat = image.origin + image.step * [column, row]
            point = plane.scan(flat[None], image.position)
            assert volume.values_at(point)[0] == image.values[row, column]
            assert volume.scan_to_voxel(point) == pytest.approx(
                np.rint(volume.scan_to_voxel(point)), abs=1e-9
            )


def test_every_slice_can_be_reached_and_no_other() -> None:
    volume = scan_of([(MIDDLE, 2.0)], DIRECTIONS["permuted"])
    source = VolumeSlicer(volume)
    for plane in PLANES:
        low, high = source.limits(plane)
        n = round((high - low) / source.step(plane)) + 1
        assert n in volume.size
        seen = {source.image(plane, p).position for p in np.linspace(low - 1, high + 1, 5 * n)}
        assert len(seen) == n
        assert source.snap(plane, -1e6) == pytest.approx(low)
        assert source.snap(plane, 1e6) == pytest.approx(high)


@pytest.mark.parametrize("name", ["straight", "mirrored", "oblique"])
def test_the_outline_is_where_the_mesh_is_cut(name: str) -> None:
    volume = scan_of([(MARKER, 2.0), (MIDDLE - 3, 1.0)], DIRECTIONS[name])
    surface = extract_isosurface(volume, 100, smallest_mm=0)
    source = VolumeSlicer(volume)
    for plane in PLANES:
        image = source.image(plane, plane.position_of(MARKER))
        outline = image.outline(100)
        points = plane.scan(outline.reshape(-1, 2), image.position)
        assert len(outline) > 30
        away = [np.linalg.norm(surface.project(p).point - p) for p in points[::3]]
        assert max(away) < (1e-4 if name != "oblique" else 0.06)
        assert image.outline(250).shape == (0, 2, 2)


@pytest.mark.parametrize("name", ["straight", "mirrored", "permuted"])
@pytest.mark.parametrize("n", range(4))
def test_a_plane_of_any_orientation_shows_what_lies_on_it(name: str, n: int) -> None:
    """The values of the volume itself are the reference, interpolated by SciPy between the same voxels."""
    volume = scan_of([(MARKER, 0.8), (MIDDLE, 1.5)], DIRECTIONS[name])
    rng = np.random.default_rng(n)
    plane = PLANES[n % 3].rotated(rng.normal(size=3), rng.uniform(0.2, 3.0), MIDDLE + rng.normal(size=3))
    source = VolumeSlicer(volume)
    assert source.is_oblique(plane)
    image = source.image(plane, plane.position_of(MARKER))
    assert image.position == pytest.approx(plane.position_of(MARKER), abs=1e-9)  # cut where it is asked for
    row, column = np.indices(image.values.shape)
    flat = image.origin + image.step * np.stack([column.ravel(), row.ravel()], axis=1)
    points = plane.scan(flat, image.position)
    index = volume.scan_to_voxel(points)
    inside = np.all((index > 0) & (index < np.array(volume.size) - 1), axis=1)
    expected = map_coordinates(volume.array.astype(float), index[inside, ::-1].T, order=1)
    assert np.abs(image.values.ravel()[inside] - expected).max() <= 1.0
    assert inside.mean() > 0.3
    low, high = source.limits(plane)
    for position in np.linspace(low, high, 5):  # the grid covers what of the plane lies in the volume
        cut = source.image(plane, position)
        edges = cut.edges
        section = plane.flat(volume.voxel_to_scan(_on_plane(volume, plane, position)))
        assert (section >= edges[0] - 1e-6).all()
        assert (section <= edges[1] + 1e-6).all()


def test_an_oblique_slice_is_sampled_no_finer_than_the_screen_shows_it() -> None:
    source = VolumeSlicer(scan_of([(MARKER, 1.0)], np.eye(3)))
    plane = AXIAL.rotated([1, 0.4, 0.2], 0.5, MIDDLE)
    voxel = min(source.volume.spacing)
    for mm_per_pixel in (0.01, voxel, 0.33, 0.5, 1.7):
        step = source.sampling_step(plane, mm_per_pixel)
        assert step >= voxel
        assert step <= max(voxel, mm_per_pixel)
        assert step >= min(max(voxel, mm_per_pixel / 1.5), mm_per_pixel / 1.5) or step == voxel
        assert source.sampling_step(AXIAL, mm_per_pixel) == voxel
    fine, coarse = (source.image(plane, plane.position_of(MARKER), step) for step in (voxel, 2 * voxel))
    assert (coarse.step == 2 * voxel).all()
    assert fine.values.size > 3.5 * coarse.values.size
    for image in (fine, coarse):  # the marker is where it is, however coarsely it is sampled
        rows, columns = np.nonzero(image.values > 100)
        middle = image.origin + image.step * [columns.mean(), rows.mean()]
        assert middle == pytest.approx(plane.flat(MARKER[None])[0], abs=0.15)


def _on_plane(volume: Volume, plane: SlicePlane, position: float) -> np.ndarray:
    """Voxels whose centres lie within half a voxel of a slice, moved onto it where that is inside."""
    index = np.stack(np.unravel_index(np.arange(volume.array.size), volume.size), axis=1)
    points = volume.voxel_to_scan(index)
    near = np.abs(plane.depth(points) - position) < 0.05
    return index[near]


def test_planes_turn_about_a_point_and_stay_orthonormal() -> None:
    plane, about = SAGITTAL, np.array([3.0, -2.0, 7.0])
    for _ in range(2000):
        plane = plane.rotated([0.3, -1.0, 0.2], 0.011, about)
    assert plane.axes.T @ plane.axes == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(plane.axes) == pytest.approx(np.linalg.det(SAGITTAL.axes))
    back = plane.rotated([0.3, -1.0, 0.2], -0.011 * 2000, about)
    assert back.axes == pytest.approx(SAGITTAL.axes, abs=1e-9)
    assert plane.scan([[1.0, 2.0]], 3.0)[0] == pytest.approx(plane.origin + plane.axes @ [1.0, 2.0, 3.0])
    with pytest.raises(GeometryError, match="orthogonal"):
        SlicePlane([1, 0, 0], [0, 1, 0.1], [0, 0, 1])


def test_letters_name_the_nearest_directions_in_the_frame() -> None:
    R = Rotation.from_euler("zyx", [170, 20, -35], degrees=True).as_matrix()
    head = AnatomicalFrame("head", RigidTransform.from_parts(R.T, -R.T @ MARKER, dst="head", src="scan"))
    for plane in Plane:
        turned = head.plane(plane.value)
        assert head.edge_letters(turned) == SCAN_FRAME.edge_letters(plane.in_scan)
        assert turned.position_of(MARKER) == pytest.approx(0.0)
    assert head.letters(R @ [1, 0, 0]) == "L"
    assert head.letters(R @ [0.7, -0.7, 0.1]) == "LA"
    assert head.letters(R @ [0.2, -0.95, 0.1]) == "A"
    oblique = SAGITTAL.rotated([0, 0, 1], np.radians(30), [0, 0, 0])
    assert SCAN_FRAME.position_text(oblique, -2.0) == "-2.0 mm LP"


def test_pixels_and_positions_are_inverse_and_the_view_moves_as_told() -> None:
    source = VolumeSlicer(scan_of([(MIDDLE, 2.0)], np.eye(3)))
    rng = np.random.default_rng(4)
    for plane in PLANES:
        view = SliceViewport.fitted(source, plane, (301, 201))
        pixels = rng.uniform(-50, 350, (20, 2))
        points = view.pixel_to_scan(pixels)
        assert view.scan_to_pixel(points) == pytest.approx(pixels)
        assert view.off_slice(points) == pytest.approx(0)
        anchor = np.array([40.0, 160.0])
        zoomed = view.zoomed(3.0, about=anchor)
        assert zoomed.mm_per_pixel == pytest.approx(view.mm_per_pixel / 3)
        assert zoomed.pixel_to_scan(anchor[None]) == pytest.approx(view.pixel_to_scan(anchor[None]))
        assert view.panned(10, -5).scan_to_pixel(points) == pytest.approx(pixels + np.array([10, -5]))
        assert view.centred(points[0]).scan_to_pixel(points[:1])[0] == pytest.approx([150, 100])
        assert view.showing(MIDDLE).centre == pytest.approx(view.centre)
        assert view.showing(MIDDLE + 500).off_slice(MIDDLE[None] + 500) == pytest.approx(0)
        assert view.resized(601, 401).scan_to_pixel(points) == pytest.approx(pixels + np.array([150, 100]))
        corners = view.image_corners(source.image(plane, view.position))
        assert (corners[0] > 0).all()
        assert (corners[1] < [301, 201]).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.uint16, np.int16, np.int32, np.float32, np.float64])
def test_window_and_level_are_linear_for_all_types(dtype: type) -> None:
    values = (
        np.array([[-120, -3, 0], [1, 64, 127]])
        .clip(np.iinfo(dtype).min if dtype(1.5) == 1 else None)
        .astype(dtype)
    )
    window = WindowLevel(-10.0, 110.0)
    expected = ((values.astype(float) + 10) * 255 / 120).clip(0, 255)
    assert np.abs(window.grey(values).astype(float) - expected).max() <= 1.0
    turned = np.asfortranarray(values)[::-1]
    assert np.array_equal(window.grey(turned), window.grey(np.ascontiguousarray(turned)))
    wider = window.moved(60, 5)
    assert (wider.width, wider.level) == pytest.approx((180, 55))
    assert window.moved(-1e9, 0).width > 0


@pytest.mark.parametrize(("dtype", "offset"), [("uint32", 2**31), ("int32", -(2**31)), ("float64", 1e12)])
def test_grey_values_are_right_for_small_differences_of_large_values(dtype: str, offset: float) -> None:
    steps = np.arange(256).reshape(16, 16)
    values = (steps.astype(np.float64) + offset).astype(dtype)
    assert np.array_equal(WindowLevel(offset, offset + 255).grey(values), steps)


def test_nothing_is_black_and_the_preview_is_tinted() -> None:
    volume = scan_of([(MIDDLE, 2.0)], np.eye(3))
    window = WindowLevel.of(volume)
    image = VolumeSlicer(volume).image(AXIAL, MIDDLE[2])
    rgb = image.rgb(window, threshold=100)
    bone = image.values >= 100
    assert (rgb[bone, 0] > rgb[bone, 2]).all()
    assert np.ptp(rgb[~bone].astype(int), axis=1).max() == 0
    assert window.grey(np.array([np.nan, np.inf, -np.inf])).tolist() == [0, 255, 0]
    assert WindowLevel.of(Volume(np.zeros((3, 3, 3)), np.eye(4))).width > 0


def test_words_and_scale_bars() -> None:
    assert SCAN_FRAME.position_text(AXIAL, 12.44) == "S 12.4 mm"
    assert SCAN_FRAME.position_text(SAGITTAL, -3) == "R 3.0 mm"
    assert SCAN_FRAME.position_text(CORONAL, 9.1) == "P 9.1 mm"
    assert letter_of([0.2, -0.9, 0.1]) == "A"
    for zoom in (1e-4, 0.0123, 0.05, 0.7, 9.0):
        length, pixels = scale_bar_length(zoom, 100)
        assert 40 <= pixels <= 100.001
        assert length / 10 ** np.floor(np.log10(length) + 1e-9) == pytest.approx(
            round(length / 10 ** np.floor(np.log10(length) + 1e-9))
        )
        assert pixels * zoom == pytest.approx(length)


def test_straight_slices_are_quick() -> None:
    volume = Volume(np.zeros((256, 256, 256), np.uint16), np.diag([0.1, 0.1, 0.1, 1]))
    source, window = VolumeSlicer(volume), WindowLevel(0, 100)
    source.image(AXIAL, 3.0).grey(window)
    costs = []
    for n in range(30):
        start = time.thread_time()  # of this thread alone, whatever else the machine does
        for plane in PLANES:
            source.image(plane, 0.1 * n).grey(window)
        costs.append(time.thread_time() - start)
    assert min(costs) < 0.03
