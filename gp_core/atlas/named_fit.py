"""Fit an atlas to named points: pose and shape together, with heavy-tailed touch errors.

Model, in the atlas frame (left side). The point touched at feature j is

    y_j = R (mu_j + s_j + e_j) + t,    s_j ~ N(0, v_j I),    e_j ~ Student-t(nu, sigma),

where s_j is how this animal's feature differs from the mean, with the variance v_j the atlas gives it, and
e_j is the error of the touch. A Student-t is a Gaussian of variance sigma^2 / w_j whose weight w_j is itself
unknown, so a mistouch talks itself out of the fit. Expectation conditional maximisation: the weights and
sigma from the expected squared errors, then the pose by weighted Procrustes with the shape integrated out.

Correlations between features are left out of the weights on purpose: learned from some twenty sides, they
made the estimates of held-out animals worse (docs/method.md). They do enter the error bars, `robust_pose`.

Several readings of the same touches (the other side, names exchanged, another start) are fitted at once, as
rows of one batch: NumPy then takes hardly longer than for one.

References
----------
Lange, Little and Taylor, "Robust statistical modeling using the t distribution", JASA 84, 1989.
https://doi.org/10.1080/01621459.1989.10478852
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gp_core.checks import FloatArray
from gp_core.errors import GeometryError
from gp_core.registration.procrustes import weighted_procrustes

__all__ = ["NamedFit", "TouchModel", "careful_misfit", "fit_named_points", "fit_readings", "motion_jacobian"]

TYPICAL_NOISE_MM = 0.05
"""Scale of a careful touch, mm a coordinate, to which the estimate of sigma is drawn."""

_PRIOR_WEIGHT = 2.0
_NU = 4.0
_MAX_ITERATIONS = 100
_SCREENING_ITERATIONS = 12
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
    points : (n, 3) array, mm
        The touches, brought into the atlas frame.
    residual : (3 n,) array, mm
        Touch minus mean.
    weights : (n,) array
        About 1 for an ordinary touch, towards 0 for one that does not fit.
    noise : float
        Scale sigma of the touch errors, mm.
    noise_estimated : bool
        Whether it was found from the touches.
    precision : (3 n,) array
        Inverse variance of `residual` with these weights.
    misfit : float
        Negative log posterior up to a constant; lower is better among readings of the same touches.
    converged : bool
        False where the iterations ran out first.
    """

    rotation: FloatArray
    translation: FloatArray
    points: FloatArray
    residual: FloatArray
    weights: FloatArray
    noise: float
    noise_estimated: bool
    precision: FloatArray
    misfit: float
    converged: bool

    @property
    def doubtful(self) -> bool:
        """Whether a touch was half set aside."""
        return bool(self.weights.min() < _DOUBTFUL_WEIGHT)

    @property
    def rough(self) -> bool:
        """Whether the touches fit worse than careful ones do."""
        return self.doubtful or self.noise > 3 * TYPICAL_NOISE_MM

    @property
    def jacobian(self) -> FloatArray:
        """(3 n, 6) `motion_jacobian` of the touches."""
        return motion_jacobian(self.points)

    @property
    def touch_variances(self) -> FloatArray:
        """(n,) variance of each touch, mm^2 a coordinate.

        A Student-t varies more than its scale says, and a scale found from few touches is itself unsure.
        """
        freedom = 3 * len(self.weights) - 6 + _PRIOR_WEIGHT
        unsure = freedom / (freedom - 2) if self.noise_estimated else 1.0
        variances: FloatArray = unsure * _NU / (_NU - 2) * self.noise**2 / self.weights
        return variances


def fit_named_points(model: TouchModel, touches: FloatArray) -> NamedFit:
    """Fit the atlas to touched points.

    Parameters
    ----------
    model : TouchModel
    touches : (n, 3) array, mm
        In any frame of the atlas's handedness; row j is feature j of the model.

    Raises
    ------
    GeometryError
        Fewer than three touches, touches on one line, or touches that no pose brings near the atlas.
    """
    return fit_readings(model, touches[None])[0]


def fit_readings(model: TouchModel, readings: FloatArray, *, screen: bool = False) -> list[NamedFit]:
    """Fit the atlas to several readings of the same touches.

    A mistouch can hold a fit in a wrong place, so where one touch is doubted, the fit is also started
    without each touch in turn, and the best of these stands.

    Parameters
    ----------
    model : TouchModel
    readings : (B, n, 3) array, mm
    screen : bool
        Only tell good readings from bad ones: few iterations, and no second start.

    Raises
    ------
    GeometryError
        As `fit_named_points`.
    """
    weighted_procrustes(model.mean, readings[0], names=model.codes)  # for its guards
    n = readings.shape[1]
    fits = _fit_batch(
        model, readings, np.ones((len(readings), n)), _SCREENING_ITERATIONS if screen else _MAX_ITERATIONS
    )
    doubted = [i for i, fit in enumerate(fits) if fit.doubtful and n > 3 and not screen]
    if doubted:
        starts = np.where(np.eye(n, dtype=bool), _LEFT_OUT, 1.0)
        others = _fit_batch(
            model, np.repeat(readings[doubted], n, axis=0), np.tile(starts, (len(doubted), 1))
        )
        for row, i in enumerate(doubted):
            fits[i] = min([fits[i], *others[row * n : row * n + n]], key=lambda fit: fit.misfit)
    return fits


