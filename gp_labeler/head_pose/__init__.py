"""How a head lies in its scan: found from the symmetry of its bone, or from points."""

from gp_labeler.head_pose.by_points import straighten_by_landmarks, straighten_by_points
from gp_labeler.head_pose.mid_plane import MidPlane
from gp_labeler.head_pose.result import (
    LEFT_OF_LANDMARKS,
    Confidence,
    HeadPose,
    HeadPoseError,
    SeveralHeadsError,
)
from gp_labeler.head_pose.straighten import straighten
from gp_labeler.head_pose.template import HeadTemplate

__all__ = [
    "LEFT_OF_LANDMARKS",
    "Confidence",
    "HeadPose",
    "HeadPoseError",
    "HeadTemplate",
    "MidPlane",
    "SeveralHeadsError",
    "straighten",
    "straighten_by_landmarks",
    "straighten_by_points",
]
