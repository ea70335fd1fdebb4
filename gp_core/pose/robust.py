"""The robust estimator: named points, pose and shape together, insensitive to an outlying touch."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from gp_core.atlas.atlas import Atlas
from gp_core.constants import DEFINING_FEATURES
from gp_core.errors import FeatureError, GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.anatomy import axis_frame, cochlea_origin, mirror_right, touched_features
from gp_core.landmarks.features import Side
from gp_core.landmarks.repeats import repeat_noise
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.covariance import cochlea_jacobian
from gp_core.pose.hypotheses import FittedHypothesis, fit_hypotheses
from gp_core.pose.hypothesis_check import hypothesis_states, hypothesis_warnings
from gp_core.pose.mixture import Hypothesis
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM, SystematicError
from gp_core.registration.named_points import (
    NamedFit,
    TouchModel,
    compile_if_repeated,
    fit_named_points,
    motion_jacobian,
)
from gp_core.validation import FloatArray

__all__ = ["defining_points", "estimate_robust", "locate_robust", "pose_covariance", "touch_model"]

_SUSPECT_WEIGHT = 0.2
_SUSPECT_SQUARED = 20.0
"""Squared Mahalanobis distance from where the others predict a touch; 1 ordinary touch of 6000 exceeds it."""

_ENOUGH_TOUCHES = 5
"""Number of touches from which on an outlier can be distinguished from an unusual animal."""

_EXCHANGE_GAIN = 6.0
"""Difference in log posterior (odds of 400 to 1) from which on two names are reported as exchanged."""

_MIRROR = np.diag([-1.0, 1.0, 1.0])
_MIRROR_POSE = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])  # a rotation vector mirrors with the opposite sign


def estimate_robust(
    touches: LandmarkSet,
    atlas: Atlas,
    *,
    probe_noise: float | None = None,
    shared_error: float = DEFAULT_SHARED_ERROR_MM,
    times: Mapping[str, float] | None = None,
) -> CochleaPose:
    """Estimate the pose of a cochlea from named touches; see `gp_core.pose.estimate.estimate_pose`.

    Parameters
    ----------
    touches : LandmarkSet
        At least three external features, in any frame, mm.
    atlas : Atlas
        Mean shape and its variation.
    probe_noise : float, optional
        Scale of an ordinary touch error, mm per coordinate; by default estimated from the touches.
    shared_error : float
        RMS length of one offset that all touches share, mm; see `gp_core.pose.systematic_error`.
    times : mapping of str to float, optional
        When each feature was touched, s; if all have a time, a drift is estimated.

    Returns
    -------
    CochleaPose
        In the frame of the touches.

    Raises
    ------
    FeatureError
        Too few features, or one that no probe can touch.
    GeometryError
        The touches are collinear.
    """
    compile_if_repeated()
    model = touch_model(touches, atlas, probe_noise)
    points = mirror_right(touches.array(model.codes), touches.side)
    systematic = SystematicError(shared_error, _elapsed(times, model))
    fit = fit_named_points(model, points)
    named, *others = fit_hypotheses(model, points, fit)
    better = _better_exchanged(model, fit, others) if fit.fits_poorly else None
    suspects = _suspects(model, fit)
    frame, covariance = _frame_and_covariance(atlas, model, fit, touches, systematic)
    pose = CochleaPose(
        side=touches.side,
        method="robust",
        atlas=atlas.name,
        transform_to_touches=frame,
        covariance=covariance,
        residuals=_residuals(model, fit),
        suspects=suspects,
        probe_noise=fit.noise,
        T_touches_atlas=_atlas_in_touches(fit, touches),
        shared_error=shared_error,
        probability=named.probability,
        hypotheses=tuple(_hypothesis(atlas, model, hypothesis, touches, systematic) for hypothesis in others),
    )
    decided = replace(pose, **hypothesis_states(pose, better))
    return replace(decided, warnings=tuple(_warnings(fit, decided, systematic.drift(fit))))


def _elapsed(times: Mapping[str, float] | None, model: TouchModel) -> list[float] | None:
    """Return the times of the model's touches; None unless all have one."""
    if times is None or not all(code in times for code in model.codes):
        return None
    return [float(times[code]) for code in model.codes]


def _frame_and_covariance(
    atlas: Atlas, model: TouchModel, fit: NamedFit, touches: LandmarkSet, systematic: SystematicError
) -> tuple[RigidTransform, FloatArray]:
    """Return ``T_touches_cochlea`` of a fit, and its (6, 6) covariance."""
    defining = defining_points(atlas, model, fit)
    covariance = pose_covariance(atlas, model, fit, defining, touches.side, systematic)
    return _cochlea_in_touches(defining, fit, touches), covariance


