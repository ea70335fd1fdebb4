"""Predict the features of a labelled side that are not placed."""

from __future__ import annotations

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.constants import DEFINING_FEATURES
from gp_core.errors import FeatureError, GeometryError
from gp_core.landmarks.anatomy import cochlea_origin, mirror_right
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.named_points import NamedFit, TouchModel, fit_named_points, motion_jacobian
from gp_core.validation import FloatArray

__all__ = ["predict"]

UNKNOWN_ANGLE_SD = np.pi / np.sqrt(3)
"""Standard deviation of a uniformly distributed angle, rad."""


@checks_arguments
def predict(atlas: Atlas, landmarks: LandmarkSet) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Predict every feature that is not placed from those that are.

    Parameters
    ----------
    atlas : Atlas
        Mean shape and its variation.
    landmarks : LandmarkSet
        At least three placed features that the atlas holds, not collinear, in any frame, mm.

    Returns
    -------
    dict of str to (mean (3,), covariance (3, 3))
        In the frame of the landmarks, mm and mm^2; includes CO where it is not placed.

    Raises
    ------
    FeatureError
        Fewer than three usable features.
    GeometryError
        They are collinear.
    """
    known = _known(atlas, landmarks)
    fit = _fit(atlas, landmarks, known)
    wanted = tuple(code for code in atlas.codes if code not in known)
    mean, covariance = _given(atlas, known, fit, wanted)
    mean, covariance = _to_frame(mean, covariance, fit, landmarks.side)
    found = {
        code: (mean[i], covariance[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]) for i, code in enumerate(wanted)
    }
    if "CO" not in landmarks:
        found["CO"] = _predict_origin(landmarks, found)
    return found


def _known(atlas: Atlas, landmarks: LandmarkSet) -> tuple[str, ...]:
    known = tuple(code for code in landmarks.placed if code in atlas.codes)
    if len(known) < 3:
        raise FeatureError(
            f"at least three placed features are needed, got {len(known)}", remedy="Place more of them."
        )
    return known


def _fit(atlas: Atlas, landmarks: LandmarkSet, known: tuple[str, ...]) -> NamedFit:
    points = landmarks.array(known)
    sd = atlas.labelling_error.of(known)
    least = float(sd.min())
    variances = atlas.variances(known) + (sd**2 - least**2)  # the fit takes one error for all
    model = TouchModel(known, atlas.rows(known), variances, least)
    return fit_named_points(model, mirror_right(points, landmarks.side))


def _given(
    atlas: Atlas, known: tuple[str, ...], fit: NamedFit, wanted: tuple[str, ...]
) -> tuple[FloatArray, FloatArray]:
    """Return conditional mean (m, 3) and covariance (3 m, 3 m) of other features; atlas frame."""
    noise = np.repeat(atlas.labelling_error.of(known) ** 2 / fit.weights, 3)
    precision = np.linalg.inv(atlas.cross_covariance(known, known) + np.diag(noise))
    jacobian = fit.jacobian
    information = jacobian.T @ precision @ jacobian
    _check_rotation(information)
    shift = np.linalg.solve(information, jacobian.T @ precision @ fit.residual)
    cross = atlas.cross_covariance(wanted, known) @ precision
    prior = atlas.rows(wanted)
    motion = motion_jacobian(prior)
    mean = prior + (cross @ (fit.residual - jacobian @ shift) + motion @ shift).reshape(-1, 3)
    motion_left = motion - cross @ jacobian
    covariance = atlas.cross_covariance(wanted, wanted) - cross @ atlas.cross_covariance(known, wanted)
    return mean, covariance + motion_left @ np.linalg.solve(information, motion_left.T)


def _check_rotation(information: FloatArray) -> None:
    """Reject points that tell no more about the orientation of the head than no points would.

    `information` (6, 6): of the translation, 1/mm^2, and the rotation, 1/rad^2.
    """
    about_middle = information[3:, 3:] - information[3:, :3] @ np.linalg.solve(
        information[:3, :3], information[:3, 3:]
    )
    if not np.linalg.eigvalsh(about_middle)[0] > UNKNOWN_ANGLE_SD**-2:
        raise GeometryError(
            "the placed features are at one position or on a line, so they do not determine the "
            "orientation of the head",
            remedy="Place a feature away from them, and check that the labels are in mm.",
        )


def _to_frame(
    mean: FloatArray, covariance: FloatArray, fit: NamedFit, side: Side
) -> tuple[FloatArray, FloatArray]:
    points = mirror_right(mean @ fit.rotation.T + fit.translation, side)
    rotation = np.kron(np.eye(len(mean)), fit.rotation)
    if side is Side.RIGHT:
        rotation = np.kron(np.eye(len(mean)), np.diag([-1.0, 1.0, 1.0])) @ rotation
    return points, rotation @ covariance @ rotation.T


def _predict_origin(
    landmarks: LandmarkSet, found: dict[str, tuple[FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """Return CO from placed or predicted points, and the covariance of the least certain of them."""
    points = [landmarks[code] if code in landmarks else found[code][0] for code in DEFINING_FEATURES]
    spreads = [found[code][1] for code in DEFINING_FEATURES if code in found] or [np.zeros((3, 3))]
    return cochlea_origin(*points), max(spreads, key=np.trace)
