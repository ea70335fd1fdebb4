"""Weighted Procrustes: known motions come back, det +1 always, and what leaves a turn open is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gp_core.errors import GeometryError, GpError
from gp_core.frames import mirror_x
from gp_core.registration.procrustes import (
    certainly_not_collinear,
    fit_rigid,
    rms_without_each,
    weighted_procrustes,
)
from gp_core.validation import FloatArray

seeds = st.integers(0, 2**32 - 1)


def random_rotation(rng: np.random.Generator) -> FloatArray:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


@settings(max_examples=50, deadline=None)
@given(seed=seeds, n=st.integers(4, 20))
def test_known_motion_is_recovered_whatever_the_weights(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    rotation, translation = random_rotation(rng), 100 * rng.normal(size=3)
    source = 5 * rng.normal(size=(n, 3))
    weights = rng.uniform(0.1, 3.0, n)
    found_r, found_t = weighted_procrustes(source, source @ rotation.T + translation, weights)
    np.testing.assert_allclose(found_r, rotation, atol=1e-9)
    np.testing.assert_allclose(found_t, translation, atol=1e-8)


def test_three_points_suffice() -> None:
    rng = np.random.default_rng(1)
    rotation = random_rotation(rng)
    source = np.array([[0, 0, 0], [5, 0, 0], [0, 3, 0.0]])
    found, _ = weighted_procrustes(source, source @ rotation.T)
    np.testing.assert_allclose(found, rotation, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_no_small_motion_fits_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source, target = rng.normal(size=(8, 3)), rng.normal(size=(8, 3))
    weights = rng.uniform(size=8)
    rotation, translation = weighted_procrustes(source, target, weights)

    def cost(r: FloatArray, t: FloatArray) -> float:
        return float(weights @ ((source @ r.T + t - target) ** 2).sum(axis=1))

    best = cost(rotation, translation)
    for _ in range(50):
        axis = 1e-3 * rng.normal(size=3)
        cross = np.cross(np.eye(3), axis)
        turn = np.linalg.solve(np.eye(3) - cross / 2, np.eye(3) + cross / 2)
        assert cost(turn @ rotation, translation + 1e-3 * rng.normal(size=3)) >= best - 1e-12


def test_mirror_image_is_met_by_a_rotation_not_a_mirror() -> None:
    source = np.random.default_rng(2).normal(size=(10, 3)) * [3.0, 2.0, 1.0]
    rotation, _ = weighted_procrustes(source, mirror_x(source))
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert fit_rigid(source, mirror_x(source), dst="atlas", src="scan").rms > 0.1


def test_points_of_weight_zero_do_not_count() -> None:
    rng = np.random.default_rng(3)
    source = rng.normal(size=(6, 3))
    target = source + 1.0
    target[5] += 50.0
    _, translation = weighted_procrustes(source, target, [1, 1, 1, 1, 1, 0])
    np.testing.assert_allclose(translation, [1, 1, 1], atol=1e-12)


def test_fit_reports_residuals_and_registration_error() -> None:
    source = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [4, 4, 0.0]])
    target = source + np.array([[7.1, 8, 9], [6.9, 8, 9], [6.9, 8, 9], [7.1, 8, 9]])
    fit = fit_rigid(source, target, dst="scan", src="tracker")
    assert (fit.transform.dst, fit.transform.src) == ("scan", "tracker")
    np.testing.assert_allclose(fit.transform.translation, [7, 8, 9], atol=1e-12)
    np.testing.assert_allclose(fit.residuals, 0.1, atol=1e-12)
    assert fit.rms == pytest.approx(0.1)


LINE = np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2], [5, 5, 5.0]])
CROSS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0.0]])


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (np.zeros((0, 3)), "three points, got 0"),
        (np.eye(3)[:2], "got 2: RWA, RWP"),
        (LINE + 150.0, "one line.*RWA, RWP, LLI, MN"),
        (LINE + np.array([[0, 0, 0], [0, 1e-5, 0], [1e-5, 0, 0], [0, 0, 0]]), "one line"),
        (np.full((4, 3), 150.1), "one line"),
    ],
)
def test_points_that_do_not_determine_a_rotation_are_named(source: FloatArray, words: str) -> None:
    names = ("RWA", "RWP", "LLI", "MN")[: len(source)]
    with pytest.raises(GeometryError, match=words):
        weighted_procrustes(source, source, names=names)


def test_line_of_all_that_count_is_refused() -> None:
    points = np.vstack([LINE, [9.0, 0, 0]])
    with pytest.raises(GeometryError, match="one line"):
        weighted_procrustes(points, points, [1, 1, 1, 1, 0])


def test_line_in_the_target_is_refused() -> None:
    with pytest.raises(GeometryError, match="target points lie on one line"):
        weighted_procrustes(CROSS, LINE)


def test_ambiguous_rotation_is_refused() -> None:
    tetrahedron = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
    with pytest.raises(GeometryError, match="do not determine"):
        weighted_procrustes(tetrahedron, mirror_x(tetrahedron))


@pytest.mark.parametrize(
    ("source", "target", "weights", "names", "words"),
    [
        (np.eye(3), np.eye(3)[:2], None, None, "as many"),
        (np.eye(4), np.eye(4), None, None, "source must have the shape"),
        ([[np.nan, 0, 0]] * 3, np.eye(3), None, None, "source must be finite"),
        (np.eye(3), [[np.inf, 0, 0]] * 3, None, None, "target must be finite"),
        (np.eye(3), np.eye(3), [1, 1], None, r"weights must have the shape \(3,\)"),
        (np.eye(3), np.eye(3), [1, 1, -1], None, "not negative"),
        (np.eye(3), np.eye(3), [1, 1, np.nan], None, "finite"),
        (np.eye(3), np.eye(3), ["a", "b", "c"], None, "numbers"),
        (np.eye(3), np.eye(3), [0, 0, 0], None, "got 0"),
        (np.eye(3), np.eye(3), None, ["RWA"], "names must hold 3"),
    ],
)
def test_bad_input_is_named(source: Any, target: Any, weights: Any, names: Any, words: str) -> None:
    with pytest.raises(GpError, match=words):
        weighted_procrustes(source, target, weights, names=names)


def test_input_is_left_alone() -> None:
    source = np.random.default_rng(4).normal(size=(5, 3))
    target, weights = source + 1.0, np.ones(5)
    before = source.copy(), target.copy(), weights.copy()
    fit_rigid(source, target, weights=weights, dst="scan", src="tracker")
    for now, then in zip((source, target, weights), before, strict=True):
        np.testing.assert_array_equal(now, then)


@pytest.mark.parametrize(("width", "sure"), [(0.0, False), (2e-3, False), (1e-2, True), (1.0, True)])
def test_a_line_is_never_surely_none(width: float, sure: bool) -> None:
    line = 7 * np.arange(5.0)[:, None] * np.array([1.0, 2, 2]) / 3 + 100
    bent = line + 10 * width * np.array([0, 1, 0, -1, 0])[:, None] * np.array([2.0, 1, -2]) / 3
    assert certainly_not_collinear(bent) is sure
    assert not certainly_not_collinear(np.full((4, 3), 123.456))
    assert not certainly_not_collinear(bent[:2])


def test_leaving_each_out_at_once_is_leaving_them_out_one_by_one() -> None:
    rng = np.random.default_rng(4)
    points = 10 * rng.normal(size=(7, 3)) + 50
    aims = points + 0.3 * rng.normal(size=points.shape)
    wanted = [
        fit_rigid(np.delete(points, i, 0), np.delete(aims, i, 0), dst="scan", src="tracker").rms
        for i in range(7)
    ]
    np.testing.assert_allclose(rms_without_each(points, aims), wanted, rtol=1e-9)
    mirrored = rms_without_each(points, points * (-1, 1, 1))
    assert (mirrored > 1).all(), "a mirror image is no motion"


@pytest.mark.parametrize("noise", [0.0, 1e-5, 3e-3])
def test_without_the_one_point_off_a_line_there_is_no_rotation(noise: float) -> None:
    rng = np.random.default_rng(5)
    line = np.outer(np.arange(5.0), (1.0, 2.0, 3.0)) + noise * rng.normal(size=(5, 3))
    points = np.vstack([line, [3.0, 0.0, 0.0]])
    without = rms_without_each(points, points + 1e-3 * rng.normal(size=points.shape))
    assert np.isinf(without[5])
    assert np.isfinite(without[:5]).all()
