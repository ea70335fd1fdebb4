from __future__ import annotations

import numpy as np
import pytest
from atlas_cases import random_pose

from gp_core import PROBE, Atlas
from gp_core.errors import GeometryError
from gp_core.frames import mirror_x
from gp_core.registration.named_points import TouchModel, fit_named_points, gaussian_deviance, motion_jacobian
from gp_core.registration.procrustes import weighted_procrustes


def _model(codes: tuple[str, ...] = PROBE, noise: float | None = None) -> TouchModel:
    atlas = Atlas.published()
    return TouchModel(codes, atlas.rows(codes), atlas.variances(codes), noise)


def test_exact_touches_give_the_exact_pose() -> None:
    model, T = _model(), random_pose(np.random.default_rng(0))
    fit = fit_named_points(model, T.apply(model.mean))
    np.testing.assert_allclose(fit.rotation, T.rotation, atol=1e-9)
    np.testing.assert_allclose(fit.translation, T.translation, atol=1e-7)
    assert fit.converged


def test_the_pose_moves_with_the_tracker_and_ignores_the_order() -> None:
    rng = np.random.default_rng(1)
    model, T = _model(), random_pose(rng)
    touches = model.mean + 0.3 * rng.normal(size=model.mean.shape)
    still, moved = fit_named_points(model, touches), fit_named_points(model, T.apply(touches))
    np.testing.assert_allclose(moved.rotation, T.rotation @ still.rotation, atol=1e-8)
    np.testing.assert_allclose(moved.weights, still.weights, atol=1e-8)
    back = TouchModel(model.codes[::-1], model.mean[::-1], model.variances[::-1])
    turned = fit_named_points(back, touches[::-1])
    np.testing.assert_allclose(turned.rotation, still.rotation, atol=1e-9)
    np.testing.assert_allclose(turned.weights[::-1], still.weights, atol=1e-9)


@pytest.mark.parametrize("wrong", ["CL", "LLI", "OS", "RWA", "RWP"])
def test_a_mistouch_talks_itself_out(wrong: str) -> None:
    rng = np.random.default_rng(2)
    model = _model()
    touches = model.mean + 0.05 * rng.normal(size=model.mean.shape)
    clean = fit_named_points(model, touches)
    row = model.codes.index(wrong)
    touches[row] += (0, 2.0, 2.0)
    fit = fit_named_points(model, touches)
    assert fit.weights.argmin() == row
    assert fit.weights[row] < 0.1
    assert np.linalg.norm(fit.translation - clean.translation) < 0.35


def test_the_noise_scale_follows_the_noise() -> None:
    rng = np.random.default_rng(3)
    codes = tuple(code for code in Atlas.published().codes if code not in ("IN", "ZL"))
    model = _model(codes)
    found = []
    for noise in (0.05, 0.2, 0.8):
        shape = np.sqrt(model.variances)[:, None] * rng.normal(size=model.mean.shape)
        fits = [
            fit_named_points(model, model.mean + shape + noise * rng.normal(size=shape.shape))
            for _ in range(20)
        ]
        found.append(np.mean([fit.noise for fit in fits]))
    assert found[0] < 0.15 < found[1] < 0.35 < found[2]


def test_given_noise_is_kept() -> None:
    model = _model(noise=0.3)
    assert fit_named_points(model, model.mean).noise == pytest.approx(0.3)


def test_a_mirrored_ear_fits_worse_at_careful_and_at_rough_touches() -> None:
    rng = np.random.default_rng(5)
    codes = tuple(code for code in Atlas.published().codes if code not in ("IN", "ZL"))
    model = _model(codes)
    assert gaussian_deviance(model, model.mean, 0.05) < 1e-9
    assert gaussian_deviance(model, mirror_x(model.mean), 0.05) > 20
    for noise in (0.0, 0.4):
        touches = model.mean + noise * rng.normal(size=model.mean.shape)
        own, mirrored = fit_named_points(model, touches), fit_named_points(model, mirror_x(touches))
        assert mirrored.neg_log_posterior > own.neg_log_posterior + 10


def test_a_touch_is_held_against_the_others_as_if_it_had_been_left_out() -> None:
    rng = np.random.default_rng(6)
    model = _model(noise=0.1)
    touches = model.mean + 0.01 * rng.normal(size=model.mean.shape)
    touches[2] += (0.0, 0.05, -0.05)
    fit = fit_named_points(model, touches)
    for j in range(len(touches)):
        keep = np.arange(len(touches)) != j
        precision = fit.precision[::3][keep]
        rotation, translation = weighted_procrustes(model.mean[keep], touches[keep], precision)
        away = (touches[j] - translation) @ rotation - model.mean[j]
        jacobian = motion_jacobian(model.mean[keep])
        information = jacobian.T @ (np.repeat(precision, 3)[:, None] * jacobian)
        lever = motion_jacobian(model.mean[[j]])
        of_pose = lever @ np.linalg.solve(information, lever.T)
        spread = of_pose + (model.variances[j] + 0.1**2) * np.eye(3)
        found = fit.leave_one_out_residuals
        assert found.squared[j] == pytest.approx(away @ np.linalg.solve(spread, away), rel=0.05)


def test_an_odd_touch_is_as_wrong_as_makes_its_deviation_an_average_one() -> None:
    model = _model()
    touches = model.mean.copy()
    touches[2] += (0.0, 2.5, -2.5)
    others = fit_named_points(model, touches).leave_one_out_residuals
    j = int(others.squared.argmax())
    spread = others.variances[j] + others.error_variance[j]
    assert others.squared[j] > 8
    assert (others.deviations[j] / spread).sum() == pytest.approx(3, rel=1e-6)
    ordinary = others.squared < 3
    np.testing.assert_allclose(others.error_variance[ordinary], others.touch_variances[ordinary])


def test_three_touches_say_nothing_against_each_other() -> None:
    model = _model(("CL", "OS", "RWA"))
    fit = fit_named_points(model, model.mean * 1.02)
    assert (fit.leave_one_out_residuals.squared < 2).all()


@pytest.mark.parametrize("scale", [1 / 25.4, 1 / 3, 1 / 2.54, 3, 25.4])
def test_sizes_that_are_wrong_make_no_wild_pose(scale: float) -> None:
    model = _model()
    fit = fit_named_points(model, model.mean * scale + 100)
    assert np.isfinite(fit.translation).all()
    assert np.linalg.norm(fit.translation - 100) < 30 * max(scale, 1)


def test_the_jacobian_is_the_derivative_of_a_motion() -> None:
    points = np.random.default_rng(4).normal(size=(4, 3))
    step = 1e-6
    for column in range(6):
        move = np.zeros(6)
        move[column] = step
        moved = points + np.cross(move[3:], points) + move[:3]
        np.testing.assert_allclose(
            motion_jacobian(points)[:, column], (moved - points).ravel() / step, atol=1e-8
        )


def test_touches_on_a_line_are_refused_by_name() -> None:
    model = _model(("CL", "OS", "MN"))
    line = np.array([(0, 0, 0), (1, 1, 1), (3, 3, 3.0)])
    with pytest.raises(GeometryError, match=r"one line.*CL, OS, MN"):
        fit_named_points(model, line)
