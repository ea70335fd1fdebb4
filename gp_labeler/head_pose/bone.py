"""A scan made coarse, and the surface of its bone as points: what a head's pose is found from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.head_pose.distance_field import DistanceField
from gp_labeler.head_pose.holder import without_holders
from gp_labeler.imaging.threshold import propose_threshold
from gp_labeler.imaging.volume import Volume

__all__ = [
    "COARSER",
    "Bone",
    "CoarseScan",
    "bone_of",
    "coarse_scan",
    "finest_step",
    "threshold_above",
    "threshold_candidates",
]

_Values = NDArray[np.float32]
_Mask = NDArray[np.bool_]

_VOXELS_ACROSS = 110
"""Of the finer copy, along its middle edge: 0.4 mm in a guinea pig's head."""

COARSER = 1.5
"""Cubes of the search over those of the refinement."""

_N_POINTS = 4000
_SMALLEST_ISLAND = 0.05
_MOST_ISLANDS, _RIVAL_SHARE = 6, 0.2
"""Islands that are looked at by themselves, at most, and their size over that of the largest, at least."""

_APART_RADII = 0.8
"""Distance of two heads over both radii, at least."""

_NORMAL_MEDIAN = 0.6745
"""Median of what noise of standard deviation 1 differs from its mean by."""

_NOISY, _BLUR_VOXELS = 0.05, 1.0
"""Noise over the range of grey values above which a copy is smoothed, and by how much."""

_FEWEST_NOISY = 0.1
"""Share of the second differences that are not 0, at least, in a scan with noise."""

_RING_VOXELS = 8.0
"""How far around a voxel its slice tells what it would be without a ring, or a wider shade."""

_BLURRED_VOXELS = 2
"""How far what is left out brightens its surroundings."""

_EDGE_VOXELS = 1.0
"""How near to the edge of the scan bone is cut by it."""

_FEWEST_VOXELS = 500
_TAILS_PERCENT = (0.5, 99.9)
_SAMPLES = 500_000
_APART = 1.25
"""How much farther from the dark end a second candidate of the threshold must be to be worth a try."""


_BRIGHTER = 1.4
"""How many times brighter bone is than soft tissue, at least."""


