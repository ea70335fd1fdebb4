"""The 3D scene with no display: what is drawn where, what a pixel hits, and that closing lets all go."""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import threading
import weakref
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scene_cases import BALL, DIRECTIONS, MIDDLE, RADIUS, scan_of, unlike_background

from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.surface import Surface, extract_isosurface
from gp_labeler.scene.camera import VIEWPOINTS
from gp_labeler.scene.colours import DARK, LIGHT
from gp_labeler.scene.ghosts import GhostEllipsoid
from gp_labeler.scene.marks import Mark
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.scene.segments import Segment
from gp_labeler.scene.slices import VolumeSlicer
from gp_labeler.scene.target import RenderTarget
from gp_labeler.scene.window_level import WindowLevel

pytestmark = pytest.mark.machine


@pytest.fixture
def scene() -> Iterator[Scene3D]:
    made = Scene3D(RenderTarget.offscreen(320, 240))
    made.cube.visible = False
    yield made
    made.close()


@pytest.fixture(scope="module")
def ball() -> Surface:
    return extract_isosurface(scan_of([(BALL, RADIUS)], np.eye(3)), 100)


@pytest.mark.parametrize("letter", VIEWPOINTS)
@pytest.mark.parametrize("name", ["straight", "mirrored", "oblique mirrored"])
def test_a_bright_ball_is_drawn_where_it_is(scene: Scene3D, name: str, letter: str) -> None:
    scene.bone.show([extract_isosurface(scan_of([(BALL, RADIUS)], DIRECTIONS[name]), 100)])
    scene.camera.view_from(letter)
    scene.camera.focus_on(MIDDLE, across_mm=16)
    drawn = unlike_background(scene.image())
    assert drawn.shape == (240, 320)
    rows, columns = np.nonzero(drawn)
    assert np.array([columns.mean(), rows.mean()]) == pytest.approx(scene.display_of(BALL[None])[0], abs=0.6)
    assert drawn.sum() == pytest.approx(np.pi * (RADIUS * 240 / 16) ** 2, rel=0.03)


@pytest.mark.parametrize("parallel", [True, False])
def test_a_click_on_the_projection_of_a_surface_point_gives_it_back(
    scene: Scene3D, ball: Surface, parallel: bool
) -> None:
    scene.bone.show([ball])
    scene.camera.parallel = parallel
    rng = np.random.default_rng(8)
    n_found = 0
    for _ in range(12):
        scene.camera.rotate(*rng.uniform(-200, 200, 2))
        scene.camera.focus_on(BALL + rng.uniform(-1, 1, 3), across_mm=rng.uniform(4, 14))
        points = ball.points[rng.integers(0, len(ball.points), 30)].astype(float)
        points = points[~scene.hidden(points) & (np.abs((points - BALL) @ scene.camera.direction) > 1)]
        for point, (x, y) in zip(points, scene.display_of(points), strict=True):
            hit = scene.pick(x, y)
            assert hit is not None
            assert np.linalg.norm(hit.point - point) < 0.1 * 0.2
            assert hit.normal @ scene.camera.direction < 0
            n_found += 1
    assert n_found > 60


def test_what_is_drawn_is_what_is_hit(scene: Scene3D, ball: Surface) -> None:
    """Every pixel, against the picture: they differ at most on the rim of the silhouette."""
    scene.bone.show([ball])
    scene.target.resize(80, 60)
    scene.camera.focus_on(BALL + np.array([0.3, 0.2, 0.4]), across_mm=8)
    scene.set_colours(LIGHT)  # against a bright background, bone is seen in the shade as well
    drawn = unlike_background(scene.image())
    hit = np.array([[scene.pick(x, y) is not None for x in range(80)] for y in range(60)])
    assert hit.sum() > 1000
    assert (drawn != hit).sum() < 0.03 * hit.sum()
    rows, columns = np.nonzero(hit)
    drawn_rows, drawn_columns = np.nonzero(drawn)
    assert columns.mean() == pytest.approx(drawn_columns.mean(), abs=0.1)
    assert rows.mean() == pytest.approx(drawn_rows.mean(), abs=0.1)


