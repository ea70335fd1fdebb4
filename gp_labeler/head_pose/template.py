"""Which way is front and up: the bone of a known head is laid onto the bone, within the mid-plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.frames import RigidTransform
from gp_core.validation import FloatArray
from gp_labeler.head_pose.bone import Bone, bone_of
from gp_labeler.head_pose.mid_plane import MidPlane
from gp_labeler.head_pose.surface_fit import (
    SCALES_OF_A_SPECIES,
    Similarity,
    angle_deg,
    distance_score,
    fit_surface,
)
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.volume import Volume

__all__ = ["HeadTemplate", "InPlane", "axes_in_plane", "front_and_up", "phantom_template"]

_N_POINTS, _N_COARSE = 5000, 700
_TURN_STEP_DEG = 15.0
_SHIFTS = np.arange(-0.6, 0.61, 0.12)
_KEPT, _FINER = 8, 3
_APART_DEG = 25.0
_CLIP_FIT = 8.0
_SAME_SPECIES = (0.6, 1.67)
"""Ratios of two radii that a cropped scan explains: the sizes of the heads themselves may be alike."""

_ALIKE = 0.05


@dataclass(frozen=True, eq=False)
class HeadTemplate:
    """The surface of a known head's bone, made symmetric.

    Parameters
    ----------
    points : (N, 3) array, mm
        In the head's frame (left, posterior, superior).
    radius : float
        Root mean square distance of the bone from its centroid, mm.
    name : str
        What head it is, in words.
    """

    points: FloatArray
    radius: float
    name: str

    @classmethod
    def of(
        cls, volume: Volume, T_head_scan: RigidTransform, *, threshold: float | None = None
    ) -> HeadTemplate:
        """Make a template of a scan whose head pose is known."""
        bone = bone_of(volume, threshold)[0]
        points = T_head_scan.apply(bone.points)
        both = np.concatenate([points, points * (-1.0, 1.0, 1.0)])
        order = np.random.default_rng(0).permutation(len(both))[:_N_POINTS]
        return cls(both[order], bone.radius, volume.name)

    @cached_property
    def tree(self) -> Any:
        """A search tree of the points."""
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    def inside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return that all points (N, 3) could have been seen: the template is a whole head."""
        return np.ones(len(points), dtype=bool)


@cache
def phantom_template() -> HeadTemplate:
    """Return the template of the mean guinea pig of the published atlas; made once, in a second."""
    from gp_core.atlas.atlas import Atlas
    from gp_core.atlas.sampling import mean_animal
    from gp_labeler.phantom import make_phantom

    mean = mean_animal(Atlas.published(), name="the synthetic guinea pig")
    phantom = make_phantom(spacing=0.5, specimen=mean, noise=0.0)
    return HeadTemplate.of(phantom.volume, phantom.T_head_scan)


@dataclass(frozen=True, eq=False)
class InPlane:
    """Front and up in a mid-plane.

    Parameters
    ----------
    axes : (3, 3) array
        Columns: left, posterior and superior in the scan; left is normal to the mid-plane.
    origin : (3,) array, LPS mm
        Where the template's origin comes to, on the mid-plane.
    score : float
        0 where the template lies on the bone, 1 where nothing fits.
    margin : float
        How much worse the best fit that is turned by more than 25 degrees is.
    """

    axes: FloatArray
    origin: FloatArray
    score: float
    margin: float


