"""Fit an atlas to named points: pose and shape together, with heavy-tailed touch errors.

Model, in the atlas frame (left side). The point touched at feature j is

    y_j = R (mu_j + s_j + e_j) + t,    s_j ~ N(0, v_j I),    e_j ~ Student-t(nu, sigma),

where s_j is the deviation of this animal's feature from the mean, with the variance v_j that the atlas gives
it, and e_j is the error of the touch. A Student-t distribution is a Gaussian of variance sigma^2 / w_j whose
weight w_j is itself unknown, so an outlying touch is down-weighted. Where the feature was touched n_j times,
y_j is the mean of its touches, and its scale is sigma / sqrt(n_j). The fit is by expectation conditional
maximisation: first the weights and sigma from the expected squared errors, then the pose by weighted
Procrustes with the shape integrated out.

The weights deliberately ignore correlations between features: learned from about twenty sides, they made the
estimates of held-out animals worse (docs/method.md). Correlations do enter the error bars, in `gp_core.pose`.

The iterations run in `gp_core.registration.student_t_fit`: compiled, once
`gp_core.registration.student_t_fit_compiled` has been imported, and until then as plain Python, with the same
results. Loading the compiled code takes longer than it saves in a process that estimates only once, such as
the shell command; so the second estimate loads it (`compile_if_repeated`). A window or a tracker that must
not wait imports that module beforehand, in a thread.

References
----------
Lange, Little and Taylor, "Robust statistical modeling using the t distribution", JASA 84, 1989.
https://doi.org/10.1080/01621459.1989.10478852
"""

from __future__ import annotations

import importlib
import math
import sys
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from typing import NamedTuple

import numpy as np

from gp_core.errors import GeometryError
from gp_core.registration import student_t_fit
from gp_core.registration.procrustes import certainly_not_collinear, weighted_procrustes
from gp_core.registration.student_t_fit import NU, POSE_SIZE, PRIOR_WEIGHT, TOLERANCE, TYPICAL_NOISE_MM
from gp_core.validation import FloatArray

__all__ = [
    "LeaveOneOutResiduals",
    "NamedFit",
    "TouchModel",
    "approximate_neg_log_posterior",
    "best_exchange",
    "compile_if_repeated",
    "fit_named_points",
    "gaussian_deviance",
    "motion_jacobian",
]

_IDENTITY = (1.0, 0.0, 0.0, 0.0)

_COMPILED = "gp_core.registration.student_t_fit_compiled"
_ESTIMATES = count()

_MAX_ITERATIONS = 500
_OUTLIER_WEIGHT = 0.5
_START_WEIGHT_LEFT_OUT = 1e-3
_NEWTON_STEPS = 6
_QUICK_ITERATIONS = 6
_TINY = 1e-300


@dataclass(frozen=True)
class TouchModel:
    """What the atlas predicts for the touched points.

    Parameters
    ----------
    codes : tuple of str
        Their features.
    mean : (n, 3) array, mm, atlas frame
        Mean positions.
    variances : (n,) array, mm^2
        Variance between animals of one coordinate of each feature.
    noise : float or None
        Scale of the touch errors, mm per coordinate; None: estimated with the pose.
    counts : (n,) array or None
        Of how many touches each point is the mean; None: one each.
    repeat_noise : float
        Standard deviation of one touch as repeated touches show it, mm per coordinate; 0 without repeats. It
        bounds the noise of the 95 % region from below.
    """

    codes: tuple[str, ...]
    mean: FloatArray
    variances: FloatArray
    noise: float | None = None
    counts: FloatArray | None = None
    repeat_noise: float = 0.0

    def with_counts_exchanged(self, i: int, j: int) -> TouchModel:
        """Return the model for touches whose rows i and j are exchanged.

        Parameters
        ----------
        i, j : int
            Two rows.

        Returns
        -------
        TouchModel
            The counts go with the touches.
        """
        if self.counts is None:
            return self
        counts = self.counts.copy()
        counts[[i, j]] = self.counts[[j, i]]
        return replace(self, counts=counts)