def test_a_click_that_misses_or_meets_what_is_not_seen_hits_nothing(scene: Scene3D, ball: Surface) -> None:
    assert scene.pick(160, 120) is None
    scene.bone.show([ball])
    scene.fit()
    assert scene.pick(160, 120) is not None
    assert scene.pick(2, 2) is None
    scene.bone.opacity = 0.02
    assert scene.pick(160, 120) is None
    scene.bone.opacity = 1
    scene.bone.visible = False
    assert scene.pick(160, 120) is None
    assert not unlike_background(scene.image()).any()


def test_the_nearest_of_several_surfaces_is_hit(scene: Scene3D) -> None:
    near, far = (
        extract_isosurface(scan_of([(BALL + np.array([0, y, 0]), 1.5)], np.eye(3)), 100) for y in (-3.0, 3.0)
    )
    scene.bone.show([far, near])
    scene.camera.view_from("A")
    scene.camera.focus_on(BALL)
    x, y = scene.display_of(BALL[None])[0]
    hit = scene.pick(x, y)
    assert hit is not None
    assert hit.point[1] == pytest.approx(BALL[1] - 4.5, abs=0.05)
    assert scene.bone.bounds == pytest.approx(np.stack([near.bounds[0], far.bounds[1]]))


def test_the_mark_under_the_pointer_is_named(scene: Scene3D, ball: Surface) -> None:
    front, behind = BALL + np.array([0, -RADIUS, 0]), BALL + np.array([0.2, RADIUS, 0])
    scene.bone.show([ball])
    scene.marks.show([Mark("L:MH", behind), Mark("L:OI", front), Mark("gone", np.full(3, np.nan))])
    scene.camera.view_from("A")
    scene.fit()
    (x, y), (x2, y2) = scene.display_of([front, behind])
    assert scene.mark_at(x, y) == "L:OI"
    assert scene.mark_at(x2 - 0.4, y2) == "L:OI"  # the seen one first
    assert scene.mark_at(x2 + 9, y2) == "L:MH"
    assert scene.mark_at(x + 60, y) is None


@pytest.mark.parametrize("spread", [(1.0, 2.0, 3.0), (2.0, 1.0, 3.0), (3.0, 2.0, 1.0), (1.0, 3.0, 2.0)])
def test_a_ghost_is_bright_inside_whichever_way_it_is_long(scene: Scene3D, spread: tuple[float, ...]) -> None:
    scene.camera.focus_on(MIDDLE, across_mm=20)
    without = scene.image()[120, 160].astype(int)
    scene.ghosts.show([GhostEllipsoid("L:IN", MIDDLE, np.diag(spread), active=True)])
    assert (scene.image()[120, 160] > without + 8).all()


def test_lines_and_slices_are_drawn_and_taken_away(scene: Scene3D) -> None:
    volume = scan_of([(BALL, RADIUS)], np.eye(3))
    source = VolumeSlicer(volume)
    scene.camera.view_from("A")
    scene.camera.rotate(40, 30)
    scene.camera.focus_on(MIDDLE, across_mm=14)
    empty = scene.image()
    shows = {
        "line": (
            lambda: scene.lines.show([Segment(MIDDLE - 3, MIDDLE + 3, "#FF00FF")]),
            lambda: scene.lines.show([]),
        ),
        "slices": (
            lambda: scene.slices.show(
                [source.image(p.in_scan, p.in_scan.position_of(MIDDLE)) for p in Plane],
                WindowLevel.of(volume),
                [p.colour for p in Plane],
            ),
            lambda: scene.slices.show([], WindowLevel(0, 1), []),
        ),
    }
    for name, (show, hide) in shows.items():
        show()
        assert np.abs(scene.image().astype(int) - empty).max() > 60, name
        hide()
        assert np.abs(scene.image().astype(int) - empty).max() < 3, name


