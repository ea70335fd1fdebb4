"""Where several templates expect the landmarks of a scan, each by itself."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.autolabel.confidence import centre_of, spread_of
from gp_labeler.autolabel.pose_search import (
    UNCERTAIN,
    FoundPose,
    converged,
    determines_pose,
    find_pose,
    pose_from_points,
    refine_pose,
)
from gp_labeler.autolabel.registration import Registration
from gp_labeler.autolabel.settings import Settings
from gp_labeler.autolabel.template import Template
from gp_labeler.autolabel.transfer import TargetScan, carry
from gp_labeler.head_pose.surface_fit import SCALES_OF_A_SPECIES, fit_similarity
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.volume import Volume

__all__ = ["Carried", "HeadNotFoundError", "Prediction", "predict"]

_TRIED_TEMPLATES = 3
_POSE_SHARE = 0.15

_WORSE = 0.08
"""A template's bone does not fit where its score is so much worse than that of the one posed first."""

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
        By template, then by landmark, LPS mm; nothing of a template whose bone does not fit the scan.
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

    @property
    def templates(self) -> tuple[str, ...]:
        """Names of the templates that say something, the most similar first."""
        return tuple(name for name, carried in self.carried.items() if carried)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the templates whose bone does not fit the scan."""
        return tuple(name for name, carried in self.carried.items() if not carried)

    def without(self, templates: Collection[str]) -> Prediction:
        """Return what the other templates say."""
        carried = {name: points for name, points in self.carried.items() if name not in templates}
        return replace(self, carried=carried)

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
        Return what a template carried earlier, or None; receive what it carries now, nothing where its bone
        does not fit the scan.
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
    base, pose = _pose(volume, templates, placed or {}, report.part(0.0, _POSE_SHARE))
    poses = {base.name: pose}
    for other in templates:
        report.check()
        if other is not base:
            poses[other.name] = _pose_of(other, base, pose, volume, report.part(_POSE_SHARE, _POSE_SHARE))
    chosen = sorted(templates, key=lambda template: poses[template.name].score)[:most]
    target = TargetScan(volume, pose.bone.threshold, min(t.image.grid.step for t in chosen))
    carried: dict[str, Carried] = {}
    for n, template in enumerate(chosen):
        part = report.part(*(_POSE_SHARE + (1 - _POSE_SHARE) * (n + i) / len(chosen) for i in (0, 1)))
        found = known(template)
        if found is None:
            own = poses[template.name]
            fit = converged(own, template.surface).fit
            found = carry(template, target, fit, registration, settings, part) if _fits(own, pose) else {}
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


def _pose_of(other: Template, base: Template, pose: FoundPose, volume: Volume, report: Report) -> FoundPose:
    """Return the pose of another template, by the landmarks that it shares with the one that was posed.

    Where they do not determine it, or are wrong in one of the two, it is found by its bone.
    """
    shared = tuple(name for name in other.points if name in base.points)
    there, here = other.array(shared), base.array(shared)
    if determines_pose(there, other.surface) and determines_pose(here, base.surface):
        weights = np.full(len(shared), 1 / len(shared))
        between = fit_similarity(there, here, weights, SCALES_OF_A_SPECIES)
        found = refine_pose(pose.bone, other.surface, pose.fit.after(between))
        if _fits(found, pose):
            return found
    return find_pose(volume, other.surface, report)


def _fits(found: FoundPose, base: FoundPose) -> bool:
    """Return whether a template's bone fits a scan, about as well as that of the template posed first."""
    return found.score <= max(UNCERTAIN, base.score + _WORSE)
