"""Both ears of one head: two estimates that check each other without any CT, or that are made one.

Where both ears of a skull were touched in one frame, its mid-sagittal plane follows from the touches: of the
features that were touched on both sides, of IN, and of skull features that are named as lying in it. The
estimate of one ear, mirrored in that plane, should then be that of the other. Skull features that were
touched with both ears tell whether the head moved between them (`gp_core.pose.skull_link`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from gp_core.argument_types import check_fields, checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.constants import CHI2_3_95
from gp_core.errors import GpError
from gp_core.frames import RigidTransform, angle_between_deg, cross_matrix
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.estimate_inputs import EarInputs, EstimateInputs, same_touches
from gp_core.pose.mid_plane import FEWEST_PAIRS, MirrorPlane, mirror_plane
from gp_core.pose.skull_link import SkullLink, link_by_skull
from gp_core.validation import FloatArray

__all__ = [
    "FEWEST_PAIRS",
    "EarCheck",
    "EarComparison",
    "MirrorPlane",
    "check_ears",
    "compare_ears",
    "compared_as",
    "fuse_ears",
    "mirror_plane",
    "not_comparable",
]

_ASYMMETRY_MM, _RESIDUAL_FACTOR = 0.3, 1.5
"""How much the two sides of a head differ, mm per coordinate; factor by which pairs may exceed that."""

_CORRELATION = 0.6
"""Of the errors of the two axes: both ears of an animal differ from the atlas in much the same way."""

_PAIR_ASYMMETRY, _PLANE_ERROR_MM = 1.5, 0.1
"""Variance of a pair over that of its feature between animals, as the authors' animals have it; error of the
plane of the other pairs at a pair, mm per coordinate."""

_PAIR_SQUARED = 16.3
"""Squared Mahalanobis distance of a pair from being mirror images; 1 ordinary pair of 1000 exceeds it."""


@dataclass(frozen=True)
class EarCheck:
    """How the estimates of two ears agree.

    Attributes
    ----------
    plane : MirrorPlane
        The mid-plane.
    origin_mm, axis_deg : float
        Distance of the left origin from the mirrored right one, and angle of the axes.
    expected_mm, expected_deg : float
        What 95 % of heads stay within, by the regions of both estimates and of the plane.
    expected_residual_mm : float
        What the residual of the plane stays within, by the noise of the touches and the asymmetry of heads.
    expected_pairs_mm : mapping of str to float
        What a pair stays within, see `MirrorPlane.pairs_mm`, by the same.
    """

    plane: MirrorPlane
    origin_mm: float
    axis_deg: float
    expected_mm: float
    expected_deg: float
    expected_residual_mm: float
    expected_pairs_mm: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "expected_pairs_mm", MappingProxyType(dict(self.expected_pairs_mm)))

    @property
    def agrees(self) -> bool:
        """Whether both differences, and those of the touched pairs, are within what is expected."""
        within = self.origin_mm <= self.expected_mm and self.axis_deg <= self.expected_deg
        return within and self.plane.residual_mm <= self.expected_residual_mm and not self.suspects

    @property
    def suspects(self) -> tuple[str, ...]:
        """Features whose two touches are no mirror images, the worst first: one of them is a mistouch."""
        limits, apart = self.expected_pairs_mm, self.plane.pairs_mm
        beyond = [code for code in limits if apart[code] > limits[code]]
        return tuple(sorted(beyond, key=lambda code: limits[code] / apart[code]))

    @property
    def text(self) -> str:
        """The check in a sentence."""
        word = "agree" if self.agrees else "DISAGREE"
        limits = (
            f"{self.expected_mm:.2f} mm, {self.expected_deg:.1f} deg and {self.expected_residual_mm:.2f} mm"
        )
        return (
            f"the two ears {word}: CO {self.origin_mm:.2f} mm, axis {self.axis_deg:.1f} deg and touches "
            f"{self.plane.residual_mm:.2f} mm from the mirror image of the other (within {limits}); "
            f"mid-plane from {', '.join(self.plane.codes)}{self._of_suspects()}"
        )

    @property
    def remedy(self) -> str:
        """What to do where the ears disagree."""
        if self.suspects:
            return f"Touch {self.suspects[0]} again on both ears."
        return (
            "Check sides and names. If head and reference moved between the ears, clear the touches of the "
            "other ear."
        )

    def _of_suspects(self) -> str:
        """Say which feature to touch again: the worst, as it draws the plane from which others are judged."""
        if not self.suspects:
            return ""
        code = self.suspects[0]
        return (
            f"; {code} is {self.plane.pairs_mm[code]:.2f} mm from being mirrored "
            f"(within {self.expected_pairs_mm[code]:.2f} mm): touch it again on both ears"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the check for a JSON file, mm and degrees.

        Returns
        -------
        dict
            Plain values.
        """
        return {
            "agrees": self.agrees,
            "text": self.text,
            "origin_mm": self.origin_mm,
            "axis_deg": self.axis_deg,
            "expected_mm": self.expected_mm,
            "expected_deg": self.expected_deg,
            "plane_normal": self.plane.normal.tolist(),
            "plane_offset_mm": self.plane.offset,
            "plane_from": list(self.plane.codes),
            "plane_residual_mm": self.plane.residual_mm,
            "expected_residual_mm": self.expected_residual_mm,
            "pairs_mm": dict(self.plane.pairs_mm),
            "expected_pairs_mm": dict(self.expected_pairs_mm),
            "suspect": list(self.suspects),
        }