def _hypothesis(
    atlas: Atlas,
    model: TouchModel,
    hypothesis: FittedHypothesis,
    touches: LandmarkSet,
    systematic: SystematicError,
) -> Hypothesis:
    side = touches.side.other if hypothesis.mirrored else touches.side
    frame, covariance = _frame_and_covariance(
        atlas, model, hypothesis.fit, replace(touches, side=side), systematic
    )
    pair = None
    if hypothesis.exchanged is not None:
        i, j = hypothesis.exchanged
        pair = model.codes[i], model.codes[j]
    return Hypothesis(side, pair, hypothesis.probability, frame, covariance)


def locate_robust(touches: LandmarkSet, atlas: Atlas) -> RigidTransform:
    """Return ``T_touches_cochlea`` of `estimate_robust` alone, for studies with thousands of touches.

    Parameters
    ----------
    touches : LandmarkSet
        At least three external features, in any frame, mm.
    atlas : Atlas
        Mean shape and its variation.

    Returns
    -------
    RigidTransform
        ``T_touches_cochlea``.

    Raises
    ------
    FeatureError, GeometryError
        As for `estimate_robust`.
    """
    compile_if_repeated()
    model = touch_model(touches, atlas, None)
    fit = fit_named_points(model, mirror_right(touches.array(model.codes), touches.side))
    return _cochlea_in_touches(defining_points(atlas, model, fit), fit, touches)


def touch_model(touches: LandmarkSet, atlas: Atlas, probe_noise: float | None) -> TouchModel:
    """Return the atlas's prediction for the touched features, after checking that they can be used.

    Parameters
    ----------
    touches : LandmarkSet
        Touched features, mm.
    atlas : Atlas
        Mean shape and its variation.
    probe_noise : float or None
        Scale of an ordinary touch error, mm per coordinate; None: to be estimated.

    Returns
    -------
    TouchModel
        For those touched features that the atlas holds.

    Raises
    ------
    FeatureError
        Too few features, or one that no probe can touch.
    GpError
        `probe_noise` is not a positive number.
    """
    if probe_noise is not None and not (math.isfinite(probe_noise) and probe_noise > 0):
        raise GpError(f"probe noise must be a positive number of mm, got {probe_noise!r}")
    codes = touched_features(touches)
    usable = tuple(code for code in codes if code in atlas.codes)
    if len(usable) < 3:
        raise FeatureError(
            f"a pose needs at least three touched features that the atlas holds, got {len(usable)}"
            f"{': ' + ' '.join(usable) if usable else ''}",
            remedy="Touch more of them.",
        )
    repeats = {code: one for code, one in touches.repeats.items() if code in usable}
    counts = np.array([repeats[code].n_used if code in repeats else 1.0 for code in usable])
    return TouchModel(
        usable, atlas.rows(usable), atlas.variances(usable), probe_noise, counts, repeat_noise(repeats)
    )


def defining_points(atlas: Atlas, model: TouchModel, fit: NamedFit) -> FloatArray:
    """Return the expected CA, CB, RWA and RWP of this animal, in the atlas frame.

    Parameters
    ----------
    atlas : Atlas
        Mean shape and its variation.
    model : TouchModel
        Of the touched features.
    fit : NamedFit
        Of the touches.

    Returns
    -------
    (4, 3) array, mm
        In the atlas frame.
    """
    shape = _shape_of_residual(model, fit) @ fit.residual
    return atlas.rows(DEFINING_FEATURES) + shape.reshape(-1, 3)


def _shape_of_residual(model: TouchModel, fit: NamedFit) -> FloatArray:
    """Return (12, 3 n): the fraction of each residual due to the animal's shape, at the defining points."""
    gain = np.zeros((len(DEFINING_FEATURES), 3, len(model.codes), 3))
    for row, code in enumerate(DEFINING_FEATURES):
        if code in model.codes:
            column = model.codes.index(code)
            share = model.variances[column] * fit.precision[3 * column]
            gain[row, (0, 1, 2), column, (0, 1, 2)] = share
    return gain.reshape(3 * len(DEFINING_FEATURES), -1)


def _cochlea_in_touches(defining: FloatArray, fit: NamedFit, touches: LandmarkSet) -> RigidTransform:
    """Return ``T_touches_cochlea`` with x along the modiolar axis on both sides."""
    ca, cb, rwa, rwp = mirror_right(defining @ fit.rotation.T + fit.translation, touches.side)
    origin = cochlea_origin(ca, cb, rwa, rwp)
    return axis_frame(origin, ca - cb, (rwa + rwp) / 2 - origin, dst=touches.frame, src="cochlea")


def _atlas_in_touches(fit: NamedFit, touches: LandmarkSet) -> RigidTransform:
    rotation, translation = fit.rotation, fit.translation
    if touches.side is Side.RIGHT:
        rotation, translation = _MIRROR @ rotation @ _MIRROR, _MIRROR @ translation
    return RigidTransform.from_parts(rotation, translation, dst=touches.frame, src="atlas")