def test_slices_in_3d_show_the_marker_where_it_is(scene: Scene3D) -> None:
    volume = scan_of([(BALL, 1.0)], DIRECTIONS["mirrored"])
    source = VolumeSlicer(volume)
    for plane, letter in zip(Plane, "SLA", strict=True):
        image = source.image(plane.in_scan, plane.in_scan.position_of(BALL))
        scene.slices.show([image], WindowLevel(0, 200), [plane.colour])
        scene.camera.view_from(letter)
        scene.camera.focus_on(MIDDLE, across_mm=14)
        rows, columns = np.nonzero(scene.image().min(axis=2) > 150)
        found = [columns.mean(), rows.mean()]
        assert found == pytest.approx(scene.display_of(BALL[None])[0], abs=2.0)


def test_a_slice_before_the_cube_does_not_hide_it(scene: Scene3D) -> None:
    source = VolumeSlicer(scan_of([(BALL, 1.0)], np.eye(3)))
    scene.camera.view_from("A")
    scene.camera.focus_on(MIDDLE, across_mm=4)
    slices = [source.image(Plane.CORONAL.in_scan, BALL[1])]
    scene.cube.visible = False
    scene.slices.show(slices, WindowLevel(0, 200), [Plane.CORONAL.colour])
    without = scene.image().astype(int)
    scene.cube.visible = True
    assert (np.abs(scene.image() - without).max(axis=2) > 30).sum() > 300


def test_the_cube_shows_where_one_looks_from(scene: Scene3D) -> None:
    empty = scene.image()
    scene.cube.visible = True
    changed = np.abs(scene.image().astype(int) - empty).max(axis=2) > 30
    assert changed[160:, :95].sum() > 800  # lower left
    assert not changed[:150].any()
    views = []
    for letter in VIEWPOINTS:
        scene.camera.view_from(letter)
        views.append(scene.image()[160:, :95].astype(int))
    for n, one in enumerate(views):
        assert all(np.abs(one - other).max() > 60 for other in views[n + 1 :])  # six letters


def test_themes_quick_frames_and_sizes(scene: Scene3D, ball: Surface) -> None:
    coarse = extract_isosurface(scan_of([(BALL, RADIUS / 2)], np.eye(3)), 100)
    scene.bone.show([ball], quick=[coarse])
    scene.fit()
    fine = unlike_background(scene.image()).sum()
    scene.camera.zoom(1.001)
    scene.render(quick=True)
    assert unlike_background(scene.target.pixels()).sum() < 0.4 * fine
    assert scene.pick(160, 120).point == pytest.approx(BALL + np.array([0, -RADIUS, 0]), abs=0.1)
    scene.camera.zoom(1 / 1.001)
    assert unlike_background(scene.image()).sum() == fine
    scene.set_colours(LIGHT)
    assert scene.image()[0, 0].min() > 200
    scene.set_colours(DARK)
    large = scene.image(640, 480)
    assert large.shape == (480, 640, 3)
    assert unlike_background(large).sum() == pytest.approx(4 * fine, rel=0.03)
    assert scene.target.size == (320, 240)


def test_real_landmarks_are_seen_on_the_real_skull(scene: Scene3D, shared_data: Path) -> None:
    volume = read_volume(shared_data / "mouse_ct" / "C57BL6_J_.nii.gz")
    markups = json.loads((shared_data / "mouse_ct" / "C57BL6_J_.mrk.json").read_text())["markups"]
    points = np.array([point["position"] for point in markups[0]["controlPoints"]])
    surface = extract_isosurface(volume, 32)
    nearest = [surface.project(point) for point in points]
    on_bone, normals = np.array([hit.point for hit in nearest]), np.array([hit.normal for hit in nearest])
    scene.bone.show([surface])
    n_seen = 0
    for letter in VIEWPOINTS:
        scene.camera.view_from(letter)
        scene.fit()
        facing = (normals @ scene.camera.direction < -0.6) & ~scene.hidden(points)
        seen_at = scene.display_of(on_bone[facing])  # at a sharp edge, a point off the bone is not before it
        for point, (x, y) in zip(points[facing], seen_at, strict=True):
            hit = scene.pick(x, y)
            assert hit is not None
            assert np.linalg.norm(hit.point - point) < 0.2  # they were placed up to 0.1 mm off this surface
            n_seen += 1
    assert n_seen > 30


