"""Simulated animals: the paper's figures on the real sets, and the laws of the draw."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict

import numpy as np
import pytest
from study_cases import cohort

from gp_core import TRAINING, GpError, Side, Specimen, jrmpc
from gp_core.landmarks.anatomy import cochlea_origin
from gp_core.landmarks.features import index_of
from gp_core.pose.jrmpc_estimator import training_sides
from gp_core.registration.jrmpc import ESTIMATION
from gp_core.study.simulation import simulate, simulate_sides


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_real_sets_give_the_papers_figures(real_specimens: list[Specimen]) -> None:
    pooled = simulate(real_specimens, n=1000, rng=rng()).as_dict()["groups"]["pooled"]
    assert pooled["n"] == 2000
    assert 0.19 < pooled["e_co_mm"]["mean"] < 0.23
    assert 0.42 < pooled["e_co_mm"]["whisker"] < 0.55
    assert 2.6 < pooled["e_ma_deg"]["mean"] < 3.5
    assert 6.5 < pooled["e_ma_deg"]["whisker"] < 8.5
    assert pooled["within_limits"] > 0.93


def test_drawn_features_scatter_as_the_registered_ones() -> None:
    animals = cohort(8)
    drawn = simulate_sides(animals, Side.LEFT, 4000, rng=rng())
    labelled = [training.landmarks for training in training_sides(animals, Side.LEFT)]
    registered = jrmpc([landmarks.array(TRAINING) for landmarks in labelled], **asdict(ESTIMATION))
    moved = np.array(registered.moved([landmarks.points for landmarks in labelled]))
    for code in ("CA", "OS", "ZL", "DTL"):
        expected, found = moved[:, index_of(code)], np.array([landmarks[code] for landmarks in drawn])
        covariance = np.cov(expected.T)
        np.testing.assert_allclose(found.mean(axis=0), expected.mean(axis=0), atol=0.1)
        np.testing.assert_allclose(np.cov(found.T), covariance, atol=0.08 * np.trace(covariance))
    pair = np.array([np.concatenate([landmarks["ZL"], landmarks["OS"]]) for landmarks in drawn])
    assert np.abs(np.corrcoef(pair.T)[:3, 3:]).max() < 0.06  # each feature by itself


def test_origin_is_computed_from_the_drawn_points() -> None:
    for landmarks in simulate_sides(cohort(4), Side.RIGHT, 5, rng=rng()):
        expected = cochlea_origin(*(landmarks[code] for code in ("CA", "CB", "RWA", "RWP")))
        np.testing.assert_allclose(landmarks["CO"], expected, atol=1e-12)


@pytest.mark.parametrize("method", ["jrmpc", "robust"])
def test_noise_hurts_and_seeds_repeat(method: str) -> None:
    animals = cohort(5)
    first, again = (simulate(animals, n=40, rng=rng(), method=method) for _ in range(2))
    noisy = simulate(animals, n=40, rng=rng(), method=method, noise=0.4)
    assert np.array_equal(first.groups["pooled"].e_co_mm, again.groups["pooled"].e_co_mm)
    assert noisy.groups["pooled"].e_co_mm.mean() > 1.2 * first.groups["pooled"].e_co_mm.mean()


def test_workers_do_not_change_the_answer() -> None:
    animals = cohort(4)
    alone = simulate(animals, n=250, rng=rng())
    with ThreadPoolExecutor(3) as threads:
        other = simulate(animals, n=250, rng=rng(), executor=threads)
    assert np.array_equal(alone.groups["pooled"].e_ma_deg, other.groups["pooled"].e_ma_deg)


def test_report_as_json() -> None:
    content = json.loads(json.dumps(simulate(cohort(3), n=20, rng=rng()).as_dict(), allow_nan=False))
    assert content["groups"].keys() == {"L", "R", "pooled"}
    group = content["groups"]["pooled"]
    assert group["e_co_mm"].keys() == {"mean", "median", "whisker", "beyond", "max"}
    values = np.array(content["errors"]["L"]["e_co_mm"] + content["errors"]["R"]["e_co_mm"])
    low, high = np.percentile(values, [25, 75])
    whisker = group["e_co_mm"]["whisker"]
    assert whisker in values
    assert whisker <= high + 1.5 * (high - low)
    assert group["e_co_mm"]["beyond"] == np.mean(values > whisker)


def test_what_cannot_be_simulated_is_refused() -> None:
    with pytest.raises(GpError, match="must be 1 or more, got 0"):
        simulate(cohort(3), n=0, rng=rng())
    for noise in (-0.1, np.nan):
        with pytest.raises(GpError, match="noise must be 0 mm or more"):
            simulate(cohort(3), n=1, rng=rng(), noise=noise)
