"""Matrices as trackers send them: whether they are rigid, made exactly so, and the step between two."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gp_core.frames import cross_matrix
from gp_core.validation import FloatArray

__all__ = ["PoseDistance", "nearest_rigid", "rotation_of", "step_between", "turn_deg", "why_not_rigid"]


class PoseDistance(NamedTuple):
    """How far apart two poses are."""

    mm: float
    degrees: float


def why_not_rigid(matrix: FloatArray, tolerance: float) -> str:
    """Say why a (4, 4) matrix is no rotation and translation; an empty string where it is one.

    Messages carry single precision, and some devices round to a few digits: `tolerance` is how far
    ``R.T @ R`` may be from the identity.
    """
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        return "its matrix is not finite"
    rotation = matrix[:3, :3]
    determinant = float(np.linalg.det(rotation))
    if determinant <= 0:
        return "its matrix contains a reflection" if determinant < 0 else "its matrix is singular"
    if float(np.abs(rotation.T @ rotation - np.eye(3)).max()) > tolerance:
        scale = determinant ** (1 / 3)
        return f"its matrix scales by {scale:.3f}" if abs(scale - 1) > tolerance else "its matrix shears"
    return ""


def nearest_rigid(matrix: FloatArray) -> FloatArray:
    """Return the (4, 4) matrix whose rotation is the nearest to that of `matrix`."""
    u, _, vt = np.linalg.svd(matrix[:3, :3])
    rigid = np.eye(4)
    rigid[:3, :3] = u @ vt
    rigid[:3, 3] = matrix[:3, 3]
    return rigid


def turn_deg(rotation: FloatArray) -> FloatArray:
    """Return the angles of (..., 3, 3) rotations, degrees."""
    trace = np.trace(rotation, axis1=-2, axis2=-1)
    angle: FloatArray = np.degrees(np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0)))
    return angle


def step_between(before: FloatArray, after: FloatArray) -> PoseDistance:
    """Return the distance of the origins, mm, and the angle between two (4, 4) poses."""
    degrees = float(turn_deg(before[:3, :3].T @ after[:3, :3]))
    return PoseDistance(float(np.linalg.norm(after[:3, 3] - before[:3, 3])), degrees)


def rotation_of(vector: FloatArray) -> FloatArray:
    """Return the (3, 3) rotation about (3,) `vector` by its length, radians (Rodrigues' formula)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    cross = cross_matrix(vector / angle)
    rotation: FloatArray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return rotation
