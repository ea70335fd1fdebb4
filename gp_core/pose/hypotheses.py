"""Alternative hypotheses on the same touches: the other ear, or two names exchanged; with their odds.

Each hypothesis is fitted like the touches as named, and weighted by prior times marginal likelihood. The
marginal likelihood integrates the pose out by Laplace's method, and the scale of the touch errors and the
weight of each touch over grids: the noise model is that of `gp_core.registration.named_points`, with the same
prior of its scale.

The priors are rates of human error. Selecting the wrong one of several similar items by their labels alone
happens in about 3 of 1000 selections (Swain and Guttmann, "Handbook of human reliability analysis",
NUREG/CR-1278, 1983); six touches are six selections, hence 2 % for all exchanges together. The side is one
selection, but left and right of a head swap with the view: ten times that rate, 3 %.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gp_core.errors import GeometryError
from gp_core.frames import mirror_x
from gp_core.registration.named_points import (
    NamedFit,
    TouchModel,
    approximate_neg_log_posterior,
    best_exchange,
    fit_named_points,
    gaussian_deviance,
)
from gp_core.registration.student_t_fit import NU, PRIOR_WEIGHT, TYPICAL_NOISE_MM
from gp_core.validation import FloatArray

__all__ = ["FittedHypothesis", "fit_hypotheses", "log_evidence"]

_EXCHANGE_PRIOR = 0.02
_SIDE_PRIOR = 0.03

_FEW_TOUCHES = 4
"""With so few touches, even a good fit may have two names exchanged."""

_LEAST = 1e-3
"""Probability below which a hypothesis is dropped."""

_PRUNE_ABOVE = 16.0
"""Excess negative log posterior above which an exchange is not fitted to convergence."""

_PRUNE_SIDE_ABOVE = 25.0
"""Difference in deviance of careful touches above which the other ear is not fitted."""

_N_SIGMA, _N_WEIGHTS = 9, 10
_SIGMA2 = np.geomspace(0.02, 2.0, _N_SIGMA) ** 2
_LOG_SIGMA2_PRIOR = -PRIOR_WEIGHT / 2 * (np.log(_SIGMA2) + TYPICAL_NOISE_MM**2 / _SIGMA2)
_WEIGHTS = np.geomspace(1e-3, 3.5, _N_WEIGHTS)
_WEIGHT_PRIOR = _WEIGHTS ** (NU / 2) * np.exp(-NU / 2 * _WEIGHTS)
_WEIGHT_PRIOR /= _WEIGHT_PRIOR.sum()
_NOISE2 = _SIGMA2[:, None, None] / _WEIGHTS


@dataclass(frozen=True)
class FittedHypothesis:
    """One hypothesis on the touches, with its fit.

    Attributes
    ----------
    mirrored : bool
        Whether the touches are taken as those of the other ear.
    exchanged : (int, int) or None
        Rows of the two touches whose names are exchanged.
    fit : NamedFit
        Of the touches under this hypothesis.
    probability : float
        The probabilities of all hypotheses that are kept add up to 1.
    """

    mirrored: bool
    exchanged: tuple[int, int] | None
    fit: NamedFit
    probability: float


def fit_hypotheses(model: TouchModel, points: FloatArray, fit: NamedFit) -> tuple[FittedHypothesis, ...]:
    """Return the touches as named, then every other hypothesis that is not ruled out, the likeliest first.

    Parameters
    ----------
    model : TouchModel
        Of the touched features.
    points : (n, 3) array, mm
        The touches, as of a left side.
    fit : NamedFit
        Of the touches as they are named.

    Returns
    -------
    tuple of FittedHypothesis
        The first is the touches as named.
    """
    n = len(points)
    found: list[tuple[bool, tuple[int, int] | None, NamedFit, float]] = [
        (False, None, fit, math.log(1 - _EXCHANGE_PRIOR - _SIDE_PRIOR))
    ]
    mirrored = None if _is_surely_this_side(model, points, fit) else _fitted(model, mirror_x(points))
    if mirrored is not None:
        found.append((True, None, mirrored, math.log(_SIDE_PRIOR)))
    log_prior = math.log(_EXCHANGE_PRIOR / (n * (n - 1) / 2))
    found += [(False, pair, other, log_prior) for pair, other in _exchanges(model, points, fit)]
    logs = np.array([prior + log_evidence(model, other) for _, _, other, prior in found])
    odds = np.exp(logs - logs.max())
    odds /= odds.sum()
    fitted = [
        FittedHypothesis(side, pair, other, float(p))
        for (side, pair, other, _), p in zip(found, odds, strict=True)
    ]
    named, *others = fitted
    kept = sorted((r for r in others if r.probability >= _LEAST), key=lambda r: -r.probability)
    return named, *kept


def _is_surely_this_side(model: TouchModel, points: FloatArray, fit: NamedFit) -> bool:
    """Whether careful touches rule out the other ear; saves fitting it."""
    if fit.fits_poorly:
        return False
    worse = gaussian_deviance(model, mirror_x(points), fit.noise) - gaussian_deviance(
        model, points, fit.noise
    )
    return worse > _PRUNE_SIDE_ABOVE


def _fitted(model: TouchModel, points: FloatArray) -> NamedFit | None:
    try:
        return fit_named_points(model, points)
    except GeometryError:
        return None


def _exchanges(
    model: TouchModel, points: FloatArray, fit: NamedFit
) -> Iterator[tuple[tuple[int, int], NamedFit]]:
    """Yield two rows, and the fit with their names exchanged, where that may fit equally well."""
    n = len(points)
    if n > _FEW_TOUCHES and not fit.fits_poorly:
        return
    limit = fit.neg_log_posterior + _PRUNE_ABOVE
    if best_exchange(model, points, fit, limit)[2] > limit:
        return
    for i, j in combinations(range(n), 2):
        exchanged = points.copy()
        exchanged[[i, j]] = points[[j, i]]
        renamed = model.with_counts_exchanged(i, j)
        if approximate_neg_log_posterior(renamed, exchanged, fit.quaternion) <= limit:
            other = _fitted(renamed, exchanged)
            if other is not None:
                yield (i, j), other


def log_evidence(model: TouchModel, fit: NamedFit) -> float:
    """Return the logarithm of the marginal likelihood of a hypothesis, up to a constant of the touches.

    Parameters
    ----------
    model : TouchModel
        Of the touched features.
    fit : NamedFit
        Of the touches under the hypothesis.

    Returns
    -------
    float
        The log evidence.
    """
    squared = fit.squared_residuals[:, None]
    if model.noise is None:
        noise2, prior = _NOISE2, _LOG_SIGMA2_PRIOR
    else:
        noise2, prior = model.noise**2 / _WEIGHTS[None, None], np.zeros(1)
    # (scale, touch, weight)
    variance = model.variances[:, None] + noise2 / fit.counts[:, None]
    logs = -1.5 * np.log(variance) - squared / (2 * variance)
    largest = logs.max(axis=2)
    shares = np.exp(logs - largest[..., None]) * _WEIGHT_PRIOR
    sums = shares.sum(axis=2)
    precision = (shares / variance).sum(axis=2) / sums
    jacobian = fit.jacobian.reshape(-1, 3, 6)
    of_touch = (jacobian.transpose(0, 2, 1) @ jacobian).reshape(-1, 36)
    log_volume = -0.5 * np.linalg.slogdet((precision @ of_touch).reshape(-1, 6, 6))[1]
    total = (largest + np.log(sums)).sum(axis=1) + log_volume + prior
    top = float(total.max())
    return top + float(np.log(np.exp(total - top).sum()))