def careful_misfit(model: TouchModel, reading: FloatArray, noise: float) -> float:
    """Return -2 log likelihood, up to a constant, of a reading whose touch errors are Gaussian of this scale.

    Cheap; tells the readings of careful touches apart, which one rough touch already upsets.
    """
    precision = 1 / (model.variances + noise**2)
    rotations, translations = _align(model.mean, reading[None], precision[None])
    residual = (reading - translations[0]) @ rotations[0] - model.mean
    return float(np.sum(precision[:, None] * residual**2))


def _fit_batch(
    model: TouchModel, readings: FloatArray, weights: FloatArray, n_iterations: int = _MAX_ITERATIONS
) -> list[NamedFit]:
    sigma2 = np.full((len(readings), 1), (model.noise or TYPICAL_NOISE_MM) ** 2)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for iteration in range(n_iterations + 1):
            noise = sigma2 / weights
            precision = 1 / (model.variances + noise)
            rotations, translations = _align(model.mean, readings, precision)
            points = (readings - translations[:, None]) @ rotations
            residuals = points - model.mean
            error = noise**2 * precision**2 * (residuals**2).sum(axis=2)
            spread = 3 * noise - noise**2 * (3 * precision - _leverage(points, precision))
            updated = (_NU + 3) / (_NU + (error + spread) / sigma2)
            still = np.abs(updated - weights).max(axis=1) < _WEIGHT_TOLERANCE
            if still.all() or iteration == n_iterations:
                break
            weights = updated
            if model.noise is None:
                sigma2 = sigma2 * (_noise_variance(weights, error + spread) / sigma2) ** _OVER_RELAXATION
        misfits = _misfits(model, precision, residuals, error, sigma2)
    if not np.isfinite(misfits).all():
        raise GeometryError(
            "no pose brings these points near the atlas", remedy="Check units, names and coordinates."
        )
    return [
        NamedFit(
            rotation=rotations[i],
            translation=translations[i],
            points=points[i],
            residual=residuals[i].ravel(),
            weights=weights[i],
            noise=float(sigma2[i, 0]) ** 0.5,
            noise_estimated=model.noise is None,
            precision=np.repeat(precision[i], 3),
            misfit=float(misfits[i]),
            converged=bool(still[i]),
        )
        for i in range(len(readings))
    ]


def _align(mean: FloatArray, readings: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weighted Procrustes of the mean (n, 3) to each reading (B, n, 3); det +1."""
    shares = weights / weights.sum(axis=1, keepdims=True)
    mean_centres, centres = shares @ mean, (shares[:, None] @ readings)[:, 0]
    covariance = (readings - centres[:, None]).transpose(0, 2, 1) @ (
        shares[..., None] * (mean - mean_centres[:, None])
    )
    if not np.isfinite(covariance).all():
        raise GeometryError("the coordinates are too large to fit", remedy="Check units and coordinates.")
    left, _, right = np.linalg.svd(covariance)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    rotations = left @ right
    return rotations, centres - (rotations @ mean_centres[..., None])[..., 0]


def _leverage(points: FloatArray, precision: FloatArray) -> FloatArray:
    """Return (B, n): how much of each touch's precision the pose uses up, summed over its coordinates.

    With the pose taken about the weighted centre, translation and rotation separate, and the rotation's
    information is the inertia tensor of the points.
    """
    total = precision.sum(axis=1, keepdims=True)
    arms = points - (precision[:, None] @ points) / total[..., None]
    square = (arms * arms).sum(axis=2)
    inertia = (precision * square).sum(axis=1)[:, None, None] * np.eye(3) - arms.transpose(0, 2, 1) @ (
        precision[..., None] * arms
    )
    turn = np.linalg.inv(inertia)
    through_turn = square * np.trace(turn, axis1=1, axis2=2)[:, None] - ((arms @ turn) * arms).sum(axis=2)
    used: FloatArray = precision**2 * (3 / total + through_turn)
    return used


def _noise_variance(weights: FloatArray, squared_errors: FloatArray) -> FloatArray:
    prior = _PRIOR_WEIGHT * TYPICAL_NOISE_MM**2
    total = prior + (weights * squared_errors).sum(axis=1, keepdims=True)
    variance: FloatArray = total / (_PRIOR_WEIGHT + 3 * weights.shape[1])
    return variance


def _misfits(
    model: TouchModel, precision: FloatArray, residuals: FloatArray, error: FloatArray, sigma2: FloatArray
) -> FloatArray:
    """Return (B,): shape and touch errors, each by its own law, and the scale of the touches."""
    shape = (model.variances * precision**2 * (residuals**2).sum(axis=2)).sum(axis=1) / 2
    touches = (_NU + 3) / 2 * np.log1p(error / (_NU * sigma2)).sum(axis=1)
    misfits: FloatArray = shape + touches
    if model.noise is None:
        scale = sigma2[:, 0]
        misfits = misfits + (_PRIOR_WEIGHT + 3 * error.shape[1]) / 2 * np.log(scale)
        misfits = misfits + _PRIOR_WEIGHT * TYPICAL_NOISE_MM**2 / (2 * scale)
    return misfits


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
