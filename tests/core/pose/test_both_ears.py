"""Both ears of one head: the mid-plane from touches, two estimates that check each other, one axis."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from atlas_cases import random_pose
from scipy.spatial.transform import Rotation

from gp_core import (
    EXTERNAL,
    PROBE,
    Atlas,
    EarComparison,
    GpError,
    LandmarkSet,
    Side,
    estimate_pose,
    read_pose,
)
from gp_core.atlas.sampling import draw_animal
from gp_core.cli.entry import main
from gp_core.frames import RigidTransform, angle_between_deg
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.pose.both_ears import check_ears, compare_ears, fuse_ears, mirror_plane
from gp_core.pose.skull_link import link_by_skull

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


@pytest.mark.parametrize("side", Side)
def test_a_mistouch_on_one_ear_is_named_by_its_pair_and_ordinary_ears_have_none(side: Side) -> None:
    named, wrong, alarms = 0, 0, 0
    for seed in range(25):
        _, touches = _head(seed)
        alarms += bool(_compared(touches).check.suspects)
        way = np.random.default_rng(seed).standard_normal(3)
        off = 2.5 * way / np.linalg.norm(way)
        code = ("CL", "LLI", "OS", "RWA", "RWP")[seed % 5]
        check = _compared({**touches, side: touches[side].with_point(code, touches[side][code] + off)}).check
        assert not check.agrees or not check.suspects
        named += code in check.suspects[:1]
        wrong += bool(check.suspects) and check.suspects[0] != code
    assert named >= 21
    assert wrong <= 2
    assert alarms <= 1


def _compared(touches: dict[Side, LandmarkSet], **options: object) -> EarComparison:
    left, right = touches[Side.LEFT], touches[Side.RIGHT]
    return compare_ears(left, estimate_pose(left, "L"), right, estimate_pose(right, "R"), **options)


def _with_skull(touches: dict[Side, LandmarkSet], noise: float, seed: int) -> dict[Side, LandmarkSet]:
    """Touch four skull features with each ear, the first two of them in the mid-plane."""
    rng = np.random.default_rng(seed)
    plane = mirror_plane(touches[Side.LEFT], touches[Side.RIGHT])
    middle = touches[Side.LEFT]["OS"] - 8 * plane.normal
    places = middle + rng.normal(0, 8, (4, 3))
    places[:2] -= np.outer(places[:2] @ plane.normal - plane.offset, plane.normal)
    return {
        side: replace(
            one, extra={f"S{n + 1}": place + noise * rng.standard_normal(3) for n, place in enumerate(places)}
        )
        for side, one in touches.items()
    }


def test_skull_features_tell_that_the_head_moved_between_the_ears_and_bring_it_back() -> None:
    motion = RigidTransform.from_parts(
        Rotation.from_rotvec([0.05, -0.1, 0.08]).as_matrix(), [2, -3, 1], dst="tracker", src="tracker"
    )
    still, moved = 0, 0
    for seed in range(8):
        touches = _with_skull(_head(seed)[1], 0.1, seed)
        before = _compared(touches)
        assert before.link is not None
        still += not before.link.has_moved
        knocked = {**touches, Side.RIGHT: touches[Side.RIGHT].moved(motion)}
        after = _compared(knocked)
        assert after.link is not None
        moved += after.link.has_moved
        assert after.check.plane.residual_mm < before.check.plane.residual_mm + 0.5
        assert after.check.origin_mm == pytest.approx(before.check.origin_mm, abs=1.0)
        assert after.check.axis_deg == pytest.approx(before.check.axis_deg, abs=3.0)
        assert after.poses[Side.RIGHT].radius_95 == pytest.approx(
            before.poses[Side.RIGHT].radius_95, rel=1e-6
        )
    assert still >= 7
    assert moved == 8
    assert "moved against its reference" in after.link.text
    assert after.as_dict()["skull"]["moved"] is True
    two = replace(touches[Side.LEFT], extra={"S1": [0, 0, 0], "S2": [1, 0, 0]})
    assert link_by_skull(two, two) is None


@pytest.mark.parametrize(("shift_mm", "has_moved"), [(0.0, False), (0.02, False), (1.0, True)])
def test_a_shift_below_the_noise_of_touches_is_no_motion(shift_mm: float, has_moved: bool) -> None:
    """However well the features of one ear are registered to those of the other."""
    places = {"S1": [0.0, 0, 0], "S2": [12.0, 0, 1], "S3": [3.0, 9, 0], "S4": [5.0, 2, 8]}
    ear = replace(_head(0)[1][Side.LEFT], extra=places)
    other = replace(ear, extra={name: np.add(at, [shift_mm, 0, 0]) for name, at in places.items()})
    link = link_by_skull(ear, other)
    assert link is not None
    assert link.has_moved is has_moved
    assert link.apart_mm == pytest.approx(shift_mm)


def test_skull_features_of_the_midline_determine_the_plane_better() -> None:
    without, with_midline = [], []
    for seed in range(20):
        truth, touches = _head(seed, noise=0.4)
        exact = mirror_plane(*(LandmarkSet.from_mapping(truth[s].as_mapping(EXTERNAL), s) for s in Side))
        normal = exact.normal
        rng = np.random.default_rng(seed)
        places = (
            np.array([[0, 0, 0], [12.0, 0, 0], [0, 12.0, 5]])
            @ np.linalg.qr(np.column_stack([normal, rng.standard_normal((3, 2))]))[0][:, [1, 2, 0]].T
        )
        places += truth[Side.LEFT]["OS"]
        places -= np.outer(places @ normal - exact.offset, normal)
        extra = {f"S{n}": place + 0.1 * rng.standard_normal(3) for n, place in enumerate(places)}
        left = replace(touches[Side.LEFT], extra=extra)
        for found, midline in ((without, ()), (with_midline, tuple(extra))):
            plane = mirror_plane(left, touches[Side.RIGHT], midline=midline)
            found.append(float(angle_between_deg(plane.normal, normal)))
    assert np.mean(with_midline) < 0.9 * np.mean(without)
    with pytest.raises(GpError, match="S9 is to lie in the mid-plane, and was touched with neither ear"):
        mirror_plane(left, touches[Side.RIGHT], midline=["S9"])


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
    assert joined["axis_of_both_ears"] is True
    assert read_pose(out).of_both_ears
    assert main(["estimate", str(out)]) in (0, 3)
    assert "identical to pose.json" in capsys.readouterr().out
    assert main([*words, "--midline", "S1"]) == 2
    assert "S1 is to lie in the mid-plane" in capsys.readouterr().err
    assert main(["estimate", str(file), "--side", "L", "--both-ears"]) == 2
    assert "--other-ear" in capsys.readouterr().err
