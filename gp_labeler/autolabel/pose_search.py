"""How a known head lies in a scan: every turn is tried with all shifts at once, and the best are refined.

The surface of the known head's bone is correlated by FFT with a clipped distance field of the bone in the
scan, for about a thousand evenly spread rotations. The best are refined by robust ICP, which takes the field
of view into account. A rotation never mirrors, so a scan stored as its mirror image is not found out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.autolabel.head_surface import HeadSurface
from gp_labeler.head_pose.bone import Bone, coarse_scan, threshold_candidates
from gp_labeler.head_pose.surface_fit import (
    SCALES_OF_A_SPECIES,
    Similarity,
    angle_deg,
    distance_score,
    fit_similarity,
    fit_surface,
)
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.volume import Volume

__all__ = [
    "ACCEPTED",
    "UNCERTAIN",
    "FoundPose",
    "converged",
    "determines_pose",
    "find_pose",
    "pose_from_points",
    "refine_pose",
    "spread_rotations",
]

ACCEPTED, UNCERTAIN = 0.50, 0.57
"""Distance score up to which a pose is taken, and taken with a warning (benchmarks/autolabel.py)."""

LEAST_LEAD, LEAST_SEEN = 0.05, 0.25
"""By how much a pose must fit better than those turned otherwise, and how much of the head must be seen.

On 139 cropped heads (dev-mice), right poses lead by 0.08 at least, wrong ones by less than 0.03.
"""

_N_ROTATIONS = 1152
_CELLS, _VOXELS, _CLIP = 7.0, 14.0, 8.0
"""The template's radius in cells of the search, in voxels of the coarse scan, and over the clip."""

_NEAR_CELLS, _OUTSIDE = 3.0, -0.3
"""Distances are clipped at three cells; a point beyond the scan scores neither well nor badly."""

_APART_DEG, _RIVAL_DEG = 18.0, 25.0
_TRIED, _FINER = 32, 5
_MOST_ROUNDS, _STILL_DEG = 4, 0.5
_MARGIN = 0.6

_LEAST_WIDTH = 0.05
"""How far points must lie from their longest line, over the radius of the head."""


@dataclass(frozen=True, eq=False)
class FoundPose:
    """How a known head lies in a scan.

    Parameters
    ----------
    fit : Similarity
        From the known head's scan to this scan, LPS mm.
    score : float
        0 where the bones meet, 1 where nothing does.
    rival : float
        The least score of a pose that is turned by more than 25 degrees against it.
    seen : float
        Share of the known head that lies in the scan.
    bone : Bone
        What was taken for bone in the scan.
    """

    fit: Similarity
    score: float
    rival: float
    seen: float
    bone: Bone

    @property
    def is_accepted(self) -> bool:
        """Whether it can be trusted, with a warning or without."""
        return not self.refusal

    @property
    def is_certain(self) -> bool:
        """Whether it can be trusted without a warning."""
        return self.score <= ACCEPTED and self.is_accepted

    @property
    def refusal(self) -> str:
        """Why it cannot be trusted, in words; empty where it can."""
        if self.score > UNCERTAIN:
            return f"the bones do not match: score {self.score:.2f}, at most {UNCERTAIN:.2f}"
        if self.seen < LEAST_SEEN:
            return f"only {100 * self.seen:.0f} % of a head would lie in it"
        if self.rival - self.score < LEAST_LEAD:
            return "a different orientation fits nearly as well"
        return ""


def find_pose(volume: Volume, known: HeadSurface, report: Report | None = None) -> FoundPose:
    """Find how a known head lies in a scan.

    Several candidates of the bone threshold are tried; where nothing fits, the islands of bone one by one.

    Parameters
    ----------
    volume : Volume
    known : HeadSurface
        Of a head of the same species.
    report : Report, optional
        Told the fraction done; asked whether to stop.

    Returns
    -------
    FoundPose
        The best; ask it whether it can be trusted.

    Raises
    ------
    GpError
        There is no contrast, or hardly any bone.
    Cancelled
        The report said so.
    """
    report = report or Report()
    best: FoundPose | None = None
    for bone in _bones(volume, known):
        found = _search(bone, known, report)
        if best is None or found.score < best.score:
            best = found
        if best.is_certain:
            break
    assert best is not None
    return converged(best, known)


