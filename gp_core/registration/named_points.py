"""Fit an atlas to named points: pose and shape together, with heavy-tailed touch errors.

Model, in the atlas frame (left side). The point touched at feature j is

    y_j = R (mu_j + s_j + e_j) + t,    s_j ~ N(0, v_j I),    e_j ~ Student-t(nu, sigma),

where s_j is how this animal's feature differs from the mean, with the variance v_j the atlas gives it, and
e_j is the error of the touch. A Student-t is a Gaussian of variance sigma^2 / w_j whose weight w_j is itself
unknown, so a mistouch talks itself out of the fit. Expectation conditional maximisation: the weights and
sigma from the expected squared errors, then the pose by weighted Procrustes with the shape integrated out.

Correlations between features are left out of the weights on purpose: learned from some twenty sides, they
made the estimates of held-out animals worse (docs/method.md). They enter the error bars, in `gp_core.pose`.

The iterations run in `gp_core.registration.student_t_fit`: compiled, once
`gp_core.registration.student_t_fit_compiled` has been imported, and until then as plain Python, to the same
numbers. A process that estimates once, such as the
shell command, would wait longer for the compiled code than it saves, so the second estimate loads it
(`compile_if_repeated`). A window or a tracker that must not wait imports that module beforehand, in a thread.

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
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import NamedTuple

import numpy as np

from gp_core.errors import GeometryError
from gp_core.registration import student_t_fit
from gp_core.registration.procrustes import surely_no_line, weighted_procrustes
from gp_core.registration.student_t_fit import NU, POSE_SIZE, PRIOR_WEIGHT, TOLERANCE, TYPICAL_NOISE_MM
from gp_core.validation import FloatArray

__all__ = [
    "AgainstOthers",
    "NamedFit",
    "TouchModel",
    "best_exchange",
    "careful_misfit",
    "compile_if_repeated",
    "fit_named_points",
    "motion_jacobian",
    "quick_misfit",
]

_NO_TURN = (1.0, 0.0, 0.0, 0.0)

_COMPILED = "gp_core.registration.student_t_fit_compiled"
_ESTIMATES = count()

_MAX_ITERATIONS = 500
_DOUBTFUL_WEIGHT = 0.5
_LEFT_OUT = 1e-3
_NEWTON_STEPS = 6
_QUICK_ITERATIONS = 6
_TINY = 1e-300


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
class AgainstOthers:
    """Touches held against where the others alone would put them, along the principal axes of that spread.

    Attributes
    ----------
    deviations : (n, 3) array
        Squared deviations, mm^2.
    variances : (n, 3) array
        Of pose and shape, to which each touch adds its own error, mm^2.
    noise : float
        Scale of an ordinary touch error, mm.
    """

    deviations: FloatArray
    variances: FloatArray
    noise: float

    @cached_property
    def squared(self) -> FloatArray:
        """(n,) squared deviation over its variance: of ordinary touches, chi-square of 3 degrees."""
        squared: FloatArray = (self.deviations / (self.variances + self.noise**2)).sum(axis=1)
        return squared

    @property
    def error_variance(self) -> FloatArray:
        """(n,) variance of its own error that would make each deviation an average one, mm^2 a coordinate.

        Newton's method on the inverse of `squared`, which is nearly linear in that variance.
        """
        variance = np.full(len(self.deviations), self.noise**2)
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
    turn : (4,) array
        `rotation` as a unit quaternion, w first.
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

    turn: FloatArray
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

    @cached_property
    def squared_residuals(self) -> FloatArray:
        """(n,) squared distance of each touch from the mean, mm^2."""
        squared: FloatArray = (self.residual**2).reshape(-1, 3).sum(axis=1)
        return squared

    @cached_property
    def jacobian(self) -> FloatArray:
        """(3 n, 6) `motion_jacobian` of the touches."""
        return motion_jacobian(self.points)

    @cached_property
    def against_others(self) -> AgainstOthers:
        """Each touch held against where the others alone would put it.

        Without a touch that pulls the pose after it, such as a far one, its error would show in full: the
        residual is brought to what it would be without the touch, by the linear algebra of leaving one out.
        """
        jacobian = self.jacobian.reshape(-1, 3, 6)
        precision = self.precision[::3]
        variances = 1 / precision - self.noise**2 / self.weights
        covariance = np.linalg.inv((self.precision[:, None] * self.jacobian).T @ self.jacobian)
        of_pose = jacobian @ covariance @ jacobian.transpose(0, 2, 1)
        # where a touch alone holds the pose, hardly anything is left to be inverted, and all is possible
        release = np.linalg.inv((1 + 1e-9) * np.eye(3) - precision[:, None, None] * of_pose)
        away = release @ self.residual.reshape(-1, 3, 1)
        spread, axes = np.linalg.eigh(of_pose @ release)
        deviations = (axes.transpose(0, 2, 1) @ away)[..., 0] ** 2
        return AgainstOthers(deviations, spread + variances[:, None], self.noise)

    @cached_property
    def touch_variances(self) -> FloatArray:
        """(n,) variance of each touch, mm^2 a coordinate.

        A Student-t varies more than its scale says, and a scale found from few touches is itself unsure.
        """
        freedom = 3 * len(self.weights) - 6 + PRIOR_WEIGHT
        unsure = freedom / (freedom - 2) if self.noise_estimated else 1.0
        variances: FloatArray = unsure * NU / (NU - 2) * self.noise**2 / self.weights
        return variances


def compile_if_repeated() -> None:
    """Load the compiled kernels if this is the second estimate of the process, and no thread is at it yet."""
    if next(_ESTIMATES) == 1 and _COMPILED not in sys.modules:
        with suppress(ImportError):  # then plain Python has to do
            importlib.import_module(_COMPILED)


class _Settled(NamedTuple):
    """What `gp_core.registration.student_t_fit.settle` makes of one reading of the touches."""

    sigma2: float
    change: float
    misfit: float
    weights: FloatArray
    precision: FloatArray
    points: FloatArray
    pose: FloatArray


def fit_named_points(model: TouchModel, touches: FloatArray) -> NamedFit:
    """Fit the atlas to touched points.

    A mistouch can hold a fit in a wrong place, so where one touch is doubted, the fit is also started
    without each touch in turn, and the best of these stands.

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
    if not (surely_no_line(model.mean) and surely_no_line(touches)):
        weighted_procrustes(model.mean, touches, names=model.codes)  # for its guards
    settled = _settle(model, touches, model.noise)
    if not math.isfinite(settled.misfit):
        weighted_procrustes(model.mean, touches, names=model.codes)
        raise GeometryError(
            "no pose brings these points near the atlas", remedy="Check units, names and coordinates."
        )
    n = len(touches)
    if n > 3 and settled.weights.min() < _DOUBTFUL_WEIGHT:
        starts = np.where(np.eye(n, dtype=bool), _LEFT_OUT, 1.0)
        others = (_settle(model, touches, model.noise, weights=start, turn=settled.pose) for start in starts)
        settled = min((settled, *others), key=lambda other: other.misfit)
    return _as_fit(model, settled)


