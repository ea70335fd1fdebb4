"""A side of a head as the probe reports it: its true points, and the touches with their errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gp_core.errors import GpError
from gp_core.landmarks.anatomy import round_window_frame
from gp_core.landmarks.sets import LandmarkSet
from gp_core.study.scoring import touched
from gp_core.study.subsets import WINDOW_FEATURES
from gp_core.validation import FloatArray

__all__ = ["Trial", "check_noise", "make_trial", "window_arrays"]


@dataclass(frozen=True)
class Trial:
    """One side, touched once.

    Attributes
    ----------
    truth : LandmarkSet
        All points as they are, CO among them.
    touches : LandmarkSet
        What the probe reports of the probe features, in the same frame.
    window : LandmarkSet
        What it reports of them and of the features that the RW frame is built on.
    """

    truth: LandmarkSet
    touches: LandmarkSet
    window: LandmarkSet


def make_trial(
    truth: LandmarkSet,
    probe: Sequence[str],
    *,
    noise: float = 0.0,
    mistouch: float = 0.0,
    rng: np.random.Generator | None = None,
) -> Trial:
    """Touch a side, with errors.

    Parameters
    ----------
    truth : LandmarkSet
        With CO; mm, any frame.
    probe : sequence of str
        The touched features.
    noise : float
        Standard deviation of the Gaussian error of each coordinate, mm.
    mistouch : float
        Error of one probe feature, drawn at random, in a random direction, mm.
    rng : numpy Generator, optional
        Source of random numbers; not needed without errors.

    Returns
    -------
    Trial
        Truth and touches.
    """
    if rng is None or not (noise or mistouch):
        return Trial(truth, touched(truth, probe), touched(truth, [*probe, *WINDOW_FEATURES]))
    codes = list(dict.fromkeys([*probe, *WINDOW_FEATURES]))
    points = truth.array(codes) + noise * rng.standard_normal((len(codes), 3))
    wrong = int(rng.integers(len(probe)))
    direction = rng.standard_normal(3)
    points[wrong] += mistouch * direction / np.linalg.norm(direction)
    window = LandmarkSet.from_mapping(dict(zip(codes, points, strict=True)), truth.side, frame=truth.frame)
    return Trial(truth, touched(window, probe), window)


def window_arrays(trials: Sequence[Trial]) -> tuple[FloatArray, FloatArray]:
    """Return touches and truth, each trial in the RW frame of its own touches.

    Parameters
    ----------
    trials : sequence of Trial
        B trials with p touches each.

    Returns
    -------
    touches : (B, p, 3) array, mm
        What the probe reports.
    truth : (B, 20, 3) array, mm
        The true points.
    """
    touches, truths = [], []
    for trial in trials:
        T_window_frame = round_window_frame(trial.window).inverse()
        touches.append(T_window_frame.apply(trial.touches.array(trial.touches.placed)))
        truths.append(T_window_frame.apply(trial.truth.points))
    return np.array(touches), np.array(truths)


def check_noise(noise: float) -> None:
    """Check a probe noise.

    Parameters
    ----------
    noise : float
        Standard deviation, mm.

    Raises
    ------
    GpError
        It is not a number of mm from 0.
    """
    if not (math.isfinite(noise) and noise >= 0):
        raise GpError(f"the noise must be 0 mm or more, got {noise!r}")
