"""Both ears of one head: the mid-plane from touches, two estimates that check each other, one axis."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from atlas_cases import random_pose

from gp_core import PROBE, Atlas, GpError, LandmarkSet, Side, estimate_pose
from gp_core.atlas.sampling import draw_animal
from gp_core.cli.entry import main
from gp_core.frames import angle_between_deg
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.pose.both_ears import check_ears, fuse_ears, mirror_plane

ATLAS = Atlas.published()


def _head(
    seed: int, noise: float = 0.1, shift: float = 0.0
) -> tuple[dict[Side, LandmarkSet], dict[Side, LandmarkSet]]:
    """Return true sides of a head, and touches of both ears; the right ear's are shifted, mm."""
    rng = np.random.default_rng(seed)
    head = draw_animal(ATLAS, rng=rng)
    placed = random_pose(rng)
    truth = {side: with_cochlea_origin(head.side(side)).moved(placed) for side in Side}
    off = rng.standard_normal(3)
    touches = {
        side: LandmarkSet.from_touches(
            {
                code: truth[side][code]
                + noise * rng.standard_normal(3)
                + (side is Side.RIGHT) * shift * off / np.linalg.norm(off)
                for code in PROBE
            },
            side,
        )
        for side in Side
    }
    return truth, touches


def test_mirror_images_agree_exactly() -> None:
    rng = np.random.default_rng(0)
    points = {code: ATLAS[code] + np.array([0, 6.0, 0]) for code in (*PROBE, "OI")}
    pose = random_pose(rng)
    left = LandmarkSet.from_mapping(points, "L").moved(pose)
    right = LandmarkSet.from_mapping({c: p * [1, -1, 1] for c, p in points.items()}, "R").moved(pose)
    plane = mirror_plane(left, right)
    np.testing.assert_allclose(plane.normal, pose.rotation @ [0, 1, 0], atol=1e-9)
    assert plane.residual_mm < 1e-9
    check = check_ears(estimate_pose(left, "L"), estimate_pose(right, "R"), plane)
    assert check.origin_mm < 1e-6
    assert check.axis_deg < 1e-4
    assert check.agrees


def test_the_two_ears_of_a_head_agree_and_a_knocked_reference_between_them_is_told() -> None:
    agreed, knocked = [], []
    for seed in range(12):
        for shift, found in ((0.0, agreed), (8.0, knocked)):
            _, touches = _head(seed, shift=shift)
            poses = {side: estimate_pose(touches[side], side) for side in Side}
            plane = mirror_plane(touches[Side.LEFT], touches[Side.RIGHT])
            found.append(check_ears(poses[Side.LEFT], poses[Side.RIGHT], plane).agrees)
    assert np.mean(agreed) > 0.9
    assert np.mean(knocked) < 0.4


def test_one_axis_of_both_ears_is_nearer_to_the_truth() -> None:
    single, fused, within = [], [], []
    for seed in range(30):
        truth, touches = _head(seed, noise=0.3)
        poses = {side: estimate_pose(touches[side], side) for side in Side}
        plane = mirror_plane(touches[Side.LEFT], touches[Side.RIGHT])
        try:
            both = fuse_ears(poses[Side.LEFT], poses[Side.RIGHT], plane)
        except GpError:
            continue
        for side in Side:
            axis = truth[side]["CA"] - truth[side]["CO"]
            single.append(angle_between_deg(poses[side].axis, axis))
            fused.append(angle_between_deg(both[side].axis, axis))
            within.append(fused[-1] < np.degrees(both[side].cone_95))
            np.testing.assert_array_equal(both[side].origin, poses[side].origin)
            assert both[side].plain_cone_95 < 1.02 * poses[side].plain_cone_95
    assert len(single) > 50
    assert np.mean(fused) < 0.95 * np.mean(single)
    assert np.mean(within) > 0.9


def test_what_is_no_pair_of_ears_is_refused() -> None:
    _, touches = _head(0)
    left, right = touches[Side.LEFT], touches[Side.RIGHT]
    with pytest.raises(GpError, match="left and of the right"):
        mirror_plane(right, left)
    few = LandmarkSet.from_mapping(right.as_mapping(("CL", "MN")), "R", frame="tracker")
    with pytest.raises(GpError, match="touched on both sides, got 2"):
        mirror_plane(left, few)
    same = LandmarkSet.from_mapping(left.as_mapping(), "R", frame="tracker")
    with pytest.raises(GpError, match="about one plane"):
        mirror_plane(left, same)


def test_the_command_checks_and_joins_both_ears(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, touches = _head(3)
    file = tmp_path / "head.csv"
    rows = [
        f"{code}_{side.value},{','.join(map(repr, point.tolist()))}"
        for side in Side
        for code, point in touches[side].as_mapping().items()
    ]
    file.write_text("name,x,y,z\n" + "\n".join(rows) + "\n")
    out = tmp_path / "pose.json"
    words = ["estimate", str(file), "--side", "L", "--other-ear", str(file), "--json", str(out)]
    assert main(words) in (0, 3)
    assert "the two ears agree: CO 0." in capsys.readouterr().out
    content = json.loads(out.read_text())
    assert content["other_ear"]["agrees"] is True
    assert main([*words, "--both-ears"]) in (0, 3)
    joined = json.loads(out.read_text())
    assert joined["plain_cone_95_deg"] < 1.02 * content["plain_cone_95_deg"]
    assert joined["modiolar_axis"] != content["modiolar_axis"]
    assert joined["cochlea_origin_mm"] == content["cochlea_origin_mm"]
    assert main(["estimate", str(file), "--side", "L", "--both-ears"]) == 2
    assert "--other-ear" in capsys.readouterr().err