def best_exchange(
    model: TouchModel, touches: FloatArray, fit: NamedFit, below: float
) -> tuple[int, int, float]:
    """Find the two touches whose names, exchanged, make the best fit.

    Parameters
    ----------
    model : TouchModel
    touches : (n, 3) array, mm
    fit : NamedFit
        Of the touches as they are named.
    below : float
        Misfit below which an exchange is of interest.

    Returns
    -------
    i, j : int
        Their rows.
    misfit : float
        Of the fit to the touches so read; infinite where no exchange comes near `below`.
    """
    buffers = _buffers(model, touches, None, fit.turn)
    i, j, misfit = _run("best_exchange", *buffers, model.noise or 0.0, _MAX_ITERATIONS, below)
    return int(i), int(j), misfit


def careful_misfit(model: TouchModel, reading: FloatArray, noise: float) -> float:
    """Return -2 log likelihood, up to a constant, of a reading whose touch errors are Gaussian of this scale.

    Cheap; tells the readings of careful touches apart, which one rough touch already upsets.
    """
    settled = _settle(model, reading, noise, n_iterations=0)
    squared = ((settled.points.reshape(-1, 3) - model.mean) ** 2).sum(axis=1)
    return float(settled.precision @ squared)


def quick_misfit(model: TouchModel, touches: FloatArray, turn: FloatArray) -> float:
    """Return about what the misfit of a reading will be, after a few iterations from a given turn.

    Early on, the misfit is hardly ever above the one that a fit settles at.

    Parameters
    ----------
    model : TouchModel
    touches : (n, 3) array, mm
    turn : (4,) array
        A quaternion to start from.
    """
    return _settle(model, touches, model.noise, turn=turn, n_iterations=_QUICK_ITERATIONS).misfit


def _settle(
    model: TouchModel,
    touches: FloatArray,
    noise: float | None,
    *,
    weights: FloatArray | None = None,
    turn: FloatArray | None = None,
    n_iterations: int = _MAX_ITERATIONS,
) -> _Settled:
    """Settle one reading from given weights and a given turn, by default ordinary ones and none."""
    buffers = _buffers(model, touches, weights, turn)
    _, _, _, weights, precision, points, _, pose = buffers
    return _Settled(*_run("settle", *buffers, noise or 0.0, n_iterations), weights, precision, points, pose)


def _buffers(
    model: TouchModel, touches: FloatArray, weights: FloatArray | None, turn: FloatArray | None
) -> tuple[FloatArray, ...]:
    """Return the buffers that the kernels work on, in their order."""
    n = len(touches)
    pose = np.zeros(POSE_SIZE)
    pose[:4] = _NO_TURN if turn is None else turn[:4]
    return (
        np.ascontiguousarray(model.mean).reshape(-1),
        np.ascontiguousarray(model.variances),
        np.array(touches).reshape(-1),  # a copy: the exchanges write into it
        np.ones(n) if weights is None else weights,
        np.empty(n),
        np.empty(3 * n),
        np.empty(n),
        pose,
    )


def _run(kernel: str, *arguments: FloatArray | float) -> tuple[float, float, float]:
    """Run a kernel: compiled, if the compiled ones are there."""
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


def _as_fit(model: TouchModel, settled: _Settled) -> NamedFit:
    points = settled.points.reshape(-1, 3)
    return NamedFit(
        turn=settled.pose[:4],
        rotation=settled.pose[7:].reshape(3, 3),
        translation=settled.pose[4:7],
        points=points,
        residual=(points - model.mean).ravel(),
        weights=settled.weights,
        noise=settled.sigma2**0.5,
        noise_estimated=model.noise is None,
        precision=np.repeat(settled.precision, 3),
        misfit=settled.misfit,
        converged=settled.change < TOLERANCE,
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
