"""Landmarks, outlines, names and the scale bar, painted over a frame of the 3D view."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from overlay_cases import frame_of, pixels_of
from scene_cases import BALL, MIDDLE, RADIUS, coloured, scan_of, unlike_background

from gp_labeler.imaging.surface import Surface, extract_isosurface
from gp_labeler.scene.colours import DARK, LIGHT
from gp_labeler.scene.ghosts import RADIUS_95, GhostEllipsoid, ellipse
from gp_labeler.scene.marks import GlyphSize, Mark
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.scene.target import RenderTarget
from gp_labeler.views.painting.label_layout import place_labels
from gp_labeler.views.painting.marker_pictures import marker_picture
from gp_labeler.views.painting.marks import place_marks, tags_of
from gp_labeler.views.painting.name_tags import NameTag, place_names
from gp_labeler.views.painting.qt_paths import polygon
from gp_labeler.views.painting.scene_overlay import SceneOverlay

pytestmark = pytest.mark.any_binding

SHAPES = ("ball", "diamond", "triangle", "square", "inverted")


@pytest.fixture
def scene(qapp) -> Iterator[Scene3D]:
    made = Scene3D(RenderTarget.offscreen(320, 240))
    made.cube.visible = False
    yield made
    made.close()


@pytest.fixture(scope="module")
def ball() -> Surface:
    return extract_isosurface(scan_of([(BALL, RADIUS)], np.eye(3)), 100)


def _height(frame: np.ndarray) -> int:
    return int(np.ptp(np.nonzero(unlike_background(frame))[0])) + 1


def test_marks_are_drawn_solid_in_front_and_faint_behind_bone(scene: Scene3D, ball: Surface) -> None:
    front, behind = BALL + np.array([1, -RADIUS, 1]), BALL + np.array([-1, RADIUS, -1])
    scene.bone.show([ball])
    scene.marks.show([Mark("front", front), Mark("behind", behind)])
    scene.camera.view_from("A")
    scene.fit()
    assert scene.hidden(scene.marks.positions).tolist() == [False, True]
    pixels = frame_of(scene)
    orange = coloured(pixels, DARK.states["placed"])
    x, y = np.rint(scene.display_of(front[None])[0]).astype(int)
    assert orange[y - 2 : y + 3, x - 2 : x + 3].mean() > 0.7
    x, y = np.rint(scene.display_of(behind[None])[0]).astype(int)
    scene.marks.show([])
    bare = frame_of(scene)
    assert not coloured(bare, DARK.states["placed"]).any()
    change = np.abs(pixels[y, x].astype(int) - bare[y, x]).max()
    assert 8 < change < 120
    scene.camera.view_from("P")
    scene.marks.show([Mark("front", front), Mark("behind", behind)])
    assert scene.hidden(scene.marks.positions).tolist() == [True, False]


def test_glyphs_are_as_large_as_asked_in_pixels_or_mm(scene: Scene3D) -> None:
    scene.marks.show([Mark("a", MIDDLE)])
    for across in (5.0, 40.0):
        scene.camera.focus_on(MIDDLE, across_mm=across)
        scene.marks.size = GlyphSize(20, "px")
        assert _height(frame_of(scene)) == pytest.approx(20, abs=2)
        scene.marks.size = GlyphSize(2.0, "mm")
        expected = 2.0 * 240 / across
        assert np.ptp(np.nonzero(unlike_background(frame_of(scene)))[0]) + 1 == pytest.approx(expected, abs=2)


def test_labels_do_not_cover_each_other() -> None:
    rng = np.random.default_rng(6)
    anchors = rng.uniform(100, 300, (40, 2))
    sizes = np.column_stack([rng.uniform(20, 40, 40), np.full(40, 16.0)])
    ranks = np.zeros(40)
    ranks[7] = 1.0
    corners, shown = place_labels(anchors, sizes, (400, 400), gaps=np.full(40, 8.0), ranks=ranks)
    boxes = np.column_stack([corners, corners + sizes])[shown]
    assert shown[7]
    assert shown.sum() > 20
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(axis=2) - np.diag(sizes[shown].prod(axis=1))
    assert (shared / sizes[shown].prod(axis=1)).max() < 0.36
    assert not place_labels([[500, 10]], [[20, 10]], (400, 400), gaps=[4], ranks=[1])[1].any()
    assert place_labels([], [], (400, 400), gaps=[], ranks=[])[0].shape == (0, 2)


@pytest.mark.parametrize("x", [1.0, 60.0, 100.0, 199.0])
def test_what_must_be_said_is_not_cut_off_by_the_edge(x: float) -> None:
    size = [150.0, 14.0]
    corners, shown = place_labels([[x, 2.0]], [size], (200, 300), gaps=[10], ranks=[1])
    assert shown.all()
    assert (corners >= 0).all()
    assert (corners + size <= [200, 300]).all()
    too_long, _ = place_labels([[x, 2.0]], [[400.0, 14.0]], (200, 300), gaps=[10], ranks=[1])
    assert too_long[0, 0] == 0, "its beginning can be read"


def test_pixels_kept_free_are_no_names_and_take_no_more_room(qapp) -> None:
    place = np.array([100.0, 100.0])
    free = [NameTag("", place + np.array([30.0 * n, 0.0]), DARK.text, 4.0, -2.0) for n in range(3)]
    minor = NameTag("OS", place + np.array([12.0, 0.0]), DARK.text, 6.0, -3.0)
    (word,) = place_names([*free, minor], (400, 200), ratio=1.0, text=12.0, halo=DARK.halo)
    (alone,) = place_names([minor], (400, 200), ratio=1.0, text=12.0, halo=DARK.halo)
    assert word.text == "OS"
    assert (word.x, word.y) == (alone.x, alone.y)


@pytest.mark.parametrize("n", [0, 1, 3, 70])
def test_pixels_become_the_polygon_of_the_same_corners(n: int) -> None:
    points = np.random.default_rng(n).normal(0, 1e3, (n, 2))
    assert [(corner.x(), corner.y()) for corner in polygon(points)] == list(map(tuple, points.tolist()))


def test_names_are_written_beside_their_marks(scene: Scene3D) -> None:
    overlay = SceneOverlay()
    overlay.scale_bar_visible = False
    scene.marks.show([Mark("a", MIDDLE, state="computed")])
    scene.camera.focus_on(MIDDLE)
    without = coloured(frame_of(scene, overlay), DARK.states["computed"]).sum()
    scene.marks.show([Mark("a", MIDDLE, "RWA", state="computed")])
    drawn = coloured(frame_of(scene, overlay), DARK.states["computed"])
    assert overlay.names == ["RWA"]
    assert drawn.sum() > without + 40
    rows, columns = np.nonzero(drawn)
    assert np.abs(columns - 160).max() < 50
    assert np.abs(rows - 120).max() < 30
    overlay.names_visible = False
    assert coloured(frame_of(scene, overlay), DARK.states["computed"]).sum() == without


@pytest.mark.parametrize("show_hidden", [True, False])
def test_hidden_marks_are_faint_or_left_out_but_for_the_active_one(scene: Scene3D, show_hidden: bool) -> None:
    scene.marks.show([Mark("a", MIDDLE, "RWA"), Mark("b", MIDDLE + 1, "RWP", active=True)])
    scene.marks.show_hidden = show_hidden
    view = scene.camera.viewpoint()
    for behind in (False, True, True, False):
        placed = place_marks(scene.marks, view, np.array([behind, behind]), ratio=1.0, bone_opacity=1.0)
        tags = {tag.text: tag.faint for tag in tags_of(placed, DARK, 1.0)}
        assert tags == ({"RWA": behind, "RWP": False} if show_hidden or not behind else {"RWP": False})
        assert [one.opacity for one in placed] == pytest.approx(
            [0.3 * show_hidden if behind else 1.0] * len(placed)
        )


def test_a_ghost_is_outlined_by_its_95_percent_ellipse(scene: Scene3D) -> None:
    covariance = np.diag([0.8, 0.3, 0.1])
    scene.ghosts.show([GhostEllipsoid("L:IN", MIDDLE, covariance, active=True)])
    scene.camera.view_from("A")
    scene.camera.focus_on(MIDDLE, across_mm=12)
    rows, columns = np.nonzero(coloured(frame_of(scene), DARK.states["ghost"]))
    per_mm = 240 / 12
    assert np.ptp(columns) / 2 == pytest.approx(RADIUS_95 * np.sqrt(0.8) * per_mm, abs=3)
    assert np.ptp(rows) / 2 == pytest.approx(RADIUS_95 * np.sqrt(0.1) * per_mm, abs=3)
    outline = ellipse([1, 2], [[4, 1], [1, 2]], 1.5) - [1, 2]
    radius = np.sqrt(np.einsum("ij,jk,ik->i", outline, np.linalg.inv([[4, 1], [1, 2]]), outline))
    assert radius == pytest.approx(1.5)


def test_the_scale_bar_is_at_the_lower_right_and_that_of_the_zoom(scene: Scene3D) -> None:
    empty, overlay = frame_of(scene), SceneOverlay()
    changed = np.abs(frame_of(scene, overlay).astype(int) - empty).max(axis=2) > 30
    assert changed[200:, 180:].sum() > 150
    assert not changed[:200].any()
    assert not changed[:, :180].any()
    seen = []
    for factor in (1.0, 1.3, 2.0, 0.5):
        scene.camera.zoom(factor)
        seen.append(frame_of(scene, overlay))
        bars = (seen[-1][-14:, 180:].min(axis=2) > 200).sum(axis=1)
        per_mm = 1 / scene.camera.viewpoint().pixel_sizes(MIDDLE[None])[0]
        assert bars.max() / per_mm == pytest.approx(round_length(bars.max() / per_mm), abs=4 / per_mm)
    assert all((one != other).any() for one, other in pairwise(seen))


def round_length(mm: float) -> float:
    """Return the nearest of 1, 2 and 5 times a power of ten."""
    lengths = np.array([f * 10.0**k for k in range(-4, 4) for f in (1, 2, 5)])
    return float(lengths[np.abs(np.log(lengths / mm)).argmin()])


@pytest.mark.parametrize("colours", [DARK, LIGHT], ids=["dark", "light"])
def test_at_twice_the_resolution_the_picture_is_the_same_but_finer(ball: Surface, colours, qapp) -> None:
    frames = []
    for ratio in (1, 2):
        scene = Scene3D(RenderTarget.offscreen(320 * ratio, 240 * ratio))
        scene.scale = ratio
        scene.set_colours(colours)
        scene.camera.view_from("A")
        scene.camera.focus_on(MIDDLE, across_mm=12)
        states = ("placed", "computed", "doubtful", "suggested", "reference")
        places = MIDDLE + np.array([[3.0 * (n - 2), 0, 2.0] for n in range(5)])
        scene.marks.show([Mark(s, p, s, s, s == "placed") for s, p in zip(states, places, strict=True)])
        scene.ghosts.show([GhostEllipsoid("g", MIDDLE - [0, 0, 2], np.diag([0.3, 0.2, 0.1]), "IN?")])
        frames.append(frame_of(scene, SceneOverlay(), colours).astype(float))
        scene.close()
    coarse, fine = frames
    halved = fine.reshape(240, 2, 320, 2, 3).mean(axis=(1, 3))
    background = np.abs(coarse - coarse[:, :1]).max(axis=2) < 2
    assert (~background).mean() > 0.03, "much is painted"
    assert np.abs(halved - coarse).mean() < 2.5
    assert np.abs(halved - coarse)[~background].mean() < 40
    moved = np.roll(halved, 4, axis=1)
    assert np.abs(moved - coarse).mean() > 2 * np.abs(halved - coarse).mean(), (
        "four pixels aside would be seen"
    )


def _picture(shape: str, radius: float, *, full: bool, lit: bool = False) -> np.ndarray:
    image = marker_picture(shape, radius, "#F39C1F", full=full, line=1.6, halo=3.2, lit=lit).image
    return pixels_of(image, 4)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("radius", [3.0, 5.5, 20.0])
def test_a_marker_is_as_large_as_asked_whole_and_in_the_middle(qapp, shape: str, radius: float) -> None:
    alpha = _picture(shape, radius, full=True)[..., 3]
    middle = alpha.shape[0] // 2
    assert alpha.shape[0] % 2 == 1
    assert alpha[middle, middle] == 255
    assert alpha[[0, -1]].max() == alpha[:, [0, -1]].max() == 0, "nothing is cut off"
    assert np.abs(alpha.astype(int) - alpha[:, ::-1]).max() < 40
    if shape == "ball":
        assert (alpha / 255).sum() == pytest.approx(np.pi * (radius + 1.6) ** 2, rel=0.05)


def test_markers_differ_by_shape_and_a_hollow_one_shows_what_lies_beneath(qapp) -> None:
    outlines = []
    for shape in SHAPES:
        alpha = np.zeros((81, 81), int)
        found = _picture(shape, 10.0, full=True)[..., 3]
        edge = (81 - len(found)) // 2
        alpha[edge : edge + len(found), edge : edge + len(found)] = found
        outlines.append(alpha > 127)
        hollow = _picture(shape, 10.0, full=False)[..., 3]
        assert hollow[len(hollow) // 2, len(hollow) // 2] == 0
    assert all((a != b).sum() > 60 for n, a in enumerate(outlines) for b in outlines[n + 1 :])
    assert marker_picture("ball", 1e6, "#FFFFFF", full=True, line=2, halo=3).image.width() < 1000


def test_a_lit_marker_is_brighter_towards_the_upper_left(qapp) -> None:
    picture = _picture("ball", 10.0, full=True, lit=True)
    middle = len(picture) // 2
    assert picture[middle - 4, middle - 4, :3].mean() > picture[middle + 5, middle + 5, :3].mean() + 25
