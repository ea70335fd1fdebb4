"""The pose of a head found by itself, from the symmetry of its bone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.validation import FloatArray
from gp_labeler.head_pose.bone import (
    COARSER,
    Bone,
    CoarseScan,
    coarse_scan,
    finest_step,
    threshold_above,
    threshold_candidates,
)
from gp_labeler.head_pose.grey_refinement import GreyValues, refined_by_grey_values, uncertainty_deg
from gp_labeler.head_pose.holder import without_holders
from gp_labeler.head_pose.mid_plane import MidPlane
from gp_labeler.head_pose.mirror_search import Agreement, agreement_of, search_planes
from gp_labeler.head_pose.result import (
    DOUBTFUL_DEG,
    MOST_DEG,
    Confidence,
    HeadPose,
    HeadPoseError,
    SeveralHeadsError,
)
from gp_labeler.head_pose.template import HeadTemplate, InPlane, front_and_up, phantom_template
from gp_labeler.imaging.progress import Progress, Report
from gp_labeler.imaging.volume import Volume

__all__ = ["left_of_file", "pose_in_plane", "straighten"]

_REFINED = 4
_RIVAL_DEG = 8.0
_LEAST_OVERLAP = 0.25
_WHOLE = (0.65, 0.7, 0.12)
"""Least agreement, overlap and margin of a head that lies in the scan as a whole."""

_PART = (0.82, 0.4, 0.1)
"""The same where much of the head is missing: agreement must be higher."""

_CLEAR = (0.58, 0.6, 0.2)
"""The same where no other plane comes near: some of the head may be missing, or bone be ragged."""

_LEAST_CUT = 0.02
"""Share of the surface of a cropped head that lies at the edge of the scan, at least; 0.04 to 0.25 mostly."""

_GAIN, _LATE_GAIN = 0.15, 0.04
"""By how much the fit of grey values raises agreement, overlap or margin at most, and the whole fit after the
quick one; what is farther behind is left."""

_THIN_MARGIN = 0.03
_MUCH_THICKER = 2.0
_FAILED = "the head could not be straightened by its symmetry"
_BESIDE = "another large part of bone lies beside the head: check that this is the head that you mean"


@dataclass(frozen=True, eq=False)
class _Found:
    plane: MidPlane
    confidence: Confidence
    bone: Bone
    lies_beside: bool = False
    """Whether another large part of bone lies beside it that is no head."""

    @property
    def accepted(self) -> bool:
        return self._passes(0.0)

    def is_hopeless(self, gain: float) -> bool:
        """Whether a fit that raises each figure by so much will not make it acceptable either."""
        return not self._passes(gain)

    @property
    def may_be_several(self) -> bool:
        """Whether much of the bone has no mirror image in the scan, though the scan's edge cuts no bone."""
        return self._lacks_an_image(0.0)

    def _lacks_an_image(self, slack: float) -> bool:
        return self.confidence.overlap + slack < _WHOLE[1] and self.bone.share_at_edge < _LEAST_CUT

    def _passes(self, slack: float) -> bool:
        c = self.confidence
        if c.uncertainty_deg > MOST_DEG or self._lacks_an_image(slack):
            return False
        return any(
            c.agreement + slack >= agreement and c.overlap + slack >= overlap and c.margin + slack >= margin
            for agreement, overlap, margin in (_WHOLE, _PART, _CLEAR)
        )


