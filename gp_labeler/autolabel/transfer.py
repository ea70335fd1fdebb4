"""The landmarks of one template carried onto a scan: by its pose, the whole head, then region by region."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.autolabel.grey_image import Affine, GreyImage, sampled
from gp_labeler.autolabel.registration import Registration
from gp_labeler.autolabel.settings import Settings
from gp_labeler.autolabel.template import Region, Template, part_of
from gp_labeler.head_pose.bone import CoarseScan
from gp_labeler.head_pose.surface_fit import Similarity
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.volume import Volume

__all__ = ["TargetScan", "carry"]

_LATTICE = 5
_VOLUME_RATIOS = (0.4, 2.5)
"""Of a region over that of the pose: a deformation beyond them is not believed."""

Move = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class TargetScan:
    """A scan that is to be labelled.

    Parameters
    ----------
    volume : Volume
    threshold : float
        Grey value at which bone begins.
    step : float
        mm, at which the whole head is sampled.
    """

    volume: Volume
    threshold: float
    step: float

    @cached_property
    def whole(self) -> CoarseScan:
        """All of it, ready to be sampled."""
        return part_of(self.volume, self.step)


def carry(
    template: Template,
    target: TargetScan,
    pose: Similarity,
    registration: Registration,
    settings: Settings,
    report: Report,
) -> dict[str, FloatArray]:
    """Return where a template's landmarks lie in a scan.

    Parameters
    ----------
    template : Template
    target : TargetScan
    pose : Similarity
        From the template's scan to the target.
    registration : Registration
    settings : Settings
    report : Report

    Returns
    -------
    dict of str to (3,) array
        LPS mm in the target. What the pose puts beyond the edge of the scan stays there: nothing was
        measured there to register, and the cut edges of bone would pull it in.

    Raises
    ------
    Cancelled
        The report said so.
    """
    rigid = Affine(pose.scale * pose.rotation, pose.shift)
    moving = sampled(target.whole, template.image.grid, rigid, target.threshold)
    report(0.1)
    whole = _registered(template.image, moving, rigid, registration, settings.iterations, report)
    names = tuple(template.points)
    found = dict(zip(names, whole(template.array(names)), strict=True))
    for n, region in enumerate(template.regions):
        report(0.5 + 0.5 * n / len(template.regions))
        move = _region_move(region, target, whole, rigid, registration, settings, report)
        if move is not None:
            found.update(zip(region.names, move(template.array(region.names)), strict=True))
    report(1.0)
    posed = rigid(template.array(names))
    is_inside = target.volume.contains(posed)
    return {name: found[name] if is_inside[n] else posed[n] for n, name in enumerate(names)}


def _registered(
    fixed: GreyImage,
    moving: GreyImage,
    first: Affine,
    registration: Registration,
    iterations: str,
    report: Report,
) -> Move:
    """Return the map of points from the template's scan to the target."""
    field = registration.register(
        fixed.values, moving.values, fixed.grid.step, iterations, cancel=report.cancel
    )
    return lambda points: first(fixed.grid.displaced(field, points))


def _region_move(
    region: Region,
    target: TargetScan,
    whole: Move,
    rigid: Affine,
    registration: Registration,
    settings: Settings,
    report: Report,
) -> Move | None:
    """Return the finer map of a region; None where the scan does not hold it, or nothing fits there."""
    grid = region.image.grid
    lattice = grid.lattice(_LATTICE)
    local = Affine.fitted(lattice, whole(lattice))
    ratio = float(np.linalg.det(local.matrix) / np.linalg.det(rigid.matrix))
    if not _VOLUME_RATIOS[0] < ratio < _VOLUME_RATIOS[1]:
        local = Affine(rigid.matrix, whole(lattice).mean(axis=0) - rigid.matrix @ lattice.mean(axis=0))
    corners = local(grid.lattice(2))
    try:
        part = part_of(target.volume, grid.step, np.stack([corners.min(axis=0), corners.max(axis=0)]))
    except GpError:
        return None
    moving = sampled(part, grid, local, target.threshold)
    return _registered(region.image, moving, local, registration, settings.fine_iterations, report)