def _bones(volume: Volume, known: HeadSurface) -> list[Bone]:
    """Return what may be the head's bone: all of it at each threshold, then island by island."""
    scan = coarse_scan(volume, known.radius / _VOXELS)
    together, alone = [], []
    for level in threshold_candidates(scan):
        try:
            first, *others = Bone.islands(scan, level)
        except GpError:
            continue
        together.append(first)
        alone += others
    if not together:
        raise GpError(
            "there is hardly any bone as large as that of the labelled heads",
            file=volume.path,
            remedy="Check the voxel size, and that the scan shows a head of the same species.",
        )
    return [*together, *alone]


def _search(bone: Bone, known: HeadSurface, report: Report) -> FoundPose:
    """Return the best pose in one candidate of the bone."""
    clip = known.radius / _CLIP
    rough = []
    for start in _starts(bone, known, report.part(0.0, 0.7)):
        report.check()
        fit = fit_surface(
            bone, known, start, widths=(1.6 * clip, 0.6 * clip), steps=10, scales=(1.0, 1.0), every=4
        )
        rough.append((distance_score(bone, known, fit, clip, every=4), fit))
    rough.sort(key=lambda pair: pair[0])
    report(0.85)
    fine = []
    for _, start in rough[:_FINER]:
        report.check()
        fine.append(refine_pose(bone, known, start))
    best = min(fine, key=lambda pose: pose.score)
    others = [(pose.score, pose.fit) for pose in fine] + rough
    rivals = [score for score, fit in others if angle_deg(fit.rotation, best.fit.rotation) > _RIVAL_DEG]
    report(1.0)
    return FoundPose(best.fit, best.score, min([*rivals, 1.0]), best.seen, bone)


def refine_pose(bone: Bone, known: HeadSurface, start: Similarity) -> FoundPose:
    """Return the pose of a known head near a first one, with its scale."""
    clip = known.radius / _CLIP
    fit = fit_surface(
        bone, known, start, widths=(clip, 0.2 * clip), steps=24, scales=SCALES_OF_A_SPECIES, every=2
    )
    seen = float(bone.inside(fit.forth(known.points)).mean())
    return FoundPose(fit, distance_score(bone, known, fit, clip), 1.0, seen, bone)


def converged(pose: FoundPose, known: HeadSurface) -> FoundPose:
    """Return a pose that is refined until it stays; its scores, by which it was accepted, are as before.

    One refinement may end some degrees before it has arrived.
    """
    for _ in range(_MOST_ROUNDS):
        again = refine_pose(pose.bone, known, pose.fit)
        turned = angle_deg(again.fit.rotation, pose.fit.rotation)
        pose = replace(pose, fit=again.fit)
        if turned < _STILL_DEG:
            break
    return pose


def pose_from_points(
    volume: Volume, known: HeadSurface, here: FloatArray, there: FloatArray, report: Report | None = None
) -> FoundPose:
    """Find how a known head lies in a scan from three or more points known in both.

    Parameters
    ----------
    volume : Volume
    known : HeadSurface
    here, there : (N, 3) array, LPS mm
        The same points in the scan, and in the known head's scan.
    report : Report, optional
        Asked whether to stop.

    Raises
    ------
    GpError
        The points lie on a line, or there is no bone.
    """
    (report or Report()).check()
    n = len(here)
    if not (determines_pose(here, known) and determines_pose(there, known)):
        raise GpError(
            "the points do not determine the orientation of the head",
            remedy="Place three that are far apart, not on a line.",
        )
    start = fit_similarity(there, here, np.full(n, 1 / n), (1.0, 1.0) if n < 4 else SCALES_OF_A_SPECIES)
    found = (refine_pose(bone, known, start) for bone in _bones(volume, known))
    return converged(min(found, key=lambda pose: pose.score), known)