def straighten(
    volume: Volume,
    *,
    threshold: float | None = None,
    box: ArrayLike | None = None,
    near: ArrayLike | None = None,
    template: HeadTemplate | None = None,
    progress: Progress | None = None,
    cancel: Callable[[], bool] | None = None,
) -> HeadPose:
    """Find how a head lies in its scan, from the symmetry of its bone.

    Parameters
    ----------
    volume : Volume
    threshold : float, optional
        Grey value at which bone begins; by default two candidates are tried.
    box : (2, 3) array_like, LPS mm, optional
        Look at this part of the scan only: without a holder, a second head.
    near : (3,) array_like, LPS mm, optional
        A point in the head that is meant, in a scan of several.
    template : HeadTemplate, optional
        A known head that says which way is front and up, and the pitch; by default the synthetic guinea pig.
    progress, cancel : callable, optional
        Told the fraction done; asked whether to stop.

    Returns
    -------
    HeadPose

    Raises
    ------
    HeadPoseError
        No plane was found that can be trusted; the message says why and asks for points.
    SeveralHeadsError
        The scan contains several heads, and `near` does not say which one is meant.
    GpError
        There is no bone, no contrast, or nothing in the box.
    Cancelled
        `cancel` said so.
    """
    report = Report(progress, cancel)
    report(0.0)
    step = finest_step(volume)
    fine = coarse_scan(volume, step, box)
    coarse = coarse_scan(volume, COARSER * step, box)
    coarse = fine if coarse.grid.shape == fine.grid.shape else coarse  # as large: one is enough
    meant = None if near is None else np.asarray(near, dtype=np.float64).reshape(3)
    found = _mid_plane(fine, coarse, threshold, meant, volume, report.part(0.05, 0.7))
    known = template or phantom_template()
    lying = front_and_up(found.bone, found.plane, known, report.part(0.7, 1.0))
    _check_together(found, lying, volume)
    pose = _posed(volume, found.bone, lying, found.confidence, known)
    return replace(pose, warnings=(*pose.warnings, _BESIDE)) if found.lies_beside else pose


def _check_together(found: _Found, lying: InPlane, volume: Volume) -> None:
    """Raise `HeadPoseError` where neither the plane nor front and up are clear enough for each other."""
    unclear = [lying.margin < _THIN_MARGIN, not _dense_in_front(found.bone, lying)]
    if all(unclear):
        raise HeadPoseError(f"{_FAILED}: it does not show which way is front and up", file=volume.path)
    if any(unclear) and found.bone.scan.is_noisy:
        raise HeadPoseError(
            f"{_FAILED}: in so much noise it is not clear which way is front and up", file=volume.path
        )
    if any(unclear) and found.confidence.uncertainty_deg > DOUBTFUL_DEG:
        raise HeadPoseError(
            f"{_FAILED}: its parts do not agree on one plane, and the template does not decide",
            file=volume.path,
        )
    if any(unclear) and found.confidence.margin < _CLEAR[2]:
        raise HeadPoseError(
            f"{_FAILED}: it is nearly as symmetric in another plane, and the template does not decide",
            file=volume.path,
        )


def _mid_plane(
    fine: CoarseScan,
    coarse: CoarseScan,
    threshold: float | None,
    meant: FloatArray | None,
    volume: Volume,
    report: Report,
) -> _Found:
    """Return the first plane without a warning, else the least uncertain, over thresholds and islands."""
    tried: list[_Found] = []
    fine, coarse, levels = _without_holders(fine, coarse, threshold)
    for islands in _islands_at(levels, fine, coarse):
        heads, apart = _separate_heads(islands, report)
        if len(heads) > 1 and meant is None:
            raise SeveralHeadsError([head.bone.centre for head in heads], file=volume.path)
        if heads:
            found = _meant_head(heads, apart, meant, islands, report)
            return replace(found, lies_beside=len(apart) > len(heads))
        for bone in islands.searched:
            found = islands.plane_of(bone, report)
            tried.append(found)
            if found.accepted and not found.confidence.warnings:
                return found
    accepted = [found for found in tried if found.accepted]
    if accepted:
        return min(accepted, key=lambda found: found.confidence.uncertainty_deg)
    raise HeadPoseError(_why(max(tried, key=lambda f: f.confidence.agreement)), file=volume.path)


def _without_holders(
    fine: CoarseScan, coarse: CoarseScan, threshold: float | None
) -> tuple[CoarseScan, CoarseScan, tuple[float, ...]]:
    """Return both copies without holders, and the thresholds to try, which holders are not asked about."""

    def levels_in(scan: CoarseScan) -> tuple[float, ...]:
        return _levels(scan) if threshold is None else (threshold,)

    with_holders = levels_in(coarse)
    bare = without_holders(coarse, with_holders)
    finer = bare if fine is coarse else without_holders(fine, with_holders)
    return finer, bare, with_holders if bare is coarse else levels_in(bare)