@dataclass(frozen=True)
class LeaveOneOutResiduals:
    """Deviation of each touch from where the other touches alone predict it.

    Along the principal axes of the uncertainty of that prediction.

    Attributes
    ----------
    deviations : (n, 3) array
        Squared deviations, mm^2.
    variances : (n, 3) array
        Of pose and shape, to which each touch adds its own error, mm^2.
    touch_variances : (n,) array
        Squared scale of the error of each touch, mm^2: smaller for the mean of several touches.
    """

    deviations: FloatArray
    variances: FloatArray
    touch_variances: FloatArray

    @cached_property
    def squared(self) -> FloatArray:
        """(n,) squared Mahalanobis distances: chi-squared with 3 degrees of freedom for ordinary touches."""
        spread = self.variances + self.touch_variances[:, None]
        squared: FloatArray = (self.deviations / spread).sum(axis=1)
        return squared

    @property
    def error_variance(self) -> FloatArray:
        """(n,) error variance that would make the deviation of each touch average, mm^2 per coordinate."""
        variance = self.touch_variances.copy()
        for _ in range(_NEWTON_STEPS):
            spread = self.variances + variance[:, None]
            squared = (self.deviations / spread).sum(axis=1)
            slope = (self.deviations / spread**2).sum(axis=1)
            variance += np.maximum(squared - 3, 0) * squared / (3 * np.maximum(slope, _TINY))
        return variance


@dataclass(frozen=True)
class NamedFit:
    """An atlas fitted to touched points; vectors in the atlas frame.

    Attributes
    ----------
    quaternion : (4,) array
        `rotation` as a unit quaternion, w first.
    rotation, translation : (3, 3), (3,) arrays
        The atlas in the frame of the touches, ``y = rotation @ x + translation``, mm.
    points : (n, 3) array, mm
        The touches, moved into the atlas frame.
    residual : (3 n,) array, mm
        Touch minus mean.
    weights : (n,) array
        About 1 for an ordinary touch, towards 0 for an outlier.
    noise : float
        Scale sigma of the touch errors, mm.
    noise_estimated : bool
        Whether it was estimated from the touches.
    precision : (3 n,) array
        Inverse variance of `residual` with these weights.
    neg_log_posterior : float
        Negative log posterior up to a constant; the lower, the better, among hypotheses on the same touches.
    converged : bool
        False where the maximum number of iterations was reached first.
    counts : (n,) array
        Of how many touches each point is the mean.
    """

    quaternion: FloatArray
    rotation: FloatArray
    translation: FloatArray
    points: FloatArray
    residual: FloatArray
    weights: FloatArray
    noise: float
    noise_estimated: bool
    precision: FloatArray
    neg_log_posterior: float
    converged: bool
    counts: FloatArray

    @property
    def has_outlier(self) -> bool:
        """Whether the fit gave some touch less than half of its weight."""
        return bool(self.weights.min() < _OUTLIER_WEIGHT)

    @property
    def fits_poorly(self) -> bool:
        """Whether the touches fit worse than careful ones do."""
        return self.has_outlier or self.noise > 3 * TYPICAL_NOISE_MM

    @cached_property
    def squared_residuals(self) -> FloatArray:
        """(n,) squared residual of each touch, mm^2."""
        squared: FloatArray = (self.residual**2).reshape(-1, 3).sum(axis=1)
        return squared

    @cached_property
    def jacobian(self) -> FloatArray:
        """(3 n, 6) `motion_jacobian` of the touches."""
        return motion_jacobian(self.points)

    @cached_property
    def leave_one_out_residuals(self) -> LeaveOneOutResiduals:
        """The deviation of each touch from where the other touches alone predict it.

        A touch with high leverage, such as a distant one, pulls the pose towards itself and hides its own
        error. The residual that it would have without its own influence follows from the usual leave-one-out
        algebra.
        """
        jacobian = self.jacobian.reshape(-1, 3, 6)
        precision = self.precision[::3]
        scales = self.noise**2 / self.counts
        variances = 1 / precision - scales / self.weights
        covariance = np.linalg.inv((self.precision[:, None] * self.jacobian).T @ self.jacobian)
        of_pose = jacobian @ covariance @ jacobian.transpose(0, 2, 1)
        # the factor keeps the matrix invertible where one touch alone determines the pose
        release = np.linalg.inv((1 + 1e-9) * np.eye(3) - precision[:, None, None] * of_pose)
        deviation = release @ self.residual.reshape(-1, 3, 1)
        spread, axes = np.linalg.eigh(of_pose @ release)
        deviations = (axes.transpose(0, 2, 1) @ deviation)[..., 0] ** 2
        return LeaveOneOutResiduals(deviations, spread + variances[:, None], scales)

    @cached_property
    def touch_variances(self) -> FloatArray:
        """(n,) variance of each touch, mm^2 per coordinate.

        The variance of a Student-t exceeds its squared scale, and a scale estimated from few touches is
        itself uncertain.
        """
        freedom = 3 * len(self.weights) - 6 + PRIOR_WEIGHT
        inflation = freedom / (freedom - 2) if self.noise_estimated else 1.0
        scales = self.noise**2 / self.counts
        variances: FloatArray = inflation * NU / (NU - 2) * scales / self.weights
        return variances