def _drawn_objects(scene: Scene3D) -> list[weakref.ref[object]]:
    layers = scene.layers
    found: list[object] = [layers.bone, layers.base, layers.overlay, scene.cube.renderer, scene.target.window]
    for renderer in (layers.bone, layers.base, layers.overlay):
        props = renderer.GetViewProps()
        found += [props.GetItemAsObject(n) for n in range(props.GetNumberOfItems())]
    return [weakref.ref(thing) for thing in found]


def test_closing_lets_every_vtk_object_go(ball: Surface) -> None:
    scene = Scene3D(RenderTarget.offscreen(100, 80))
    scene.bone.show([ball], quick=[ball])
    scene.marks.show([Mark("a", BALL, "CA", active=True)])
    scene.ghosts.show([GhostEllipsoid("b", BALL, np.eye(3), "IN?", active=True)])
    scene.lines.show([Segment(BALL - 1, BALL + 1, "#FF00FF")])
    source = VolumeSlicer(scan_of([(BALL, RADIUS)], DIRECTIONS["oblique"]))
    scene.slices.show([source.image(Plane.AXIAL.in_scan, BALL[2])], WindowLevel(0, 200), ["#FF0000"])
    scene.render()
    objects = _drawn_objects(scene)
    assert len(objects) > 14
    scene.close()
    source.close()
    del scene, source
    gc.collect()
    assert [ref() for ref in objects if ref() is not None] == []


def test_opening_and_closing_again_and_again_leaks_nothing(ball: Surface) -> None:
    def cycle() -> None:
        scene = Scene3D(RenderTarget.offscreen(160, 120))
        scene.bone.show([ball])
        scene.marks.show([Mark("a", BALL, "CA")])
        scene.fit()
        assert scene.image().std() > 5
        scene.close()

    for _ in range(4):
        cycle()
    gc.collect()
    files, threads, memory = (
        _open_files(),
        threading.active_count(),
        _resident_mb(),
    )
    for _ in range(8):
        cycle()
    gc.collect()
    assert _open_files() <= files
    assert threading.active_count() <= threads
    assert _resident_mb() - memory < 25


def _open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def _resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 1e6


def test_two_scenes_share_nothing(ball: Surface) -> None:
    one, two = (Scene3D(RenderTarget.offscreen(160, 120)) for _ in range(2))
    one.bone.show([ball])
    one.fit()
    two.fit()
    two.cube.visible = False
    one.render()
    two.render()
    assert unlike_background(one.target.pixels())[30:90, 40:120].any()
    assert not unlike_background(two.target.pixels()).any()
    one.close()
    assert two.image().shape == (120, 160, 3)
    two.close()
    with pytest.raises(RuntimeError, match="closed"):
        two.target.render()


def test_without_a_display_nothing_is_said_on_stderr() -> None:
    code = (
        "from gp_labeler.scene.target import RenderTarget\n"
        "from gp_labeler.scene.scene3d import Scene3D\n"
        "scene = Scene3D(RenderTarget.offscreen(64, 48))\n"
        "print(scene.image().shape)\n"
        "scene.close()\n"
        "foreign = ('PySide6', 'PyQt6', 'qtpy', 'pyvista')\n"
        "import sys; print([m for m in sys.modules if m.startswith(foreign)])\n"
    )
    without = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-c", code], env=without, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[:2] == ["(48, 64, 3)", "[]"]
    assert done.stderr == ""