@dataclass(frozen=True, eq=False)
class CoarseScan:
    """A scan of cubes of voxels.

    Parameters
    ----------
    grid : (nz, ny, nx) float32 array
        Grey values.
    T_scan_index : (4, 4) array
        From an index (i, j, k) to LPS mm; an index names the centre of its cube.
    measured : (nz, ny, nx) bool array, optional
        Where the scanner measured; None: everywhere.
    is_noisy : bool
        Whether noise was so strong that the grey values were smoothed.
    """

    grid: _Values
    T_scan_index: FloatArray
    measured: _Mask | None = None
    is_noisy: bool = False

    @cached_property
    def T_index_scan(self) -> FloatArray:  # noqa: N802 - a transform keeps its name
        """(4, 4) from LPS mm to index."""
        return np.asarray(np.linalg.inv(self.T_scan_index), dtype=np.float64)

    @property
    def spacing(self) -> FloatArray:
        """(3,) mm along i, j, k."""
        lengths: FloatArray = np.linalg.norm(self.T_scan_index[:3, :3], axis=0)
        return lengths

    @property
    def extent(self) -> FloatArray:
        """(3,) mm: how long the scan is along i, j, k."""
        return self.spacing * self.grid.shape[::-1]

    def indices(self, points: FloatArray) -> FloatArray:
        """Return the indices (N, 3), fractions, of points (N, 3), LPS mm."""
        found: FloatArray = points @ self.T_index_scan[:3, :3].T + self.T_index_scan[:3, 3]
        return found

    def places(self, index: NDArray[Any]) -> FloatArray:
        """Return the centres (N, 3) of voxels (N, 3) named by i, j, k, LPS mm."""
        return np.asarray(index @ self.T_scan_index[:3, :3].T + self.T_scan_index[:3, 3])

    def inside(self, points: FloatArray) -> _Mask:
        """Return which points (N, 3) lie where the scanner measured."""
        index = np.rint(self.indices(points)).astype(np.intp)
        size = np.array(self.grid.shape[::-1])
        there = np.all((index >= 0) & (index < size), axis=1)
        if self.measured is not None:
            i, j, k = np.clip(index, 0, size - 1).T
            there &= self.measured[k, j, i]
        return np.asarray(there)

    def islands_above(self, level: float) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return which island above a grey value each measured voxel is of, and how many voxels each has.

        Returns
        -------
        numbers : (nz, ny, nx) int array
            0 outside all islands.
        sizes : (n + 1,) int array
            Of island 0, that is none, 0.
        """
        from scipy.ndimage import label

        above = self.grid > level
        if self.measured is not None:
            above &= self.measured
        numbers, n = label(above, structure=np.ones((3, 3, 3)))
        sizes = np.bincount(numbers.ravel(), minlength=n + 1)
        sizes[0] = 0
        return numbers, sizes

    def without(self, part: _Mask) -> CoarseScan:
        """Return the scan as if a part, and what it blurs into, had not been measured."""
        from scipy.ndimage import binary_dilation

        measured = np.ones(part.shape, dtype=bool) if self.measured is None else self.measured
        return replace(self, measured=measured & ~binary_dilation(part, iterations=_BLURRED_VOXELS))

    def sampled(self, values: _Values, points: FloatArray) -> FloatArray:
        """Return values of the grid at points (N, 3), interpolated."""
        from scipy.ndimage import map_coordinates

        index = self.indices(points)[:, ::-1].T
        found: FloatArray = map_coordinates(values, index, order=1, mode="nearest", output=np.float64)
        return found


def finest_step(volume: Volume) -> float:
    """Return the edge of the cubes, mm, that are fine enough for the pose of a head that fills the scan."""
    extent = np.sort(np.array(volume.size) * volume.spacing)
    return float(extent[1]) / _VOXELS_ACROSS


def coarse_scan(volume: Volume, step: float, box: ArrayLike | None = None) -> CoarseScan:
    """Return a scan, or the part of it in a box, in cubes of about `step` mm.

    Parameters
    ----------
    volume : Volume
    step : float
        mm; along a longer edge of the voxels, the voxels stay as they are. Strong noise is smoothed.
    box : (2, 3) array_like, LPS mm, optional

    Raises
    ------
    GpError
        The box holds none of the scan.
    """
    first, last = _index_range(volume, box)
    part = volume.array[first[2] : last[2], first[1] : last[1], first[0] : last[0]]
    whole = np.floor(step / np.array(volume.spacing) + 1e-6).astype(int)
    factors = np.clip(whole, 1, last - first)
    to_volume = np.eye(4)
    to_volume[:3, :3] = np.diag(factors)
    to_volume[:3, 3] = first + (factors - 1) / 2
    measured = None if volume.fill is None else _block_means(part != volume.fill, factors) > 0.5
    grid = _block_means(part, factors)
    is_noisy = _noise(grid) > _NOISY
    grid = _without_noise(grid) if is_noisy else grid
    return CoarseScan(grid, volume.T_scan_voxel @ to_volume, measured, is_noisy)


def _without_noise(grid: _Values) -> _Values:
    """Return grey values smoothed, without rings: what is alike in most slices, unlike what is around it."""
    from scipy.ndimage import gaussian_filter

    surroundings = gaussian_filter(grid, (0.0, _RING_VOXELS, _RING_VOXELS))
    return gaussian_filter(grid - np.median(grid - surroundings, axis=0), _BLUR_VOXELS)


def _noise(grid: _Values) -> float:
    """Return the standard deviation of noise over the range of grey values.

    It is taken from second differences along the noisiest axis, the median of those that are not 0: what is
    constant, such as a fill, has none. Where nearly all are 0, the rest are edges, and there is no noise.
    """
    low, high = (float(v) for v in np.percentile(grid[::2, ::2, ::2], _TAILS_PERCENT))
    if not low < high:
        return 0.0
    differences = [np.abs(np.diff(grid, 2, axis=axis)) for axis in range(3) if grid.shape[axis] > 2]
    medians = [float(np.median(d[d > 0])) for d in differences if (d > 0).mean() > _FEWEST_NOISY]
    return max([*medians, 0.0]) / (_NORMAL_MEDIAN * float(np.sqrt(6.0)) * (high - low))


def _index_range(volume: Volume, box: ArrayLike | None) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first voxel (3,) of a box, and the one after the last."""
    size = np.array(volume.size, dtype=np.intp)
    if box is None:
        return np.zeros(3, dtype=np.intp), size
    low, high = np.asarray(box, dtype=np.float64).reshape(2, 3)
    corners = low + np.array(list(np.ndindex(2, 2, 2))) * (high - low)
    index = volume.scan_to_voxel(corners)
    first = np.clip(np.ceil(index.min(axis=0)), 0, size).astype(np.intp)
    last = np.clip(np.floor(index.max(axis=0)) + 1, 0, size).astype(np.intp)
    if np.any(last - first < 2):
        raise GpError(
            "the box contains no part of the scan", file=volume.path, remedy="Draw it around the head."
        )
    return first, last


