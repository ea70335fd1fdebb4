"""The mid-sagittal plane from bone alone: mirror images of its surface are laid onto the surface.

All normals and offsets on a grid are scored on a clipped distance field, the best are refined by ICP onto the
mirror image, and the best of those by grey values. After Combès et al., "Automatic symmetry plane estimation
of bilateral objects in point clouds", CVPR 2008, doi:10.1109/CVPR.2008.4587757, with a field of view.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.head_pose.bone import Bone
from gp_labeler.head_pose.distance_field import CLIP
from gp_labeler.head_pose.mid_plane import MidPlane, hemisphere
from gp_labeler.imaging.progress import Report

__all__ = ["Agreement", "agreement_of", "refined_by_points", "search_planes"]

_N_NORMALS, _N_POINTS = 320, 1200
_N_LIKELY, _N_FEW_POINTS = 90, 300
"""All normals are scored with few points, and the likeliest again with all."""

_REACH, _STEP = 0.6, 0.45
"""How far from the centroid planes are tried (in radii), and how densely (in clipping distances)."""


_APART_DEG = 12.0
_KEPT, _FINER = 14, 6
_NEAR = 18.0
"""A mirrored point meets bone within radius / 18."""


@dataclass(frozen=True)
class Agreement:
    """How well the two halves of the bone agree.

    Parameters
    ----------
    share : float
        Of the mirrored surface points that lie in the scan, how many meet bone, 0 to 1.
    overlap : float
        How many of the mirrored surface points lie in the scan, 0 to 1.
    """

    share: float
    overlap: float


def agreement_of(bone: Bone, plane: MidPlane) -> Agreement:
    """Return how well a bone agrees with its mirror image in a plane."""
    mirrored = plane.mirrored(bone.points)
    inside = bone.scan.inside(mirrored)
    if not inside.any():
        return Agreement(0.0, 0.0)
    distance = bone.tree.query(mirrored[inside], distance_upper_bound=bone.radius / _NEAR)[0]
    return Agreement(float(np.isfinite(distance).mean()), float(inside.mean()))


def search_planes(bone: Bone, report: Report) -> list[MidPlane]:
    """Return distinct planes in which a bone may be symmetric, the best first."""
    starts = _scored_on_grid(bone, report.part(0.0, 0.6))
    clip = bone.radius / CLIP
    found = []
    for n, start in enumerate(starts):
        report(0.6 + 0.3 * n / len(starts))
        plane = refined_by_points(bone, start, (1.2 * clip, 0.35 * clip), 8, every=4)
        found.append((_distance_score(bone, plane, clip / 2, every=2), plane))
    found.sort(key=lambda pair: pair[0])
    likely = [plane for _, plane in found[:_FINER]]
    finer = [refined_by_points(bone, plane, (0.5 * clip, 0.12 * clip), 10, every=2) for plane in likely]
    finer.sort(key=lambda plane: _distance_score(bone, plane, clip / 2))
    report(1.0)
    return distinct(finer, 3.0)


def distinct(planes: list[MidPlane], apart_deg: float) -> list[MidPlane]:
    """Return the planes, without those that are near an earlier one."""
    kept: list[MidPlane] = []
    for plane in planes:
        if all(plane.angle_to_deg(other) >= apart_deg for other in kept):
            kept.append(plane)
    return kept


def _scored_on_grid(bone: Bone, report: Report) -> list[MidPlane]:
    offsets = np.arange(-_REACH, _REACH + 1e-9, _STEP / CLIP) * bone.radius
    normals = hemisphere(_N_NORMALS)
    first = [_best_offset(bone, normal, offsets, _N_FEW_POINTS)[0] for normal in normals]
    report(0.4)
    scored = []
    for n in np.argsort(first)[:_N_LIKELY]:
        score, offset = _best_offset(bone, normals[n], offsets, _N_POINTS)
        scored.append((score, MidPlane.through(bone.centre + offset * normals[n], normals[n])))
    report(1.0)
    scored.sort(key=lambda pair: pair[0])
    return distinct([plane for _, plane in scored], _APART_DEG)[:_KEPT]


def _best_offset(bone: Bone, normal: FloatArray, offsets: FloatArray, n_points: int) -> tuple[float, float]:
    """Return the least mean distance of mirror images in planes of one normal, and the plane's offset."""
    field = bone.distances
    points = bone.points[:n_points]
    heights = (points - bone.centre) @ normal
    step = field.T_index_scan[:3, :3] @ normal
    score = field.means(field.indices(points) - 2 * (heights - offsets[:, None])[..., None] * step)
    best = int(score.argmin())
    return float(score[best]), float(offsets[best])


def refined_by_points(
    bone: Bone, plane: MidPlane, widths: tuple[float, float], steps: int, *, every: int = 1
) -> MidPlane:
    """Return the plane that best lays the mirrored surface onto the surface, near a first one.

    Parameters
    ----------
    bone : Bone
    plane : MidPlane
    widths : (float, float)
        Distance, mm, at which a pair of points counts a quarter: in the first and the last step.
    steps : int
    every : int
        Use every n-th point only.
    """
    points = bone.points[::every]
    for width in np.geomspace(*widths, steps):
        mirrored = plane.mirrored(points)
        distance, nearest = bone.tree.query(mirrored)
        partners = bone.points[nearest]
        weights = bone.scan.inside(mirrored) / (1 + (distance / width) ** 2) ** 2
        if weights.sum() < 20:
            break
        weights /= weights.sum()
        centre = weights @ (points + partners) / 2
        cross = ((points - centre) * weights[:, None]).T @ (partners - centre)
        normal = np.linalg.eigh(cross + cross.T)[1][:, 0]
        plane = MidPlane.through(centre, normal * (np.sign(normal @ plane.normal) or 1.0))
    return plane


def _distance_score(bone: Bone, plane: MidPlane, clip: float, *, every: int = 1) -> float:
    """Return the mean clipped distance between mirrored and unmirrored surface, 0 to 1."""
    mirrored = plane.mirrored(bone.points[::every])
    distance = np.minimum(bone.tree.query(mirrored, distance_upper_bound=clip)[0], clip)
    distance[~bone.scan.inside(mirrored)] = clip / 2
    return float(distance.mean() / clip)