def compile_if_repeated() -> None:
    """Load the compiled kernels at the second estimate of the process, unless a thread is loading them."""
    if next(_ESTIMATES) == 1 and _COMPILED not in sys.modules:
        with suppress(ImportError):  # then plain Python is used
            importlib.import_module(_COMPILED)


class _StudentTFit(NamedTuple):
    """Result of `gp_core.registration.student_t_fit.fit_student_t` for one assignment of names to touches."""

    sigma2: float
    change: float
    neg_log_posterior: float
    weights: FloatArray
    precision: FloatArray
    points: FloatArray
    pose: FloatArray


def fit_named_points(model: TouchModel, touches: FloatArray) -> NamedFit:
    """Fit the atlas to touched points.

    An outlying touch can trap the fit in a local optimum. So where some touch is down-weighted, the fit is
    also started without each touch in turn, and the best of the results is returned.

    Parameters
    ----------
    model : TouchModel
        Mean and variances of the touched features.
    touches : (n, 3) array, mm
        In any frame of the atlas's handedness; row j is feature j of the model.

    Returns
    -------
    NamedFit
        Pose, weights and scale of the touch errors.

    Raises
    ------
    GeometryError
        Fewer than three touches, collinear touches, or touches that no pose brings near the atlas.
    """
    if not (certainly_not_collinear(model.mean) and certainly_not_collinear(touches)):
        weighted_procrustes(model.mean, touches, names=model.codes)  # for its error messages
    solution = _fit_student_t(model, touches, model.noise)
    if not math.isfinite(solution.neg_log_posterior):
        weighted_procrustes(model.mean, touches, names=model.codes)
        raise GeometryError(
            "no pose fits these points to the atlas", remedy="Check units, names and coordinates."
        )
    n = len(touches)
    if n > 3 and solution.weights.min() < _OUTLIER_WEIGHT:
        starts = np.where(np.eye(n, dtype=bool), _START_WEIGHT_LEFT_OUT, 1.0)
        others = (
            _fit_student_t(model, touches, model.noise, weights=start, quaternion=solution.pose)
            for start in starts
        )
        solution = min((solution, *others), key=lambda other: other.neg_log_posterior)
    return _as_fit(model, solution)


def best_exchange(
    model: TouchModel, touches: FloatArray, fit: NamedFit, below: float
) -> tuple[int, int, float]:
    """Find the two touches that fit best with their names exchanged.

    Parameters
    ----------
    model : TouchModel
        Mean and variances of the touched features.
    touches : (n, 3) array, mm
        Row j is feature j of the model.
    fit : NamedFit
        Of the touches as they are named.
    below : float
        Negative log posterior below which an exchange is of interest.

    Returns
    -------
    i, j : int
        Their rows.
    neg_log_posterior : float
        Of the fit with these two exchanged; infinite where no exchange comes near `below`.
    """
    buffers = _buffers(model, touches, None, fit.quaternion)
    i, j, neg_log_posterior = _run("best_exchange", *buffers, model.noise or 0.0, _MAX_ITERATIONS, below)
    return int(i), int(j), neg_log_posterior


