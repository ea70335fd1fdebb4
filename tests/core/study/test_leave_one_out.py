"""Leave-one-out: the authors' errors to 1e-6, and that nothing of the held-out animal is used."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from study_cases import cohort, moved

from gp_core import PROBE, TRAINING, GpError, Side, Specimen, estimate_pose
from gp_core.atlas.fitting import fit_atlas
from gp_core.registration.jrmpc import DEFAULTS, ESTIMATION
from gp_core.study.leave_one_out import leave_one_out
from gp_core.study.scoring import angle_between_deg


def test_jrmpc_gives_the_authors_errors(shared_data: Path, real_specimens: list[Specimen]) -> None:
    oracle = json.loads((shared_data / "oracles" / "loo_oracle.json").read_text())["errors"]
    rows = leave_one_out(real_specimens, method="jrmpc").rows
    for side in "LR":
        ours = [row for row in rows if row.side == side]
        np.testing.assert_allclose([row.e_co_mm for row in ours], oracle[side]["e_co_mm"], rtol=0, atol=1e-6)
        np.testing.assert_allclose(
            [row.e_ma_deg for row in ours], oracle[side]["e_ma_deg"], rtol=0, atol=1e-6
        )


def test_defaults_give_the_papers_total_error(real_specimens: list[Specimen]) -> None:
    report = leave_one_out(real_specimens, method="jrmpc", settings=DEFAULTS)
    assert report.errors.e_t == pytest.approx(19.56, abs=0.02)


def test_robust_is_as_good_without_noise(real_specimens: list[Specimen]) -> None:
    summary = leave_one_out(real_specimens, method="robust").as_dict()["summary"]
    assert summary["e_co_mm"]["mean"] < 0.23
    assert summary["e_ma_deg"]["mean"] < 3.5


@pytest.mark.parametrize("method", ["jrmpc", "robust"])
def test_where_and_in_which_order_animals_lie_does_not_count(method: str) -> None:
    animals = cohort(5)
    rng = np.random.default_rng(1)
    rows = leave_one_out(animals, method=method).rows
    others = leave_one_out([moved(animal, rng) for animal in reversed(animals)], method=method).rows
    expected = {(row.specimen, row.side): (row.e_co_mm, row.e_ma_deg) for row in rows}
    found = {(row.specimen, row.side): (row.e_co_mm, row.e_ma_deg) for row in others}
    assert found.keys() == expected.keys()
    for key, value in expected.items():
        assert found[key] == pytest.approx(value, abs=1e-5)


def test_robust_uses_neither_side_of_the_held_out_animal() -> None:
    animals = cohort(4)
    spoilt = animals[0].side("R")
    rng = np.random.default_rng(2)
    for code in spoilt.placed:
        if code not in PROBE:
            spoilt = spoilt.with_point(code, spoilt[code] + rng.normal(size=3))
    changed = Specimen("D01", {Side.LEFT: animals[0].side("L"), Side.RIGHT: spoilt})
    before = leave_one_out(animals, method="robust").rows
    after = leave_one_out([changed, *animals[1:]], method="robust").rows
    assert before[0] == after[0]  # the left side of the animal whose right side was spoilt
    assert all(b != a for b, a in zip(before[1:], after[1:], strict=True))


def test_robust_rows_are_estimates_on_an_atlas_of_the_others() -> None:
    animals = cohort(4)
    row = leave_one_out(animals, method="robust").rows[1]
    truth = animals[1].side("L")
    pose = estimate_pose(
        truth.as_mapping(PROBE), "L", fit_atlas([animals[i] for i in (0, 2, 3)], features=TRAINING)
    )
    assert row.specimen == "D02"  # the study takes a short way to the same pose
    assert row.e_co_mm == pytest.approx(np.linalg.norm(pose.origin - truth["CO"]), abs=1e-12)
    assert row.e_ma_deg == pytest.approx(
        float(angle_between_deg(pose.axis, truth["CA"] - truth["CB"])), abs=1e-9
    )


def test_report_says_what_it_ran_on() -> None:
    report = leave_one_out(cohort(3), method="jrmpc", probe=["cl", "mn", "os", "rwa"]).as_dict()
    assert report.keys() == {"rows", "summary", "settings"}
    assert report["rows"][0].keys() == {"specimen", "side", "e_co_mm", "e_ma_deg"}
    assert report["summary"].keys() == {"e_co_mm", "e_ma_deg", "e_t"}
    assert report["summary"]["e_co_mm"].keys() == {"mean", "median", "max"}
    assert report["settings"]["probe"] == ["CL", "MN", "OS", "RWA"]
    assert report["settings"]["max_iterations"] == ESTIMATION.max_iterations
    weighted = sum(row["e_co_mm"] + 0.2 * row["e_ma_deg"] for row in report["rows"])
    assert report["summary"]["e_t"] == pytest.approx(weighted)
    json.dumps(report, allow_nan=False)


def test_animals_with_one_side_take_part() -> None:
    animals = cohort(5)
    animals[2] = Specimen("D03", {Side.LEFT: animals[2].side("L")})
    for method in ("jrmpc", "robust"):
        rows = leave_one_out(animals, method=method).rows
        assert [row.side for row in rows] == ["L"] * 5 + ["R"] * 4
        assert "D03" not in [row.specimen for row in rows if row.side == "R"]


def test_one_side_alone_is_enough() -> None:
    animals = [Specimen(a.name, {Side.RIGHT: a.side("R")}) for a in cohort(4)]
    for method in ("jrmpc", "robust"):
        assert len(leave_one_out(animals, method=method).rows) == 4


def test_what_cannot_be_done_is_refused() -> None:
    animals = cohort(3)
    with pytest.raises(GpError, match="at least 3 labelled animals, got 2"):
        leave_one_out(animals[:2])
    with pytest.raises(GpError, match="D01: two animals have this name"):
        leave_one_out([animals[0], *animals])
    with pytest.raises(GpError, match="must not contain IN; allowed are CL"):
        leave_one_out(animals, training=["CA", "CB", "CL", "MN", "OS"], probe=["CL", "MN", "IN"])
    with pytest.raises(GpError, match="must not contain CA"):
        leave_one_out(animals, probe=["CL", "MN", "CA"])
    with pytest.raises(GpError, match="at least 3 features, got 2"):
        leave_one_out(animals, probe=["CL", "MN"])
    with pytest.raises(GpError, match="method must be one of"):
        leave_one_out(animals, method="icp")
    bare = Specimen("D01", {Side.LEFT: animals[0].side("L").with_point("OS", None)})
    with pytest.raises(GpError, match="specimen D01, landmark OS: the left side has no OS"):
        leave_one_out([bare, *animals[1:]])
    alone = [animals[0], *(Specimen(a.name, {Side.LEFT: a.side("L")}) for a in animals[1:])]
    with pytest.raises(GpError, match="right side is labelled in 1 animals only"):
        leave_one_out(alone)
