"""The project's own estimator: named points, pose and shape together, robust to a mistouch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from gp_core.atlas.atlas import DEFINING, Atlas
from gp_core.errors import FeatureError, GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.anatomy import axis_frame, cochlea_origin, mirror_right, touched_features
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.covariance import cochlea_jacobian
from gp_core.pose.hypotheses import Reading, readings
from gp_core.pose.hypothesis_check import decide, reading_warnings
from gp_core.pose.mixture import Hypothesis
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM, Systematic
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
"""Squared deviation from where the others put a touch, over its variance; 1 ordinary one of 6000 is above."""

_ENOUGH_TO_TELL = 5
"""Touches from which a mistouch can be told from an unusual animal."""

_MUCH_BETTER = 6.0
"""Difference in log posterior, odds of 400 to 1, from which two names are said to be exchanged."""

_MIRROR = np.diag([-1.0, 1.0, 1.0])
_MIRROR_POSE = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])  # a rotation vector mirrors with the other sign


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
    probe_noise : float, optional
        Scale of an ordinary touch error, mm a coordinate; by default found from the touches.
    shared_error : float
        RMS length of one offset that all touches share, mm; see `gp_core.pose.systematic_error`.
    times : mapping of str to float, optional
        When each feature was touched, s; then a drift is looked for.

    Raises
    ------
    FeatureError
        Too few features, or one that no probe can touch.
    GeometryError
        The touches lie on one line.
    """
    compile_if_repeated()
    model = touch_model(touches, atlas, probe_noise)
    points = mirror_right(touches.array(model.codes), touches.side)
    systematic = Systematic(shared_error, _elapsed(times, model))
    fit = fit_named_points(model, points)
    named, *others = readings(model, points, fit)
    better = _better_exchanged(model, fit, others) if fit.rough else None
    suspects = _suspects(model, fit)
    frame, covariance = _posed(atlas, model, fit, touches, systematic)
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
        hypotheses=tuple(_hypothesis(atlas, model, reading, touches, systematic) for reading in others),
    )
    decided = replace(pose, **decide(pose, better))
    return replace(decided, warnings=tuple(_warnings(fit, decided)))


def _elapsed(times: Mapping[str, float] | None, model: TouchModel) -> list[float] | None:
    """Return the times of the model's touches; None unless all have one."""
    if times is None or not all(code in times for code in model.codes):
        return None
    return [float(times[code]) for code in model.codes]


def _posed(
    atlas: Atlas, model: TouchModel, fit: NamedFit, touches: LandmarkSet, systematic: Systematic
) -> tuple[RigidTransform, FloatArray]:
    """Return ``T_touches_cochlea`` and its (6, 6) covariance of a fit."""
    defining = defining_points(atlas, model, fit)
    covariance = pose_covariance(atlas, model, fit, defining, touches.side, systematic)
    return _cochlea_in_touches(defining, fit, touches), covariance


def _hypothesis(
    atlas: Atlas, model: TouchModel, reading: Reading, touches: LandmarkSet, systematic: Systematic
) -> Hypothesis:
    side = touches.side.other if reading.mirrored else touches.side
    frame, covariance = _posed(atlas, model, reading.fit, replace(touches, side=side), systematic)
    pair = None
    if reading.exchanged is not None:
        i, j = reading.exchanged
        pair = model.codes[i], model.codes[j]
    return Hypothesis(side, pair, reading.probability, frame, covariance)


def locate_robust(touches: LandmarkSet, atlas: Atlas) -> RigidTransform:
    """Return ``T_touches_cochlea`` of `estimate_robust` alone, for studies of thousands of touches.

    Raises
    ------
    FeatureError, GeometryError
        As `estimate_robust` does.
    """
    compile_if_repeated()
    model = touch_model(touches, atlas, None)
    fit = fit_named_points(model, mirror_right(touches.array(model.codes), touches.side))
    return _cochlea_in_touches(defining_points(atlas, model, fit), fit, touches)


def touch_model(touches: LandmarkSet, atlas: Atlas, probe_noise: float | None) -> TouchModel:
    """Return what the atlas says of the touched features, after checking that they can be used.

    Raises
    ------
    FeatureError
        Too few features, or one that no probe can touch.
    GpError
        `probe_noise` is no positive number.
    """
    if probe_noise is not None and not (np.isfinite(probe_noise) and probe_noise > 0):
        raise GpError(f"probe noise must be a positive number of mm, got {probe_noise!r}")
    codes = touched_features(touches)
    usable = tuple(code for code in codes if code in atlas.codes)
    if len(usable) < 3:
        raise FeatureError(
            f"a pose needs at least three touched features that the atlas holds, got {len(usable)}"
            f"{': ' + ' '.join(usable) if usable else ''}",
            remedy="Touch more of them.",
        )
    return TouchModel(usable, atlas.rows(usable), atlas.variances(usable), probe_noise)


