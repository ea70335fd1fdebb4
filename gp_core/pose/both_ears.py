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
from numpy.typing import ArrayLike

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.constants import CHI2_3_95
from gp_core.errors import GpError
from gp_core.frames import RigidTransform, angle_between_deg, cross_matrix
from gp_core.landmarks.features import CODES, EXTERNAL, Side, feature
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.skull_link import SkullLink, link_by_skull
from gp_core.validation import FloatArray, as_points, as_vectors, freeze_arrays

__all__ = [
    "FEWEST_PAIRS",
    "EarCheck",
    "EarComparison",
    "MirrorPlane",
    "check_ears",
    "compare_ears",
    "fuse_ears",
    "mirror_plane",
]

FEWEST_PAIRS = 3
"""So many features must be touched on both sides for a mid-plane."""

_PAIR_SD_MM = 0.5
"""Standard deviation by which the two sides of a head differ in a touched feature, mm a coordinate."""

_ASYMMETRY_MM, _RESIDUAL_FACTOR = 0.3, 1.5
"""How much the two sides of a head differ, mm a coordinate; factor by which pairs may exceed that."""

_CORRELATION = 0.6
"""Of the errors of the two axes: both ears of an animal differ from the atlas in much the same way."""

_PAIR_ASYMMETRY, _PLANE_ERROR_MM = 1.5, 0.1
"""Variance of a pair over that of its feature between animals, as the authors' animals have it; error of the
plane of the other pairs at a pair, mm a coordinate."""

_PAIR_SQUARED = 16.3
"""Squared Mahalanobis distance of a pair from being mirror images; 1 ordinary pair of 1000 exceeds it."""