@checks_arguments
def check_ears(left: CochleaPose, right: CochleaPose, plane: MirrorPlane) -> EarCheck:
    """Compare the estimates of two ears: each, mirrored in the mid-plane, should be the other.

    Parameters
    ----------
    left, right : CochleaPose
        In one frame.
    plane : MirrorPlane
        See `mirror_plane`.

    Returns
    -------
    EarCheck
        With what is expected of a correct pair.
    """
    mirrored, axis = plane.mirror(right.origin[None])[0], plane.mirror_direction(right.axis)
    apart = float(np.linalg.norm(mirrored - left.origin))
    turned = float(angle_between_deg(axis, left.axis))
    lever = np.linalg.norm(left.origin - right.origin)
    sway = 2 * plane.normal_sd_deg
    of_plane_mm = np.hypot(2 * plane.offset_sd_mm, np.radians(sway) * lever)
    expected_mm = float(np.sqrt(left.radius_95**2 + right.radius_95**2 + CHI2_3_95 * of_plane_mm**2))
    cones = np.degrees([left.cone_95, right.cone_95])
    expected_deg = float(np.sqrt((cones**2).sum() + CHI2_3_95 * sway**2))
    noise = max(left.probe_noise or 0.0, right.probe_noise or 0.0)
    residual_mm = _RESIDUAL_FACTOR * float(np.sqrt(3 * (2 * noise**2 + _ASYMMETRY_MM**2)))
    pairs_mm = _expected_pairs(plane, left, right)
    return EarCheck(plane, apart, turned, expected_mm, expected_deg, residual_mm, pairs_mm)


def _expected_pairs(plane: MirrorPlane, left: CochleaPose, right: CochleaPose) -> dict[str, float]:
    """Return how far a pair may be from being mirror images, by feature: noise, asymmetry and the plane.

    The noise is what the estimates say, or what all other pairs show, whichever is more: six touches hardly
    tell their own.
    """
    codes = list(plane.pairs_mm)
    if not codes:
        return {}
    noise = sum((pose.probe_noise or 0.0) ** 2 for pose in (left, right))
    shown = np.array([plane.rest_mm[code] ** 2 / 3 for code in codes])
    asymmetry = _PAIR_ASYMMETRY * Atlas.published().variances(codes)
    limits = np.sqrt(_PAIR_SQUARED * (asymmetry + np.maximum(noise, shown) + _PLANE_ERROR_MM**2))
    return dict(zip(codes, limits.tolist(), strict=True))


