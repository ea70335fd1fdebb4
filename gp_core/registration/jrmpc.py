"""Joint registration of multiple point sets (JRMPC): unnamed points of many sets, all poses at once.

The points of every set are taken as samples of one mixture of K isotropic Gaussians and a uniform class of
outliers; expectation conditional maximisation finds the pose of each set, the centres and their variances.
The inner loops are compiled (`gp_core.registration.jrmpc_kernels`) and loaded on first use; without Numba,
`gp_core.registration.jrmpc_numpy` does the same, slower.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.argument_types import checks_arguments
from gp_core.errors import GeometryError, GpError
from gp_core.processors import n_cores
from gp_core.validation import FloatArray, as_points, freeze_arrays

__all__ = ["DEFAULTS", "ESTIMATION", "JrmpcBatch", "JrmpcResult", "JrmpcSettings", "jrmpc", "jrmpc_batch"]

_FEWEST_POINTS = 3
_SIZES = (1e-30, 1e30)
_LEAST_GAMMA = 1e-12
STATIONARY = 1e-13
"""Relative change of an iteration below which the remaining ones would change nothing beyond 1e-9."""
_CONVERGED = 1e-6
TABLE_SIZE = 32768
"""Responsibilities per thread held at a time: a quarter of a megabyte, so that they stay in the cache."""
THREADS_FROM_WORK = 200_000


def _is_number(value: Any, allowed: Callable[[float], bool]) -> bool:
    try:
        return math.isfinite(value) and allowed(value)
    except (TypeError, ValueError, OverflowError):
        return False


@dataclass(frozen=True)
class JrmpcSettings:
    """How JRMPC is run.

    Parameters
    ----------
    max_iterations : int
        Number of iterations; fewer are run only where the rest would change nothing.
    gamma : float, optional
        Expected ratio of outliers to inliers; 1 / K by default.
    epsilon : float
        Added to each variance at each iteration, mm².

    Raises
    ------
    GpError
        A value is out of its range.
    """

    max_iterations: int = 100
    gamma: float | None = None
    epsilon: float = 1e-6

    def __post_init__(self) -> None:
        count = self.max_iterations
        if not isinstance(count, int | np.integer) or isinstance(count, bool) or count < 1:
            raise GpError(f"max_iterations must be a whole number from 1, got {count!r}")
        if self.gamma is not None and not _is_number(self.gamma, lambda g: g >= _LEAST_GAMMA):
            raise GpError(f"gamma must be a number from {_LEAST_GAMMA:g}, got {self.gamma!r}")
        if not _is_number(self.epsilon, lambda e: e >= 0):
            raise GpError(f"epsilon must be a number from 0, got {self.epsilon!r}")
        object.__setattr__(self, "epsilon", float(self.epsilon))
        if self.gamma is not None:
            object.__setattr__(self, "gamma", float(self.gamma))


DEFAULTS = JrmpcSettings()
"""As the authors of the algorithm set it; the search of feature subsets runs on these."""
ESTIMATION = JrmpcSettings(max_iterations=60, gamma=0.05, epsilon=1e-9)
"""As Usevitch et al. set it to estimate a cochlea."""


@dataclass(frozen=True)
class JrmpcResult:
    """Poses of M point sets in one frame, and the K Gaussians that explain them.

    Parameters
    ----------
    rotations, translations : (M, 3, 3), (M, 3) array
        Set j moves to ``points @ rotations[j].T + translations[j]``; det +1, mm.
    centres : (K, 3) array
        Centres of the Gaussians, mm.
    variances : (K,) array
        Their variances, mm² per coordinate.
    objective : (n_iterations,) array
        Negative log-likelihood of all points (up to a constant) before each iteration. With epsilon 0 it
        never rises.
    n_iterations : int
        How many iterations were run.
    converged : bool
        Whether the last iteration changed angles, relative lengths and variances by less than 1e-6.
    """

    rotations: FloatArray
    translations: FloatArray
    centres: FloatArray
    variances: FloatArray
    objective: FloatArray
    n_iterations: int
    converged: bool

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @checks_arguments
    def moved(self, point_sets: Sequence[ArrayLike]) -> list[FloatArray]:
        """Return the points of each set in the common frame.

        Parameters
        ----------
        point_sets : sequence of (N_j, 3) array_like
            One list of points for each registered set, mm; any points of that set's frame.

        Returns
        -------
        list of (N_j, 3) array, mm
            The moved points.

        Raises
        ------
        GpError
            Not as many lists as were registered, or one is not of shape (N, 3).
        """
        if len(point_sets) != len(self.rotations):
            raise GpError(f"point_sets must hold {len(self.rotations)} sets, got {len(point_sets)}")
        return [
            as_points(points, f"set {j}", missing_allowed=True) @ self.rotations[j].T + self.translations[j]
            for j, points in enumerate(point_sets)
        ]


@dataclass(frozen=True)
class JrmpcBatch:
    """Results of B problems; each field as in `JrmpcResult`, with the problem first.

    Parameters
    ----------
    rotations, translations : (B, M, 3, 3), (B, M, 3) array
        Poses.
    centres, variances : (B, K, 3), (B, K) array
        Gaussians.
    n_iterations : (B,) int array
        How many iterations were run.
    converged : (B,) bool array
        Whether the last one changed next to nothing.
    """

    rotations: FloatArray
    translations: FloatArray
    centres: FloatArray
    variances: FloatArray
    n_iterations: NDArray[np.int64]
    converged: NDArray[np.bool_]


@checks_arguments
def jrmpc(
    point_sets: Sequence[ArrayLike],
    centres: ArrayLike | None = None,
    *,
    max_iterations: int = 100,
    gamma: float | None = None,
    epsilon: float = 1e-6,
) -> JrmpcResult:
    """Register point sets jointly, whatever their number and sizes.

    Each set starts unrotated, with its centroid on the centroid of the centres; the variances start at the
    squared diagonal of the box around everything. Memory grows with points + centres, not with their product.
    Large problems run on all cores.

    Parameters
    ----------
    point_sets : sequence of (N_j, 3) array_like
        Points of each set, mm; at least three a set.
    centres : (K, 3) array_like, optional
        Initial centres, mm; by default one for each set, at its centroid.
    max_iterations : int
        See `JrmpcSettings`.
    gamma : float, optional
        See `JrmpcSettings`.
    epsilon : float
        See `JrmpcSettings`, mm^2.

    Returns
    -------
    JrmpcResult
        Poses, centres and variances.

    Raises
    ------
    GeometryError
        A set has too few points, or all points coincide or are out of scale.
    GpError
        Something is not finite, of a wrong shape, or a setting is out of its range.

    References
    ----------
    Evangelidis and Horaud, "Joint alignment of multiple point sets with batch and incremental
    expectation-maximization", IEEE TPAMI 40(6), 2018. https://doi.org/10.1109/TPAMI.2017.2717829

    Examples
    --------
    >>> square = np.array([[0, 0, 0], [4, 0, 0], [4, 1, 0], [0, 1, 2.0]])
    >>> result = jrmpc([square, square + 5.0])
    >>> np.abs(np.subtract(*result.moved([square, square + 5.0]))).max() < 1e-9
    np.True_
    """
    settings = JrmpcSettings(max_iterations, gamma, epsilon)
    sets = [as_points(points, f"set {j}") for j, points in enumerate(point_sets)]
    sizes = _as_sizes([len(points) for points in sets])
    start = None if centres is None else as_points(centres, "centres")[None]
    if start is not None and start.shape[1] == 0:
        raise GpError("centres must hold at least one point")
    problem = _Problem.prepare(np.concatenate(sets)[None], sizes, start, settings)
    objective, change = _run_one(problem, settings)
    rotations, translations, found, variances = (field[0] for field in problem.answer())
    return JrmpcResult(
        rotations, translations, found, variances, objective, len(objective), bool(change < _CONVERGED)
    )


def jrmpc_batch(problems: ArrayLike, sizes: Sequence[int], settings: JrmpcSettings = DEFAULTS) -> JrmpcBatch:
    """Run JRMPC on many small problems whose sets have the same sizes, with one centre for each set.

    Each result equals that of `jrmpc` on the same sets with ``centres=None``. The work is compiled, runs on
    one core and releases the interpreter lock, so a study can spread its batches over threads or processes.

    Parameters
    ----------
    problems : (B, P, 3) array_like
        The points of all sets of each problem, set after set, mm.
    sizes : sequence of int
        How many points each of the M sets has; their sum is P.
    settings : JrmpcSettings
        Iterations, outlier ratio and variance floor.

    Returns
    -------
    JrmpcBatch
        The results, problem first.

    Raises
    ------
    GeometryError
        A set has too few points, or in some problem all points coincide or are out of scale.
    GpError
        Something is not finite or of a wrong shape.
    """
    counts = _as_sizes(sizes)
    points = _as_problems(problems, int(counts.sum()))
    problem = _Problem.prepare(points, counts, None, settings)
    n_problems = len(points)
    iterations, change = np.zeros(n_problems, dtype=np.int64), np.zeros(n_problems)
    _batch_kernels().run_batch(
        problem.points,
        problem.starts,
        problem.poses,
        problem.centres,
        problem.beta,
        problem.prior,
        settings.epsilon,
        problem.size,
        settings.max_iterations,
        STATIONARY,
        iterations,
        change,
    )
    return JrmpcBatch(*problem.answer(), iterations, change < _CONVERGED)


@dataclass(frozen=True)
class _Problem:
    """B problems as the kernels need them: coordinates in rows, each set about its own centroid.

    `poses` (B, M, 7) and `centres` (B, 5, K) change as the kernels run. All arrays are C-contiguous: any
    other layout would make numba compile the kernels once more.
    """

    points: FloatArray
    starts: NDArray[np.uint64]
    centroids: FloatArray
    shift: FloatArray
    size: FloatArray
    poses: FloatArray
    centres: FloatArray
    beta: FloatArray
    prior: float

    @classmethod
    def prepare(
        cls, points: FloatArray, sizes: NDArray[np.int64], centres: FloatArray | None, settings: JrmpcSettings
    ) -> _Problem:
        """Place sets and centres at their start; `points` (B, P, 3), `centres` (B, K, 3)."""
        starts = np.concatenate([[0], np.cumsum(sizes)])
        with np.errstate(over="ignore", invalid="ignore"):
            centroids = np.add.reduceat(points, starts[:-1], axis=1) / sizes[:, None]
            rows = np.swapaxes(points - np.repeat(centroids, sizes, axis=1), 1, 2)
            x = np.swapaxes(centroids if centres is None else centres, 1, 2)
            shift = x.mean(axis=2)
            x = x - shift[:, :, None]
            high, low = np.maximum(rows.max(2), x.max(2)), np.minimum(rows.min(2), x.min(2))
            size = np.linalg.norm(high - low, axis=1)
        _check_sizes(size)
        n_centres = x.shape[2]
        gamma = 1.0 / n_centres if settings.gamma is None else float(settings.gamma)
        prior = 1.0 / (n_centres * (gamma + 1.0))
        precision = np.broadcast_to((1.0 / size**2)[:, None, None], (len(x), 1, n_centres))
        poses = np.zeros((len(x), len(sizes), 7))
        poses[:, :, 0] = 1.0
        return cls(
            points=np.ascontiguousarray(rows),
            starts=starts.astype(np.uint64),
            centroids=centroids,
            shift=shift,
            size=size,
            poses=poses,
            centres=np.ascontiguousarray(np.concatenate([x, precision, prior * precision**1.5], axis=1)),
            beta=gamma / (2.0 * size**2 * (gamma + 1.0)),
            prior=prior,
        )

    def answer(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return rotations, translations, centres and variances in the caller's coordinates."""
        rotations = _rotations(self.poses[:, :, :4])
        turned = np.einsum("bmij,bmj->bmi", rotations, self.centroids)
        translations = self.shift[:, None] + self.poses[:, :, 4:] - turned
        centres = np.swapaxes(self.centres[:, :3], 1, 2) + self.shift[:, None]
        return rotations, translations, centres, 1.0 / self.centres[:, 3]