@dataclass(frozen=True, eq=False)
class _Islands:
    """Bone above one threshold, in the copy of the scan that is searched, and in the one for the last fit."""

    searched: list[Bone]
    fine: CoarseScan
    level: float
    _planes: dict[Bone, _Found] = field(default_factory=dict)

    @classmethod
    def above(cls, level: float, fine: CoarseScan, coarse: CoarseScan) -> _Islands:
        return cls(Bone.islands(coarse, level), fine, level)

    def plane_of(self, bone: Bone, report: Report) -> _Found:
        """Return the best plane of one of the islands searched, which is looked for once."""
        if bone not in self._planes:
            self._planes[bone] = _best_plane(bone, self, report)
        return self._planes[bone]

    @cached_property
    def _refined(self) -> list[Bone]:
        is_same_copy = self.searched[0].scan is self.fine
        return self.searched if is_same_copy else Bone.islands(self.fine, self.level)

    def counterpart(self, bone: Bone) -> Bone:
        """Return the bone of the finer copy that is the same island."""

        def unlike(other: Bone) -> float:
            return float(np.linalg.norm(other.centre - bone.centre)) + abs(other.radius - bone.radius)

        return min(self._refined, key=unlike)


def _islands_at(levels: Sequence[float], fine: CoarseScan, coarse: CoarseScan) -> list[_Islands]:
    """Return the bone above each threshold, the likeliest first; raises `GpError` where there is none at all.

    What is much thicker than what lies above the next threshold is a head with its flesh: it is symmetric,
    too, but less exactly, and the template of a skull does not fit it.
    """
    found, problem = [], None
    for level in levels:
        try:
            found.append(_Islands.above(level, fine, coarse))
        except GpError as error:
            problem = error
    if problem is not None and not found:
        raise problem
    thickness = [islands.searched[0].thickness for islands in found]
    return found[::-1] if thickness[0] > _MUCH_THICKER * thickness[-1] else found


def _separate_heads(islands: _Islands, report: Report) -> tuple[list[_Found], list[Bone]]:
    """Return the mid-plane of each head beside another large part of bone, and all such parts."""
    rivals = islands.searched[1:]
    apart = [b for b in rivals if any(b.is_apart_from(other) for other in rivals if other is not b)]
    found = [islands.plane_of(bone, report) for bone in apart]
    return [head for head in found if head.accepted], apart


def _meant_head(
    heads: list[_Found],
    apart: list[Bone],
    meant: FloatArray | None,
    islands: _Islands,
    report: Report,
) -> _Found:
    """Return the only head, or the one that a point lies nearest to, with its jaw and what else is near."""
    own = heads[0]
    if meant is not None:
        own = min(heads, key=lambda head: float(np.linalg.norm(head.bone.centre - meant)))
    others = [bone for bone in apart if bone is not own.bone]
    found = _best_plane(own.bone.with_what_is_near(islands.searched[0], others), islands, report)
    return found if found.accepted else own


def _levels(scan: CoarseScan) -> tuple[float, ...]:
    """Return two thresholds to try, where there are two."""
    levels = threshold_candidates(scan)
    further = threshold_above(scan, levels[0]) if len(levels) == 1 else None
    return levels if further is None else (*levels, further)


