"""Fit an atlas to named points: pose and shape together, with heavy-tailed touch errors.

Model, in the atlas frame (left side). The point touched at feature j is

    y_j = R (mu_j + s_j + e_j) + t,    s_j ~ N(0, v_j I),    e_j ~ Student-t(nu, sigma),

where s_j is how this animal's feature differs from the mean, with the variance v_j the atlas gives it, and
e_j is the error of the touch. A Student-t is a Gaussian of variance sigma^2 / w_j whose weight w_j is itself
unknown, so a mistouch talks itself out of the fit. Expectation conditional maximisation: the weights and
sigma from the expected squared errors, the pose by a Gauss-Newton step on the likelihood with the shape
integrated out.

Correlations between features are left out of the weights on purpose: learned from some twenty sides, they
made the estimates of held-out animals worse (docs/method.md). They do enter the error bars, `robust_pose`.

References
----------
Lange, Little and Taylor, "Robust statistical modeling using the t distribution", JASA 84, 1989.
https://doi.org/10.1080/01621459.1989.10478852
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, log, log1p, sin

import numpy as np

from gp_core.checks import FloatArray
from gp_core.errors import GeometryError
from gp_core.frames import cross_matrix
from gp_core.registration.procrustes import align, weighted_procrustes

__all__ = [
    "TYPICAL_NOISE_MM",
    "NamedFit",
    "TouchModel",
    "fit_named_points",
    "motion_jacobian",
    "quick_misfit",
]

TYPICAL_NOISE_MM = 0.05
"""Scale of a careful touch, mm a coordinate, to which the estimate of sigma is drawn."""

_PRIOR_WEIGHT = 2.0
_NU = 4.0
_MAX_ITERATIONS = 100
_WEIGHT_TOLERANCE = 3e-3
_DOUBTFUL_WEIGHT = 0.5
_LEFT_OUT = 1e-3
_OVER_RELAXATION = 2.0  # sigma alone would creep: twice its step halves the iterations, same fixed point


@dataclass(frozen=True)
class TouchModel:
    """What the atlas says of the points that are touched.

    Parameters
    ----------
    codes : tuple of str
        Their features.
    mean : (n, 3) array, mm, atlas frame
    variances : (n,) array, mm^2
        Between animals, a coordinate.
    noise : float or None
        Scale of the touch errors, mm a coordinate; None: estimated with the pose.
    """

    codes: tuple[str, ...]
    mean: FloatArray
    variances: FloatArray
    noise: float | None = None


@dataclass(frozen=True)
class NamedFit:
    """An atlas fitted to touched points; vectors in the atlas frame.

    Attributes
    ----------
    rotation, translation : (3, 3), (3,) arrays
        The atlas in the frame of the touches, ``y = rotation @ x + translation``, mm.
    residual : (3 n,) array, mm
        Touch minus mean, at this pose.
    weights : (n,) array
        About 1 for an ordinary touch, towards 0 for one that does not fit.
    noise : float
        Scale sigma of the touch errors, mm.
    noise_estimated : bool
        Whether it was found from the touches.
    precision : (3 n,) array
        Inverse variance of `residual` with these weights.
    jacobian : (3 n, 6) array
        `motion_jacobian` of the touches.
    misfit : float
        Negative log posterior up to a constant; lower is better among fits of the same touches.
    converged : bool
        False where the iterations ran out first.
    """

    rotation: FloatArray
    translation: FloatArray
    residual: FloatArray
    weights: FloatArray
    noise: float
    noise_estimated: bool
    precision: FloatArray
    jacobian: FloatArray
    misfit: float
    converged: bool

    @property
    def touch_variances(self) -> FloatArray:
        """(3 n,) variance of each touched coordinate, mm^2.

        A Student-t varies more than its scale says, and a scale found from few touches is itself unsure.
        """
        freedom = 3 * len(self.weights) - 6 + _PRIOR_WEIGHT
        unsure = freedom / (freedom - 2) if self.noise_estimated else 1.0
        return np.repeat(unsure * _NU / (_NU - 2) * self.noise**2 / self.weights, 3)


def fit_named_points(model: TouchModel, touches: FloatArray) -> NamedFit:
    """Fit the atlas to touched points.

    A mistouch can hold the fit in a wrong place, so wherever one touch is doubted, the fit is also started
    without each touch in turn, and the best of these stands.

    Parameters
    ----------
    model : TouchModel
    touches : (n, 3) array, mm
        In any frame of the atlas's handedness; row j is feature j of the model.

    Raises
    ------
    GeometryError
        Fewer than three touches, or touches on one line.
    """
    weighted_procrustes(model.mean, touches, names=model.codes)  # for its guards; below, none are needed
    fit = _fit_from(model, touches, np.ones(len(touches)))
    if fit.weights.min() > _DOUBTFUL_WEIGHT or len(touches) == 3:
        return fit
    others = [_fit_from(model, touches, start) for start in _one_left_out(model, touches)]
    return min([fit, *others], key=lambda candidate: candidate.misfit)


def quick_misfit(model: TouchModel, touches: FloatArray) -> float:
    """Return -2 log likelihood, up to a constant, of careful touches with no mistouch among them.

    Cheap, and on one scale for any reading of the same touches (other side, names exchanged); about
    chi-square with 3 n - 6 degrees of freedom where the reading is right.
    """
    noise = (TYPICAL_NOISE_MM if model.noise is None else model.noise) ** 2
    rotation, translation = align(model.mean, touches, 1 / (model.variances + noise))
    residual = ((touches - translation) @ rotation - model.mean).ravel()
    return float(residual @ (np.repeat(1 / (model.variances + noise), 3) * residual))


def _one_left_out(model: TouchModel, touches: FloatArray) -> Iterator[FloatArray]:
    for j in range(len(touches)):
        weights = np.ones(len(touches))
        weights[j] = _LEFT_OUT
        try:
            weighted_procrustes(model.mean[weights == 1], touches[weights == 1])
        except GeometryError:
            continue
        yield weights


def _fit_from(model: TouchModel, touches: FloatArray, weights: FloatArray) -> NamedFit:
    sigma2 = (TYPICAL_NOISE_MM if model.noise is None else model.noise) ** 2
    rotation, translation = align(model.mean, touches, 1 / (model.variances + sigma2 / weights))
    for iteration in range(_MAX_ITERATIONS + 1):
        local = (touches - translation) @ rotation
        residual = (local - model.mean).ravel()
        noise = sigma2 / weights
        precision = np.repeat(1 / (model.variances + noise), 3)
        jacobian = motion_jacobian(local)
        pull = precision[:, None] * jacobian
        pose_covariance = np.linalg.inv(jacobian.T @ pull)
        step = pose_covariance @ (residual @ pull)
        pulled = precision * residual - pull @ step
        leverage = ((pull @ pose_covariance) * pull).sum(axis=1)
        error = noise**2 * _over_coordinates(pulled * pulled)
        spread = 3 * noise - noise**2 * _over_coordinates(precision - leverage)
        updated = (_NU + 3) / (_NU + (error + spread) / sigma2)
        converged = bool(np.abs(updated - weights).max() < _WEIGHT_TOLERANCE)
        if converged or iteration == _MAX_ITERATIONS:
            break
        weights = updated
        if model.noise is None:
            sigma2 *= (_noise_variance(weights, error + spread) / sigma2) ** _OVER_RELAXATION
        translation = translation + rotation @ step[:3]
        rotation = rotation @ _rotation_from_vector(step[3:])
    misfit = _misfit(model, _over_coordinates(pulled * pulled), error, sigma2)
    return NamedFit(
        rotation=rotation,
        translation=translation,
        residual=residual,
        weights=weights,
        noise=sigma2**0.5,
        noise_estimated=model.noise is None,
        precision=precision,
        jacobian=jacobian,
        misfit=misfit,
        converged=converged,
    )


def motion_jacobian(points: FloatArray) -> FloatArray:
    """Return how points move with the atlas: d point / d (translation in mm, rotation vector in rad).

    Parameters
    ----------
    points : (n, 3) array, mm, atlas frame

    Returns
    -------
    (3 n, 6) array
        Row 3 j + c is coordinate c of point j.
    """
    x, y, z = points.T
    jacobian = np.zeros((len(points), 3, 6))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = jacobian[:, 2, 2] = 1.0
    jacobian[:, 0, 4], jacobian[:, 0, 5] = z, -y
    jacobian[:, 1, 3], jacobian[:, 1, 5] = -z, x
    jacobian[:, 2, 3], jacobian[:, 2, 4] = y, -x
    return jacobian.reshape(-1, 6)


def _over_coordinates(values: FloatArray) -> FloatArray:
    total: FloatArray = values.reshape(-1, 3).sum(axis=1)
    return total


def _noise_variance(weights: FloatArray, squared_errors: FloatArray) -> float:
    prior = _PRIOR_WEIGHT * TYPICAL_NOISE_MM**2
    return float((prior + weights @ squared_errors) / (_PRIOR_WEIGHT + 3 * len(weights)))


def _misfit(model: TouchModel, pulled: FloatArray, error: FloatArray, sigma2: float) -> float:
    """Shape and touch errors, each by its own law; `pulled` is |s_j|^2 / v_j^2."""
    shape = float(model.variances @ pulled) / 2
    touches = (_NU + 3) / 2 * sum(log1p(e / (_NU * sigma2)) for e in error.tolist())
    prior = 0.0
    if model.noise is None:
        prior = (_PRIOR_WEIGHT + 3 * len(error)) / 2 * log(sigma2)
        prior += _PRIOR_WEIGHT * TYPICAL_NOISE_MM**2 / (2 * sigma2)
    return shape + touches + prior


def _rotation_from_vector(vector: FloatArray) -> FloatArray:
    """Rodrigues' formula; also for the tiny turns near convergence."""
    angle = float(vector @ vector) ** 0.5
    across = cross_matrix(vector)
    first, second = (sin(angle) / angle, (1 - cos(angle)) / angle**2) if angle > 1e-8 else (1.0, 0.5)
    turn: FloatArray = np.eye(3) + first * across + second * (across @ across)
    return turn
