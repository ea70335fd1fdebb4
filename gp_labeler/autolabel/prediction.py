"""Where several templates expect the landmarks of a scan, each by itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.autolabel.confidence import centre_of, spread_of
from gp_labeler.autolabel.pose_search import FoundPose, converged, find_pose, pose_from_points, refine_pose
from gp_labeler.autolabel.registration import Registration
from gp_labeler.autolabel.settings import Settings
from gp_labeler.autolabel.template import Template
from gp_labeler.autolabel.transfer import TargetScan, carry
from gp_labeler.head_pose.surface_fit import SCALES_OF_A_SPECIES, Similarity, fit_similarity
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.volume import Volume

__all__ = ["Carried", "HeadNotFoundError", "Prediction", "predict"]

_TRIED_TEMPLATES = 3
_POSE_SHARE = 0.15

Carried = Mapping[str, FloatArray]
"""Landmarks carried by one template: positions (3,) by name, LPS mm in the target."""


class HeadNotFoundError(GpError):
    """No pose of the head was found that can be trusted."""

    def __init__(self, found: FoundPose, *, file: Path | None = None) -> None:
        super().__init__(
            f"the head was not found in the scan ({found.refusal})",
            file=file,
            remedy="Place three landmarks that are far apart, and run it again.",
        )


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where each of several templates expects the landmarks of a scan.

    Parameters
    ----------
    carried : mapping of str to mapping of str to (3,) array
        By template, then by landmark, LPS mm.
    pose : FoundPose
        Of the best template.
    scores : mapping of str to float
        Of each template's pose.
    """

    carried: Mapping[str, Carried]
    pose: FoundPose | None
    scores: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def names(self) -> tuple[str, ...]:
        """Landmarks that any template has, in the order of the first that has them."""
        return tuple(dict.fromkeys(name for carried in self.carried.values() for name in carried))

    def of(self, name: str) -> FloatArray:
        """Return where the templates expect one landmark, (k, 3)."""
        return np.array([carried[name] for carried in self.carried.values() if name in carried])

    @cached_property
    def centres(self) -> Mapping[str, FloatArray]:
        """Where they agree, (3,) LPS mm, by landmark; see `gp_labeler.autolabel.confidence.centre_of`."""
        return {name: centre_of(self.of(name)) for name in self.names}

    @cached_property
    def spreads(self) -> Mapping[str, float]:
        """How they differ, mm, by landmark; see `gp_labeler.autolabel.confidence.spread_of`."""
        return {name: spread_of(self.of(name)) for name in self.names}


def predict(
    volume: Volume,
    templates: Sequence[Template],
    registration: Registration,
    settings: Settings,
    *,
    placed: Mapping[str, FloatArray] | None = None,
    most: int = 5,
    known: Callable[[Template], Carried | None] = lambda template: None,
    keep: Callable[[Template, Carried], None] = lambda template, carried: None,
    report: Report | None = None,
) -> Prediction:
    """Carry the landmarks of templates onto a scan.

    Parameters
    ----------
    volume : Volume
    templates : sequence of Template
        One or more.
    registration : Registration
    settings : Settings
    placed : mapping of str to (3,) array, optional
        Three or more landmarks that are known in the scan, LPS mm: they say how the head lies.
    most : int
        Of more templates than so many, those are taken whose bone lies on the scan's best.
    known, keep : callable, optional
        Return what a template carried earlier, or None; receive what it carries now.
    report : Report, optional

    Returns
    -------
    Prediction

    Raises
    ------
    HeadNotFoundError
        No pose can be trusted.
    GpError
        There is no template, no contrast, or hardly any bone.
    Cancelled
        The report said so.
    """
    if not templates:
        raise GpError("no labelled scan was given")
    report = report or Report()
    if len(templates) <= most:
        earlier = {template.name: known(template) for template in templates}
        if all(carried is not None for carried in earlier.values()):
            return Prediction(
                {name: carried for name, carried in earlier.items() if carried is not None}, None
            )
    base, pose = _pose(volume, templates, placed or {}, report.part(0.0, _POSE_SHARE))
    poses = {base.name: pose}
    for other in templates:
        report.check()
        if other is not base:
            poses[other.name] = _pose_of(other, base, pose, volume)
    chosen = sorted(templates, key=lambda template: poses[template.name].score)[:most]
    target = TargetScan(volume, pose.bone.threshold, min(t.image.grid.step for t in chosen))
    carried: dict[str, Carried] = {}
    for n, template in enumerate(chosen):
        part = report.part(*(_POSE_SHARE + (1 - _POSE_SHARE) * (n + i) / len(chosen) for i in (0, 1)))
        found = known(template)
        if found is None:
            fit = converged(poses[template.name], template.surface).fit
            found = carry(template, target, fit, registration, settings, part)
            keep(template, found)
        carried[template.name] = found
    return Prediction(carried, pose, {template.name: poses[template.name].score for template in chosen})


def _pose(
    volume: Volume, templates: Sequence[Template], placed: Mapping[str, FloatArray], report: Report
) -> tuple[Template, FoundPose]:
    """Return the pose of the first template that fits well, or of the best of a few."""
    best: tuple[Template, FoundPose] | None = None
    for template in templates[:_TRIED_TEMPLATES]:
        names = [name for name in placed if name in template.points]
        if len(names) >= 3:
            here, there = np.array([placed[name] for name in names]), template.array(tuple(names))
            return template, pose_from_points(volume, template.surface, here, there, report)
        pose = find_pose(volume, template.surface, report)
        if best is None or pose.score < best[1].score:
            best = template, pose
        if pose.is_certain:
            break
    assert best is not None
    if not best[1].is_accepted:
        raise HeadNotFoundError(best[1], file=volume.path)
    return best


def _pose_of(other: Template, base: Template, pose: FoundPose, volume: Volume) -> FoundPose:
    """Return the pose of another template, by the landmarks that it shares with the one that was posed."""
    shared = tuple(name for name in other.points if name in base.points)
    if len(shared) < 3:
        return find_pose(volume, other.surface)
    weights = np.full(len(shared), 1 / len(shared))
    between = fit_similarity(other.array(shared), base.array(shared), weights, SCALES_OF_A_SPECIES)
    start: Similarity = pose.fit.after(between)
    return refine_pose(pose.bone, other.surface, start)
