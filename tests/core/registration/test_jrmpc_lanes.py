"""Eight problems side by side give the answers that each gives by itself."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
import pytest

from gp_core.registration import jrmpc_lanes
from gp_core.registration.jrmpc import DEFAULTS, ESTIMATION, JrmpcBatch, JrmpcSettings, jrmpc_batch
from gp_core.registration.lanes import LANES
from gp_core.validation import FloatArray

SIZES = [9, 9, 7, 5]


def problems(n: int, rng: np.random.Generator) -> FloatArray:
    """Noisy animals of one shape, each gently turned."""
    made = []
    for _ in range(n):
        shape = rng.normal(size=(9, 3)) * [4.0, 3.0, 2.0]
        sets = [(shape + 0.2 * rng.normal(size=shape.shape))[:size] for size in SIZES]
        made.append(np.concatenate([points @ _turn(rng) for points in sets]))
    return np.array(made)


def _turn(rng: np.random.Generator) -> FloatArray:
    half = 0.1 * rng.uniform(-1, 1, 3)
    cross = np.cross(np.eye(3), half)
    return np.linalg.solve(np.eye(3) - cross, np.eye(3) + cross)


def both(
    batch: FloatArray, settings: JrmpcSettings, monkeypatch: pytest.MonkeyPatch
) -> tuple[JrmpcBatch, JrmpcBatch]:
    run, n_runs = jrmpc_lanes.run_batch, []

    def counted(*inputs: object, **options: object) -> object:
        n_runs.append(1)
        return run(*inputs, **options)

    with monkeypatch.context() as patched:
        patched.setattr(jrmpc_lanes, "run_batch", counted)
        lanes = jrmpc_batch(batch, SIZES, settings)
        assert n_runs
        patched.setitem(sys.modules, jrmpc_lanes.__name__, None)  # as where they cannot be compiled
        return lanes, jrmpc_batch(batch, SIZES, settings)


def assert_same(one: JrmpcBatch, other: JrmpcBatch, which: Sequence[int] | slice = slice(None)) -> None:
    for field in ("rotations", "translations", "centres", "variances"):
        a, b = getattr(one, field)[which], getattr(other, field)[which]
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
    # a problem is at rest where rounding is all that is left, which for some is a little later
    assert np.median(np.abs(one.n_iterations[which] - other.n_iterations[which])) <= 1
    np.testing.assert_array_equal(one.converged[which], other.converged[which])


@pytest.mark.parametrize("n", [1, 2, 3, LANES, LANES + 2, 2 * LANES + 5])
@pytest.mark.parametrize("settings", [ESTIMATION, DEFAULTS], ids=["estimation", "defaults"])
def test_a_batch_of_any_size_has_the_answers_of_each_alone(
    n: int, settings: JrmpcSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    batch = problems(n, np.random.default_rng(n))
    assert_same(*both(batch, settings, monkeypatch))


def test_an_answer_is_the_same_to_the_last_bit_whatever_stands_beside_it() -> None:
    batch = problems(2 * LANES + 1, np.random.default_rng(6))
    batch[3, :, 1:] = 0.0  # straight: its rotations are found another way
    whole = jrmpc_batch(batch, SIZES, DEFAULTS)
    for n in (0, 2, 3, 10, 2 * LANES):
        alone = jrmpc_batch(batch[n : n + 1], SIZES, DEFAULTS)
        np.testing.assert_array_equal(alone.rotations[0], whole.rotations[n])
        np.testing.assert_array_equal(alone.centres[0], whole.centres[n])
        assert alone.n_iterations[0] == whole.n_iterations[n]


def test_problems_that_rest_early_stay_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    batch = problems(LANES, np.random.default_rng(3))
    batch[2] = np.tile(batch[2, :5], (6, 1))[: len(batch[2])]  # the same points in all sets: soon at rest
    lanes, alone = both(batch, JrmpcSettings(300, 0.1, 1e-3), monkeypatch)
    assert len(set(alone.n_iterations.tolist())) > 1
    assert_same(lanes, alone)


def test_a_problem_with_flat_or_straight_sets_does_not_disturb_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    batch = problems(LANES, np.random.default_rng(4))
    batch[1, :, 2] = 0.0
    batch[5, :, 1:] = 0.0  # rotations about the line are open: the smallest ones are taken
    lanes, alone = both(batch, JrmpcSettings(20, 0.05, 1e-6), monkeypatch)
    assert np.isfinite(lanes.rotations).all()
    assert_same(lanes, alone, [0, 2, 3, 4, 6, 7])
    np.testing.assert_allclose(lanes.rotations[[1, 5]], alone.rotations[[1, 5]], atol=1e-6)