def front_and_up(bone: Bone, plane: MidPlane, template: HeadTemplate, report: Report) -> InPlane:
    """Return how a template lies in a mid-plane of a bone."""
    clip = bone.radius / _CLIP_FIT
    tried = _scales(bone, template)
    scales = (SCALES_OF_A_SPECIES[0] * min(tried), SCALES_OF_A_SPECIES[1] * max(tried))
    fits = []
    starts = [start for scale in tried for start in _starts(bone, plane, template, scale)]
    for n, start in enumerate(_distinct(starts)):
        report(0.3 + 0.4 * n / _KEPT)
        fit = fit_surface(
            bone, template, start, widths=(1.6 * clip, 0.5 * clip), steps=12, scales=scales, every=4
        )
        fits.append((distance_score(bone, template, fit, clip, every=2), fit))
    fits.sort(key=lambda pair: pair[0])
    finer = []
    for n, (_, fit) in enumerate(fits[:_FINER]):
        report(0.7 + 0.3 * n / _FINER)
        fine = fit_surface(
            bone, template, fit, widths=(0.8 * clip, 0.2 * clip), steps=16, scales=scales, every=2
        )
        finer.append((distance_score(bone, template, fine, clip), fine))
    finer.sort(key=lambda pair: pair[0])
    score, best = finer[0]
    others = [score for score, fit in (*finer, *fits) if angle_deg(fit.rotation, best.rotation) > _APART_DEG]
    axes = axes_in_plane(best.rotation, plane)
    return InPlane(axes, plane.nearest(best.shift), score, min([*others, 1.0]) - score)


def _scales(bone: Bone, template: HeadTemplate) -> tuple[float, ...]:
    """Return about how large a head may be over a template.

    The radius of its bone alone does not say it: that of a head of which 30 % are cropped is 0.7 to 0.9, and
    a template made so much smaller came to lie up to 24 degrees off in pitch.
    """
    ratio = bone.radius / template.radius
    is_same_species = _SAME_SPECIES[0] < ratio < _SAME_SPECIES[1]
    return (1.0, ratio) if is_same_species and abs(ratio - 1) > _ALIKE else (ratio,)


def axes_in_plane(rotation: FloatArray, plane: MidPlane) -> FloatArray:
    """Return the axes (columns) nearest to a rotation whose first is normal to the plane."""
    left = plane.normal * np.sign(plane.normal @ rotation[:, 0])
    back = rotation[:, 1] - (rotation[:, 1] @ left) * left
    back /= np.linalg.norm(back)
    return np.stack([left, back, np.cross(left, back)], axis=1)


_Start = tuple[float, Similarity]


def _starts(bone: Bone, plane: MidPlane, template: HeadTemplate, scale: float) -> list[_Start]:
    """Return turns of the template in the plane, each with its best shift and its clipped distance."""
    field = bone.distances
    middle = template.points.mean(axis=0) * (0.0, 1.0, 1.0)
    points = scale * (template.points[:_N_COARSE] - middle)
    first, second = np.linalg.svd(plane.normal[None])[2][1:]
    centre = plane.nearest(bone.centre)
    shifts = np.array([centre + bone.radius * (a * first + b * second) for a in _SHIFTS for b in _SHIFTS])
    at_shift = field.indices(shifts)
    scored = []
    for rotation in _turns(plane, first, second):
        offsets = points @ rotation.T @ field.T_index_scan[:3, :3].T
        score = field.means(offsets[None] + at_shift[:, None])
        best = int(score.argmin())
        scored.append(
            (float(score[best]), Similarity(scale, rotation, shifts[best] - scale * rotation @ middle))
        )
    return scored


def _distinct(scored: list[_Start]) -> list[Similarity]:
    """Return the best starts that are turned otherwise than those before."""
    kept: list[Similarity] = []
    for _, fit in sorted(scored, key=lambda pair: pair[0]):
        if all(angle_deg(fit.rotation, other.rotation) >= _APART_DEG for other in kept):
            kept.append(fit)
    return kept[:_KEPT]


def _turns(plane: MidPlane, first: FloatArray, second: FloatArray) -> list[FloatArray]:
    """Return all rotations, in steps, whose first column is normal to the plane."""
    turns = []
    for angle in np.radians(np.arange(0.0, 360.0, _TURN_STEP_DEG)):
        back = np.cos(angle) * first + np.sin(angle) * second
        turns += [
            np.stack([left, back, np.cross(left, back)], axis=1) for left in (plane.normal, -plane.normal)
        ]
    return turns