def defining_points(atlas: Atlas, model: TouchModel, fit: NamedFit) -> FloatArray:
    """Return the expected CA, CB, RWA, RWP (4, 3) of this animal, mm, in the atlas frame."""
    shape = _shape_of_residual(model, fit) @ fit.residual
    return atlas.rows(DEFINING) + shape.reshape(-1, 3)


def _shape_of_residual(model: TouchModel, fit: NamedFit) -> FloatArray:
    """Return (12, 3 n): the part of each residual taken as the animal's own shape, at the defining points."""
    gain = np.zeros((len(DEFINING), 3, len(model.codes), 3))
    for row, code in enumerate(DEFINING):
        if code in model.codes:
            column = model.codes.index(code)
            share = model.variances[column] * fit.precision[3 * column]
            gain[row, (0, 1, 2), column, (0, 1, 2)] = share
    return gain.reshape(3 * len(DEFINING), -1)


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
    systematic: Systematic,
) -> FloatArray:
    """Return the (6, 6) covariance of the cochlea frame: origin (mm), rotation vector (rad).

    `defining` are the `defining_points`, `systematic` what is added beyond independent errors.

    Near the solution the estimate is linear in the residuals, so its error is a linear map of the animal's
    shape and of the touch errors. The shape enters with all its correlations as measured: features taken one
    by one, which is what gives the estimate its weights, would promise too much.
    """
    jacobian = fit.jacobian
    pull = (fit.precision[:, None] * jacobian).T
    pose_of_residual = np.linalg.solve(pull @ jacobian, pull)
    shape_of_residual = _shape_of_residual(model, fit)
    lever = motion_jacobian(defining) - shape_of_residual @ jacobian
    points_of_residual = shape_of_residual + lever @ pose_of_residual
    to_frame = (fit.rotation @ cochlea_jacobian(*defining).reshape(2, 3, -1)).reshape(6, -1)
    if side is Side.RIGHT:
        to_frame *= _MIRROR_POSE[:, None]
    of_touches = to_frame @ points_of_residual
    of_shape = np.zeros((6, len(atlas.scatter)))
    of_shape[:, atlas.coordinates(DEFINING)] = to_frame
    of_shape[:, atlas.coordinates(model.codes)] -= of_touches
    covariance = of_shape @ atlas.scatter @ of_shape.T
    variances = np.maximum(
        _touch_variances(fit, systematic.odd_squared), systematic.noise_floor(len(model.codes)) ** 2
    )
    covariance += (of_touches * variances) @ of_touches.T
    covariance += systematic.covariance(atlas, fit, of_touches, of_shape)
    symmetric: FloatArray = (covariance + covariance.T) / 2
    return symmetric


def _touch_variances(fit: NamedFit, odd_squared: float) -> FloatArray:
    """Return (3 n,) variances of the touched coordinates; suspect and odd ones are as wrong as they look."""
    variances = fit.touch_variances
    odd = _suspicious(fit)
    if len(odd) >= _ENOUGH_TO_TELL:
        odd |= fit.against_others.squared > odd_squared
    if odd.any():
        variances = np.where(odd, np.maximum(fit.against_others.error_variance, variances), variances)
    return np.repeat(variances, 3)


def _residuals(model: TouchModel, fit: NamedFit) -> dict[str, float]:
    lengths = np.sqrt(fit.squared_residuals)
    return dict(zip(model.codes, lengths.tolist(), strict=True))


def _suspicious(fit: NamedFit) -> NDArray[np.bool_]:
    """Mark touches (n,) that the fit set aside, or that only a most unusual animal would explain."""
    marks: NDArray[np.bool_] = fit.against_others.squared > _SUSPECT_SQUARED
    return marks | (fit.weights < _SUSPECT_WEIGHT)


def _suspects(model: TouchModel, fit: NamedFit) -> tuple[str, ...]:
    return tuple(compress(model.codes, _suspicious(fit).tolist()))


def _better_exchanged(model: TouchModel, fit: NamedFit, others: Sequence[Reading]) -> tuple[str, str] | None:
    """Return two features whose exchange fits much better than the names as given, and than the other ear."""
    best = min(others, key=lambda other: other.fit.misfit, default=None)
    if best is None or best.exchanged is None or best.fit.misfit > fit.misfit - _MUCH_BETTER:
        return None
    i, j = best.exchanged
    return model.codes[i], model.codes[j]


def _warnings(fit: NamedFit, pose: CochleaPose) -> Iterator[str]:
    yield from reading_warnings(pose)
    if pose.suspects and pose.names_state != "wrong":
        names = " and ".join(pose.suspects)
        verb, it = ("does", "it") if len(pose.suspects) == 1 else ("do", "them")
        yield f"{names} {verb} not fit the other points: touch {it} again, or leave {it} out"
    n = len(fit.weights)
    if n < _ENOUGH_TO_TELL and not pose.suspects:
        yield f"only {n} points: a mistouch cannot be told from an unusual animal"
    if not fit.converged:
        yield "the fit did not settle; check the touches"
