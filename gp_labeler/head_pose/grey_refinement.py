"""The mid-plane to a fraction of a voxel: grey values near bone are laid onto their mirror image."""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.head_pose.bone import Bone
from gp_labeler.head_pose.mid_plane import MidPlane

__all__ = ["GreyValues", "refined_by_grey_values", "uncertainty_deg"]

_N_POINTS = 12_000
_BLUR_VOXELS = 1.0
_FITS = ((0.18, 4), (0.105, 1))
"""Two fits: the difference, bone being 1 and soft tissue 0, at which a point begins to count less, and of how
many points each uses one."""

_MOST_STEPS = 25


class GreyValues:
    """Clipped grey values of a scan, and points near the surface of its bone; made once for several planes.

    Parameters
    ----------
    bone : Bone
        In the finer copy of the scan.
    """

    def __init__(self, bone: Bone) -> None:
        from scipy.ndimage import binary_dilation, binary_erosion, gaussian_filter

        grid, threshold = bone.scan.grid, bone.threshold
        sample = grid[::2, ::2, ::2]
        below, above = sample[sample < threshold], sample[sample > threshold]
        soft, bright = (float(np.median(v)) if v.size else threshold for v in (below, above))
        low = max(threshold - (bright - soft) / 2, soft)
        high = max(bright, 2 * threshold - low)
        self.bone = bone
        self.grey_values = gaussian_filter(np.clip((grid - low) / max(high - low, 1e-6), 0, 1), _BLUR_VOXELS)
        shell = binary_dilation(bone.mask) & ~binary_erosion(bone.mask)
        places = np.argwhere(shell)
        chosen = places[np.random.default_rng(0).permutation(len(places))[:_N_POINTS]]
        self.own = self.grey_values[tuple(chosen.T)].astype(np.float64)
        T = bone.scan.T_scan_index
        self.points: FloatArray = chosen[:, ::-1] @ T[:3, :3].T + T[:3, 3]

    def halves(self, plane: MidPlane) -> list[GreyValues]:
        """Return the front and the back half of the points, the upper and the lower, the outer and the inner.

        Each has points on both sides of the plane, and half of them.
        """
        across = np.linalg.svd(plane.normal[None])[2][1:]
        in_plane = (self.points - self.points.mean(axis=0)) @ across.T
        along = in_plane @ np.linalg.svd(in_plane, full_matrices=False)[2].T
        measures = (*along.T, np.abs(plane.heights(self.points)))
        return [self._only(half) for m in measures for half in (m > np.median(m), m <= np.median(m))]

    def _only(self, chosen: NDArray[np.bool_]) -> GreyValues:
        part = copy(self)
        part.points, part.own = self.points[chosen], self.own[chosen]
        return part

    def differences(self, plane: MidPlane, *, every: int = 1) -> FloatArray:
        """Return how much brighter the mirror image of every n-th point is; 0 beyond the scan."""
        mirrored = plane.mirrored(self.points[::every])
        found: FloatArray = self.bone.scan.sampled(self.grey_values, mirrored) - self.own[::every]
        found[~self.bone.scan.inside(mirrored)] = 0.0
        return found


def refined_by_grey_values(values: GreyValues, plane: MidPlane, *, quick: bool = False) -> MidPlane:
    """Return the plane whose mirror image agrees best, near a first one: two angles and an offset.

    Parameters
    ----------
    values : GreyValues
    plane : MidPlane
        Within some six degrees; farther off it may not be pulled in.
    quick : bool
        To a few tenths of a degree only, in a fifth of the time: to choose between planes.
    """
    from scipy.optimize import least_squares

    bone = values.bone
    step = float(bone.scan.spacing.mean())
    across = np.linalg.svd(plane.normal[None])[2][1:]
    centre = plane.nearest(bone.centre)

    def moved(p: FloatArray) -> MidPlane:
        normal = plane.normal + (p[:2] / bone.radius) @ across
        return MidPlane.through(centre + p[2] * plane.normal, normal)

    def residuals(p: FloatArray, every: int) -> FloatArray:
        return values.differences(moved(p), every=every)

    def slopes(p: FloatArray, every: int) -> FloatArray:
        h = 0.5 * step
        columns = [(residuals(p + d, every) - residuals(p - d, every)) / (2 * h) for d in h * np.eye(3)]
        return np.stack(columns, axis=1)

    found = np.zeros(3)
    for width, every in _FITS[:1] if quick else _FITS:
        found = least_squares(
            residuals,
            found,
            jac=slopes,
            args=(every,),
            loss="cauchy",
            f_scale=width,
            x_scale=step,
            xtol=1e-4,
            ftol=1e-5,
            max_nfev=_MOST_STEPS,
        ).x
    return moved(found)


def uncertainty_deg(values: GreyValues, plane: MidPlane) -> float:
    """Return the standard deviation of a plane's direction, degrees, as the halves of the head tell it.

    The plane is fitted again to each half of the points. Where bone alone is symmetric, they agree within a
    degree; where a holder, or what is too coarse to be told from it, pulls at the plane, they do not. The
    deviations from the whole, squared, are on average the variance (McCarthy, "Pseudo-replication: half
    samples", 1969).

    Parameters
    ----------
    values : GreyValues
    plane : MidPlane
        The one fitted to all points, by `refined_by_grey_values`.
    """
    halves = values.halves(plane)
    away = [refined_by_grey_values(half, plane, quick=True).angle_to_deg(plane) for half in halves]
    return float(np.sqrt(np.mean(np.square(away))))