def _best_plane(bone: Bone, islands: _Islands, report: Report) -> _Found:
    """Return the plane in which the two halves agree best, and its lead over the others.

    Most of the time goes into the fit of grey values, so it is spent only on planes that may be accepted: a
    quick fit first, of those that may turn out to be the best, then the whole fit of the best one.
    """
    judged = [(agreement_of(bone, plane), plane) for plane in search_planes(bone, report.part(0.0, 0.6))]
    judged = judged[:_REFINED]
    found = _leading(bone, judged)
    if found.is_hopeless(_GAIN):
        return found
    values = GreyValues(islands.counterpart(bone))
    least = found.confidence.agreement - _GAIN
    for n, (agreement, plane) in enumerate(judged):
        report(0.6 + 0.3 * n / len(judged))
        if agreement.share >= least:
            plane = refined_by_grey_values(values, plane, quick=True)
            judged[n] = (agreement_of(bone, plane), plane)
    found = _leading(bone, judged)
    if found.is_hopeless(_LATE_GAIN):
        return found
    report(0.9)
    others = [pair for pair in judged if pair[1] is not found.plane]
    plane = refined_by_grey_values(values, found.plane)
    found = _leading(bone, [(agreement_of(bone, plane), plane), *others])
    uncertain = uncertainty_deg(values, found.plane)
    return replace(found, confidence=replace(found.confidence, uncertainty_deg=uncertain))


def _leading(bone: Bone, judged: list[tuple[Agreement, MidPlane]]) -> _Found:
    """Return the best plane, and its lead over those of other directions."""
    seen = [pair for pair in judged if pair[0].overlap >= _LEAST_OVERLAP] or judged
    best, plane = max(seen, key=lambda pair: pair[0].share)
    rivals = [a.share for a, other in seen if other.angle_to_deg(plane) > _RIVAL_DEG]
    margin = best.share - max([*rivals, 0.0])
    return _Found(plane, Confidence(best.share, best.overlap, margin), bone)


def _why(found: _Found) -> str:
    c = found.confidence
    if found.may_be_several:
        reason = (
            f"{100 * (1 - c.overlap):.0f} % of the bone has no mirror image in the scan, though the edge of "
            "the scan cuts no bone: there may be more than one head"
        )
    elif c.overlap < _WHOLE[1]:
        reason = f"only {100 * c.overlap:.0f} % of the bone has a mirror image within the scan"
    elif c.agreement < _WHOLE[0]:
        reason = f"only {100 * c.agreement:.0f} % of the bone meets its mirror image"
    elif c.uncertainty_deg > MOST_DEG:
        reason = f"its parts do not agree on one plane: it is uncertain by {c.uncertainty_deg:.0f} degrees"
    else:
        reason = "it is nearly as symmetric in another plane"
    return f"{_FAILED}: {reason}"


def pose_in_plane(
    volume: Volume,
    bone: Bone,
    plane: MidPlane,
    confidence: Confidence | None,
    template: HeadTemplate,
    report: Report,
    *,
    found_by: str,
) -> HeadPose:
    """Return the pose of a head whose mid-plane is known; front, up and pitch are the template's."""
    return _posed(volume, bone, front_and_up(bone, plane, template, report), confidence, template, found_by)


def _posed(
    volume: Volume,
    bone: Bone,
    lying: InPlane,
    confidence: Confidence | None,
    template: HeadTemplate,
    found_by: str = "symmetry",
) -> HeadPose:
    warnings = [] if confidence is None else list(confidence.warnings)
    if lying.margin < _THIN_MARGIN or not _dense_in_front(bone, lying):
        warnings.append("front and up are uncertain: check that the nose points forward and the teeth down")
    return HeadPose(
        RigidTransform.from_parts(lying.axes, lying.origin, dst="scan", src="head").inverse(),
        found_by,
        confidence,
        f"proposed from {template.name}",
        left_of_file(volume),
        tuple(warnings),
    )


def _dense_in_front(bone: Bone, lying: InPlane) -> bool:
    """Whether the densest bone, the teeth, lies in front of the middle of all bone."""
    values = bone.scan.grid[bone.mask]
    places = bone.scan.places(bone.index)
    densest = places[values >= np.quantile(values, 0.985)]
    forward: FloatArray = -lying.axes[:, 1]
    return float((densest.mean(axis=0) - places.mean(axis=0)) @ forward) > 0


def left_of_file(volume: Volume) -> str:
    """Return what left and right are taken from, in words."""
    grid = "a left-handed grid" if volume.is_mirrored else "a right-handed grid"
    return f"the file's orientation ({grid}); nothing in the scan can prove it"
