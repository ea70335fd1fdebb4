"""The pose of a head from a few of its points, refined by the symmetry of its bone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import mean_animal
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.procrustes import fit_rigid
from gp_core.validation import FloatArray
from gp_labeler.head_pose.bone import Bone, bone_of
from gp_labeler.head_pose.grey_refinement import GreyValues, refined_by_grey_values, uncertainty_deg
from gp_labeler.head_pose.mid_plane import MidPlane
from gp_labeler.head_pose.mirror_search import agreement_of
from gp_labeler.head_pose.result import LEFT_OF_LANDMARKS, Confidence, HeadPose, HeadPoseError
from gp_labeler.head_pose.straighten import pose_in_plane
from gp_labeler.head_pose.template import HeadTemplate, axes_in_plane, front_and_up, phantom_template
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.volume import Volume

__all__ = ["straighten_by_landmarks", "straighten_by_points"]

_FARTHEST_DEG = 10.0
"""A refinement that turns the plane farther than this went astray: it pulls in some 6 degrees."""

_LEAST_AGREEMENT = 0.6
_LEAST_SPREAD_MM = 3.0
_SILENT = Report()
_Refined = tuple[MidPlane, Confidence | None, Bone | None, list[str]]


def straighten_by_landmarks(
    volume: Volume,
    sides: Mapping[Side, LandmarkSet],
    *,
    threshold: float | None = None,
    template: HeadTemplate | None = None,
    refine: bool = True,
) -> HeadPose:
    """Find how a head lies in its scan from placed landmarks, such as IN and OI on both sides.

    The mean head of the published atlas is laid onto the points: it gives front, up and pitch. The mid-plane
    is then refined by the symmetry of the bone, if that agrees.

    Parameters
    ----------
    volume : Volume
    sides : mapping of Side to LandmarkSet
        Placed features, frame ``scan``: one pair and IN, or two pairs, at least.
    threshold : float, optional
        Grey value at which bone begins; by default proposed.
    template : HeadTemplate, optional
        What front and up are checked against; by default the synthetic guinea pig.
    refine : bool
        Whether to ask the bone at all.

    Raises
    ------
    HeadPoseError
        There are too few points, or they lie on a line.
    """
    mean, placed, names = _matched(sides)
    left_right = [n for n in names if n != "IN"]
    if not left_right or len(placed) < 3:
        is_none = not any(landmarks.placed for landmarks in sides.values())
        few = (
            "no landmark is placed"
            if is_none
            else "landmarks of one side do not determine the pose of the head"
        )
        raise HeadPoseError(
            few,
            file=volume.path,
            remedy="Place IN, and one feature such as OI or MN on both sides.",
        )
    try:
        scale = _spread(placed) / _spread(mean)
        fit = fit_rigid(scale * mean, placed, dst="scan", src="head").transform
    except GpError as error:
        reason = f"the landmarks do not determine the pose of the head: {error}"
        raise HeadPoseError(reason, file=volume.path) from None
    start = MidPlane.through(fit.translation, fit.rotation[:, 0])
    unrefined: _Refined = (start, None, None, [])
    plane, confidence, bone, warnings = _refined(volume, start, threshold) if refine else unrefined
    axes, origin = axes_in_plane(fit.rotation, plane), plane.nearest(fit.translation)
    if bone is not None and confidence is not None:
        warnings += confidence.warnings
        lying = front_and_up(bone, plane, template or phantom_template(), _SILENT)
        if float(lying.axes[:, 2] @ axes[:, 2]) < 0:
            warnings.append("the bone looks upside down: check whether left and right are exchanged")
    return HeadPose(
        RigidTransform.from_parts(axes, origin, dst="scan", src="head").inverse(),
        "landmarks",
        confidence,
        f"from {', '.join(names)}",
        LEFT_OF_LANDMARKS,
        tuple(warnings),
    )


def straighten_by_points(
    volume: Volume,
    *,
    midline: ArrayLike,
    left: ArrayLike,
    right: ArrayLike,
    threshold: float | None = None,
    template: HeadTemplate | None = None,
) -> HeadPose:
    """Find how a head lies in its scan from a point of its midline and any pair of points.

    The plane halfway between `left` and `right` is refined by the symmetry of the bone. Front, up and pitch
    are the template's.

    Parameters
    ----------
    volume : Volume
    midline, left, right : (3,) array_like, LPS mm
        `left` and `right` are the same place on both sides.
    threshold, template
        As for `straighten`.

    Raises
    ------
    HeadPoseError
        The points are too near to each other, or there is no bone for the refinement.
    """
    m, a, b = (np.asarray(p, dtype=np.float64) for p in (midline, left, right))
    if not np.isfinite([m, a, b]).all() or np.linalg.norm(a - b) < _LEAST_SPREAD_MM:
        raise HeadPoseError(
            "the two points of the pair are too close to each other",
            file=volume.path,
            remedy="Choose a wider pair.",
        )
    start = _halfway_plane(m, a, b)
    plane, confidence, bone, warnings = _refined(volume, start, threshold)
    if bone is None:
        raise HeadPoseError(
            "there is no bone for the refinement", file=volume.path, remedy="Move the threshold."
        )
    known = template or phantom_template()
    pose = pose_in_plane(volume, bone, plane, confidence, known, _SILENT, found_by="points")
    if float(pose.T_head_scan.rotation[0] @ (a - b)) < 0:
        warnings.append("the point given as left is on the right according to the file's orientation")
    return HeadPose(
        pose.T_head_scan, "points", confidence, pose.pitch, pose.left, (*pose.warnings, *warnings)
    )


def _halfway_plane(midline: FloatArray, left: FloatArray, right: FloatArray) -> MidPlane:
    """Return the plane normal to a pair, halfway between the pair's middle and a midline point."""
    normal = (left - right) / np.linalg.norm(left - right)
    return MidPlane.through(((left + right) / 2 + midline) / 2, normal)