def _run_one(problem: _Problem, settings: JrmpcSettings) -> tuple[FloatArray, float]:
    """Run the only problem there is; return the objective before each iteration, and the last change."""
    kernels = _kernels()
    points, poses, centres = problem.points[0], problem.poses[0], problem.centres[0]
    n_points, n_centres = points.shape[1], centres.shape[1]
    pieces, piece_sets, blocks = cut_into_blocks(problem.starts, max(32, TABLE_SIZE // n_centres))
    moved, inverse = np.empty_like(points), np.empty(n_points)
    moments = np.empty((len(piece_sets), 5, n_centres))
    widest = int(np.diff(pieces[blocks]).max())
    objective: list[float] = []
    change = np.inf
    with _shares(blocks, n_points * n_centres) as (shares, do_all):
        tables = [np.empty((n_centres, widest)) for _ in shares]

        def expect(i: int) -> None:
            kernels.expect(moved, pieces, shares[i], centres, problem.beta[0], tables[i], inverse, moments)

        while len(objective) < settings.max_iterations and change > STATIONARY:
            kernels.move(points, problem.starts, poses, moved)
            do_all(expect, range(len(shares)))
            objective.append(float(np.log(inverse).sum()))
            change = kernels.maximise(
                moments, piece_sets, poses, centres, problem.prior, settings.epsilon, problem.size[0]
            )
    return np.array(objective), float(change)


@contextmanager
def _shares(
    blocks: NDArray[np.uint64], work: int
) -> Iterator[tuple[list[NDArray[np.uint64]], Callable[[Callable[[int], None], range], object]]]:
    """Split blocks among threads where it is worth while; also yield a function that maps over the parts."""
    workers = min(n_cores(), len(blocks) - 1) if work >= THREADS_FROM_WORK else 1
    if workers == 1:
        yield [blocks], lambda function, which: list(map(function, which))
        return
    bounds = np.linspace(0, len(blocks) - 1, workers + 1).round().astype(int)
    with ThreadPoolExecutor(workers, thread_name_prefix="jrmpc") as pool:
        yield (
            [blocks[a : b + 1] for a, b in pairwise(bounds)],
            lambda function, which: list(pool.map(function, which)),
        )


def cut_into_blocks(
    starts: NDArray[np.uint64], longest: int
) -> tuple[NDArray[np.uint64], NDArray[np.uint64], NDArray[np.uint64]]:
    """Cut sets into pieces and gather pieces into blocks, both of limited length.

    Parameters
    ----------
    starts : (M + 1,) array of uint64
        Set j holds the points from ``starts[j]`` to ``starts[j + 1]``.
    longest : int
        Maximum number of points of a piece, and of a block.

    Returns
    -------
    pieces : (P + 1,) array of uint64
        Where pieces start; the last value is the end.
    piece_sets : (P,) array of uint64
        The set of each piece.
    blocks : (B + 1,) array of uint64
        The first piece of each block; the last value is the number of pieces.
    """
    pieces, blocks = [0], [0]
    piece_sets: list[int] = []
    block_start = 0
    for j, (start, stop) in enumerate(zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)):
        for begin in range(start, stop, longest):
            end = min(begin + longest, stop)
            if end - block_start > longest:
                blocks.append(len(piece_sets))
                block_start = begin
            pieces.append(end)
            piece_sets.append(j)
    blocks.append(len(piece_sets))
    return tuple(np.array(rows, dtype=np.uint64) for rows in (pieces, piece_sets, blocks))  # type: ignore[return-value]


def _rotations(quaternions: FloatArray) -> FloatArray:
    """Return (..., 3, 3) rotations of unit quaternions (..., 4), w first."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _as_sizes(sizes: Sequence[int]) -> NDArray[np.int64]:
    counts = np.asarray(sizes)
    if counts.ndim != 1 or len(counts) == 0 or counts.dtype.kind not in "iu":
        raise GpError("JRMPC needs at least one point set, and sizes as whole numbers")
    if counts.min() < _FEWEST_POINTS:
        j = int(counts.argmin())
        raise GeometryError(
            f"each point set needs at least {_FEWEST_POINTS} points, set {j} has {counts[j]}",
            remedy="Leave the set out or add points to it.",
        )
    return counts.astype(np.int64)


def _as_problems(problems: ArrayLike, n_points: int) -> FloatArray:
    try:
        points = np.asarray(problems, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise GpError(f"problems must be numbers in (B, {n_points}, 3)") from None
    if points.ndim != 3 or points.shape[1:] != (n_points, 3):
        raise GpError(f"problems must have the shape (B, {n_points}, 3), got {points.shape}")
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=(1, 2)))[0])
        raise GpError(f"problems must be finite, problem {bad} is not")
    return points


def _check_sizes(size: FloatArray) -> None:
    lowest, highest = _SIZES
    good = (size > lowest) & (size < highest)
    if not good.all():
        raise GeometryError(
            f"the point sets have no usable extent, got {size[~good][0]:.3g}",
            remedy="Check that the points differ and that their unit is mm.",
        )


def _batch_kernels() -> Any:
    """Return what runs many problems: compiled for eight at a time, or else as `_kernels` says."""
    try:
        return import_module("gp_core.registration.jrmpc_lanes")
    except ImportError:
        return _kernels()


def _kernels() -> Any:
    """Return the compiled inner loops; where Numba is missing or cannot be used, those in plain NumPy."""
    try:
        return import_module("gp_core.registration.jrmpc_kernels")
    except ImportError:
        return import_module("gp_core.registration.jrmpc_numpy")