def pose_covariance(
    atlas: Atlas,
    model: TouchModel,
    fit: NamedFit,
    defining: FloatArray,
    side: Side,
    systematic: SystematicError,
) -> FloatArray:
    """Return the covariance of the cochlea frame.

    Near the solution the estimate is linear in the residuals, so its error is a linear map of the animal's
    shape and of the touch errors. The shape enters with all its measured correlations: treating features as
    independent, as the weights of the estimate do, would make the region too small.

    Parameters
    ----------
    atlas : Atlas
        Mean shape and its variation.
    model : TouchModel
        Of the touched features.
    fit : NamedFit
        Of the touches.
    defining : (4, 3) array, mm, atlas frame
        The `defining_points`.
    side : Side
        Side of the head.
    systematic : SystematicError
        What is added beyond independent errors.

    Returns
    -------
    (6, 6) array
        Of the origin (mm) and of a rotation vector (rad), in the frame of the touches.
    """
    jacobian = fit.jacobian
    weighted = (fit.precision[:, None] * jacobian).T
    pose_of_residual = np.linalg.solve(weighted @ jacobian, weighted)
    shape_of_residual = _shape_of_residual(model, fit)
    motion = motion_jacobian(defining) - shape_of_residual @ jacobian
    points_of_residual = shape_of_residual + motion @ pose_of_residual
    to_frame = (fit.rotation @ cochlea_jacobian(*defining).reshape(2, 3, -1)).reshape(6, -1)
    if side is Side.RIGHT:
        to_frame *= _MIRROR_POSE[:, None]
    of_touches = to_frame @ points_of_residual
    of_shape = np.zeros((6, len(atlas.scatter)))
    of_shape[:, atlas.coordinates(DEFINING_FEATURES)] = to_frame
    of_shape[:, atlas.coordinates(model.codes)] -= of_touches
    covariance = of_shape @ atlas.scatter @ of_shape.T
    least = max(systematic.noise_floor(len(model.codes)), model.repeat_noise)
    variances = np.maximum(
        _touch_variances(fit, systematic.outlier_squared), np.repeat(least**2 / fit.counts, 3)
    )
    covariance += (of_touches * variances) @ of_touches.T
    covariance += systematic.covariance(atlas, fit, of_touches, of_shape)
    symmetric: FloatArray = (covariance + covariance.T) / 2
    return symmetric


def _touch_variances(fit: NamedFit, outlier_squared: float) -> FloatArray:
    """Return (3 n,) variances of the touched coordinates; outliers get the variance that they show."""
    variances = fit.touch_variances
    outlying = _is_suspect(fit)
    if len(outlying) >= _ENOUGH_TOUCHES:
        outlying |= fit.leave_one_out_residuals.squared > outlier_squared
    if outlying.any():
        variances = np.where(
            outlying, np.maximum(fit.leave_one_out_residuals.error_variance, variances), variances
        )
    return np.repeat(variances, 3)


def _residuals(model: TouchModel, fit: NamedFit) -> dict[str, float]:
    lengths = np.sqrt(fit.squared_residuals)
    return dict(zip(model.codes, lengths.tolist(), strict=True))


def _is_suspect(fit: NamedFit) -> NDArray[np.bool_]:
    """Mark touches (n,) that the fit down-weighted, or that only a very unusual animal would explain."""
    marks: NDArray[np.bool_] = fit.leave_one_out_residuals.squared > _SUSPECT_SQUARED
    return marks | (fit.weights < _SUSPECT_WEIGHT)


def _suspects(model: TouchModel, fit: NamedFit) -> tuple[str, ...]:
    return tuple(compress(model.codes, _is_suspect(fit).tolist()))


def _better_exchanged(
    model: TouchModel, fit: NamedFit, others: Sequence[FittedHypothesis]
) -> tuple[str, str] | None:
    """Return two features whose exchange fits much better than the names as given, and than the other ear."""
    best = min(others, key=lambda other: other.fit.neg_log_posterior, default=None)
    if (
        best is None
        or best.exchanged is None
        or best.fit.neg_log_posterior > fit.neg_log_posterior - _EXCHANGE_GAIN
    ):
        return None
    i, j = best.exchanged
    return model.codes[i], model.codes[j]


def _warnings(fit: NamedFit, pose: CochleaPose, drift: float | None) -> Iterator[str]:
    yield from hypothesis_warnings(pose)
    if pose.suspects and pose.names_state != "wrong":
        names = " and ".join(pose.suspects)
        verb, it = ("does", "it") if len(pose.suspects) == 1 else ("do", "them")
        yield f"{names} {verb} not fit the other points: touch {it} again, or leave {it} out"
    if drift is not None:
        yield (
            f"the touches drift by {drift:.1f} mm from the first to the last: check that the reference is "
            "fixed, and touch the first feature again"
        )
    n = len(fit.weights)
    if n < _ENOUGH_TOUCHES and not pose.suspects:
        yield f"only {n} points: a mistouch cannot be distinguished from an unusual animal"
    if not fit.converged:
        yield "the fit did not converge; check the touches"
