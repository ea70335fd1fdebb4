"""A click on a coarse surface, brought to the surface of the full data."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.imaging.mesh import Surface, SurfaceHit
from gp_labeler.imaging.surface import box_around, extract_isosurface
from gp_labeler.imaging.volume import Volume

__all__ = ["refined_hit"]

_REACH = 2.5
"""Half the edge of the box that is meshed at full resolution, in voxels of the coarse surface."""

_SPECK_MM = 0.15
_MOST_CROSSINGS = 16


def refined_hit(volume: Volume, threshold: float, hit: SurfaceHit, direction: ArrayLike) -> SurfaceHit:
    """Return where a ray meets the isosurface of the full data, near where it met a coarser surface.

    A small box is meshed at full resolution, in some milliseconds.

    Parameters
    ----------
    volume : Volume
        The scan.
    threshold : float
        Grey value where bone begins.
    hit : SurfaceHit
        Where; it is returned itself where that surface is at full resolution.
    direction : (3,) array_like
        Of the ray, away from the eye.

    Returns
    -------
    SurfaceHit
        `hit` itself, too, where there is no surface near it in the full data.
    """
    if hit.stride == 1:
        return hit
    reach = _REACH * hit.stride * max(volume.spacing)
    try:
        fine = extract_isosurface(volume, threshold, box=box_around(hit.point, reach), smallest_mm=_SPECK_MM)
    except GpError:
        return hit
    along = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    seen = [
        found
        for found in _crossings(fine, hit.point - 1.8 * reach * along, along)
        if found.normal @ along < 0
    ]
    if not seen:
        return fine.project(hit.point)
    return min(seen, key=lambda found: float(np.linalg.norm(found.point - hit.point)))


def _crossings(surface: Surface, start: FloatArray, along: FloatArray) -> list[SurfaceHit]:
    """Return where a ray meets a surface, all along."""
    found: list[SurfaceHit] = []
    step = 1e-3 * surface.voxel_mm
    while len(found) < _MOST_CROSSINGS and (hit := surface.pick(start, along)) is not None:
        found.append(hit)
        start = hit.point + step * along
    return found
