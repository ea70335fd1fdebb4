"""One rule says whether a pose may be sent to a robot, and every reason why not."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gp_core import PROBE, Atlas, CochleaPose, GpError, PoseGate, estimate_pose
from gp_core.atlas.sampling import draw_animal
from gp_core.cli import main
from gp_core.io.pose_json import read_pose
from gp_core.pose.gate import reasons_against_writing

SEVEN = (*PROBE, "IN")
ATLAS = Atlas.published()
ANIMAL = draw_animal(ATLAS, rng=np.random.default_rng(3)).side("L").as_mapping(SEVEN)
EXCHANGED = {**ANIMAL, "MN": ANIMAL["OS"], "OS": ANIMAL["MN"]}


@pytest.fixture(scope="module")
def pose() -> CochleaPose:
    return estimate_pose(ANIMAL, "L", ATLAS)


def _codes(pose: CochleaPose | None, gate: PoseGate | None = None, **known: object) -> list[str]:
    known = {"accepted": True, "reference_age_s": 0.1, **known}
    return [reason.code for reason in (gate or PoseGate()).reasons(pose, **known)]  # type: ignore[arg-type]


def test_a_careful_accepted_fresh_pose_may_be_sent(pose: CochleaPose) -> None:
    assert pose.state == "side clear, names clear"
    assert _codes(pose) == _codes(pose, reference_age_s=None) == []


def test_no_limit_and_no_person_overrules_a_wrong_side_or_name() -> None:
    loose = PoseGate(max_radius_mm=100, max_cone_deg=180)
    assert _codes(estimate_pose(ANIMAL, "R", ATLAS), loose) == ["wrong side"]
    assert _codes(estimate_pose(EXCHANGED, "L", ATLAS), loose) == ["wrong names"]
    flat = estimate_pose({code: ANIMAL[code] for code in ("OS", "MN", "RWA")}, "L", ATLAS)
    assert _codes(flat, loose) == ["side undecided"]
    assert _codes(None, loose) == ["no pose"]


def test_a_pose_that_nobody_checked_is_held_back(pose: CochleaPose) -> None:
    unchecked = replace(pose, side_state="unchecked", names_state="unchecked")
    assert _codes(unchecked) == ["side unchecked", "names unchecked"]


@pytest.mark.parametrize(("scale", "code"), [([1, 1, 1, 0, 0, 0], "radius"), ([0, 0, 0, 1, 1, 1], "cone")])
def test_the_limits_are_the_users(pose: CochleaPose, scale: list[float], code: str) -> None:
    grown = replace(pose, covariance=np.diag(scale) * 0.25)
    assert _codes(grown) == [code]
    assert _codes(grown, PoseGate(max_radius_mm=2, max_cone_deg=90)) == []


def test_a_region_that_is_not_finite_is_never_sent(pose: CochleaPose) -> None:
    assert "radius" in _codes(replace(pose, covariance=np.full((6, 6), np.nan)))


def test_acceptance_and_freshness_are_asked_for(pose: CochleaPose) -> None:
    assert _codes(pose, accepted=False) == ["not accepted"]
    assert _codes(pose, reference_age_s=1.01) == _codes(pose, reference_age_s=math.inf) == ["stale"]
    assert _codes(pose, reference_age_s=math.nan) == ["stale"]
    assert _codes(pose, PoseGate(max_age_s=2), reference_age_s=1.5) == []


@pytest.mark.parametrize("limit", ["max_radius_mm", "max_cone_deg", "max_age_s"])
@pytest.mark.parametrize("value", [0, -1, math.nan, math.inf])
def test_a_limit_that_limits_nothing_is_refused(limit: str, value: float) -> None:
    with pytest.raises(GpError, match="must be above 0"):
        PoseGate(**{limit: value})


def _file(folder: Path, touches: dict[str, np.ndarray]) -> str:
    rows = [f"{code},{x!r},{y!r},{z!r}" for code, (x, y, z) in ((c, p.tolist()) for c, p in touches.items())]
    path = folder / "touches.csv"
    path.write_text("\n".join(rows) + "\n")
    return str(path)


@pytest.mark.parametrize(
    ("touches", "side", "state"),
    [
        (ANIMAL, "R", ("wrong", "clear")),
        (EXCHANGED, "L", ("clear", "wrong")),
        ({code: ANIMAL[code] for code in ("OS", "MN", "RWA")}, "L", ("undecided", "clear")),
    ],
)
def test_the_shell_writes_no_ambiguous_pose_for_a_robot(
    touches: dict, side: str, state: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = {name: tmp_path / name for name in ("p.json", "p.tfm", "p.csv", "p.mrk.json")}
    options = [
        part
        for o, f in zip(("json", "tfm", "csv", "landmarks"), out.values(), strict=True)
        for part in (f"--{o}", str(f))
    ]
    words = ["estimate", _file(tmp_path, touches), "--side", side, *options]
    assert main(words) == 3
    assert [file.name for file in out.values() if file.exists()] == ["p.json"]
    pose = read_pose(out["p.json"])
    assert (pose.side_state, pose.names_state) == state
    text = capsys.readouterr().out
    assert f"not written: {out['p.tfm']} {out['p.csv']} {out['p.mrk.json']}" in text
    assert "--accept-warnings" in text
    assert main([*words, "--accept-warnings"]) == 0
    assert all(file.exists() for file in out.values())


def test_the_shell_ends_with_3_even_where_nothing_was_to_be_written(tmp_path: Path) -> None:
    assert main(["estimate", _file(tmp_path, ANIMAL), "--side", "R"]) == 3
    assert main(["estimate", _file(tmp_path, ANIMAL), "--side", "L"]) == 0


def test_the_shell_reads_touches_as_they_are_likeliest_meant(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    straight = estimate_pose(ANIMAL, "L", ATLAS)
    out = tmp_path / "p.json"
    for touches, side, words in (
        (ANIMAL, "R", ["--take-best"]),
        (EXCHANGED, "L", ["--take-best"]),
        (EXCHANGED, "L", ["--exchange", "mn,OS"]),
        (ANIMAL, "L", ["--take-best"]),
    ):
        file = _file(tmp_path, touches)
        assert main(["estimate", file, "--side", side, *words, "--json", str(out)]) == 0
        pose = read_pose(out)
        np.testing.assert_allclose(pose.transform, straight.transform, atol=1e-6)
        assert pose.side.value == "L"
    said = capsys.readouterr().out
    assert said.count("! used as the left ear, which is more likely than the given names and side") == 1
    assert said.count("exchanged, which is more likely") == 1


@pytest.mark.parametrize(
    ("pair", "message"),
    [("MN,ZL", "MN and ZL cannot be exchanged: ZL not touched"), ("MN,XX", "unknown feature 'XX'")],
)
def test_names_that_are_not_touched_are_not_exchanged(
    pair: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["estimate", _file(tmp_path, ANIMAL), "--side", "L", "--exchange", pair]) == 2
    assert message in capsys.readouterr().err


def test_the_shell_says_what_the_regions_allow_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    radii = []
    for words in ([], ["--shared-error", "0.6"]):
        out = tmp_path / "p.json"
        assert main(["estimate", _file(tmp_path, ANIMAL), "--side", "L", *words, "--json", str(out)]) == 0
        radii.append(read_pose(out).radius_95)
    said = capsys.readouterr().out
    assert "shared error  0.2 mm" in said
    assert "shared error  0.6 mm" in said
    assert radii[1] > 1.5 * radii[0]
    assert main(["estimate", _file(tmp_path, ANIMAL), "--side", "L", "--shared-error", "-1"]) == 2


def test_a_file_named_for_the_other_side_is_held_back_until_the_user_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The touches themselves fit the side that is given clearly."""
    file, tfm = Path(_file(tmp_path, ANIMAL)), tmp_path / "p.tfm"
    other = file.rename(tmp_path / "GP7_Right.csv")
    words = ["estimate", str(other), "--side", "L", "--tfm", str(tfm)]
    assert main(words) == 3
    assert "GP7_Right.csv indicates the right side" in capsys.readouterr().out
    assert not tfm.exists()
    assert main([*words, "--accept-warnings"]) == 0
    assert main(["estimate", str(other.rename(tmp_path / "GP7_Left.csv")), "--side", "L"]) == 0


def test_the_papers_method_passes_the_same_gate() -> None:
    """JRMPC cannot judge side and names: the robust method's readings of the same touches do."""
    rng = np.random.default_rng(5)
    cohort = [draw_animal(ATLAS, rng=rng, name=f"{i}") for i in range(4)]
    for touches, side, state in (
        (ANIMAL, "L", "side clear, names clear"),
        (ANIMAL, "R", "side wrong, names clear"),
        (EXCHANGED, "L", "side clear, names wrong"),
    ):
        pose = estimate_pose(touches, side, method="jrmpc", specimens=cohort)
        assert pose.state == state
        assert bool(reasons_against_writing(pose)) == (state != "side clear, names clear")
    two = estimate_pose(ANIMAL, "L", method="jrmpc", specimens=cohort[:2])
    assert two.state == "side clear, names clear"
