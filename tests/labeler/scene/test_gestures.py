"""Mouse gestures do what they do in 3D Slicer, and the camera's pixels are right."""

from __future__ import annotations

import numpy as np
import pytest
from vtkmodules.vtkRenderingCore import vtkCamera

from gp_core.errors import GeometryError, GpError
from gp_labeler.scene.camera import VIEWPOINTS, SceneCamera
from gp_labeler.scene.gestures import Button, CameraControl, DragMode, Modifier, SliceControl, drag_of
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.slice_viewport import SliceViewport

SIZE = (401, 301)
RIGHT_AND_UP = {"A": "LS", "P": "RS", "L": "PS", "R": "AS", "S": "RA", "I": "LA"}
LETTER = {"L": [1, 0, 0], "R": [-1, 0, 0], "P": [0, 1, 0], "A": [0, -1, 0], "S": [0, 0, 1], "I": [0, 0, -1]}


@pytest.fixture(params=[True, False], ids=["orthographic", "perspective"])
def camera(request: pytest.FixtureRequest) -> SceneCamera:
    made = SceneCamera(vtkCamera(), lambda: SIZE)
    made.parallel = request.param
    made.focus_on([10, 20, 30], across_mm=25)
    made.view_from("A")
    return made


@pytest.mark.parametrize("letter", VIEWPOINTS)
def test_named_viewpoints_show_what_they_say(camera: SceneCamera, letter: str) -> None:
    camera.view_from(letter)
    right, up = (np.array(LETTER[c]) for c in RIGHT_AND_UP[letter])
    pixels = camera.viewpoint().display([camera.focus, camera.focus + right, camera.focus + up])[:, :2]
    assert pixels[0] == pytest.approx([200, 150], abs=1e-6)  # the middle of 401 x 301 pixels
    assert pixels[1] - pixels[0] == pytest.approx([301 / 25, 0], abs=1e-6)
    assert pixels[2] - pixels[0] == pytest.approx([0, -301 / 25], abs=1e-6)
    assert camera.direction == pytest.approx(-np.array(LETTER[letter]))
    assert camera.up == pytest.approx(up)


def test_rays_and_pixels_are_inverse(camera: SceneCamera) -> None:
    rng = np.random.default_rng(1)
    camera.rotate(33, -21)
    view = camera.viewpoint()
    points = camera.focus + rng.uniform(-8, 8, (50, 3))
    display = view.display(points)
    assert view.scan(display) == pytest.approx(points, abs=1e-6)
    for point, (x, y, _) in zip(points, display, strict=True):
        origin, direction = view.ray(x, y)
        off = np.cross(point - origin, direction)
        assert np.linalg.norm(off) < 1e-6
        assert (point - origin) @ direction > 0
        assert np.linalg.norm(direction) == pytest.approx(1)
    beside = display.copy()
    beside[:, 0] += 1
    assert view.pixel_sizes(points) == pytest.approx(np.linalg.norm(view.scan(beside) - points, axis=1))


def test_fit_shows_every_point_and_wastes_little(camera: SceneCamera) -> None:
    rng = np.random.default_rng(2)
    points = rng.normal(size=(500, 3)) * [20, 5, 3] + [100, -50, 7]
    for letter in VIEWPOINTS:
        camera.view_from(letter)
        camera.rotate(15, 40)
        camera.fit(points)
        pixels = camera.viewpoint().display(points)[:, :2]
        assert (pixels > 0).all()
        assert (pixels < SIZE).all()
        assert (np.ptp(pixels, axis=0) / SIZE).max() > 0.6


def test_switching_the_projection_keeps_the_size_of_what_is_in_the_middle(camera: SceneCamera) -> None:
    before = camera.viewpoint().pixel_sizes(camera.focus[None])
    camera.parallel = not camera.parallel
    assert camera.viewpoint().pixel_sizes(camera.focus[None]) == pytest.approx(before, rel=1e-6)