def _block_means(values: NDArray[Any], factors: NDArray[np.intp]) -> _Values:
    """Return the means of blocks of (fx, fy, fz) voxels of a (z, y, x) array, without what is left over."""
    if len(set(factors.tolist())) == 1:
        array = values.view(np.uint8) if values.dtype == bool else values
        from gp_labeler.imaging.coarse import means_of_cubes  # numba takes long to import: not at start-up

        return means_of_cubes(array, int(factors[0]))
    fx, fy, fz = (int(f) for f in factors)
    nz, ny, nx = (n // f for n, f in zip(values.shape, (fz, fy, fx), strict=True))
    out = np.empty((nz, ny, nx), np.float32)
    for k in range(nz):
        slab = values[k * fz : (k + 1) * fz, : ny * fy, : nx * fx].mean(axis=0, dtype=np.float32)
        out[k] = slab.reshape(ny, fy, nx, fx).mean(axis=(1, 3))
    return out


def threshold_candidates(scan: CoarseScan) -> tuple[float, ...]:
    """Return the grey values at which bone may begin, the likeliest first.

    The upper cut of three classes of the square root of the grey values, and the third of four where that is
    clearly higher: bone among tissue that is bright itself.

    Raises
    ------
    GpError
        All voxels have the same value.
    """
    from skimage.filters import threshold_multiotsu

    roots, low, high = _roots(scan)
    if len(np.unique(roots)) < 4:
        return (float(low + high) / 2,)
    three = float(threshold_multiotsu(roots, classes=3, nbins=128)[1] ** 2)  # type: ignore[no-untyped-call]
    four = float(threshold_multiotsu(roots, classes=4, nbins=128)[2] ** 2)  # type: ignore[no-untyped-call]
    return (three + low, four + low) if four > _APART * three else (three + low,)


def threshold_above(scan: CoarseScan, level: float) -> float | None:
    """Return the cut of what is brighter than a level, which may cut fat from muscle; None if there is none.

    What lies above the cut must be much brighter than what lies below it.
    """
    from skimage.filters import threshold_otsu

    roots, low, _ = _roots(scan)
    above = roots[roots**2 > level - low]
    if len(np.unique(above)) < 3:
        return None
    cut = float(threshold_otsu(above, nbins=128))  # type: ignore[no-untyped-call]
    dark, bright = (float(np.square(part).mean()) for part in (above[above <= cut], above[above > cut]))
    return cut**2 + low if bright > _BRIGHTER * dark else None


def _roots(scan: CoarseScan) -> tuple[_Values, float, float]:
    """Return square roots of grey values over the darkest, some of them, and the darkest and brightest."""
    values = scan.grid.ravel() if scan.measured is None else scan.grid[scan.measured]
    values = values[:: max(1, values.size // _SAMPLES)]
    low, high = (float(v) for v in np.percentile(values, _TAILS_PERCENT)) if values.size else (0.0, 0.0)
    if not low < high:
        raise GpError("the scan has no contrast", remedy="Check that the right series or folder was opened.")
    return np.sqrt(np.clip(values, low, high) - low), low, high


@dataclass(frozen=True, eq=False)
class Bone:
    """Bone in a coarse scan.

    Parameters
    ----------
    scan : CoarseScan
    threshold : float
        Grey value at which bone begins.
    mask : (nz, ny, nx) bool array
        Its voxels.
    """

    scan: CoarseScan
    threshold: float
    mask: _Mask = field(repr=False)

    @classmethod
    def islands(cls, scan: CoarseScan, threshold: float) -> list[Bone]:
        """Return the bone of all large islands together, and where there are several, of each alone.

        Raises
        ------
        GpError
            There is hardly any bone.
        """
        numbers, sizes = scan.islands_above(threshold)
        large = np.argsort(-sizes)[: np.count_nonzero(sizes >= _SMALLEST_ISLAND * max(int(sizes.max()), 1))]
        if sizes[large].sum() < _FEWEST_VOXELS:
            raise GpError(f"there is almost no bone above {threshold:g}", remedy="Move the threshold.")
        is_large = np.isin(np.arange(len(sizes)), large)
        together = cls(scan, threshold, is_large[numbers])
        rivals = [i for i in large[:_MOST_ISLANDS] if sizes[i] >= _RIVAL_SHARE * sizes[large[0]]]
        return [together, *(cls(scan, threshold, numbers == i) for i in rivals if len(large) > 1)]

    def is_apart_from(self, other: Bone) -> bool:
        """Whether a bone lies beside another one, not around or under it."""
        distance = float(np.linalg.norm(self.centre - other.centre))
        return distance > _APART_RADII * (self.radius + other.radius)

    def with_what_is_near(self, everything: Bone, others: Sequence[Bone]) -> Bone:
        """Return the bone with what belongs to neither it nor others, but lies nearest to it."""
        rest = everything.mask & ~np.any([bone.mask for bone in (self, *others)], axis=0)
        index = indices_of(rest)
        places = everything.scan.places(index)
        away = [np.linalg.norm(places - bone.centre, axis=1) for bone in (self, *others)]
        i, j, k = index[np.argmin(away, axis=0) == 0].T
        mask = self.mask.copy()
        mask[k, j, i] = True
        return Bone(self.scan, self.threshold, mask)

    @cached_property
    def surface(self) -> _Mask:
        """Its outermost voxels."""
        from scipy.ndimage import binary_erosion

        return np.asarray(self.mask & ~binary_erosion(self.mask))

    @cached_property
    def points(self) -> FloatArray:
        """(N, 3) LPS mm: some of the surface, in random order, the same each time."""
        index = indices_of(self.surface)
        order = np.random.default_rng(0).permutation(len(index))[:_N_POINTS]
        return self.scan.places(index[order])

    @cached_property
    def tree(self) -> Any:
        """A search tree of the surface points."""
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    @cached_property
    def distances(self) -> DistanceField:
        """How far places are from its surface."""
        return DistanceField.of(self)

    def inside(self, points: FloatArray) -> _Mask:
        """Return which points (N, 3), LPS mm, lie where the scanner measured."""
        return self.scan.inside(points)

    @cached_property
    def index(self) -> NDArray[np.intp]:
        """(N, 3) i, j, k of its voxels."""
        return indices_of(self.mask)

    @cached_property
    def centre(self) -> FloatArray:
        """(3,) LPS mm: the centroid."""
        centroid: FloatArray = self.scan.places(self.index.mean(axis=0)[None])[0]
        return centroid

    @cached_property
    def radius(self) -> float:
        """Root mean square distance from the centroid, mm."""
        axes = self.scan.T_scan_index[:3, :3]
        return float(np.sqrt(np.trace(axes @ np.cov(self.index.T, bias=True) @ axes.T)))

    @cached_property
    def share_at_edge(self) -> float:
        """How much of its surface lies at the edge of what the scanner measured: of a cropped head, not 0."""
        around = np.concatenate([np.eye(3), -np.eye(3)]) @ self.scan.T_scan_index[:3, :3].T
        is_inside = [self.scan.inside(self.points + _EDGE_VOXELS * step) for step in around]
        return float(1 - np.all(is_inside, axis=0).mean())

    @cached_property
    def thickness(self) -> float:
        """Volume over surface, in radii: 0.04 to 0.07 of a skull, 0.13 to 0.3 of a head with its flesh."""
        edge = np.prod(self.scan.spacing) ** (1 / 3)
        n_surface = int(np.count_nonzero(self.surface))
        return len(self.index) / n_surface * float(edge) / self.radius


def indices_of(mask: _Mask) -> NDArray[np.intp]:
    """Return i, j, k (N, 3) of the voxels of a mask."""
    k, j, i = np.unravel_index(np.flatnonzero(mask), mask.shape)
    return np.stack([i, j, k], axis=1)


def bone_of(volume: Volume, threshold: float | None = None) -> tuple[Bone, Bone]:
    """Return all bone of a scan, in its finer and its coarser copy.

    Raises
    ------
    GpError
        There is no contrast, or hardly any bone.
    """
    level = propose_threshold(volume) if threshold is None else threshold
    copies = (coarse_scan(volume, factor * finest_step(volume)) for factor in (1.0, COARSER))
    fine, coarse = (Bone.islands(without_holders(copy, (level,)), level)[0] for copy in copies)
    return fine, coarse
