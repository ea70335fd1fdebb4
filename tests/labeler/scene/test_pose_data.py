"""What is drawn of an estimate says what the estimate says, in the scan."""

from __future__ import annotations

import numpy as np
import pytest
from pose_cases import ALL, POSE, TRUTH, pose

from gp_core import PROBE, Atlas, RigidTransform, Side, estimate_pose
from gp_labeler.scene.pose_camera import along_axis, through_round_window
from gp_labeler.scene.pose_data import (
    AXIS_MM,
    BEHIND_MM,
    DrawnPose,
    DrawnTruth,
    DrawnVector,
    error_text,
)
from gp_labeler.scene.pose_names import texts_of
from gp_labeler.scene.pose_rows import axes_of, dashes
from gp_labeler.views.painting.label_layout import place_labels

SIGNS = {Side.LEFT: 1.0, Side.RIGHT: -1.0}


def estimated(side: Side, noise: float = 0.1):
    rng, atlas = np.random.default_rng(4), Atlas.published()
    touched = {code: atlas[code] * [SIGNS[side], 1, 1] + rng.normal(0, noise, 3) for code in PROBE}
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    T_scan_touches = RigidTransform.from_parts(turn, [30.0, -20.0, 10.0], dst="scan", src="tracker")
    return estimate_pose(touched, side, atlas), T_scan_touches, touched, atlas


@pytest.mark.parametrize("side", list(Side))
def test_an_estimate_is_brought_into_the_scan(side) -> None:
    found, T_scan_touches, _, _ = estimated(side)
    drawn = DrawnPose.of(found, T_scan_touches, label="CO")
    np.testing.assert_allclose(drawn.origin, T_scan_touches.apply(found.origin[None])[0])
    np.testing.assert_allclose(drawn.axis, T_scan_touches.apply_vector(found.axis))
    turn = T_scan_touches.rotation
    np.testing.assert_allclose(drawn.covariance[:3, :3], turn @ found.covariance[:3, :3] @ turn.T)
    np.testing.assert_allclose(drawn.covariance[:3, 3:], turn @ found.covariance[:3, 3:] @ turn.T)
    assert (drawn.side, drawn.role, drawn.style) == (side, "pose", "dashed")


def test_shape() -> None:
    np.testing.assert_allclose(np.linalg.norm(POSE.tip - POSE.origin), AXIS_MM)
    from_tip = POSE.rim - POSE.tip
    np.testing.assert_allclose(from_tip @ POSE.axis, 0.0, atol=1e-12)
    angle = np.arctan(np.linalg.norm(from_tip, axis=1) / AXIS_MM)
    np.testing.assert_allclose(np.degrees(angle), 9.0)


def test_errors_are_written_at_the_estimates_of_that_side_only() -> None:
    turn = np.radians(3.1)
    x, y = POSE.T_scan_cochlea[:3, 0], POSE.T_scan_cochlea[:3, 1]
    truth = DrawnTruth(Side.LEFT, POSE.origin + 0.42 * y, np.cos(turn) * x + np.sin(turn) * y)
    np.testing.assert_allclose(truth.errors(POSE), (0.42, turn))
    assert error_text(0.42, turn) == "0.42 mm, 3.1°"
    scene = type(ALL)((POSE, pose(side=Side.RIGHT, label="other")), (truth,))
    assert [scene.text_of(each) for each in scene.poses] == ["robust · off 0.42 mm, 3.1°", "other"]


def test_long_vectors_and_suspects_are_named() -> None:
    words = [name.text for name in texts_of(ALL)]
    assert "CL 2.0 mm" in words
    assert "MN ?" in words
    assert "labelled" in words
    assert "OS" not in words  # labelled points of that name stand beside it
    assert not DrawnVector(np.zeros(3), np.array([0.9, 0, 0])).is_long


@pytest.mark.parametrize("style", ["solid", "dashed", "dotted"])
def test_dashes_cover_the_line(style) -> None:
    found = dashes(6.0, style)
    assert found[0][0] == 0.0
    assert all(0 <= start < end <= 6.0 for start, end in found)
    assert (len(found) == 1) == (style == "solid")


def test_what_is_estimated_is_broken_and_what_is_labelled_solid() -> None:
    rods = {role: [s for s in axes_of(ALL) if s.role == role and s.shape == 0] for role in ("pose", "truth")}
    assert len(rods["pose"]) > 4
    longest = max(rod.long[0] for rod in rods["truth"])
    np.testing.assert_allclose(longest, np.linalg.norm(TRUTH.tip - TRUTH.tail))
    np.testing.assert_allclose(longest, AXIS_MM + BEHIND_MM)


@pytest.mark.parametrize("side", list(Side))
def test_views_look_down_the_axis_and_through_the_window_with_the_head_upright(side) -> None:
    """On the left x points forward, y to the left and z up; the right ear is its mirror image."""
    forward, up = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    outward = np.array([SIGNS[side], 0.0, 0.0])
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([forward, outward, np.cross(forward, outward)], axis=1)
    drawn = pose(T_scan_cochlea=matrix, side=side)
    np.testing.assert_allclose(drawn.up, up, atol=1e-12)
    down, inward = along_axis(drawn), through_round_window(drawn)
    np.testing.assert_allclose((down.direction, down.up), (-forward, outward), atol=1e-12)
    np.testing.assert_allclose((inward.direction, inward.up), (-outward, up), atol=1e-12)


def test_names_stay_off_what_only_keeps_its_place_free() -> None:
    anchors = np.array([[50.0, 50.0], *([[66.0 + 8 * k, 44.0] for k in range(8)])])
    sizes = np.array([[40.0, 10.0], *([[0.0, 0.0]] * 8)])
    gaps, ranks = [6.0] + [14.0] * 8, [1.0] + [-2.0] * 8
    corners, shown = place_labels(anchors, sizes, (200, 100), gaps=gaps, ranks=ranks)
    assert shown.tolist() == [True] + [False] * 8
    low, high = corners[0], corners[0] + sizes[0]
    covered = [(low < spot + 7).all() and (high > spot - 7).all() for spot in anchors[1:]]
    assert not any(covered)


def test_another_reading_is_drawn_dotted_with_its_odds_and_its_own_region() -> None:
    _, T_scan_touches, touched, atlas = estimated(Side.LEFT)
    found = estimate_pose({**touched, "CL": touched["OS"], "OS": touched["CL"]}, "L", atlas)
    reading = found.hypotheses[0]
    drawn = DrawnPose.of_reading(reading, T_scan_touches)
    np.testing.assert_allclose(drawn.origin, T_scan_touches.apply(reading.origin[None])[0])
    assert (drawn.style, drawn.side) == ("dotted", Side.LEFT)
    assert drawn.label == f"100 % {reading.label}"
    shown = DrawnPose.of(found, T_scan_touches)
    assert (shown.cone, drawn.key != shown.key) == (found.plain_cone_95, True)
    assert found.radius_95 > 1.5 * found.plain_radius_95
