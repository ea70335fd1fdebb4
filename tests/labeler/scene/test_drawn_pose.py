"""An estimated cochlea in the 3D view is drawn where it is, also behind bone, and lets go of everything."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scene_cases import MIDDLE, scan_of

from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.scene.pose import PoseActor
from gp_labeler.scene.pose_data import AXIS_MM, DrawnPose, PoseScene
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.scene.target import RenderTarget

TURN = np.array([[0.6, 0.0, -0.8], [0.0, 1.0, 0.0], [0.8, 0.0, 0.6]])
POSE = DrawnPose(
    "L",
    np.block([[TURN, MIDDLE[:, None]], [np.zeros((1, 3)), 1.0]]),
    np.diag([0.02] * 3 + [0.005] * 3),
    np.radians(9.0),
)


@pytest.fixture
def scene() -> Iterator[Scene3D]:
    made = Scene3D(RenderTarget.offscreen(320, 240))
    made.scale_bar.visible = made.cube.visible = False
    made.camera.view_from("A")
    yield made
    made.close()


def blue(image: np.ndarray) -> np.ndarray:
    red, green, blue = image.astype(int).transpose(2, 0, 1)
    return (blue - red > 40) & (blue - green > 15)


def test_shape() -> None:
    np.testing.assert_allclose(np.linalg.norm(POSE.tip - POSE.origin), AXIS_MM)
    from_tip = POSE.rim - POSE.tip
    np.testing.assert_allclose(from_tip @ POSE.axis, 0.0, atol=1e-12)
    angle = np.arctan(np.linalg.norm(from_tip, axis=1) / AXIS_MM)
    np.testing.assert_allclose(np.degrees(angle), 9.0)


@pytest.mark.parametrize("in_bone", [False, True])
def test_origin_and_axis_are_seen_also_through_bone(scene, in_bone) -> None:
    if in_bone:
        scene.bone.show([extract_isosurface(scan_of([(MIDDLE, 7.0)], np.eye(3)), 100.0)])
    scene.pose.show(PoseScene((POSE,)))
    scene.camera.focus_on(MIDDLE, across_mm=16.0)
    seen = blue(scene.image())
    for point in (POSE.origin, POSE.tip - 0.4 * POSE.axis):
        x, y = np.rint(scene.display_of(point[None])[0]).astype(int)
        assert seen[y, x]
    x, y = np.rint(scene.display_of((POSE.origin - 4.0 * POSE.axis)[None])[0]).astype(int)
    assert not seen[y, x]


def test_showing_nothing_takes_everything_away(scene) -> None:
    empty = scene.image()
    scene.pose.show(PoseScene((POSE,)))
    assert (scene.image() != empty).any()
    scene.pose.show(PoseScene())
    np.testing.assert_array_equal(scene.image(), empty)
    assert isinstance(scene.pose, PoseActor)
    assert scene.pose.poses == ()
