"""The project's own estimator: named points, pose and shape together, robust to a mistouch."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from gp_core.atlas.atlas import DEFINING, Atlas
from gp_core.atlas.named_fit import (
    NamedFit,
    TouchModel,
    best_exchange,
    careful_misfit,
    compile_if_repeated,
    fit_named_points,
    motion_jacobian,
)
from gp_core.atlas.pose import CochleaPose
from gp_core.atlas.uncertainty import cochlea_jacobian
from gp_core.checks import FloatArray
from gp_core.errors import FeatureError, GpError
from gp_core.frames import RigidTransform, mirror_x
from gp_core.landmarks.anatomy import axis_frame, cochlea_origin, mirror_right, touched_features
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet

__all__ = ["defining_points", "estimate_robust", "locate_robust", "pose_covariance", "touch_model"]

_SUSPECT_WEIGHT = 0.2
_SUSPECT_SQUARED = 20.0
"""Squared deviation from where the others put a touch, over its variance; 1 ordinary one of 6000 is above."""

_ODD_SQUARED = 7.814727903251179
"""The same, with 1 of 20 above: from there on a touch counts as uncertain as it looks."""

_ENOUGH_TO_TELL = 5
"""Touches from which a mistouch can be told from an unusual animal."""

_CLEAR_MISFIT = 6.0
"""Difference in -2 log posterior, odds of 20 to 1, from which one side is told from the other."""

_AGAINST_THE_USER = 12.0
"""The same for saying that the user named the wrong side, or exchanged two names: odds of 400 to 1."""

_MIRROR = np.diag([-1.0, 1.0, 1.0])
_MIRROR_POSE = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])  # a rotation vector mirrors with the other sign


def estimate_robust(touches: LandmarkSet, atlas: Atlas, *, probe_noise: float | None = None) -> CochleaPose:
    """Estimate the pose of a cochlea from named touches; see `gp_core.atlas.pose.estimate_pose`.

    Parameters
    ----------
    touches : LandmarkSet
        At least three external features, in any frame, mm.
    atlas : Atlas
    probe_noise : float, optional
        Scale of an ordinary touch error, mm a coordinate; by default found from the touches.

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
    fit = fit_named_points(model, points)
    suspects = _suspects(model, fit)
    defining = defining_points(atlas, model, fit)
    frame = _cochlea_in_touches(defining, fit, touches)
    worse = _other_side_worse(model, points, fit)
    swapped = _swapped(model, points, fit, max(_AGAINST_THE_USER, -worse)) if fit.rough else None
    return CochleaPose(
        side=touches.side,
        method="robust",
        atlas=atlas.name,
        transform_to_touches=frame,
        covariance=pose_covariance(atlas, model, fit, defining, touches.side),
        residuals=_residuals(model, fit),
        suspects=suspects,
        warnings=tuple(_warnings(fit, touches.side, suspects, worse, swapped)),
        probe_noise=fit.noise,
        T_touches_atlas=_atlas_in_touches(fit, touches),
        swapped=swapped,
        side_state=_side_state(worse) if swapped is None else "clear",
        names_state="clear" if swapped is None else "wrong",
    )


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
    atlas: Atlas, model: TouchModel, fit: NamedFit, defining: FloatArray, side: Side
) -> FloatArray:
    """Return the (6, 6) covariance of the cochlea frame: origin (mm), rotation vector (rad).

    `defining` are the `defining_points`.

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
    covariance += (of_touches * _touch_variances(fit)) @ of_touches.T
    symmetric: FloatArray = (covariance + covariance.T) / 2
    return symmetric


def _touch_variances(fit: NamedFit) -> FloatArray:
    """Return (3 n,) variances of the touched coordinates; suspect and odd ones are as wrong as they look."""
    variances = fit.touch_variances
    odd = _suspicious(fit)
    if len(odd) >= _ENOUGH_TO_TELL:
        odd |= fit.against_others.squared > _ODD_SQUARED
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


def _warnings(
    fit: NamedFit, side: Side, suspects: tuple[str, ...], worse: float, swapped: tuple[str, str] | None
) -> Iterator[str]:
    if swapped is not None:
        yield f"{' and '.join(swapped)} look swapped"
    else:
        yield from _side_warning(worse, side)
    if suspects and swapped is None:
        names = " and ".join(suspects)
        verb, it = ("does", "it") if len(suspects) == 1 else ("do", "them")
        yield f"{names} {verb} not fit the other points: touch {it} again, or leave {it} out"
    n = len(fit.weights)
    if n < _ENOUGH_TO_TELL and not suspects:
        yield f"only {n} points: a mistouch cannot be told from an unusual animal"
    if not fit.converged:
        yield "the fit did not settle; check the touches"


def _other_side_worse(model: TouchModel, points: FloatArray, fit: NamedFit) -> float:
    """Return by how much the other side fits worse, in -2 log posterior."""
    mirrored = mirror_x(points)
    if fit.rough:
        return 2 * (fit_named_points(model, mirrored).misfit - fit.misfit)
    return careful_misfit(model, mirrored, fit.noise) - careful_misfit(model, points, fit.noise)


def _side_state(worse: float) -> str:
    if worse < -_AGAINST_THE_USER:
        return "wrong"
    return "undecided" if worse < _CLEAR_MISFIT else "clear"


def _side_warning(worse: float, side: Side) -> Iterator[str]:
    """Say so where the other side fits as well or better; `worse` is its misfit less this side's."""
    if worse < -_AGAINST_THE_USER:
        yield f"the {side.other.word} side fits these points better than the {side.word}: check the side"
    elif worse < _CLEAR_MISFIT:
        yield (
            f"these points fit the {side.other.word} side about as well, so a wrong side would pass: "
            "touch one more feature away from their plane"
        )


def _swapped(model: TouchModel, points: FloatArray, fit: NamedFit, least: float) -> tuple[str, str] | None:
    """Return the two features whose exchange gains more than `least` in -2 log posterior, if any are such."""
    below = fit.misfit - least / 2
    i, j, misfit = best_exchange(model, points, fit, below)
    return (model.codes[i], model.codes[j]) if misfit < below else None
