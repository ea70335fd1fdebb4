"""Animals drawn from the scatter of the labelled ones, and the errors of their estimates (Figure 6 C, D)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.atlas.plain_fit import fit_plain_atlas
from gp_core.constants import METHODS
from gp_core.errors import GpError
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.features import CODES, PROBE, TRAINING, Side
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.pose.jrmpc_estimator import training_sides
from gp_core.registration.jrmpc import ESTIMATION, JrmpcSettings, jrmpc
from gp_core.study.leave_one_out import describe
from gp_core.study.parallel import run_map
from gp_core.study.scoring import PoseErrors, jrmpc_errors, robust_errors
from gp_core.study.subsets import check_labels, check_subsets, sides_of
from gp_core.study.trials import Trial, check_noise, make_trial, window_arrays
from gp_core.validation import FloatArray, check_option

__all__ = ["LIMITS", "SimulationReport", "simulate", "simulate_sides"]

LIMITS = (0.43, 8.1)
"""The largest errors (mm, degrees) of the paper's 22 sides, its limits for the simulated ones."""

_CHUNK = 100


@dataclass(frozen=True)
class SimulationReport:
    """Errors on simulated sides.

    Attributes
    ----------
    method : str
    training, probe : tuple of str
    settings : JrmpcSettings or None
        Of ``jrmpc``.
    noise : float
        Standard deviation of the touch errors, mm per coordinate.
    errors : dict of str to PoseErrors
        By side, ``L`` and ``R``.
    """

    method: str
    training: tuple[str, ...]
    probe: tuple[str, ...]
    settings: JrmpcSettings | None
    noise: float
    errors: dict[str, PoseErrors]

    @property
    def groups(self) -> dict[str, PoseErrors]:
        """The errors of each side, and ``pooled``."""
        return {**self.errors, "pooled": PoseErrors.joined(list(self.errors.values()))}

    def as_dict(self) -> dict[str, Any]:
        """Return the report as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        settings = describe(self.method, self.training, self.probe, self.settings)
        return {
            "groups": {name: _statistics(errors) for name, errors in self.groups.items()},
            "settings": {**settings, "noise_mm": self.noise},
            "errors": {
                side: {"e_co_mm": errors.e_co_mm.tolist(), "e_ma_deg": errors.e_ma_deg.tolist()}
                for side, errors in self.errors.items()
            },
        }


def _statistics(errors: PoseErrors) -> dict[str, Any]:
    e_co, e_ma = _box(errors.e_co_mm), _box(errors.e_ma_deg)
    beyond = (errors.e_co_mm > e_co["whisker"]) | (errors.e_ma_deg > e_ma["whisker"])
    within = (errors.e_co_mm <= LIMITS[0]) & (errors.e_ma_deg <= LIMITS[1])
    return {
        "n": len(errors.e_co_mm),
        "e_co_mm": e_co,
        "e_ma_deg": e_ma,
        "beyond_either": float(beyond.mean()),
        "within_limits": float(within.mean()),
        "limits": {"e_co_mm": LIMITS[0], "e_ma_deg": LIMITS[1]},
    }


def _box(values: FloatArray) -> dict[str, float]:
    """Return what a box plot shows; the whisker is the last datum within 1.5 interquartile ranges."""
    low, median, high = np.percentile(values, (25, 50, 75))
    whisker = float(values[values <= high + 1.5 * (high - low)].max())
    return {
        "mean": float(values.mean()),
        "median": float(median),
        "whisker": whisker,
        "beyond": float((values > whisker).mean()),
        "max": float(values.max()),
    }


@checks_arguments
def simulate(
    specimens: Sequence[Specimen],
    *,
    n: int = 1000,
    rng: np.random.Generator,
    method: str = "jrmpc",
    training: Iterable[str] = TRAINING,
    probe: Iterable[str] = PROBE,
    settings: JrmpcSettings = ESTIMATION,
    noise: float = 0.0,
    executor: Executor | None = None,
) -> SimulationReport:
    """Draw animals from the scatter of the labelled ones and estimate their cochleae from all of these.

    Parameters
    ----------
    specimens : sequence of Specimen
        At least three labelled animals.
    n : int
        Number of animals drawn for each side.
    rng : numpy Generator
        Source of random numbers.
    method : {"jrmpc", "robust"}
        The estimator.
    training, probe : iterable of str
        Features of the labelled animals, and those that are touched.
    settings : JrmpcSettings
        Of ``jrmpc``, and of the registration that the scatter is taken from.
    noise : float
        Standard deviation of the touch errors, mm per coordinate.
    executor : concurrent.futures.Executor, optional
        Runs the estimates; the result does not depend on it.

    Returns
    -------
    SimulationReport
        Errors of all drawn sides.

    Raises
    ------
    GpError
        Too few animals, a feature is missing or not allowed, or a number is out of range.
    """
    check_option(method, "method", METHODS)
    features, touches = check_subsets(training, probe)
    check_labels(specimens, CODES)
    check_noise(noise)
    if n < 1:
        raise GpError(f"the number of animals to draw must be 1 or more, got {n}")
    atlas = fit_plain_atlas(specimens, features=features) if method == "robust" else None
    errors = {}
    for side, _ in sides_of(specimens):
        drawn = simulate_sides(specimens, side, n, features=features, settings=settings, rng=rng)
        trials = [make_trial(truth, touches, noise=noise, rng=rng) for truth in drawn]
        chunks = [trials[i : i + _CHUNK] for i in range(0, n, _CHUNK)]
        if atlas is not None:
            estimate = partial(_robust, atlas)
        else:
            labelled = np.array([t.landmarks.points for t in training_sides(specimens, side)])
            estimate = partial(_jrmpc, labelled, features, settings)
        errors[side.value] = PoseErrors.joined(run_map(estimate, chunks, executor))
    used = settings if method == "jrmpc" else None
    return SimulationReport(method, features, touches, used, noise, errors)


def simulate_sides(
    specimens: Sequence[Specimen],
    side: Side,
    n: int,
    *,
    features: Sequence[str] = TRAINING,
    settings: JrmpcSettings = ESTIMATION,
    rng: np.random.Generator,
) -> list[LandmarkSet]:
    """Draw sides from the scatter of the labelled ones, feature by feature.

    The labelled sides are registered by JRMPC on some features; mean and covariance of each of the 20
    features in the joint frame make a Gaussian. CO is recomputed from the drawn points, as in an animal.

    Parameters
    ----------
    specimens, n, settings, rng
        As for `simulate`.
    side : Side
        The side to draw.
    features : sequence of str
        What the labelled sides are registered by.

    Returns
    -------
    list of LandmarkSet
        In the joint frame, mm.
    """
    labelled = [training.landmarks for training in training_sides(specimens, side)]
    registered = jrmpc(
        [landmarks.array(features) for landmarks in labelled],
        max_iterations=settings.max_iterations,
        gamma=settings.gamma,
        epsilon=settings.epsilon,
    )
    moved = np.array(registered.moved([landmarks.points for landmarks in labelled]))
    drawn = np.empty((n, len(CODES), 3))
    for row in range(len(CODES)):
        mean, covariance = moved[:, row].mean(axis=0), np.cov(moved[:, row].T)
        drawn[:, row] = rng.multivariate_normal(mean, covariance, size=n, method="eigh")
    return [with_cochlea_origin(LandmarkSet(points, side, "joint")) for points in drawn]


def _jrmpc(
    labelled: FloatArray,
    features: Sequence[str],
    settings: JrmpcSettings,
    trials: Sequence[Trial],
) -> PoseErrors:
    touches, truths = window_arrays(trials)
    training = np.broadcast_to(labelled, (len(trials), *labelled.shape))
    return jrmpc_errors(training, touches, truths, features, settings)


def _robust(atlas: Atlas, trials: Sequence[Trial]) -> PoseErrors:
    return robust_errors(
        [atlas] * len(trials), [trial.touches for trial in trials], [trial.truth for trial in trials]
    )