def test_drags_follow_the_hand(camera: SceneCamera) -> None:
    control = CameraControl(camera)
    point = camera.viewpoint().scan([[120.0, 90.0, camera.viewpoint().display(camera.focus[None])[0, 2]]])
    control.press(Button.MIDDLE, 120, 90)
    control.move(150, 100)
    control.move(190, 140)
    assert camera.viewpoint().display(point)[0, :2] == pytest.approx([190, 140], abs=1e-6)
    assert not control.release(190, 140)

    control.press(Button.RIGHT, 50, 100)
    size = camera.viewpoint().pixel_sizes(camera.focus[None])[0]
    assert control.move(50, 60)
    assert camera.viewpoint().pixel_sizes(camera.focus[None])[0] < size
    control.release(50, 60)
    assert control.wheel(-2)

    camera.view_from("A")
    nose = camera.focus + np.array([0, -5, 0])
    control.press(Button.LEFT, 100, 100)
    control.move(130, 100)
    assert camera.viewpoint().display(nose[None])[0, 0] > 200  # the near side goes along with the hand
    control.move(130, 130)
    assert camera.viewpoint().display(nose[None])[0, 1] > 150
    control.release(130, 130)

    camera.view_from("A")
    control.press(Button.LEFT, 300, 150, Modifier.CTRL)
    control.move(200, 250)  # a quarter turn about the middle, clockwise
    shown = camera.viewpoint().display([camera.focus + np.array([0, 0, 3])])[0, :2] - [200, 150]
    assert shown[0] > 10
    assert abs(shown[1]) < 1e-6
    assert camera.direction == pytest.approx([0, 1, 0])


def test_a_click_moves_nothing_and_a_trembling_hand_clicks(camera: SceneCamera) -> None:
    control, before = CameraControl(camera), camera.state()
    control.press(Button.LEFT, 100, 100)
    assert not control.move(102, 101)
    assert control.release(101, 103)
    assert camera.state() == before
    assert not control.move(300, 300)  # no button is down
    assert not control.release(300, 300)
    control.press(Button.LEFT, 100, 100)
    control.move(140, 100)
    assert not control.release(100, 100)  # back again, but it was a drag


def test_state_comes_back_exactly_and_nonsense_does_not(camera: SceneCamera) -> None:
    camera.rotate(31, 17)
    state, view = camera.state(), camera.viewpoint().matrix
    camera.view_from("S")
    camera.zoom(3)
    camera.restore(state)
    assert camera.viewpoint().matrix == pytest.approx(view, abs=1e-9)
    with pytest.raises(GeometryError, match="camera state is damaged"):
        camera.restore({"position": [1, 2, 3]})
    with pytest.raises(GeometryError, match="looks nowhere"):
        camera.restore({**state, "position": state["focus"]})
    with pytest.raises(GpError, match="viewpoint must be one of A, P, L, R, S, I, got 'X'"):
        camera.view_from("X")


@pytest.mark.parametrize(
    ("button", "modifiers", "drag"),
    [
        (Button.LEFT, Modifier.NONE, DragMode.ROTATE),
        (Button.LEFT, Modifier.CTRL, DragMode.SPIN),
        (Button.LEFT, Modifier.SHIFT, DragMode.PAN),
        (Button.MIDDLE, Modifier.NONE, DragMode.PAN),
        (Button.RIGHT, Modifier.NONE, DragMode.ZOOM),
    ],
)
def test_the_mapping_is_slicers(button: Button, modifiers: Modifier, drag: DragMode) -> None:
    assert drag_of(button, modifiers) is drag


def test_slice_gestures() -> None:
    view = SliceViewport(Plane.AXIAL.in_scan, 5.0, np.array([10.0, 20.0]), 0.1, SIZE)
    control = SliceControl()
    assert not control.press(Button.LEFT, 10, 10)
    assert control.move(view, 60, 60) is view
    assert not control.release(60, 60)
    assert control.press(Button.LEFT, 10, 10, Modifier.SHIFT)
    assert control.move(view, 30, 5).centre == pytest.approx([8.0, 20.5])
    control.release(30, 5)
    assert control.press(Button.RIGHT, 100, 100)
    zoomed = control.move(view, 100, 70)
    assert zoomed.mm_per_pixel < 0.1
    assert zoomed.pixel_to_scan([[100, 100]]) == pytest.approx(view.pixel_to_scan([[100, 100]]))
    control.release(100, 70)
    assert control.wheel(view, 2, 0, 0, Modifier.NONE, 0.25).position == pytest.approx(5.5)
    assert control.wheel(view, 1, 9, 9, Modifier.CTRL, 0.25).mm_per_pixel < 0.1
    control.press(Button.LEFT, 5, 5)
    assert control.release(6, 6)