@dataclass(frozen=True)
class MirrorPlane:
    """The mid-sagittal plane of a head, from touches of both ears.

    Attributes
    ----------
    normal : (3,) array
        Unit normal, towards the left ear, in the frame of the touches.
    offset : float
        The plane is ``normal @ x = offset``, mm.
    residual_mm : float
        RMS distance of the pairs from being mirror images.
    codes : tuple of str
        Features that it is made from.
    normal_sd_deg, offset_sd_mm : float
        Standard deviation of its direction, and of its place at the middle of the pairs.
    pairs_mm : mapping of str to float
        By feature, how far its two touches are from being mirror images in the plane of all *other* features;
        empty where too few are left for that.
    rest_mm : mapping of str to float
        By feature, the RMS distance of those others.
    """

    normal: FloatArray
    offset: float
    residual_mm: float
    codes: tuple[str, ...]
    normal_sd_deg: float
    offset_sd_mm: float
    pairs_mm: Mapping[str, float] = field(default_factory=dict)
    rest_mm: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze_arrays(self)
        for name in ("pairs_mm", "rest_mm"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def mirror(self, points: ArrayLike) -> FloatArray:
        """Return points mirrored in the plane.

        Parameters
        ----------
        points : (N, 3) array_like
            In the frame of the touches, mm.

        Returns
        -------
        (N, 3) array
            Their mirror images, mm.
        """
        rows = as_points(points, "points", missing_allowed=True)
        mirrored: FloatArray = rows - 2 * np.outer(rows @ self.normal - self.offset, self.normal)
        return mirrored

    def mirror_direction(self, vector: ArrayLike) -> FloatArray:
        """Return a direction mirrored in the plane.

        Parameters
        ----------
        vector : (..., 3) array_like
            In the frame of the touches.

        Returns
        -------
        (..., 3) array
            Of the same length.
        """
        given = as_vectors(vector, "a direction")
        mirrored: FloatArray = given - 2 * (given @ self.normal)[..., None] * self.normal
        return mirrored


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
        return (
            f"the two ears {word}: CO {self.origin_mm:.2f} mm and axis {self.axis_deg:.1f} deg from the "
            f"mirror image of the other (within {self.expected_mm:.2f} mm, {self.expected_deg:.1f} deg), "
            f"pairs {self.plane.residual_mm:.2f} mm (within {self.expected_residual_mm:.2f} mm); "
            f"mid-plane from {', '.join(self.plane.codes)}{self._of_suspects()}"
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
def mirror_plane(left: LandmarkSet, right: LandmarkSet, *, midline: Iterable[str] = ()) -> MirrorPlane:
    """Return the mid-sagittal plane of a head from touches of both ears, in one frame.

    Parameters
    ----------
    left, right : LandmarkSet
        Touches of the two sides, mm.
    midline : iterable of str
        Skull features (``S1``, ...) that lie in the plane, touched with either ear.

    Returns
    -------
    MirrorPlane
        In the frame of the touches.

    Raises
    ------
    GpError
        The frames differ, fewer than three features were touched on both sides, a feature of the midline was
        not touched, or the pairs do not lie about one plane.

    Examples
    --------
    >>> from gp_core import Atlas
    >>> atlas = Atlas.published()
    >>> points = {code: atlas[code] + [0, 20, 0] for code in ("CL", "MN", "OS", "RWA")}
    >>> left = LandmarkSet.from_mapping(points, "L", frame="tracker")
    >>> mirrored = {code: point * [1, -1, 1] for code, point in points.items()}
    >>> right = LandmarkSet.from_mapping(mirrored, "R", frame="tracker")
    >>> bool(mirror_plane(left, right).normal[1] > 0.999)
    True
    """
    _check_sides(left, right)
    codes = tuple(c for c in EXTERNAL if c in left and c in right and not feature(c).shared)
    if len(codes) < FEWEST_PAIRS:
        raise GpError(
            f"the mid-plane needs {FEWEST_PAIRS} features that are touched on both sides, got {len(codes)}",
            remedy="Touch the same features on both ears.",
        )
    shared = [c for c in EXTERNAL if feature(c).shared and (c in left or c in right)]
    middle = {name: _shared_point(left, right, name) for name in (*shared, *midline)}
    plane = _plane_of(left, right, codes, middle)
    pairs_mm, rest_mm = {}, {}
    if len(codes) > FEWEST_PAIRS:
        for code in codes:
            others = _plane_of(left, right, tuple(c for c in codes if c != code), middle)
            image = others.mirror(right[code][None])[0]
            pairs_mm[code] = float(np.linalg.norm(image - left[code]))
            rest_mm[code] = others.residual_mm
    return replace(plane, pairs_mm=pairs_mm, rest_mm=rest_mm)


def _plane_of(
    left: LandmarkSet, right: LandmarkSet, codes: tuple[str, ...], middle: Mapping[str, FloatArray]
) -> MirrorPlane:
    """Return the plane of some pairs, and of points that lie in it."""
    one, other = left.array(codes), right.array(codes)
    half = (one - other) / 2
    on_plane = np.vstack([(one + other) / 2, *middle.values()])
    normal = _normal(half, on_plane)
    offset = float((on_plane @ normal).mean())
    plane = MirrorPlane(normal, offset, 0.0, (*codes, *middle), 0.0, 0.0)
    residual = float(np.sqrt(((plane.mirror(other) - one) ** 2).sum(axis=1).mean()))
    # each pair turns the normal by its error over its width, as a lever
    levers = float(np.sqrt((half**2).sum() + ((on_plane - on_plane.mean(axis=0)) ** 2).sum()))
    spread = max(_PAIR_SD_MM, residual / np.sqrt(3)) / np.sqrt(2)
    return replace(
        plane,
        residual_mm=residual,
        normal_sd_deg=float(np.degrees(spread / levers)),
        offset_sd_mm=float(spread / np.sqrt(len(on_plane))),
    )


def _normal(half: FloatArray, on_plane: FloatArray) -> FloatArray:
    """Return the direction that half distances of pairs have, and that points of the plane do not."""
    about = on_plane - on_plane.mean(axis=0)
    values, vectors = np.linalg.eigh(half.T @ half - about.T @ about)
    normal: FloatArray = vectors[:, -1]
    along = half @ normal
    if values[-1] <= 0 or np.abs(along).min() <= 0 or abs(np.sign(along).sum()) < len(along):
        raise GpError(
            "the touches of the two ears do not lie about one plane",
            remedy="Check sides and names; touch both ears without moving the head.",
        )
    return normal if along[0] > 0 else -normal


def _shared_point(left: LandmarkSet, right: LandmarkSet, name: str) -> FloatArray:
    """Return a point of the plane: the mean of its touches with both ears."""
    found = [point for one in (left, right) if (point := one.extra.get(name)) is not None]
    found += [one[name] for one in (left, right) if name in CODES and name in one]
    if not found:
        raise GpError(
            f"{name} is to lie in the mid-plane, and was touched with neither ear",
            remedy="Name skull features that were touched, such as S1.",
        )
    points: FloatArray = np.mean(found, axis=0)
    return points


def _check_sides(left: LandmarkSet, right: LandmarkSet) -> None:
    if (left.side, right.side) != (Side.LEFT, Side.RIGHT):
        raise GpError(f"the touches must be of the left and of the right, got {left.side} and {right.side}")
    if left.frame != right.frame:
        raise GpError(f"the ears were touched in different frames, {left.frame} and {right.frame}")


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
        Both, in the frame of the first ear, as they were estimated.
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
        return fuse_ears(self.poses[Side.LEFT], self.poses[Side.RIGHT], self.check.plane)[side]

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
    return EarComparison(check, MappingProxyType(poses), link)


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
        raise GpError(f"no estimate is made of both ears: {check.text}", remedy="Touch both ears again.")
    poses = {Side.LEFT: left, Side.RIGHT: right}
    return {side: _fused(pose, poses[side.other], plane) for side, pose in poses.items()}


def _fused(pose: CochleaPose, other: CochleaPose, plane: MirrorPlane) -> CochleaPose:
    own = pose.covariance[3:, 3:]
    reflection = np.eye(3) - 2 * np.outer(plane.normal, plane.normal)
    # a rotation vector is a pseudo-vector: it mirrors with the opposite sign, its covariance without
    mirrored = reflection @ other.covariance[3:, 3:] @ reflection.T
    theirs = mirrored + _of_plane(plane)
    common = _CORRELATION * min(own, mirrored, key=lambda one: float(np.trace(one)))
    axis = plane.mirror_direction(other.axis)
    turn = np.cross(pose.axis, axis)  # the least rotation from one axis to the other, for small angles
    across = np.eye(3) - np.outer(pose.axis, pose.axis)  # nothing is said of the rotation about the axis
    # the best linear combination of two estimates whose errors have a covariance in common
    total = across @ (own + theirs - 2 * common) @ across
    gain = across @ (own - common) @ across @ np.linalg.pinv(total, rcond=1e-9, hermitian=True)
    step = gain @ turn
    angle = float(np.linalg.norm(step))
    rotation = _rotation(step, angle) @ pose.transform_to_touches.rotation
    turned = RigidTransform.from_parts(
        rotation, pose.origin, dst=pose.transform_to_touches.dst, src="cochlea"
    )
    left_over = np.eye(3) - gain
    covariance = pose.covariance.copy()
    shared = left_over @ common @ gain.T
    covariance[3:, 3:] = left_over @ own @ left_over.T + gain @ theirs @ gain.T + shared + shared.T
    covariance[:3, 3:] = covariance[:3, 3:] @ left_over.T
    covariance[3:, :3] = covariance[:3, 3:].T
    return replace(
        pose,
        transform_to_touches=turned,
        covariance=(covariance + covariance.T) / 2,
        of_both_ears=True,
        inputs=None,
    )


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
