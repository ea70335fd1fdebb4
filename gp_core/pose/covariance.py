"""From the covariance of a pose to a radius and a cone, and the derivative of the cochlea frame."""

from __future__ import annotations

import math

import numpy as np

from gp_core.frames import cross_matrix
from gp_core.stats import NORMAL_95, chi_square_share
from gp_core.validation import FloatArray

__all__ = ["cochlea_jacobian", "cone_95", "radius_95"]


def radius_95(covariance: FloatArray) -> float:
    """Return the radius of the ball that contains the origin with 95 % probability.

    Parameters
    ----------
    covariance : (6, 6) array
        Of origin (mm) and rotation vector (rad).

    Returns
    -------
    float
        Radius, mm.
    """
    return _norm_quantile(covariance[:3, :3])


def cone_95(covariance: FloatArray, axis: FloatArray) -> float:
    """Return the half-angle of the cone that contains the axis with 95 % probability.

    Parameters
    ----------
    covariance : (6, 6) array
        Of origin (mm) and rotation vector (rad).
    axis : (3,) array
        Unit axis in the same frame; rotation about it does not move it.

    Returns
    -------
    float
        Half-angle, rad.
    """
    across = np.eye(3) - np.outer(axis, axis)
    return min(_norm_quantile(across @ covariance[3:, 3:] @ across), np.pi)


def _norm_quantile(covariance: FloatArray) -> float:
    """95 % quantile of the length of a Gaussian vector.

    The squared length is approximated by a scaled chi-squared distribution of the same mean and variance
    (Satterthwaite 1946, doi:10.2307/3002019).
    """
    mean = float(np.trace(covariance))
    if mean <= 0:
        return 0.0
    freedom = mean**2 / float((covariance * covariance).sum())
    return float((mean * chi_square_share(freedom, NORMAL_95)) ** 0.5)


def cochlea_jacobian(ca: FloatArray, cb: FloatArray, rwa: FloatArray, rwp: FloatArray) -> FloatArray:
    """Return the derivative of the cochlea frame with respect to the four points that define it.

    Parameters
    ----------
    ca, cb, rwa, rwp : (3,) arrays, mm
        The defining features.

    Returns
    -------
    (6, 12) array
        d (CO in mm, rotation vector in rad) / d (CA, CB, RWA, RWP in mm).
    """
    spiral, middle = ca - cb, (rwa + rwp) / 2 - cb
    squared = float(spiral @ spiral)
    length = math.sqrt(squared)
    x = spiral / length
    share = float(spiral @ middle) / squared  # fraction of the way from CB to CA at which CO lies
    to_window = middle - share * spiral
    along, cross_x = x[:, None] * x, cross_matrix(x)
    across = np.eye(3) - along
    origin_of_ca = x[:, None] * (to_window / length) + share * across
    rotation_of_ca = cross_x / length
    tilt = x[:, None] * (cross_x @ (to_window / float(to_window @ to_window)))
    jacobian = np.empty((2, 3, 4, 3))  # quantity, its coordinate, point, its coordinate
    jacobian[0, :, 0] = origin_of_ca
    jacobian[0, :, 1] = across - origin_of_ca
    jacobian[0, :, 2] = jacobian[0, :, 3] = along / 2
    jacobian[1, :, 0] = rotation_of_ca - share * tilt
    jacobian[1, :, 1] = (share - 1) * tilt - rotation_of_ca
    jacobian[1, :, 2] = jacobian[1, :, 3] = tilt / 2
    return jacobian.reshape(6, 12)
