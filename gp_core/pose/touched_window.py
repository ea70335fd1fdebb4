"""The cochlea frame rotated about its axis, so that y points to the round window as it was touched.

The robot of Usevitch et al. 2021 used that frame. Origin and axis stay those of the estimate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gp_core.errors import GeometryError
from gp_core.frames import RigidTransform
from gp_core.landmarks.anatomy import axis_frame
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.validation import FloatArray

__all__ = ["towards_touched_window"]

_EDGES = ("RWA", "RWP")


def towards_touched_window(pose: CochleaPose, touches: LandmarkSet) -> CochleaPose:
    """Rotate a pose about its axis: y towards the middle of the touched RWA and RWP, orthogonal to the axis.

    Parameters
    ----------
    pose : CochleaPose
        Of these touches.
    touches : LandmarkSet
        In the frame of the pose, mm.

    Returns
    -------
    CochleaPose
        Its `round_window` is ``touched``. The pose is unchanged where RWA or RWP was not touched, is suspect
        or looks exchanged with another feature, or where their middle lies on the axis.
    """
    doubtful = {*pose.suspects, *(pose.swapped or ())}
    if pose.swapped is not None and set(pose.swapped) == set(_EDGES):
        doubtful = set(pose.suspects)  # exchanged with each other: their middle is the same
    if not all(code in touches and code not in doubtful for code in _EDGES):
        return pose
    to_window = touches.array(_EDGES).mean(axis=0) - pose.origin
    frame = pose.transform_to_touches
    try:
        rotated = axis_frame(pose.origin, pose.axis, to_window, dst=frame.dst, src=frame.src)
    except GeometryError:
        return pose
    covariance = _rotated_covariance(pose, rotated, to_window)
    return replace(pose, transform_to_touches=rotated, covariance=covariance, round_window="touched")


def _rotated_covariance(pose: CochleaPose, rotated: RigidTransform, to_window: FloatArray) -> FloatArray:
    """Return the (6, 6) covariance of a frame whose rotation about x comes from two touches.

    With r and h the components of `to_window` along y and x, that rotation is (z·(dm - dCO) + h y·dtheta) /
    r; the middle of the window then errs by its touches' errors dm alone. They are taken as independent of
    the errors of the pose, although both share them: conservative, by a fifth for simulated animals touched
    to 0.15 mm.
    """
    x, y, z = rotated.rotation.T
    h, r = x @ to_window, y @ to_window
    follow = np.eye(6)
    follow[3:, 3:] -= np.outer(x, x)
    follow[3:] += np.outer(x, np.concatenate([-z, h * y])) / r
    covariance = follow @ pose.covariance @ follow.T
    of_middle = (pose.probe_noise or 0.0) ** 2 / len(_EDGES)
    covariance[3:, 3:] += np.outer(x, x) * of_middle / r**2
    symmetric: FloatArray = (covariance + covariance.T) / 2
    return symmetric