def determines_pose(points: FloatArray, known: HeadSurface) -> bool:
    """Return whether points (N, 3), mm, say how a known head lies: three or more, and not on a line."""
    if len(points) < 3:
        return False
    width = float(np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1])
    return width >= _LEAST_WIDTH * known.radius


def _starts(bone: Bone, known: HeadSurface, report: Report) -> list[Similarity]:
    """Return distinct rotations, each with its best shift, the best first, by FFT over all shifts."""
    from scipy import fft

    cell = known.radius / _CELLS
    field, low = _clipped_distances(bone, known, cell)
    shape = field.shape
    transformed = fft.rfftn(field)
    offsets = known.points - known.centre
    scored = []
    rotations = spread_rotations(_N_ROTATIONS)
    for n, rotation in enumerate(rotations):
        if n % 64 == 0:
            report(n / len(rotations))
        index = np.floor(offsets @ rotation.T / cell).astype(np.intp) % shape
        flat = np.ravel_multi_index((index[:, 0], index[:, 1], index[:, 2]), shape)
        placed = np.bincount(flat, minlength=field.size).reshape(shape).astype(np.float32)
        score = fft.irfftn(transformed * np.conj(fft.rfftn(placed)), s=shape)
        best = int(score.argmin())
        shift = low + (np.array(np.unravel_index(best, shape)) + 0.5) * cell
        scored.append((float(score.flat[best]), n, shift))
    scored.sort(key=lambda one: one[0])
    kept: list[Similarity] = []
    for _, n, shift in scored:
        rotation = rotations[n]
        if all(angle_deg(rotation, other.rotation) >= _APART_DEG for other in kept):
            kept.append(Similarity(1.0, rotation, shift - rotation @ known.centre))
        if len(kept) == _TRIED:
            break
    return kept


def _clipped_distances(bone: Bone, known: HeadSurface, cell: float) -> tuple[NDArray[np.float32], FloatArray]:
    """Return distances to bone less three cells, at most 0, on a grid [x, y, z], and its corner."""
    from scipy.fft import next_fast_len
    from scipy.ndimage import distance_transform_edt

    margin = _MARGIN * float(np.linalg.norm(known.points - known.centre, axis=1).max())
    low, high = bone.points.min(axis=0) - margin, bone.points.max(axis=0) + margin
    shape = tuple(next_fast_len(int(n), real=True) for n in np.ceil((high - low) / cell))
    empty = np.ones(shape, dtype=bool)
    i, j, k = np.floor((bone.points - low) / cell).astype(np.intp).T
    empty[i, j, k] = False
    near = _NEAR_CELLS * cell
    field = np.minimum(distance_transform_edt(empty, sampling=cell), near) - near
    centres = low + (np.argwhere(np.ones(shape, dtype=bool)) + 0.5) * cell
    field[~bone.inside(centres).reshape(shape)] = _OUTSIDE * near
    return field.astype(np.float32), low


def spread_rotations(n: int) -> FloatArray:
    """Return n rotation matrices (n, 3, 3), nearly evenly spread over all rotations.

    References
    ----------
    Alexa, "Super-Fibonacci spirals: fast, low-discrepancy sampling of SO(3)", CVPR 2022.
    https://doi.org/10.1109/CVPR52688.2022.00811
    """
    from scipy.spatial.transform import Rotation

    root, psi = np.sqrt(2.0), 1.533751168755204288118041
    s = np.arange(n) + 0.5
    inner, outer = np.sqrt(s / n), np.sqrt(1 - s / n)
    alpha, beta = 2 * np.pi * s / root, 2 * np.pi * s / psi
    parts = [inner * np.sin(alpha), inner * np.cos(alpha), outer * np.sin(beta), outer * np.cos(beta)]
    matrices: FloatArray = Rotation.from_quat(np.stack(parts, axis=1)).as_matrix()
    return matrices
