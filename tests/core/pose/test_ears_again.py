"""What two ears say of each other goes with the pose: into its file, to robots, and it is computed again."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from atlas_cases import draw_specimens, random_pose
from scipy.spatial.transform import Rotation

from gp_core import (
    PROBE,
    Atlas,
    CochleaPose,
    EarComparison,
    GpError,
    LandmarkSet,
    MirrorPlane,
    PoseGate,
    Side,
    compare_ears,
    estimate_again,
    estimate_pose,
    fuse_ears,
    mirror_plane,
    pose_quality,
    read_pose,
)
from gp_core.atlas.sampling import draw_animal
from gp_core.cli.entry import main
from gp_core.frames import RigidTransform
from gp_core.pose.estimate import compare_with_other_ear
from gp_core.pose.estimate_inputs import EarInputs
from gp_core.pose.gate import reasons_against_writing
from gp_core.service import answer_request

ATLAS = Atlas.published()
L, R = Side
SKULL = {"S1": [0.0, -30, 5], "S2": [9.0, -12, 14], "S3": [-9.0, -12, 14], "S4": [0.0, 4, 20]}
MOTION = RigidTransform.from_parts(
    Rotation.from_rotvec([0.05, -0.1, 0.08]).as_matrix(), [2, -3, 1], dst="tracker", src="tracker"
)
OFF_MM = np.array([0, 0, 2.5])


def _head(seed: int = 3, n: int = 1, skull: bool = False) -> tuple[LandmarkSet, LandmarkSet]:
    """Return touches of the two ears of a head, each feature touched `n` times."""
    rng = np.random.default_rng(seed)
    head, placed = draw_animal(ATLAS, rng=rng), random_pose(rng)
    extra = {name: placed.apply([at])[0] for name, at in SKULL.items()} if skull else {}
    points = {side: head.side(side).moved(placed).as_mapping(PROBE) | extra for side in Side}
    left, right = (
        LandmarkSet.from_touches({c: p + 0.1 * rng.standard_normal((n, 3)) for c, p in of.items()}, side)
        for side, of in points.items()
    )
    return left, right


def _compared(
    left: LandmarkSet, right: LandmarkSet, midline: tuple[str, ...] = (), **options: object
) -> EarComparison:
    poses = estimate_pose(left, "L", **options), estimate_pose(right, "R", **options)  # type: ignore[arg-type]
    return compare_ears(left, poses[0], right, poses[1], midline=midline)


def _moved() -> EarComparison:
    left, right = _head(skull=True)
    return _compared(left, right.moved(MOTION), ("S1", "S4"))


def _mistouched() -> EarComparison:
    left, right = _head()
    return _compared(left, right.with_point("RWP", right["RWP"] + OFF_MM))


def _fused_by_plane() -> CochleaPose:
    left, right = _head()
    return fuse_ears(estimate_pose(left, "L"), estimate_pose(right, "R"), mirror_plane(left, right))[R]


def _of_other_atlas() -> CochleaPose:
    own = replace(ATLAS, name="own", mean=ATLAS.mean * 1.02)
    poses = (estimate_pose(ear, ear.side, own, shared_error=0.4) for ear in _head(n=3))
    left, right = _head(n=3)
    return compare_ears(left, next(poses), right, next(poses)).fused(L)


def _by_jrmpc() -> CochleaPose:
    left, right = _head()
    animals = draw_specimens(ATLAS, 5, np.random.default_rng(3))
    pose = estimate_pose(left, "L", method="jrmpc", specimens=animals)
    assert pose.inputs is not None
    return compare_with_other_ear(pose, EarInputs(replace(pose.inputs, touches=right)))


KINDS: dict[str, Callable[[], CochleaPose]] = {
    "compared": lambda: _compared(*_head()).poses[L],
    "compared, the second ear": lambda: _compared(*_head()).poses[R],
    "combined": lambda: _compared(*_head()).fused(L),
    "combined, the second ear": lambda: _compared(*_head()).fused(R),
    "combined, repeats": lambda: _compared(*_head(n=3)).fused(L),
    "combined by a plane": _fused_by_plane,
    "combined, by another atlas": _of_other_atlas,
    "the head moved": lambda: _moved().poses[L],
    "the head moved, combined": lambda: _moved().fused(L),
    "the head moved, combined, the second ear": lambda: _moved().fused(R),
    "disagreeing": lambda: _mistouched().poses[L],
    "by JRMPC": _by_jrmpc,
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_bits_from_the_file(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pose = KINDS[kind]()
    file, again_file = tmp_path / "pose.json", tmp_path / "again.json"
    pose.save(file)
    read = read_pose(file)
    again = estimate_again(read)
    assert again.as_dict() == read.as_dict() == pose.as_dict()
    assert again.of_both_ears is ("combined" in kind)
    assert again.inputs is not None
    assert pose.inputs is not None
    assert again.inputs.as_dict() == pose.inputs.as_dict()
    status = main(["estimate", str(file), "--json", str(again_file)])
    assert status == (3 if kind == "disagreeing" else 0)
    assert "identical to pose.json" in capsys.readouterr().out
    told = json.loads(again_file.read_text())
    assert {key: told[key] for key in pose.as_dict()} == json.loads(json.dumps(pose.as_dict()))
    answer = answer_request(json.loads(file.read_text()), ATLAS)
    assert (answer["status"], answer["transform"]) == (status, pose.transform.tolist())


def test_axes_combined_by_a_plane_from_elsewhere_do_not_claim_to_be_those_of_the_touches() -> None:
    left, right = _head()
    plane = mirror_plane(left, right)
    other = MirrorPlane(plane.normal, plane.offset + 0.1, plane.residual_mm, ("CT",), 0.3, 0.05)
    fused = fuse_ears(estimate_pose(left, "L"), estimate_pose(right, "R"), other)
    assert fused[L].of_both_ears
    assert fused[L].inputs is None


def test_ears_that_disagree_are_told_by_the_pose_itself_and_no_limit_lets_it_pass() -> None:
    pose = _mistouched().poses[L]
    assert pose.ears_disagree
    assert pose.state == "side clear, names clear, ears disagree"
    assert [reason.code for reason in reasons_against_writing(pose)] == ["ears disagree"]
    (reason,) = PoseGate(max_radius_mm=99.0, max_cone_deg=180.0).reasons(pose, accepted=True)
    assert "RWP is 2." in reason.text
    assert pose_quality(pose).word == "Ears disagree"
    assert "ears disagree" in pose._repr_html_()
    agreeing = _compared(*_head()).poses[L]
    assert not agreeing.ears_disagree
    assert reasons_against_writing(agreeing) == ()
    with pytest.raises(GpError, match="no estimate is made of both ears"):
        _mistouched().fused(L)


def test_the_shell_writes_nothing_for_a_robot_where_ears_disagree(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    left, right = _head()
    files = [tmp_path / "left.csv", tmp_path / "right.csv"]
    for file, ear in zip(files, (left, right.with_point("RWP", right["RWP"] + OFF_MM)), strict=True):
        rows = (f"{code},{','.join(map(repr, ear[code].tolist()))}\n" for code in ear.placed)
        file.write_text("name,x,y,z\n" + "".join(rows))
    out, tfm = tmp_path / "pose.json", tmp_path / "pose.tfm"
    words = ["estimate", str(files[0]), "--side", "L", "--json", str(out), "--tfm", str(tfm)]
    assert main([*words, "--other-ear", str(files[1]), "--both-ears"]) == 3
    printed = capsys.readouterr().out
    assert "! the two ears DISAGREE" in printed
    assert "names clear, ears disagree" in printed
    assert not tfm.exists()
    told = json.loads(out.read_text())
    assert [reason["code"] for reason in told["reasons"]] == ["ears disagree"]
    assert not told["other_ear"]["agrees"]
    assert read_pose(out).ears_disagree
    assert main(["estimate", str(out), "--tfm", str(tfm)]) == 3  # of its own file too
    assert not tfm.exists()
    assert main([*words, "--other-ear", str(files[1]), "--accept-warnings"]) == 0
    assert tfm.exists()


def test_the_service_compares_the_ears_too() -> None:
    left, right = ({code: ear[code].tolist() for code in ear.placed} for ear in _head())
    request = {"side": "L", "touches": left, "other_ear": right}
    answer = answer_request(request, ATLAS)
    assert (answer["status"], answer["other_ear"]["agrees"]) == (0, True)
    both = answer_request({**request, "both_ears": True}, ATLAS)
    assert both["axis_of_both_ears"] is True
    assert both["transform"] == _compared(*_head()).fused(L).transform.tolist()
    off = {**right, "RWP": (np.array(right["RWP"]) + OFF_MM).tolist()}
    answer = answer_request({**request, "other_ear": off}, ATLAS)
    assert answer["status"] == 3
    assert [reason["code"] for reason in answer["reasons"]] == ["ears disagree"]
    for wrong, message in (
        ({"side": "L", "touches": left, "both_ears": True}, "need the touches of the other ear"),
        ({**request, "midline": "S1"}, "midline must be a list of names"),
        ({**request, "midline": ["S1"]}, "S1 is to lie in the mid-plane"),
        ({**request, "other_ear": [1, 2]}, "other_ear must be a JSON object"),
        ({**request, "other_ear": left}, "about one plane"),
    ):
        with pytest.raises(GpError, match=message):
            answer_request(wrong, ATLAS)
