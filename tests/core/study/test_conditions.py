"""Sessions in which something goes wrong, and what is measured of them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from gp_core import PROBE, Atlas, GpError, Side
from gp_core.atlas.sampling import draw_animal, perturbed_atlas
from gp_core.cli import main
from gp_core.study.conditions import GROUPS, TouchCondition, conditions, touch_conditions
from gp_core.study.sessions import (
    drift,
    exchanged,
    knocked_marker,
    mistouch,
    other_size,
    soft_tissue,
    tip_offset,
    touch_session,
    wrong_side,
)

TRUTH = draw_animal(Atlas.published(), rng=np.random.default_rng(0)).side("L")


def _offsets(disturbance, seed: int = 0) -> tuple[np.ndarray, object]:
    session, reported = touch_session(TRUTH, PROBE, 0.0, (disturbance,), np.random.default_rng(seed))
    true = session.truth.array(session.codes)
    return np.array(list(reported.values())) - true, session


@pytest.mark.parametrize("seed", range(5))
def test_what_goes_wrong_is_as_large_as_it_is_called(seed: int) -> None:
    tip, _ = _offsets(tip_offset(0.5), seed)
    np.testing.assert_allclose(np.linalg.norm(tip, axis=1), 0.5)
    wandering, _ = _offsets(drift(1.0), seed)
    np.testing.assert_allclose(np.linalg.norm(wandering, axis=1), np.linspace(1, 0, 6), atol=1e-9)
    tissue, session = _offsets(soft_tissue(0.4), seed)
    assert ((np.linalg.norm(tissue, axis=1) >= 0.2) & (np.linalg.norm(tissue, axis=1) <= 0.6)).all()
    assert (tissue @ session.outward).mean() > 0.1
    knocked, _ = _offsets(knocked_marker(1.0), seed)
    lengths = np.linalg.norm(knocked, axis=1)
    assert (lengths[-1], np.all(np.diff((lengths > 1e-9).astype(int)) <= 0)) == (
        pytest.approx(0, abs=1e-9),
        True,
    )
    off, session = _offsets(mistouch("MN", 3.0), seed)
    assert np.linalg.norm(off, axis=1).sum() == pytest.approx(3)
    assert np.linalg.norm(off[session.codes.index("MN")]) == pytest.approx(3)


def test_an_animal_of_another_size_is_larger_in_every_distance() -> None:
    _, session = _offsets(other_size(1.2))
    for a, b in (("CA", "CB"), ("MN", "OS")):
        before, now = (np.linalg.norm(s[a] - s[b]) for s in (TRUTH, session.truth))
        assert now == pytest.approx(1.2 * before)


def test_names_and_sides_are_exchanged_in_what_is_said_alone() -> None:
    off, session = _offsets(exchanged(("CL", "OS")))
    a, b = (session.codes.index(code) for code in ("CL", "OS"))
    np.testing.assert_allclose(off[a], session.truth["OS"] - session.truth["CL"])
    np.testing.assert_allclose(off[a], -off[b])
    off, session = _offsets(wrong_side)
    assert not off.any()
    assert (session.side, session.truth.side) == (Side.RIGHT, Side.LEFT)


def test_a_perturbed_atlas_is_one_of_animals_like_these() -> None:
    published = Atlas.published()
    other = perturbed_atlas(published, rng=np.random.default_rng(1))
    moved = np.linalg.norm(other.mean - published.mean, axis=1)
    spread = np.sqrt(3 * published.variances(published.codes))
    assert 0.1 < np.mean(moved / spread) < 0.6
    assert np.trace(other.covariance) == pytest.approx(np.trace(published.covariance), rel=0.3)
    off_diagonal = other.covariance - np.diag(np.diag(other.covariance))
    assert np.abs(off_diagonal).max() > 0.05 * np.abs(other.covariance).max()


def test_it_measures_errors_regions_and_states() -> None:
    cases = [
        TouchCondition("noise", "careful"),
        TouchCondition("side", "wrong", disturbances=(wrong_side,)),
        TouchCondition("few", "three", n_random=3),
    ]
    report = conditions(repeats=1, n_animals=4, rng=np.random.default_rng(0), cases=cases)
    careful, wrong, few = (row.as_dict() for row in report.rows)
    assert (careful["n"], few["n_touches"]) == (8, 3)
    assert careful["side_undecided"] == careful["names_wrong"] == 0
    assert careful["radius_mm"] < 1
    assert 1 < careful["radius_mm_growth"] < 1.5  # with an atlas of three animals
    assert wrong["side_undecided"] + wrong["side_wrong"] == 1
    assert wrong["radius_mm"] > wrong["radius_mm_plain"]
    assert wrong["e_co_mm"] > 1.5
    for row in (careful, wrong, few):
        low, high = row["radius_mm_holds_interval"]
        assert low <= row["radius_mm_holds"] <= high


def test_every_group_has_conditions_and_no_other_is_known() -> None:
    assert {case.group for case in touch_conditions()} == set(GROUPS)
    assert len(touch_conditions(["names"])) == 30
    with pytest.raises(GpError, match="unknown group of conditions 'weather'"):
        touch_conditions(["weather"])
    with pytest.raises(GpError, match="repeats must be 1 or more"):
        conditions(repeats=0, rng=np.random.default_rng(0))


def test_the_command_prints_a_table_and_keeps_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "conditions.json"
    words = ["conditions", "--groups", "mistouch", "--repeats", "1", "--animals", "3", "--workers", "1"]
    assert main([*words, "--json", str(out)]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    assert len(lines) == 2 + 4
    assert len({line.count("|") for line in lines}) == 1
    content = json.loads(out.read_text())
    assert content["rows"][0]["condition"] == "MN 3 mm off, noise 0.1"
    assert content["seed"] == 0
