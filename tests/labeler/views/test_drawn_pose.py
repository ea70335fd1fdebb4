"""Estimates in the 3D view are drawn where they are, also behind bone, and let go of everything."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from overlay_cases import frame_of
from pose_cases import (
    ALL,
    DATA,
    FEATURES,
    MIDDLE,
    PATH,
    POSE,
    SECOND,
    TIP,
    TOUCHES,
    TRUTH,
    VECTORS,
    pose,
    without,
)
from scene_cases import scan_of

from gp_core.landmarks.features import Side
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.scene.colours import DARK, LIGHT, rgb
from gp_labeler.scene.pose_camera import along_axis, place_camera, through_round_window
from gp_labeler.scene.pose_data import PARTS, PoseScene
from gp_labeler.scene.pose_names import written_in
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.scene.target import RenderTarget
from gp_labeler.views.painting.name_tags import pose_tags
from gp_labeler.views.painting.scene_overlay import SceneOverlay

pytestmark = pytest.mark.any_binding

ONLY = {part: frozenset({part}) for part in PARTS}


@pytest.fixture
def scene(qapp) -> Iterator[Scene3D]:
    made = Scene3D(RenderTarget.offscreen(480, 360))
    made.cube.visible = False
    made.camera.view_from("A")
    made.camera.focus_on(MIDDLE, across_mm=14.0)
    yield made
    made.close()


def like(image: np.ndarray, colour: str) -> np.ndarray:
    """Return which pixels have about the hue of a colour, whatever the light on them."""
    pixels, wanted = image.astype(float), np.array(rgb(colour)) * 255
    pixels = pixels - pixels.min(axis=2, keepdims=True)
    wanted = wanted - wanted.min()
    length = np.linalg.norm(pixels, axis=2)
    return (length > 45) & (pixels @ wanted > 0.97 * length * np.linalg.norm(wanted))


def is_seen(scene: Scene3D, seen: np.ndarray, point: np.ndarray, within: int = 2) -> bool:
    x, y = np.rint(scene.display_of(np.reshape(point, (1, 3)))[0]).astype(int)
    return bool(seen[y - within : y + within + 1, x - within : x + within + 1].any())


@pytest.mark.parametrize("in_bone", [False, True])
def test_origin_and_axis_are_seen_also_through_bone(scene, in_bone) -> None:
    if in_bone:
        scene.bone.show([extract_isosurface(scan_of([(MIDDLE, 7.0)], np.eye(3)), 100.0)])
    scene.pose.show(PoseScene((POSE,), parts=ONLY["estimate"]))
    seen = like(frame_of(scene), DARK.states["pose"])
    for point in (POSE.origin, POSE.tip - 0.4 * POSE.axis):
        assert is_seen(scene, seen, point)
    assert not is_seen(scene, seen, POSE.origin - 4.0 * POSE.axis)


def test_two_estimates_and_the_labelled_one_have_colours_of_their_own(scene) -> None:
    scene.pose.show(replace(ALL, parts=ONLY["estimate"] | ONLY["truth"]))
    image = frame_of(scene)
    for role, drawn in (("pose", POSE), ("pose_2", SECOND), ("truth", TRUTH)):
        seen = like(image, DARK.states[role])
        assert is_seen(scene, seen, drawn.origin)
        others = [other for other in (POSE, SECOND, TRUTH) if other is not drawn]
        assert not any(is_seen(scene, seen, other.origin) for other in others)


@pytest.mark.parametrize(
    ("part", "role", "place"),
    [
        ("truth", "truth", TRUTH.origin),
        ("touches", "touch", TOUCHES[0].position),
        ("touches", "doubtful", TOUCHES[1].position),
        ("features", "pose", FEATURES[0].position),
        ("vectors", "pose", (VECTORS[0].start + VECTORS[0].end) / 2),
        ("tip", "touch", TIP.position - [0.8, 0.0, 0.0]),
        ("tip", "touch", TIP.trail[4]),
        ("path", "path", PATH[4]),
    ],
)
def test_every_part_is_drawn_where_it_is(scene, part, role, place) -> None:
    scene.pose.show(replace(ALL, parts=ONLY[part]))
    assert is_seen(scene, like(frame_of(scene), DARK.states[role]), place)


@pytest.mark.parametrize("part", [*DATA, "tip"])
def test_what_is_hidden_is_not_drawn(scene, part) -> None:
    scene.pose.show(ALL)
    everything = frame_of(scene, names=False)
    scene.pose.show(replace(ALL, parts=ALL.parts - {part}))
    hidden = frame_of(scene, names=False)
    assert (hidden != everything).any()
    scene.pose.show(without(part))
    np.testing.assert_array_equal(hidden, frame_of(scene, names=False))


@pytest.mark.parametrize("part", ["estimate", "region", "cochlea", "names"])
def test_parts_of_an_estimate_are_shown_alone_or_not_at_all(scene, part) -> None:
    nothing = frame_of(scene)
    scene.pose.show(replace(ALL, parts=frozenset()))
    np.testing.assert_array_equal(frame_of(scene), nothing)
    scene.pose.show(replace(ALL, parts=ONLY[part] | ONLY["estimate"]))
    assert (frame_of(scene) != nothing).any()


def test_opacity_fades_all(scene) -> None:
    nothing = frame_of(scene).astype(float)
    strength = []
    for opacity in (0.0, 0.4, 1.0):
        scene.pose.show(replace(ALL, opacity=opacity, parts=ALL.parts - {"names"}))
        strength.append(np.abs(frame_of(scene) - nothing).sum())
    assert strength[0] == 0
    assert 0.2 < strength[1] / strength[2] < 0.9


def test_the_region_is_as_large_as_the_covariance_says(scene) -> None:
    nothing = frame_of(scene)
    scene.pose.show(PoseScene((POSE,), parts=ONLY["region"]))
    seen = (frame_of(scene) != nothing).any(axis=2)
    for axis, sigma in ((0, np.sqrt(0.03)), (2, np.sqrt(0.01))):
        rim = POSE.origin - 2.795 * sigma * np.eye(3)[axis]  # the cone is on the other side
        assert is_seen(scene, seen, rim)
        assert not is_seen(scene, seen, rim - 0.35 * np.eye(3)[axis])


def test_a_right_ear_is_coiled_the_other_way(scene) -> None:
    """The basal turn leads from the round window first below the axis (-z), on the right above (+z)."""
    ends = []
    for side in Side:
        scene.pose.show(PoseScene((pose(side=side),), parts=ONLY["cochlea"]))
        place_camera(scene.camera, along_axis(POSE))
        columns = np.nonzero(like(frame_of(scene), DARK.states["pose"]))[1]
        ends.append(np.array([columns.min(), columns.max()]) - scene.display_of(POSE.origin[None])[0, 0])
    assert abs(ends[0].sum()) > 2.0  # the first half turn is wider than the second
    np.testing.assert_allclose(ends[0], -ends[1][::-1], atol=2.0)


def test_a_probe_that_is_hidden_is_grey(scene) -> None:
    scene.pose.show(PoseScene(tip=TIP))
    assert like(frame_of(scene), DARK.states["touch"]).any()
    scene.pose.show_tip(replace(TIP, visible=False))
    image = frame_of(scene)
    assert not like(image, DARK.states["touch"]).any()
    assert (image != image[0, 0]).any()
    scene.pose.show_tip(None)
    assert scene.pose.scene.tip is None


def test_cameras_look_along_the_axis_and_through_the_window(scene) -> None:
    place_camera(scene.camera, along_axis(POSE))
    origin, tip, window = scene.display_of(np.stack([POSE.origin, POSE.tip, POSE.at([0, 2.4, 0])[0]]))
    np.testing.assert_allclose(origin, tip, atol=1e-6)
    np.testing.assert_allclose(origin[0], window[0], atol=1e-6)
    assert window[1] < origin[1] - 10
    place_camera(scene.camera, through_round_window(POSE))
    origin, tip, window = scene.display_of(np.stack([POSE.origin, POSE.tip, POSE.at([0, 2.4, 0])[0]]))
    np.testing.assert_allclose(origin, window, atol=1e-6)
    np.testing.assert_allclose(origin, (np.array(scene.target.size) - 1) / 2, atol=1e-6)


def test_names_are_written_in_the_colours_of_what_they_name(scene) -> None:
    overlay = SceneOverlay()
    overlay.place(scene, DARK)
    assert overlay.names == []
    scene.pose.show(ALL)
    overlay.place(scene, DARK)
    assert {"robust · off 2.50 mm, 0.0°", "MN ?"} <= set(overlay.names)
    written = written_in(scene.pose.scene)
    tags = {tag.text: tag for tag in pose_tags(written, written.places[:, :2], DARK)}
    assert tags["robust · off 2.50 mm, 0.0°"].colour == DARK.word("pose")
    assert tags["MN ?"].colour == DARK.word("doubtful")


def test_a_theme_recolours_what_is_drawn(scene) -> None:
    scene.pose.show(PoseScene((POSE,)))
    scene.set_colours(LIGHT)
    assert is_seen(scene, like(frame_of(scene, colours=LIGHT), LIGHT.states["pose"]), POSE.origin)


def test_showing_nothing_takes_everything_away(scene) -> None:
    empty = frame_of(scene)
    scene.pose.show(ALL)
    assert (frame_of(scene) != empty).any()
    scene.pose.show(PoseScene())
    np.testing.assert_array_equal(frame_of(scene), empty)
    assert scene.pose.poses == ()


def _props(scene: Scene3D) -> list[object]:
    found = []
    for renderer in (scene.layers.base, scene.layers.overlay):
        props = renderer.GetViewProps()
        found += [props.GetItemAsObject(n) for n in range(props.GetNumberOfItems())]
    return found


def test_actors_are_moved_and_not_made_again(scene) -> None:
    scene.pose.show(ALL)
    before = _props(scene)
    for shift in range(5):
        scene.pose.show(replace(ALL, poses=(pose(cone=0.1 + 0.02 * shift), SECOND)))
        scene.render()
    assert [id(prop) for prop in _props(scene)] == [id(prop) for prop in before]


def test_closing_lets_every_vtk_object_go() -> None:
    scene = Scene3D(RenderTarget.offscreen(100, 80))
    scene.pose.show(ALL)
    scene.render()
    things = [weakref.ref(thing) for thing in _props(scene)]
    scene.close()
    del scene
    gc.collect()
    assert [thing() for thing in things if thing() is not None] == []
