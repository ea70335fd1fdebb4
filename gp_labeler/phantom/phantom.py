"""A synthetic scan of a guinea-pig head with known landmarks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.features import CODES, index_of
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.validation import FloatArray
from gp_labeler.imaging.progress import Progress, Report
from gp_labeler.imaging.volume import Volume
from gp_labeler.phantom import grey
from gp_labeler.phantom.canvas import VoxelCanvas
from gp_labeler.phantom.ear import paint_ear, pinna
from gp_labeler.phantom.jaw import paint_jaw
from gp_labeler.phantom.layout import HeadLayout
from gp_labeler.phantom.loft import skin
from gp_labeler.phantom.objects import holder_of, paint_objects
from gp_labeler.phantom.placing import HeadPlacement, cropped, placement_of
from gp_labeler.phantom.scanner import FILL, distort, stored, with_fill
from gp_labeler.phantom.skull import (
    paint_arches,
    paint_skin,
    paint_skull,
    paint_upper_teeth,
)
from gp_labeler.phantom.tissue import alter_tissue
from gp_labeler.phantom.variation import HeadVariation

__all__ = ["Phantom", "make_phantom"]

_SPACINGS_MM = (0.08, 0.5)
_TILT_DEG = 2.0
_BLUR_MM = 0.08
_AIR_MM = 1.5
_N_SOLIDS = 122
"""What a head is painted of; only the progress that is told depends on it."""

_PAINTED, _PLACED = 0.85, 0.9
"""Share of the time after which the head is painted, and lies in its scan; blur and noise take the rest."""


@dataclass(frozen=True)
class Phantom:
    """A synthetic scan and the truth about it.

    Parameters
    ----------
    volume : Volume
        Grey values as of a micro-CT, 16 bit.
    specimen : Specimen
        True positions of the features on both sides, frame ``scan``; what lies beyond the edge of the scan
        is marked as unseen. In a scan that was mirrored silently, the animal's left ear is still its left.
    T_head_scan : RigidTransform
        From the scan to the head's own frame: x left, y posterior, z superior, cheek teeth level, x = 0 the
        mid-sagittal plane. In a scan that was mirrored silently, x points to what *looks* left.
    seed : int
        The animal and the noise.
    variation : HeadVariation
        What was done.
    """

    volume: Volume
    specimen: Specimen
    T_head_scan: RigidTransform
    seed: int = 0
    variation: HeadVariation = field(default_factory=HeadVariation)


def make_phantom(
    seed: int = 0,
    *,
    spacing: float = 0.2,
    box: FloatArray | None = None,
    specimen: Specimen | None = None,
    noise: float = 900.0,
    variation: HeadVariation | None = None,
    progress: Progress | None = None,
    cancel: Callable[[], bool] | None = None,
) -> Phantom:
    """Make the synthetic scan of a guinea pig drawn from the published atlas.

    Parameters
    ----------
    seed : int
        The animal and the noise, and what a variation leaves to chance; the same seed gives the same voxels.
    spacing : float
        Voxel size, mm.
    box : (2, 3) array, mm, scan frame, optional
        Make this part only, as it lies before any turn; by default the whole head.
    specimen : Specimen, optional
        Make this animal instead of a drawn one: all 20 features on both sides.
    noise : float
        Standard deviation of the noise in grey values; bone is 22000 above soft tissue.
    variation : HeadVariation, optional
        How this head and its scan differ; by default they do not.
    progress, cancel : callable, optional
        Told the fraction done; asked whether to stop.

    Returns
    -------
    Phantom

    Raises
    ------
    GpError
        `spacing` is not between 0.08 and 0.5 mm.
    FeatureError
        `specimen` lacks a feature.
    Cancelled
        `cancel` said so.

    Examples
    --------
    >>> varied = HeadVariation.drawn(7, ["marrow", "turn", "rings"])
    >>> make_phantom(7, spacing=0.5, variation=varied).variation.names
    ('marrow', 'turn', 'rings')
    """
    if not _SPACINGS_MM[0] <= spacing <= _SPACINGS_MM[1]:
        raise GpError(f"spacing must be {_SPACINGS_MM[0]} to {_SPACINGS_MM[1]} mm, got {spacing!r}")
    varied = variation or HeadVariation()
    rng = np.random.default_rng(seed)
    atlas = Atlas.published()
    animal = specimen or draw_animal(atlas, rng=rng, tilt_deg=_TILT_DEG, name=f"phantom-{seed}")
    head = HeadLayout(_scaled(animal, varied.size), atlas)
    report = Report(progress, cancel)
    low, high = _head_box(head, varied, seed) if box is None else box
    painting = report.part(0.0, _PAINTED)
    canvas = VoxelCanvas(low, high, spacing, grey.AIR, report=painting, n_solids=_N_SOLIDS)
    _paint(canvas, head, varied, seed)
    canvas, placement = _placed(canvas, head, varied, seed)
    report(_PLACED)
    distort(canvas, varied, seed)
    scanned = canvas.scanned(rng, blur=_BLUR_MM, noise=noise, report=report.part(_PLACED, 1.0))
    volume, T_stored_scan = _volume(canvas, scanned, varied, seed, animal.name)
    truth = head.specimen
    if varied != HeadVariation():
        truth = _specimen_in(volume, truth, placement, T_stored_scan, varied)
    return Phantom(volume, truth, _head_pose(head, placement, T_stored_scan), seed, varied)


def _scaled(animal: Specimen, factor: float) -> Specimen:
    if factor == 1:
        return animal
    sides = {
        side: LandmarkSet(factor * landmarks.points, side, landmarks.frame)
        for side, landmarks in animal.sides.items()
    }
    return Specimen(animal.name, sides)


def _head_box(head: HeadLayout, variation: HeadVariation, seed: int) -> FloatArray:
    """Return the (2, 3) corners of a box in the scan around the whole head, with some air, mm."""
    parts = [skin(head), *(pinna(ear) for ear in head.ears)]
    holder = holder_of(head, variation, seed)
    parts += [holder] if holder is not None else []
    low = np.min([part.low for part in parts], axis=0)
    high = np.max([part.high for part in parts], axis=0)
    return np.stack([low - _AIR_MM, high + _AIR_MM])


def _paint(canvas: VoxelCanvas, head: HeadLayout, variation: HeadVariation, seed: int) -> None:
    paint_skin(canvas, head)
    paint_skull(canvas, head, variation.bone_thickness)
    paint_arches(canvas, head)
    paint_upper_teeth(canvas, head)
    for ear in head.ears:
        paint_ear(canvas, ear, variation.bone_thickness)
    paint_jaw(canvas, head)
    alter_tissue(canvas, variation, seed)
    paint_objects(canvas, head, variation, seed)


def _placed(
    canvas: VoxelCanvas, head: HeadLayout, variation: HeadVariation, seed: int
) -> tuple[VoxelCanvas, HeadPlacement | None]:
    """Return the voxels of the scan, and how the head got there."""
    placement = placement_of(canvas, head, variation, seed)
    moved = canvas if placement is None else placement.canvas(canvas)
    return (cropped(moved, variation.crop) if variation.crop[0] else moved), placement


def _volume(
    canvas: VoxelCanvas, scanned: NDArray[np.uint16], variation: HeadVariation, seed: int, name: str
) -> tuple[Volume, FloatArray]:
    voxels = with_fill(canvas, scanned, variation.circle) if variation.circle else scanned
    voxels, T_stored_scan, parts = stored(voxels, canvas, variation.mirrored)
    notes = [f"synthetic head, seed {seed}: no animal was scanned"]
    if variation.names:
        notes.append("varied: " + ", ".join(variation.names))
    fill = float(FILL) if variation.circle else None
    return Volume.from_parts(voxels, name=name, notes=tuple(notes), fill=fill, **parts), T_stored_scan


def _specimen_in(
    volume: Volume,
    animal: Specimen,
    placement: HeadPlacement | None,
    T_stored_scan: FloatArray,
    variation: HeadVariation,
) -> Specimen:
    """Return the true landmarks where they lie in the scan; those beyond its edge are unseen."""
    sides = {}
    for side, landmarks in animal.sides.items():
        points = landmarks.points if placement is None else placement.points(landmarks.points)
        points = points @ T_stored_scan[:3, :3].T + T_stored_scan[:3, 3]
        hidden = np.zeros(len(points), dtype=bool)
        if variation.crop[0] or variation.circle:
            values = volume.values_at(points)
            hidden = np.isnan(values) | (values == volume.fill)
        unseen = frozenset(code for code, gone in zip(CODES, hidden, strict=True) if gone and code != "CO")
        points = np.where(hidden[:, None], np.nan, points)
        points[index_of("CO")] = np.nan
        seen = LandmarkSet(points, side, landmarks.frame, unseen=unseen)
        sides[side] = with_cochlea_origin(seen)
    return Specimen(animal.name, sides)


def _head_pose(
    head: HeadLayout, placement: HeadPlacement | None, T_stored_scan: FloatArray
) -> RigidTransform:
    """Return ``T_head_scan``; where the scan is a mirror image, of the head that the scan shows."""
    origin, axes = head.shift, head.rotation
    if placement is not None:
        origin, axes = placement.rigidly(origin), placement.rotation @ axes
    mirror = T_stored_scan[:3, :3]
    if np.linalg.det(mirror) < 0:
        axes = mirror @ axes * (-1.0, 1.0, 1.0)
    origin = mirror @ origin + T_stored_scan[:3, 3]
    return RigidTransform.from_parts(axes, origin, dst="scan", src="head").inverse()
