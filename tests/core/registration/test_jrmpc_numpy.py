"""JRMPC without Numba: the loops in plain NumPy give what the compiled ones give."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from test_jrmpc import animals, assert_same, degenerate_sets

from gp_core.registration import jrmpc as module
from gp_core.registration.jrmpc import ESTIMATION, jrmpc, jrmpc_batch


@pytest.fixture
def without_numba(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the import of the compiled loops fail, as it does where Numba is not installed."""
    monkeypatch.setitem(sys.modules, "gp_core.registration.jrmpc_kernels", None)


@pytest.mark.parametrize("seed", range(3))
def test_one_problem(seed: int, request: pytest.FixtureRequest) -> None:
    sets = animals(seed)
    compiled = jrmpc(sets)
    request.getfixturevalue("without_numba")
    plain = jrmpc(sets)
    assert_same(plain, compiled, atol=1e-8)
    assert plain.converged == compiled.converged
    shared = min(len(plain.objective), len(compiled.objective))
    np.testing.assert_allclose(plain.objective[:shared], compiled.objective[:shared], atol=1e-7)


@pytest.mark.parametrize("name", degenerate_sets())
def test_poses_are_proper_rotations_whatever_comes(name: str, without_numba: None) -> None:
    result = jrmpc(degenerate_sets()[name], epsilon=0.0)
    for rotation in result.rotations:
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert np.isfinite(result.centres).all()
    assert (result.variances > 0).all()


def test_many_problems(request: pytest.FixtureRequest) -> None:
    problems = [animals(seed) for seed in range(3)]
    sizes = [len(points) for points in problems[0]]
    packed = [np.concatenate(sets) for sets in problems]
    compiled = jrmpc_batch(packed, sizes, ESTIMATION)
    request.getfixturevalue("without_numba")
    plain = jrmpc_batch(packed, sizes, ESTIMATION)
    assert_same(plain, compiled, atol=1e-8)
    np.testing.assert_array_equal(plain.converged, compiled.converged)


def test_pieces_on_threads(monkeypatch: pytest.MonkeyPatch, without_numba: None) -> None:
    sets = animals(5, n_sets=4, sizes=(150, 101, 90, 33))
    centres = 4 * np.random.default_rng(0).normal(size=(45, 3))
    whole = jrmpc(sets, centres, gamma=0.1, max_iterations=25)
    monkeypatch.setattr(module, "TABLE_SIZE", 45 * 40)
    monkeypatch.setattr(module, "THREADS_FROM_WORK", 0)
    monkeypatch.setattr(module, "n_cores", lambda: 3)
    assert_same(jrmpc(sets, centres, gamma=0.1, max_iterations=25), whole)