def gaussian_deviance(model: TouchModel, touches: FloatArray, noise: float) -> float:
    """Return the deviance (-2 log likelihood, up to a constant) for Gaussian touch errors of a given scale.

    Cheap. It separates hypotheses on careful touches well; a single rough touch upsets it.

    Parameters
    ----------
    model : TouchModel
        Mean and variances of the touched features.
    touches : (n, 3) array, mm
        Row j is feature j of the model.
    noise : float
        Scale of the touch errors, mm per coordinate.

    Returns
    -------
    float
        The deviance; the lower, the better.
    """
    solution = _fit_student_t(model, touches, noise, n_iterations=0)
    squared = ((solution.points.reshape(-1, 3) - model.mean) ** 2).sum(axis=1)
    return float(solution.precision @ squared)


def approximate_neg_log_posterior(model: TouchModel, touches: FloatArray, quaternion: FloatArray) -> float:
    """Return approximately the negative log posterior that a fit will reach, after a few iterations.

    In early iterations it is hardly ever above its value at convergence.

    Parameters
    ----------
    model : TouchModel
        Mean and variances of the touched features.
    touches : (n, 3) array, mm
        Row j is feature j of the model.
    quaternion : (4,) array
        Rotation to start from, w first.

    Returns
    -------
    float
        Negative log posterior, up to a constant.
    """
    return _fit_student_t(
        model, touches, model.noise, quaternion=quaternion, n_iterations=_QUICK_ITERATIONS
    ).neg_log_posterior


def _fit_student_t(
    model: TouchModel,
    touches: FloatArray,
    noise: float | None,
    *,
    weights: FloatArray | None = None,
    quaternion: FloatArray | None = None,
    n_iterations: int = _MAX_ITERATIONS,
) -> _StudentTFit:
    """Run the fit from given weights and a given rotation; by default from weights of 1 and the identity."""
    buffers = _buffers(model, touches, weights, quaternion)
    _, _, _, _, weights, precision, points, _, pose = buffers
    return _StudentTFit(
        *_run("fit_student_t", *buffers, noise or 0.0, n_iterations), weights, precision, points, pose
    )


def _buffers(
    model: TouchModel, touches: FloatArray, weights: FloatArray | None, quaternion: FloatArray | None
) -> tuple[FloatArray, ...]:
    """Return the buffers that the kernels work on, in their order."""
    n = len(touches)
    pose = np.zeros(POSE_SIZE)
    pose[:4] = _IDENTITY if quaternion is None else quaternion[:4]
    return (
        np.ascontiguousarray(model.mean).reshape(-1),
        np.ascontiguousarray(model.variances),
        np.array(touches).reshape(-1),  # copies: the exchanges write into them
        np.ones(n) if model.counts is None else np.array(model.counts, dtype=np.float64),
        np.ones(n) if weights is None else weights,
        np.empty(n),
        np.empty(3 * n),
        np.empty(n),
        pose,
    )


def _run(kernel: str, *arguments: FloatArray | float) -> tuple[float, float, float]:
    """Run a kernel: compiled, if the compiled module is loaded."""
    compiled = getattr(sys.modules.get(_COMPILED), kernel, None)  # none yet while another thread imports it
    result: tuple[float, float, float]
    if compiled is not None:
        result = compiled(*arguments)
        return result
    views = [a.data if isinstance(a, np.ndarray) else a for a in arguments]
    try:
        result = getattr(student_t_fit, kernel)(*views)
    except (ZeroDivisionError, OverflowError, ValueError):  # compiled code goes on with inf and nan
        return 0.0, math.inf, math.inf
    return result


def _as_fit(model: TouchModel, solution: _StudentTFit) -> NamedFit:
    points = solution.points.reshape(-1, 3)
    return NamedFit(
        quaternion=solution.pose[:4],
        rotation=solution.pose[7:].reshape(3, 3),
        translation=solution.pose[4:7],
        points=points,
        residual=(points - model.mean).ravel(),
        weights=solution.weights,
        noise=solution.sigma2**0.5,
        noise_estimated=model.noise is None,
        precision=np.repeat(solution.precision, 3),
        neg_log_posterior=solution.neg_log_posterior,
        converged=solution.change < TOLERANCE,
        counts=np.ones(len(points)) if model.counts is None else model.counts,
    )


def motion_jacobian(points: FloatArray) -> FloatArray:
    """Return how points move with the atlas: d point / d (translation in mm, rotation vector in rad).

    Parameters
    ----------
    points : (n, 3) array, mm, atlas frame
        Points.

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
