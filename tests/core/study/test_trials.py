"""A side as the probe reports it: which touches err, and by how much."""

from __future__ import annotations

import numpy as np
import pytest
from study_cases import cohort

from gp_core import PROBE, LandmarkSet
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.study.subsets import WINDOW_FEATURES
from gp_core.study.trials import Trial, make_trial, window_arrays


@pytest.fixture(scope="module")
def side() -> LandmarkSet:
    return with_cochlea_origin(cohort(1)[0].side("L"))


def _off(trial: Trial) -> np.ndarray:
    codes = trial.touches.placed
    return trial.touches.array(codes) - trial.truth.array(codes)


def test_without_errors_touches_are_the_points(side: LandmarkSet) -> None:
    trial = make_trial(side, PROBE, rng=np.random.default_rng(0))
    assert set(trial.touches.placed) == set(PROBE)
    assert not _off(trial).any()


@pytest.mark.parametrize("seed", range(5))
def test_a_mistouch_is_one_touch_so_far_off(side: LandmarkSet, seed: int) -> None:
    trial = make_trial(side, PROBE, mistouch=3.0, rng=np.random.default_rng(seed))
    far = np.sort(np.linalg.norm(_off(trial), axis=1))
    assert far[-1] == pytest.approx(3.0)
    assert not far[:-1].any()


def test_any_touch_may_be_the_one_and_in_any_direction(side: LandmarkSet) -> None:
    rng = np.random.default_rng(1)
    off = np.array([_off(make_trial(side, PROBE, mistouch=1.0, rng=rng)) for _ in range(300)])
    which = np.linalg.norm(off, axis=2) > 0.5
    assert (which.sum(axis=0) > 25).all()  # 50 expected
    assert np.abs(off[which].mean(axis=0)).max() < 0.15


def test_noise_is_of_that_size_on_every_coordinate(side: LandmarkSet) -> None:
    rng = np.random.default_rng(2)
    off = np.array([_off(make_trial(side, PROBE, noise=0.2, rng=rng)) for _ in range(300)])
    np.testing.assert_allclose(off.std(axis=0), 0.2, atol=0.04)


def test_the_window_frame_is_built_on_touches_even_where_they_are_not_used(side: LandmarkSet) -> None:
    probe = tuple(code for code in PROBE if code not in WINDOW_FEATURES)
    trial = make_trial(side, probe, noise=0.1, rng=np.random.default_rng(3))
    assert set(trial.touches.placed) == set(probe)
    assert set(trial.window.placed) == {*probe, *WINDOW_FEATURES}
    np.testing.assert_array_equal(trial.window.array(probe), trial.touches.array(probe))
    touches, truths = window_arrays([trial])
    assert touches.shape == (1, len(probe), 3)
    assert np.linalg.norm(truths[0, 0] - truths[0, 1]) == pytest.approx(
        np.linalg.norm(side.points[0] - side.points[1])
    )
