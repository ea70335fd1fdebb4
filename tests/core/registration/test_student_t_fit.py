"""The kernels of the fit: one source, interpreted and compiled, against NumPy and against each other."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from atlas_cases import random_pose
from scipy.spatial.transform import Rotation

from gp_core import EXTERNAL, PROBE, Atlas, read_touches
from gp_core.frames import mirror_x
from gp_core.registration import rotation, student_t_fit, student_t_fit_compiled
from gp_core.registration.named_points import TouchModel, fit_named_points

_ROOT = Path(__file__).resolve().parents[3]


def _model(codes: tuple[str, ...], noise: float | None = None) -> TouchModel:
    atlas = Atlas.published()
    return TouchModel(codes, atlas.rows(codes), atlas.variances(codes), noise)


def _drawn(seed: int) -> tuple[TouchModel, np.ndarray]:
    """Draw touches of any features, from careful to wild, in some frame."""
    rng = np.random.default_rng(seed)
    codes = tuple(rng.choice(EXTERNAL, rng.integers(3, 12), replace=False).tolist())
    model = _model(codes, noise=(None, None, 0.2)[seed % 3])
    if seed % 4 == 0:
        model = replace(model, counts=rng.integers(1, 6, len(codes)).astype(float))
    touches = model.mean + rng.choice([0.05, 0.2, 0.8]) * rng.normal(size=model.mean.shape)
    touches[rng.integers(len(codes))] += rng.choice([0, 0, 3, 10]) * rng.normal(size=3)
    return model, random_pose(rng).apply(touches)


def _run(
    module: object, kernel: str, model: TouchModel, touches: np.ndarray, *more: float
) -> list[np.ndarray]:
    n = len(touches)
    pose = np.zeros(student_t_fit.POSE_SIZE)
    pose[0] = 1
    out = [np.ones(n), np.empty(n), np.empty(3 * n), np.empty(n), pose]
    counts = np.ones(n) if model.counts is None else model.counts.copy()
    buffers = [model.mean.ravel(), model.variances, touches.ravel().copy(), counts, *out]
    if module is student_t_fit:
        buffers = [buffer.data for buffer in buffers]
    answer = getattr(module, kernel)(*buffers, model.noise or 0.0, 500, *more)
    return [np.array(answer), *out]


def _assert_same(model: TouchModel, touches: np.ndarray) -> None:
    solution = _run(student_t_fit, "fit_student_t", model, touches)
    for plain, fast in zip(
        solution, _run(student_t_fit_compiled, "fit_student_t", model, touches), strict=True
    ):
        np.testing.assert_allclose(plain, fast, rtol=1e-10, atol=1e-10)
    below = solution[0][2] - 6
    for plain, fast in zip(
        _run(student_t_fit, "best_exchange", model, touches, below),
        _run(student_t_fit_compiled, "best_exchange", model, touches, below),
        strict=True,
    ):
        np.testing.assert_allclose(plain, fast, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("seed", range(40))
def test_compiled_and_plain_python_agree(seed: int) -> None:
    _assert_same(*_drawn(seed))


@pytest.mark.parametrize("name", ["SkullE_Right.dat", "SkullD_Right.dat", "SkullA_Left_new.dat"])
def test_they_agree_on_real_touches_of_either_side(name: str, shared_data: Path) -> None:
    touches = read_touches(shared_data / "probe" / name, "L").array(PROBE)
    for points in (touches, mirror_x(touches)):
        _assert_same(_model(PROBE), points)


def test_the_rotation_is_the_optimal_one() -> None:
    rng = np.random.default_rng(0)
    for trial in range(300):
        h = rng.normal(size=(3, 3)) @ np.diag([1, 10.0 ** -rng.integers(0, 4), 10.0 ** -rng.integers(0, 8)])
        start = Rotation.random(random_state=trial).as_quat(scalar_first=True)
        turn = rotation.optimal_rotation(tuple(h.ravel().tolist()), tuple(start.tolist()))
        u, s, v = np.linalg.svd(h)
        best = s.sum() - (2 * s[2] if np.linalg.det(u @ v) < 0 else 0)
        matrix = np.reshape(rotation.as_matrix(turn), (3, 3))
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(matrix) > 0
        assert np.trace(matrix.T @ h) == pytest.approx(best, rel=1e-12)


def test_an_under_determined_rotation_is_not_a_number() -> None:
    half = (1.0, 0, 0, 0, 0, 0, 0, 0, 0)
    assert np.isnan(rotation.optimal_rotation(half, (1.0, 0, 0, 0))).all()


@pytest.mark.parametrize("seed", range(12))
def test_a_converged_fit_solves_its_own_equations(seed: int) -> None:
    """Pose: weighted Procrustes; weights and scale: the expected errors, by plain linear algebra."""
    model, touches = _drawn(seed)
    fit = fit_named_points(model, touches)
    assert fit.converged
    precision = fit.precision[::3]
    jacobian = fit.jacobian
    step = np.linalg.solve(
        (fit.precision[:, None] * jacobian).T @ jacobian, jacobian.T @ (fit.precision * fit.residual)
    )
    np.testing.assert_allclose(step, 0, atol=1e-8)
    used = np.linalg.inv((fit.precision[:, None] * jacobian).T @ jacobian)
    through_pose = np.einsum("ij,jk,ik->i", jacobian, used, jacobian).reshape(-1, 3).sum(axis=1)
    noise = fit.noise**2 / (fit.counts * fit.weights)
    squared = (noise * precision) ** 2 * (fit.squared_residuals + through_pose) + 3 * noise * (
        1 - noise * precision
    )
    of_one_touch = fit.counts * squared
    np.testing.assert_allclose(fit.weights, 7 / (4 + of_one_touch / fit.noise**2), atol=2e-5)
    if model.noise is None:
        scale = (2 * 0.05**2 + (fit.weights * of_one_touch).sum()) / (2 + 3 * len(touches))
        assert fit.noise**2 == pytest.approx(scale, rel=1e-4)


def test_exchanged_touches_are_found_again() -> None:
    model = _model(PROBE)
    for i, j in ((0, 3), (1, 2), (2, 5)):
        touches = model.mean.copy()
        touches[[i, j]] = touches[[j, i]]
        for module in (student_t_fit, student_t_fit_compiled):
            found, *_ = _run(module, "best_exchange", model, touches, 0.0)
            assert found[:2].tolist() == [i, j]


def test_numba_waits_for_the_second_estimate() -> None:
    code = """
import sys, gp_core, gp_core.cli
gp_core.cli.main(["estimate", "docs/example/touches.csv", "--side", "L"])
assert "numba" not in sys.modules
atlas = gp_core.Atlas.published()
touched = {code: 2 * atlas[code] + 1 for code in gp_core.PROBE}
first = gp_core.estimate_pose(touched, "L", atlas)
assert "gp_core.registration.student_t_fit_compiled" in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True, cwd=_ROOT, capture_output=True)
