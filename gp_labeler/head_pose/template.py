"""Which way is front and up: the bone of a known head is laid onto the bone, within the mid-plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from gp_core.frames import RigidTransform
from gp_core.validation import FloatArray
from gp_labeler.head_pose.bone import Bone, bone_of
from gp_labeler.head_pose.mid_plane import MidPlane
from gp_labeler.head_pose.mirror_search import clipped_distances
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.volume import Volume

__all__ = ["HeadTemplate", "InPlane", "axes_in_plane", "front_and_up", "phantom_template"]

_N_POINTS, _N_COARSE = 5000, 700
_TURN_STEP_DEG = 15.0
_SHIFTS = np.arange(-0.6, 0.61, 0.12)
_KEPT, _FINER = 8, 3
_APART_DEG = 25.0
_SCALES = (0.75, 1.33)
_CLIP_SEARCH, _CLIP_FIT = 6.0, 8.0


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
class _Fit:
    """A template laid onto bone: ``p = scale * R @ q + shift``."""

    scale: float
    rotation: FloatArray
    shift: FloatArray

    def forth(self, points: FloatArray) -> FloatArray:
        moved: FloatArray = self.scale * points @ self.rotation.T + self.shift
        return moved

    def back(self, points: FloatArray) -> FloatArray:
        moved: FloatArray = (points - self.shift) @ self.rotation / self.scale
        return moved


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
    fits = []
    for n, start in enumerate(_starts(bone, plane, template)):
        report(0.3 + 0.4 * n / _KEPT)
        fit = _fitted(bone, template, start, (1.6 * clip, 0.5 * clip), 12, every=4)
        fits.append((_distance_score(bone, template, fit, clip, every=2), fit))
    fits.sort(key=lambda pair: pair[0])
    finer = []
    for n, (_, fit) in enumerate(fits[:_FINER]):
        report(0.7 + 0.3 * n / _FINER)
        fine = _fitted(bone, template, fit, (0.8 * clip, 0.2 * clip), 16, every=2)
        finer.append((_distance_score(bone, template, fine, clip), fine))
    finer.sort(key=lambda pair: pair[0])
    score, best = finer[0]
    others = [score for score, fit in (*finer, *fits) if _angle_deg(fit.rotation, best.rotation) > _APART_DEG]
    axes = axes_in_plane(best.rotation, plane)
    return InPlane(axes, plane.nearest(best.shift), score, min([*others, 1.0]) - score)


def axes_in_plane(rotation: FloatArray, plane: MidPlane) -> FloatArray:
    """Return the axes (columns) nearest to a rotation whose first is normal to the plane."""
    left = plane.normal * np.sign(plane.normal @ rotation[:, 0])
    back = rotation[:, 1] - (rotation[:, 1] @ left) * left
    back /= np.linalg.norm(back)
    return np.stack([left, back, np.cross(left, back)], axis=1)


def _starts(bone: Bone, plane: MidPlane, template: HeadTemplate) -> list[_Fit]:
    """Return distinct turns and shifts of the template in the plane, by a clipped distance field."""
    field, size = clipped_distances(bone, template.radius / _CLIP_SEARCH * bone.radius / template.radius)
    scale = bone.radius / template.radius
    middle = template.points.mean(axis=0) * (0.0, 1.0, 1.0)
    points = scale * (template.points[:_N_COARSE] - middle)
    first, second = np.linalg.svd(plane.normal[None])[2][1:]
    centre = plane.nearest(bone.centre)
    shifts = np.array([centre + bone.radius * (a * first + b * second) for a in _SHIFTS for b in _SHIFTS])
    at_shift = bone.scan.indices(shifts) + 1.0
    scored = []
    for rotation in _turns(plane, first, second):
        offsets = points @ rotation.T @ bone.scan.T_index_scan[:3, :3].T
        index = np.rint(offsets[None] + at_shift[:, None]).astype(np.intp)
        i, j, k = np.moveaxis(np.clip(index, 0, size - 1), -1, 0)
        score = field[(k * size[1] + j) * size[0] + i].mean(axis=1)
        best = int(score.argmin())
        scored.append((float(score[best]), _Fit(scale, rotation, shifts[best] - scale * rotation @ middle)))
    scored.sort(key=lambda pair: pair[0])
    kept: list[_Fit] = []
    for _, fit in scored:
        if all(_angle_deg(fit.rotation, other.rotation) >= _APART_DEG for other in kept):
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


def _angle_deg(first: FloatArray, second: FloatArray) -> float:
    cosine = (float(np.trace(first.T @ second)) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _fitted(
    bone: Bone, template: HeadTemplate, fit: _Fit, widths: tuple[float, float], steps: int, *, every: int
) -> _Fit:
    """Return a fit, with its scale, after ICP in both directions with weights that fall with distance."""
    own, other = template.points[::every], bone.points[::every]
    smallest, largest = (bone.radius / template.radius * s for s in _SCALES)
    for width in np.geomspace(*widths, steps):
        there, back = fit.forth(own), fit.back(other)
        d, j = bone.tree.query(there)
        e, k = template.tree.query(back)
        weights = np.concatenate(
            [
                bone.scan.inside(there) / (1 + (d / width) ** 2) ** 2,
                1 / (1 + (fit.scale * e / width) ** 2) ** 2,
            ]
        )
        weights /= weights.sum()
        a = np.concatenate([own, template.points[k]])
        b = np.concatenate([bone.points[j], other])
        fit = _similarity(a, b, weights, (smallest, largest))
    return fit


def _similarity(a: FloatArray, b: FloatArray, weights: FloatArray, scales: tuple[float, float]) -> _Fit:
    """Return the weighted least-squares similarity from points a to points b (N, 3)."""
    ca, cb = weights @ a, weights @ b
    u, s, vt = np.linalg.svd(((a - ca) * weights[:, None]).T @ (b - cb))
    signs = np.array([1.0, 1.0, np.linalg.det(vt.T @ u.T)])
    rotation = vt.T @ np.diag(signs) @ u.T
    spread = float(weights @ ((a - ca) ** 2).sum(axis=1))
    scale = float(np.clip((s * signs).sum() / spread, *scales))
    return _Fit(scale, rotation, cb - scale * rotation @ ca)


def _distance_score(bone: Bone, template: HeadTemplate, fit: _Fit, clip: float, *, every: int = 1) -> float:
    there = fit.forth(template.points[::every])
    inside = bone.scan.inside(there)
    d = np.minimum(bone.tree.query(there, distance_upper_bound=clip)[0], clip)
    back = fit.back(bone.points[::every])
    e = np.minimum(template.tree.query(back, distance_upper_bound=clip / fit.scale)[0] * fit.scale, clip)
    own = float(d[inside].mean()) if inside.sum() > 50 else clip
    return (own + float(e.mean())) / (2 * clip)