@dataclass(frozen=True)
class EarComparison:
    """Two ears of a head, compared in the frame of the first.

    Attributes
    ----------
    check : EarCheck
        Whether they agree.
    poses : mapping of Side to CochleaPose
        Both, in the frame of the first ear, as they were estimated, each with the finding as its
        `CochleaPose.other_ear`.
    link : SkullLink or None
        What the skull features say that were touched with both ears; None with fewer than three.
    """

    check: EarCheck
    poses: Mapping[Side, CochleaPose]
    link: SkullLink | None = None

    @property
    def texts(self) -> tuple[str, ...]:
        """The findings, a sentence each."""
        return (self.check.text, *([] if self.link is None else [self.link.text]))

    @checks_arguments
    def fused(self, side: Side) -> CochleaPose:
        """Return the estimate of a side with one axis of both ears, as `fuse_ears` makes it.

        Parameters
        ----------
        side : Side
            Which ear.

        Returns
        -------
        CochleaPose
            In the frame of the first ear.

        Raises
        ------
        GpError
            The two ears disagree.
        """
        if not self.check.agrees:
            raise _disagreement(self.check)
        pose = _fused(self.poses[side], self.poses[side.other], self.check.plane)
        inputs = self.poses[side].inputs
        if inputs is None or inputs.other_ear is None:
            return pose
        return replace(pose, inputs=replace(inputs, other_ear=replace(inputs.other_ear, combined=True)))

    @checks_arguments
    def combined_covariance(self, side: Side, covariance: FloatArray) -> FloatArray:
        """Return the covariance of a side once its axis is combined with that of the other ear.

        Parameters
        ----------
        side : Side
            Which ear.
        covariance : (6, 6) array
            Of its own pose, such as after one more touch: origin (mm) and rotation vector (rad), in the frame
            of the first ear.

        Returns
        -------
        (6, 6) array
            The same as `fused` has, where the pose has that covariance.
        """
        return _combination(covariance, self.poses[side].axis, self.poses[side.other], self.check.plane)[1]

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison for a JSON file, mm and degrees.

        Returns
        -------
        dict
            Plain values.
        """
        return {**self.check.as_dict(), "skull": None if self.link is None else self.link.as_dict()}


@checks_arguments
def compare_ears(
    touches: LandmarkSet,
    pose: CochleaPose,
    other_touches: LandmarkSet,
    other_pose: CochleaPose,
    *,
    midline: Iterable[str] = (),
) -> EarComparison:
    """Compare the estimates of two ears of a head that were touched in one frame.

    Skull features that were touched with both ears say whether the head moved against its reference between
    them; if it did, the other ear is moved back by them first.

    Parameters
    ----------
    touches, other_touches : LandmarkSet
        Touches of the two ears, with the skull features that were touched with each, mm.
    pose, other_pose : CochleaPose
        Their estimates.
    midline : iterable of str
        Skull features that lie in the mid-sagittal plane; see `mirror_plane`.

    Returns
    -------
    EarComparison
        In the frame of `touches`.

    Raises
    ------
    GpError
        Both are of one side, or as for `mirror_plane`.

    Examples
    --------
    >>> from gp_core import estimate_pose
    >>> atlas = Atlas.published()
    >>> points = {code: atlas[code] + [0, 6, 0] for code in ("CL", "LLI", "MN", "OS", "RWA", "RWP")}
    >>> left = LandmarkSet.from_touches(points, "L")
    >>> right = LandmarkSet.from_touches({code: p * [1, -1, 1] for code, p in points.items()}, "R")
    >>> compare_ears(left, estimate_pose(left, "L"), right, estimate_pose(right, "R")).check.agrees
    True
    """
    made = _inputs(touches, pose, other_touches, other_pose, tuple(midline))
    link = link_by_skull(touches, other_touches)
    if link is not None and link.T_ear_other is not None:
        other_touches = other_touches.moved(link.T_ear_other)
        other_pose = _moved(other_pose, link.T_ear_other)
    sets = {one.side: one for one in (touches, other_touches)}
    poses = {one.side: one for one in (pose, other_pose)}
    if set(sets) != set(Side) or set(poses) != set(Side):
        raise GpError("two ears of a head are needed, a left and a right one")
    plane = mirror_plane(sets[Side.LEFT], sets[Side.RIGHT], midline=midline)
    check = check_ears(poses[Side.LEFT], poses[Side.RIGHT], plane)
    found = EarComparison(check, poses, link)
    told = {
        side: replace(one, other_ear=found.as_dict(), inputs=made.get(side)) for side, one in poses.items()
    }
    return replace(found, poses=MappingProxyType(told))


def _inputs(
    touches: LandmarkSet,
    pose: CochleaPose,
    other_touches: LandmarkSet,
    other_pose: CochleaPose,
    midline: tuple[str, ...],
) -> dict[Side, EstimateInputs]:
    """Return what the two were made from, each with the other; empty where that is not known."""
    own, other = _own_inputs(touches, pose), _own_inputs(other_touches, other_pose)
    if own is None or other is None:
        return {}
    return {
        pose.side: replace(own, other_ear=EarInputs(other, midline)),
        other_pose.side: replace(other, other_ear=EarInputs(own, midline, in_its_frame=True)),
    }


def _own_inputs(touches: LandmarkSet, pose: CochleaPose) -> EstimateInputs | None:
    """Return what a pose alone was made from; None where it is not known, or was changed since."""
    made = pose.inputs
    if made is None or pose.of_both_ears or not same_touches(made.touches, touches):
        return None
    if made.other_ear is not None and made.other_ear.in_its_frame:
        return None
    return replace(made, other_ear=None)


def compared_as(pose: CochleaPose, other: CochleaPose, ear: EarInputs) -> CochleaPose:
    """Return a pose compared with that of the other ear, and combined with it where that is asked.

    Parameters
    ----------
    pose, other : CochleaPose
        The estimates, with what they were made from.
    ear : EarInputs
        How they are compared.

    Returns
    -------
    CochleaPose
        With the finding as its `other_ear`; with the axis of both ears where that is asked and they agree.

    Raises
    ------
    GpError
        As for `compare_ears`.
    """
    first, second = (other, pose) if ear.in_its_frame else (pose, other)
    assert first.inputs is not None
    assert second.inputs is not None
    found = compare_ears(first.inputs.touches, first, second.inputs.touches, second, midline=ear.midline)
    if ear.combined and found.check.agrees:
        return found.fused(pose.side)
    told = found.poses[pose.side]
    return told if told.inputs is None else replace(told, inputs=replace(told.inputs, other_ear=ear))


def not_comparable(pose: CochleaPose, ear: EarInputs, problem: GpError) -> CochleaPose:
    """Return a pose that says that it cannot be compared with the other ear, so that no robot is sent it.

    Parameters
    ----------
    pose : CochleaPose
        An estimate.
    ear : EarInputs
        How it was to be compared.
    problem : GpError
        Why it cannot be.

    Returns
    -------
    CochleaPose
        The same, with the problem as its `other_ear`.
    """
    told = {"agrees": False, "text": f"the two ears cannot be compared: {problem.problem}"}
    inputs = None if pose.inputs is None else replace(pose.inputs, other_ear=ear)
    return replace(pose, other_ear=told, inputs=inputs)


def _moved(pose: CochleaPose, T: RigidTransform) -> CochleaPose:
    """Return a pose as it lies after a motion within its frame."""
    turn = np.kron(np.eye(2), T.rotation)
    hypotheses = tuple(
        replace(
            one,
            transform_to_touches=T @ one.transform_to_touches,
            covariance=turn @ one.covariance @ turn.T,
        )
        for one in pose.hypotheses
    )
    return replace(
        pose,
        transform_to_touches=T @ pose.transform_to_touches,
        covariance=turn @ pose.covariance @ turn.T,
        T_touches_atlas=None if pose.T_touches_atlas is None else T @ pose.T_touches_atlas,
        hypotheses=hypotheses,
        inputs=None,
    )


@checks_arguments
def fuse_ears(left: CochleaPose, right: CochleaPose, plane: MirrorPlane) -> Mapping[Side, CochleaPose]:
    """Make one estimate of two ears, as a head's two cochleae are nearly mirror images.

    Each axis becomes the mean of its own and of the other's mirror image, weighted by their covariances with
    that of the plane; origins are not changed, since the touches of their own ear determine them far better.

    Parameters
    ----------
    left, right : CochleaPose
        In one frame, with side and names clear.
    plane : MirrorPlane
        See `mirror_plane`.

    Returns
    -------
    mapping of Side to CochleaPose
        The two poses, with smaller cones.

    Raises
    ------
    GpError
        The two ears disagree.
    """
    check = check_ears(left, right, plane)
    if not check.agrees:
        raise _disagreement(check)
    found = _comparison_by(plane, left, right)
    if found is not None:
        return {side: found.fused(side) for side in Side}
    poses = {Side.LEFT: left, Side.RIGHT: right}
    return {side: _fused(pose, poses[side.other], plane) for side, pose in poses.items()}


def _disagreement(check: EarCheck) -> GpError:
    return GpError(f"no estimate is made of both ears: {check.text}", remedy="Touch both ears again.")


def _comparison_by(plane: MirrorPlane, left: CochleaPose, right: CochleaPose) -> EarComparison | None:
    """Return the comparison that leads to this very plane; None where the plane is from elsewhere."""
    if left.inputs is None or right.inputs is None:
        return None
    midline = [name for name in plane.codes if name not in CODES]
    try:
        found = compare_ears(left.inputs.touches, left, right.inputs.touches, right, midline=midline)
    except GpError:
        return None
    moved = found.link is not None and found.link.has_moved
    same = np.array_equal(found.check.plane.normal, plane.normal) and found.check.plane.offset == plane.offset
    return found if same and not moved else None


def _fused(pose: CochleaPose, other: CochleaPose, plane: MirrorPlane) -> CochleaPose:
    gain, covariance = _combination(pose.covariance, pose.axis, other, plane)
    axis = plane.mirror_direction(other.axis)
    step = gain @ np.cross(pose.axis, axis)  # the least rotation from one axis to the other, for small angles
    angle = float(np.linalg.norm(step))
    rotation = _rotation(step, angle) @ pose.transform_to_touches.rotation
    turned = RigidTransform.from_parts(
        rotation, pose.origin, dst=pose.transform_to_touches.dst, src="cochlea"
    )
    return replace(
        pose,
        transform_to_touches=turned,
        covariance=covariance,
        of_both_ears=True,
        inputs=None,
    )


def _combination(
    covariance: FloatArray, axis: FloatArray, other: CochleaPose, plane: MirrorPlane
) -> tuple[FloatArray, FloatArray]:
    """Return the weight of the other ear's axis, (3, 3), and the covariance of the combined pose, (6, 6)."""
    own = covariance[3:, 3:]
    reflection = np.eye(3) - 2 * np.outer(plane.normal, plane.normal)
    # a rotation vector is a pseudo-vector: it mirrors with the opposite sign, its covariance without
    mirrored = reflection @ other.covariance[3:, 3:] @ reflection.T
    theirs = mirrored + _of_plane(plane)
    common = _CORRELATION * min(own, mirrored, key=lambda one: float(np.trace(one)))
    across = np.eye(3) - np.outer(axis, axis)  # nothing is said of the rotation about the axis
    # the best linear combination of two estimates whose errors have a covariance in common
    total = across @ (own + theirs - 2 * common) @ across
    gain = across @ (own - common) @ across @ np.linalg.pinv(total, rcond=1e-9, hermitian=True)
    left_over = np.eye(3) - gain
    combined = covariance.copy()
    shared = left_over @ common @ gain.T
    combined[3:, 3:] = left_over @ own @ left_over.T + gain @ theirs @ gain.T + shared + shared.T
    combined[:3, 3:] = covariance[:3, 3:] @ left_over.T
    combined[3:, :3] = combined[:3, 3:].T
    return gain, (combined + combined.T) / 2


def _of_plane(plane: MirrorPlane) -> FloatArray:
    """Return the covariance of a mirrored direction by that of the plane, rad^2: twice its tilt."""
    across = np.eye(3) - np.outer(plane.normal, plane.normal)
    covariance: FloatArray = (2 * np.radians(plane.normal_sd_deg)) ** 2 * across
    return covariance


def _rotation(vector: FloatArray, angle: float) -> FloatArray:
    if angle == 0:
        return np.eye(3)
    cross = cross_matrix(vector / angle)
    rotation: FloatArray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return rotation
