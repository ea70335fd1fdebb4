"""On a slice an estimate is drawn where it lies: cut, not projected, and only as far as it is shown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from panel_cases import workspace_with_scan
from pose_cases import (
    ALL,
    DATA,
    FEATURES,
    MIDDLE,
    PATH,
    POSE,
    SECOND,
    SPREAD,
    TIP,
    TOUCHES,
    TRUTH,
    VECTORS,
    beside,
    placed,
    pose,
    without,
)
from qtpy.QtGui import QImage, QPainter
from window_cases import image_bytes

from gp_core.landmarks.features import Side
from gp_labeler.imaging.mean_cochlea import duct_curve
from gp_labeler.scene.colours import DARK, rgb
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.pose_data import PARTS, PoseScene
from gp_labeler.scene.slice_viewport import SliceViewport
from gp_labeler.views.painting.pose_layer import PoseLayer
from gp_labeler.views.painting.pose_slices import SlicePen, region_section
from gp_labeler.views.slice_view import SliceView

pytestmark = pytest.mark.any_binding

SIZE = (480, 400)
ONLY = {part: frozenset({part}) for part in PARTS}


def through(point: np.ndarray, plane: Plane = Plane.CORONAL) -> SliceViewport:
    cut = plane.in_scan
    return SliceViewport(cut, cut.position_of(point), cut.flat(MIDDLE[None])[0], 0.03, SIZE)


def painted(scene: PoseScene, shown: SliceViewport) -> np.ndarray:
    page = QImage(*SIZE, QImage.Format.Format_RGB888)
    page.fill(0)
    painter = QPainter(page)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    SlicePen(painter, shown, 1.0, scene).draw()
    painter.end()
    rows = image_bytes(page).reshape(SIZE[1], page.bytesPerLine())[:, : 3 * SIZE[0]]
    return rows.reshape(SIZE[1], SIZE[0], 3).astype(float)


def like(image: np.ndarray, role: str) -> np.ndarray:
    wanted = np.array(rgb(DARK.states[role])) * 255
    length = np.linalg.norm(image, axis=2)
    return (length > 60) & (image @ wanted > 0.98 * length * np.linalg.norm(wanted))


def is_seen(seen: np.ndarray, shown: SliceViewport, point: np.ndarray, within: int = 2) -> bool:
    x, y = np.rint(shown.scan_to_pixel(np.reshape(point, (1, 3)))[0]).astype(int)
    return bool(seen[y - within : y + within + 1, x - within : x + within + 1].any())


@pytest.mark.parametrize(
    ("part", "role", "place"),
    [
        ("estimate", "pose", POSE.origin),
        ("estimate", "pose_2", SECOND.origin),
        ("estimate", "pose", POSE.tip - 0.2 * POSE.axis),
        ("truth", "truth", TRUTH.origin),
        ("truth", "truth", TRUTH.tip - 1.5 * TRUTH.axis),
        ("touches", "touch", TOUCHES[0].position),
        ("touches", "doubtful", TOUCHES[1].position),
        ("features", "pose", FEATURES[0].position),
        ("vectors", "pose", (VECTORS[0].start + VECTORS[0].end) / 2),
        ("tip", "touch", TIP.position),
        ("path", "path", PATH[4]),
    ],
)
def test_every_part_is_drawn_where_it_is(part, role, place) -> None:
    shown = through(place)
    seen = like(painted(replace(ALL, parts=ONLY[part]), shown), role)
    assert is_seen(seen, shown, place)
    assert not is_seen(seen, shown, beside(-6.0, 0.0, 5.0))


@pytest.mark.parametrize("part", [*DATA, "tip"])
def test_what_is_hidden_is_not_drawn(part) -> None:
    shown = through(MIDDLE)
    hidden = painted(replace(ALL, parts=ALL.parts - {part}), shown)
    assert (hidden != painted(ALL, shown)).any()
    np.testing.assert_array_equal(hidden, painted(without(part), shown))


def test_without_any_part_or_any_opacity_nothing_is_drawn() -> None:
    shown = through(MIDDLE)
    assert not painted(replace(ALL, parts=frozenset()), shown).any()
    assert not painted(replace(ALL, opacity=0.0), shown).any()
    whole, half = painted(ALL, shown).sum(), painted(replace(ALL, opacity=0.5), shown).sum()
    assert 0.3 < half / whole < 0.7


@pytest.mark.parametrize("side", list(Side))
@pytest.mark.parametrize("plane", list(Plane))
def test_the_cochlea_is_cut_where_its_curve_crosses_the_slice(side, plane) -> None:
    drawn = pose(side=side)
    line, _ = duct_curve(side)
    scan = drawn.at(line)
    shown = through(drawn.at([1.2, 0.0, 0.0])[0], plane)
    image = painted(PoseScene((drawn,), parts=ONLY["cochlea"]), shown)
    off = shown.off_slice(scan)
    crossings = np.flatnonzero(off[:-1] * off[1:] < 0)
    assert len(crossings)
    for n in crossings:
        share = off[n] / (off[n] - off[n + 1])
        assert is_seen(image.any(axis=2), shown, (1 - share) * scan[n] + share * scan[n + 1], 0)
    far = np.abs(off) > 0.7  # thicker than the duct: a projection would show it here
    elsewhere = [p for p in scan[far] if _is_clear(p, scan[~far], shown)]
    assert not any(is_seen(image.any(axis=2), shown, p, 0) for p in elsewhere)


def _is_clear(point: np.ndarray, others: np.ndarray, shown: SliceViewport) -> bool:
    """Whether no part of the coil near the slice, nor the modiolus, lies over a point."""
    pixel = shown.scan_to_pixel(point[None])[0]
    axis = POSE.at(np.linspace([-1.0, 0, 0], [4.4, 0, 0], 40))
    away = np.linalg.norm(shown.scan_to_pixel(np.concatenate([others, axis])) - pixel, axis=1)
    return bool(away.min() * shown.mm_per_pixel > 0.8)


@pytest.mark.parametrize("off_mm", [0.0, 0.12, -0.3])
def test_the_region_is_the_cut_of_the_ellipsoid(off_mm) -> None:
    shown = through(beside(0.0, off_mm, 0.0))
    outline = region_section(POSE, shown)
    assert outline is not None
    off = shown.pixel_to_scan(outline - 0.5) - POSE.origin
    np.testing.assert_allclose(off[:, 1], off_mm, atol=1e-9)
    distance = np.sqrt(np.einsum("ni,ij,nj->n", off, np.linalg.inv(SPREAD[:3, :3]), off))
    np.testing.assert_allclose(distance, 2.79548, rtol=2e-6)  # root of 7.8147, chi squared's 95 % point


def test_a_slice_beside_the_region_does_not_cut_it() -> None:
    assert region_section(POSE, through(beside(0.0, 0.5, 0.0))) is None


def test_names_stand_beside_what_is_near(qtbot) -> None:
    workspace = workspace_with_scan()
    view = SliceView(workspace, Plane.CORONAL)
    qtbot.addWidget(view)
    overlay = PoseLayer(view)
    assert view.layers == [overlay]
    overlay.show(ALL)
    near = {name.text for name in overlay.names(through(MIDDLE), 1.0)}
    beyond = {name.text for name in overlay.names(through(beside(0.0, 2.0, 0.0)), 1.0)}
    assert "labelled" in beyond  # an axis is drawn there, faintly; a point is not
    assert "MN ?" not in beyond
    far = {name.text for name in overlay.names(through(beside(0.0, 9.0, 0.0)), 1.0)}
    assert {"robust · off 2.50 mm, 0.0°", "labelled", "MN ?"} <= near
    assert far == {""}
    workspace.close(discard=True)


def test_a_window_draws_it_with_its_slices_and_takes_it_away(qtbot, window) -> None:
    view = window.grid.slice_views[Plane.CORONAL]
    there = view.shown.pixel_to_scan([(np.array(view.shown.size) - 1) / 2])[0]
    drawn = pose(T_scan_cochlea=placed(at=there))
    empty = view.grab().toImage()
    overlay = PoseLayer(view)
    overlay.show(PoseScene((drawn,)))
    image = view.grab().toImage()
    x, y = view.pixel_at(drawn.origin)
    colour = image.pixelColor(round(x * image.devicePixelRatio()), round(y * image.devicePixelRatio()))
    assert colour.name().upper() == DARK.states["pose"]
    overlay.show(PoseScene())
    assert view.grab().toImage() == empty