def test_a_point_more_is_drawn_without_drawing_the_bone_again(scene: Scene3D, ball: Surface) -> None:
    scene.cube.visible = True
    scene.bone.show([ball], quick=[ball])
    scene.camera.view_from("A")
    scene.fit()
    bare = scene.image()
    n_drawn, drawn = scene.n_bone_frames, 0

    def count(*_: object) -> None:
        nonlocal drawn
        drawn += 1

    scene.layers.bone.AddObserver("StartEvent", count)
    seen, behind = BALL - np.array([1, RADIUS, 1]), BALL + np.array([-1, RADIUS, 0.5])
    for marks in ([Mark("a", seen, "CA")], [Mark("a", seen, "CA"), Mark("b", behind, "CB", "computed")], []):
        scene.marks.show(marks)
        scene.lines.show([Segment(mark.position, BALL, "#FF00FF") for mark in marks])
        scene.ghosts.show(
            [GhostEllipsoid("c", mark.position, np.eye(3) / 9, "IN?", active=True) for mark in marks]
        )
        frame = scene.image()
        assert (frame != bare).any() == bool(marks)
    np.testing.assert_array_equal(frame, bare)  # and nothing is left of them
    assert (drawn, scene.n_bone_frames) == (0, n_drawn)
    scene.camera.rotate(3, 0)
    scene.image()
    assert drawn > 0
    assert scene.n_bone_frames == n_drawn + 1


@pytest.mark.parametrize("opacity", [1.0, 0.5])
def test_bone_drawn_in_chunks_is_the_same_bone(
    scene: Scene3D, ball: Surface, opacity: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene.bone.opacity = opacity
    scene.bone.show([ball])
    scene.fit()
    whole = scene.image().astype(int)
    assert len(scene.bone.groups(scene.camera.direction)) == 1
    monkeypatch.setattr("gp_labeler.scene.mesh_chunks.chunks_of.__defaults__", (ball.n_triangles // 7,))
    scene.bone.show([ball])
    assert len(scene.bone.groups(scene.camera.direction)) == 7
    assert not scene.is_fine
    n_steps = 1
    while not scene.advance(0.0):
        n_steps += 1
        assert not scene.is_fine
        scene.render(quick=True)  # what is seen meanwhile stays as it was
        np.testing.assert_array_equal(scene.target.pixels(), whole)
    assert n_steps > 7
    assert scene.is_fine
    off = np.abs(scene.image() - whole).max(axis=2)
    assert (off > 4).mean() < (0.001 if opacity == 1 else 0.1)
    assert off.max() < 32  # what lies behind what is judged a piece at a time


def test_a_camera_that_moves_while_bone_is_drawn_begins_again(
    scene: Scene3D, ball: Surface, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gp_labeler.scene.mesh_chunks.chunks_of.__defaults__", (ball.n_triangles // 5,))
    scene.bone.show([ball], quick=[ball])
    scene.fit()
    scene.camera.zoom(1.5)
    wanted = scene.image()
    scene.camera.zoom(1 / 1.5)
    assert not scene.advance(0.0)
    scene.camera.zoom(1.5)
    scene.render(quick=True)
    while not scene.advance(0.0):
        pass
    np.testing.assert_array_equal(scene.image(), wanted)


def test_the_first_bone_is_drawn_behind_the_empty_scene_and_later_turns_are_answered_at_once(
    scene: Scene3D, ball: Surface, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gp_labeler.scene.mesh_chunks.chunks_of.__defaults__", (ball.n_triangles // 5,))
    scene.render(quick=True)
    empty, n_drawn = scene.target.pixels(), scene.n_bone_frames
    scene.bone.show([ball])
    scene.fit()
    scene.render(quick=True)
    assert (scene.n_bone_frames, scene.is_fine) == (n_drawn, False)
    np.testing.assert_array_equal(scene.target.pixels(), empty)
    while not scene.advance(0.0):
        pass
    scene.render(quick=True)
    assert unlike_background(scene.target.pixels()).any()
    scene.camera.rotate(40, 0)
    scene.render(quick=True)
    assert scene.n_bone_frames == n_drawn + 2
