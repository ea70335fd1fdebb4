"""What is computed from landmarks: the cochlea origin and the frames built on features.

The formulas follow Usevitch et al. 2021. Where the paper's text and its authors' numbers differ (the
round-window frame), the numbers decide; see ``docs/method.md``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gp_core.constants import DEFINING_FEATURES
from gp_core.errors import FeatureError, GeometryError
from gp_core.frames import RigidTransform, mirror_x
from gp_core.landmarks.features import EXTERNAL, Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.validation import FloatArray

__all__ = [
    "axis_frame",
    "cochlea_frame",
    "cochlea_origin",
    "mirror_right",
    "modiolar_axis",
    "round_window_frame",
    "touched_features",
    "with_cochlea_origin",
]

_SMALLEST_MM = 1e-6


def cochlea_origin(ca: ArrayLike, cb: ArrayLike, rwa: ArrayLike, rwp: ArrayLike) -> FloatArray:
    """Compute the cochlea origin CO.

    Parameters
    ----------
    ca, cb, rwa, rwp : (..., 3) array_like, mm
        Cochlea apex and base, anterior and posterior edge of the round window, in any one frame.

    Returns
    -------
    (..., 3) float array, mm
        The point of the line CB-CA from which the middle of RWA and RWP lies perpendicular to the line.

    Raises
    ------
    GeometryError
        CA and CB coincide.
    """
    base = np.asarray(cb, dtype=np.float64)
    middle = (np.asarray(rwa, dtype=np.float64) + np.asarray(rwp, dtype=np.float64)) / 2
    axis = modiolar_axis(ca, base)
    along = np.sum((middle - base) * axis, axis=-1, keepdims=True)
    origin: FloatArray = base + along * axis
    return origin


def modiolar_axis(ca: ArrayLike, cb: ArrayLike) -> FloatArray:
    """Return the unit vector from the cochlea base to its apex.

    Parameters
    ----------
    ca, cb : (..., 3) array_like, mm
        Apex and base, in any one frame.

    Returns
    -------
    (..., 3) float array
        Unit vectors.

    Raises
    ------
    GeometryError
        CA and CB coincide.
    """
    axis = np.asarray(ca, dtype=np.float64) - np.asarray(cb, dtype=np.float64)
    length = np.linalg.norm(axis, axis=-1, keepdims=True)
    if (length < _SMALLEST_MM).any():
        raise GeometryError(
            "CA and CB are at the same place, so they give no axis",
            landmark="CA",
            remedy="Place one of them again.",
        )
    unit: FloatArray = axis / length
    return unit


def with_cochlea_origin(landmarks: LandmarkSet) -> LandmarkSet:
    """Return the set with CO computed from CA, CB, RWA and RWP; without CO where one of them is missing.

    Parameters
    ----------
    landmarks : LandmarkSet
        Landmarks of one side, mm.

    Returns
    -------
    LandmarkSet
        In the same frame.

    Raises
    ------
    GeometryError
        CA and CB coincide.
    """
    if not all(code in landmarks for code in DEFINING_FEATURES):
        return landmarks.with_point("CO", None)
    return landmarks.with_point("CO", cochlea_origin(*(landmarks[code] for code in DEFINING_FEATURES)))


def cochlea_frame(landmarks: LandmarkSet) -> RigidTransform:
    """Build the CO frame of the paper from CA, CB, RWA and RWP.

    Origin CO; x towards CA on the left and away from it on the right; y from CO to the middle of the round
    window; z = x × y. So the two sides are mirror images of each other in x.

    Parameters
    ----------
    landmarks : LandmarkSet
        Landmarks of one side, mm.

    Returns
    -------
    RigidTransform
        ``T_<frame>_cochlea``: from the CO frame into the frame of the landmarks.

    Raises
    ------
    FeatureError
        One of the four features is not placed.
    GeometryError
        The round window lies on the axis.
    """
    ca, cb, rwa, rwp = landmarks.array(DEFINING_FEATURES)
    origin = cochlea_origin(ca, cb, rwa, rwp)
    x = _sign(landmarks.side) * modiolar_axis(ca, cb)
    return axis_frame(origin, x, (rwa + rwp) / 2 - origin, dst=landmarks.frame, src="cochlea")


def round_window_frame(landmarks: LandmarkSet) -> RigidTransform:
    """Build the RW frame, which brings touched points near the CO frame.

    With p the foot of LLI on the line RWA-RWP: x = unit(RWA - RWP) on the left and its negative on the right,
    y = unit(LLI - p), z = x × y, origin p - (LLI - p). In the paper's text x and the origin have the opposite
    sign; this definition reproduces its authors' results.

    Parameters
    ----------
    landmarks : LandmarkSet
        Landmarks or touches of one side, mm.

    Returns
    -------
    RigidTransform
        ``T_<frame>_window``.

    Raises
    ------
    FeatureError
        RWA, RWP or LLI is not placed.
    GeometryError
        The three are collinear.
    """
    rwa, rwp, lli = landmarks.array(("RWA", "RWP", "LLI"))
    across = rwa - rwp
    if np.linalg.norm(across) < _SMALLEST_MM:
        raise GeometryError("RWA and RWP are at the same place", landmark="RWA", remedy="Touch them again.")
    across = across / np.linalg.norm(across)
    foot = rwp + np.dot(lli - rwp, across) * across
    x = _sign(landmarks.side) * across
    return axis_frame(2 * foot - lli, x, lli - foot, dst=landmarks.frame, src="window")


def mirror_right(points: FloatArray, side: Side) -> FloatArray:
    """Mirror the points of a right side in x, and leave those of a left side; it is its own inverse.

    Parameters
    ----------
    points : (N, 3) array, mm
        Points of one side.
    side : Side
        Which side.

    Returns
    -------
    (N, 3) array, mm
        Points as of a left side.
    """
    return points if side is Side.LEFT else mirror_x(points)


def touched_features(touches: LandmarkSet) -> tuple[str, ...]:
    """Return the placed features of a set of touches.

    Parameters
    ----------
    touches : LandmarkSet
        Touched features.

    Returns
    -------
    tuple of str
        Codes, in the table's order.

    Raises
    ------
    FeatureError
        One of them is not an external feature, so no probe can have touched it.
    """
    for code in touches.placed:
        if code not in EXTERNAL:
            raise FeatureError(
                f"{code} is inside the bone and cannot be touched",
                landmark=code,
                remedy=f"Touch any of {' '.join(EXTERNAL)}.",
            )
    return touches.placed


def _sign(side: Side) -> float:
    return 1.0 if side is Side.LEFT else -1.0


def axis_frame(
    origin: FloatArray, axis: FloatArray, towards_y: FloatArray, *, dst: str, src: str
) -> RigidTransform:
    """Build a right-handed frame from a point and an axis.

    Parameters
    ----------
    origin : (3,) array, mm
        Origin of the new frame.
    axis : (3,) array
        Direction of x.
    towards_y : (3,) array
        Direction of y, once made orthogonal to x.
    dst, src : str
        Frame of the given coordinates, and name of the new frame.

    Returns
    -------
    RigidTransform
        ``T_dst_src``.

    Raises
    ------
    GeometryError
        `towards_y` lies along the axis, or `axis` is zero.
    """
    x = axis / (_length(axis) or 1.0)
    across = towards_y - (towards_y @ x) * x
    length = _length(across)
    if length < _SMALLEST_MM or not x.any():
        raise GeometryError(
            f"the points that define the {src} frame lie on one line", remedy="Check their names."
        )
    y = across / length
    z = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    return RigidTransform.from_parts(np.array([x, y, z]).T, origin, dst=dst, src=src)


def _length(vector: FloatArray) -> float:
    return float(np.sqrt(vector @ vector))