def _matched(sides: Mapping[Side, LandmarkSet]) -> tuple[FloatArray, FloatArray, list[str]]:
    """Return the mean head's points (head frame), those placed (N, 3), and the names of pairs and IN."""
    head = mean_animal(Atlas.published())
    names, mean, placed = [], [], []
    left, right = (sides.get(side, LandmarkSet.empty(side)) for side in Side)
    for code in left.placed:
        if code in right and code not in ("IN", "CO"):
            names.append(code)
            for side, landmarks in ((Side.LEFT, left), (Side.RIGHT, right)):
                mean.append(head.side(side)[code])
                placed.append(landmarks[code])
    for landmarks in (left, right):
        if "IN" in landmarks and "IN" not in names:
            names.append("IN")
            mean.append(head.side(Side.LEFT)["IN"])
            placed.append(landmarks["IN"])
    return np.array(mean).reshape(-1, 3), np.array(placed).reshape(-1, 3), names


def _spread(points: FloatArray) -> float:
    return float(np.linalg.norm(points - points.mean(axis=0)))


def _refined(volume: Volume, start: MidPlane, threshold: float | None) -> _Refined:
    """Return the plane that the bone's symmetry leads to from a first one, or that one where it disagrees."""
    try:
        fine, bone = bone_of(volume, threshold)
    except GpError as error:
        return start, None, None, [f"not refined by the bone: {error}"]
    values = GreyValues(fine)
    plane = refined_by_grey_values(values, start)
    agreement = agreement_of(bone, plane)
    before = agreement_of(bone, start)
    if plane.angle_to_deg(start) > _FARTHEST_DEG or agreement.share < max(_LEAST_AGREEMENT, before.share):
        return start, None, bone, ["not refined: the bone's symmetry does not agree with the points"]
    margin, uncertain = agreement.share - before.share, uncertainty_deg(values, plane)
    return plane, Confidence(agreement.share, agreement.overlap, margin, uncertain), bone, []
