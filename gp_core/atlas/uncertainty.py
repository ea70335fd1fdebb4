"""From the covariance of a pose to a radius and a cone, and how a cochlea's frame follows its points."""

from __future__ import annotations

import numpy as np

from gp_core.checks import FloatArray
from gp_core.frames import cross_matrix

__all__ = ["cochlea_jacobian", "cone_95", "radius_95"]

_NORMAL_95 = 1.6448536269514722


def radius_95(covariance: FloatArray) -> float:
    """Return the radius (mm) of the ball that holds the origin with 95 %.

    Parameters
    ----------
    covariance : (6, 6) array
        Of origin (mm) and rotation vector (rad).
    """
    return _norm_quantile(covariance[:3, :3])


def cone_95(covariance: FloatArray, axis: FloatArray) -> float:
    """Return the half-angle (rad) of the cone that holds the axis with 95 %.

    Parameters
    ----------
    covariance : (6, 6) array
        Of origin (mm) and rotation vector (rad).
    axis : (3,) array
        Unit axis in the same frame; turning about it does not move it.
    """
    across = np.eye(3) - np.outer(axis, axis)
    return min(_norm_quantile(across @ covariance[3:, 3:] @ across), np.pi)


def _norm_quantile(covariance: FloatArray) -> float:
    """95 % quantile of the length of a Gaussian vector.

    The squared length is taken as a scaled chi-square of the same mean and variance (Satterthwaite 1946,
    doi:10.2307/3002019), whose quantile is Wilson and Hilferty's (1931, doi:10.1073/pnas.17.12.684).
    """
    mean = float(np.trace(covariance))
    if mean <= 0:
        return 0.0
    freedom = mean**2 / float((covariance * covariance).sum())
    spread = 2 / (9 * freedom)
    return float((mean * (1 - spread + _NORMAL_95 * spread**0.5) ** 3) ** 0.5)


def cochlea_jacobian(ca: FloatArray, cb: FloatArray, rwa: FloatArray, rwp: FloatArray) -> FloatArray:
    """Return how the cochlea frame follows the four points that define it.

    Parameters
    ----------
    ca, cb, rwa, rwp : (3,) arrays, mm

    Returns
    -------
    (6, 12) array
        d (CO in mm, rotation vector in rad) / d (CA, CB, RWA, RWP in mm).
    """
    eye = np.eye(3)
    length = float(np.linalg.norm(ca - cb))
    x = (ca - cb) / length
    middle = (rwa + rwp) / 2
    along = float((middle - cb) @ x)
    to_window = middle - cb - along * x
    distance = float(np.linalg.norm(to_window))
    z = cross_matrix(x) @ to_window / distance
    axis_of_ca = (eye - np.outer(x, x)) / length
    origin_of_ca = (np.outer(x, to_window) + along * eye) @ axis_of_ca
    origin_of_window = np.outer(x, x) / 2
    origin = np.hstack(
        [origin_of_ca, eye - 2 * origin_of_window - origin_of_ca, origin_of_window, origin_of_window]
    )
    nothing = np.zeros((3, 3))
    axis = np.hstack([axis_of_ca, -axis_of_ca, nothing, nothing])
    window = np.hstack([nothing, nothing, eye / 2, eye / 2]) - origin
    turn = cross_matrix(x) @ axis + np.outer(x, z) @ window / distance
    return np.vstack([origin, turn])
