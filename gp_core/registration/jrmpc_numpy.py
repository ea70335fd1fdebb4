"""The inner loops of JRMPC in plain NumPy, for installations without Numba.

The functions, their arguments and their results are those of `gp_core.registration.jrmpc_kernels`, which
explains them; they agree to rounding.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gp_core.registration.jrmpc_limits import LEAST_SPREAD, NOTHING
from gp_core.registration.rotation import IDENTITY, Quaternion, as_matrix, minimal_rotation, product
from gp_core.validation import FloatArray

__all__ = ["expect", "maximise", "move", "run_batch"]

IndexArray = NDArray[np.uint64]


def move(points: FloatArray, starts: IndexArray, poses: FloatArray, moved: FloatArray) -> None:
    """Write the points of all sets under their poses.

    Parameters
    ----------
    points : (3, P) array, mm
        Each set about its own centroid.
    starts : (M + 1,) array of uint64
        Set j begins at ``starts[j]``.
    poses : (M, 7) array
        Quaternion, w first, and translation, mm.
    moved : (3, P) array, mm
        Out: the moved points.
    """
    for pose, start, stop in zip(poses, starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        moved[:, start:stop] = _matrix(pose[:4]) @ points[:, start:stop] + pose[4:, None]


def expect(
    moved: FloatArray,
    pieces: IndexArray,
    blocks: IndexArray,
    centres: FloatArray,
    beta: float,
    table: FloatArray,
    inverse: FloatArray,
    moments: FloatArray,
) -> None:
    """Compute the responsibilities of some blocks and sum them up (expectation step).

    Parameters
    ----------
    moved : (3, P) array, mm
        Points under the present poses.
    pieces : (S + 1,) array of uint64
        Where each piece starts.
    blocks : (B + 1,) array of uint64
        The first piece of each block to do.
    centres : (5, K) array
        Rows x, y, z, precision q, prior times q^1.5.
    beta : float
        Outlier term.
    table : (K, N) array
        Not used here.
    inverse : (P,) array
        Out: 1 / (mixture density + outlier term) at each point.
    moments : (S, 5, K) array
        Out: by piece and centre, sums of a, a d (three), a |d|^2, with d from the centre to the point.
    """
    bounds, firsts = pieces.astype(np.int64), blocks.astype(np.int64)
    for first, last in pairwise(firsts):
        start, stop = bounds[first], bounds[last]
        offsets = moved[:, None, start:stop] - centres[:3, :, None]
        squared = np.einsum("ckn,ckn->kn", offsets, offsets)
        with np.errstate(divide="ignore", under="ignore"):
            shares = centres[4, :, None] * np.exp(-0.5 * centres[3, :, None] * squared)
            inverse[start:stop] = 1.0 / (beta + shares.sum(axis=0))
        shares *= inverse[start:stop]
        terms = np.concatenate([shares[None], shares * offsets, (shares * squared)[None]])
        sums = np.add.reduceat(terms, bounds[first:last] - start, axis=2)
        moments[first:last] = np.moveaxis(sums, 2, 0)


def maximise(
    moments: FloatArray,
    piece_sets: IndexArray,
    poses: FloatArray,
    centres: FloatArray,
    prior: float,
    epsilon: float,
    size: float,
) -> float:
    """Update poses, then centres, then variances, in place (conditional maximisation steps).

    Parameters
    ----------
    moments : (S, 5, K) array
        From `expect`.
    piece_sets : (S,) array of uint64
        The set of each piece, ascending.
    poses : (M, 7) array
        Unit quaternion (w first) and translation of each set, mm.
    centres : (5, K) array
        Rows x, y, z, precision q, prior times q^1.5.
    prior, epsilon : float
        Prior of each centre; what is added to each variance, mm^2.
    size : float
        Size of the whole, against which changes of length are held, mm.

    Returns
    -------
    float
        Largest change: of angles (radians), of lengths / size, of variances relative.
    """
    first_pieces = np.flatnonzero(np.diff(piece_sets.astype(np.int64), prepend=-1))
    of_sets = np.add.reduceat(moments, first_pieces, axis=0)
    rotations, translations, change = _pose_steps(of_sets, centres, poses, size)
    sums = _centre_sums(of_sets, rotations, translations, centres)
    return max(change, _centre_step(sums, centres, prior, epsilon, size))


def _pose_steps(
    moments: FloatArray, centres: FloatArray, poses: FloatArray, size: float
) -> tuple[FloatArray, FloatArray, float]:
    """Take the weighted means of each set's points to the centres (weighted Procrustes).

    The steps (M, 3, 3) and (M, 3) in common coordinates, and the largest change.
    """
    weights = centres[3] * moments[:, 0]
    offsets = centres[3] * moments[:, 1:4]
    total = weights.sum(axis=1)
    divisor = np.where(total > NOTHING, total, np.inf)[:, None]
    means = weights @ centres[:3].T / divisor
    beyond = offsets.sum(axis=2) / divisor
    about = centres[:3] - means[:, :, None]
    covariances = np.einsum("mik,mjk->mij", about, weights[:, None] * about + offsets)
    rotations, translations, change = np.empty((len(poses), 3, 3)), np.empty((len(poses), 3)), 0.0
    for j, covariance in enumerate(covariances):
        turn = _minimal_rotation(covariance)
        rotations[j] = np.reshape(as_matrix(turn), (3, 3))
        translations[j] = means[j] - rotations[j] @ (means[j] + beyond[j])
        poses[j, 4:] = rotations[j] @ poses[j, 4:] + translations[j]
        poses[j, :4] = product(turn, tuple(poses[j, :4].tolist()))
        angle = 2.0 * float(np.linalg.norm(turn[1:]))
        change = max(change, angle, float(np.linalg.norm(beyond[j])) / size)
    return rotations, translations, change


def _centre_sums(
    moments: FloatArray, rotations: FloatArray, translations: FloatArray, centres: FloatArray
) -> FloatArray:
    """Return (5, K) sums over the sets: weight, displacement from the old centre (three), its square."""
    shifts = rotations @ centres[:3] + translations[:, :, None] - centres[:3]
    turned = rotations @ moments[:, 1:4]
    weights = moments[:, 0]
    squares = moments[:, 4] + 2.0 * (turned * shifts).sum(axis=1) + weights * (shifts * shifts).sum(axis=1)
    moved = turned + weights[:, None] * shifts
    sums: FloatArray = np.concatenate([weights[:, None], moved, squares[:, None]], axis=1).sum(axis=0)
    return sums


def _centre_step(sums: FloatArray, centres: FloatArray, prior: float, epsilon: float, size: float) -> float:
    """Move each centre to the mean of its moved points, then set its variance about that mean."""
    reached = sums[0] > NOTHING  # where no point has weight, the centre stays
    if not reached.any():
        return 0.0
    steps = sums[1:4, reached] / sums[0, reached]
    squared = (steps * steps).sum(axis=0)
    variances = np.maximum((sums[4, reached] / sums[0, reached] - squared) / 3.0, 0.0) + epsilon
    precisions = 1.0 / np.maximum(variances, (LEAST_SPREAD * size) ** 2)
    changes = np.maximum(np.sqrt(squared) / size, np.abs(1.0 - centres[3, reached] / precisions))
    centres[:3, reached] += steps
    centres[3, reached], centres[4, reached] = precisions, prior * precisions**1.5
    return float(changes.max())


def run_batch(
    points: FloatArray,
    starts: IndexArray,
    poses: FloatArray,
    centres: FloatArray,
    beta: FloatArray,
    prior: float,
    epsilon: float,
    sizes: FloatArray,
    max_iterations: int,
    still: float,
    iterations: NDArray[np.int64],
    change: FloatArray,
) -> None:
    """Run many problems whose sets are of the same sizes, one after the other.

    Parameters
    ----------
    points : (B, 3, P) array, mm
        Points of all sets, each set about its own centroid.
    starts : (M + 1,) array of uint64
        Where each set starts.
    poses : (B, M, 7) array
        Start in, answer out; see `maximise`.
    centres : (B, 5, K) array
        Start in, answer out; see `maximise`.
    beta, sizes : (B,) array
        Outlier term and size of each problem.
    prior, epsilon : float
        As `maximise` takes them.
    max_iterations : int
        Iterations at most.
    still : float
        Change below which a problem is at rest and stops.
    iterations, change : (B,) array
        Out: how many iterations were run, and the largest change of the last.
    """
    n_sets, n_centres = poses.shape[1], centres.shape[2]
    moved, inverse = np.empty(points.shape[1:]), np.empty(points.shape[2])
    table, moments = np.empty((0, 0)), np.empty((n_sets, 5, n_centres))
    blocks, sets = np.array([0, n_sets], dtype=np.uint64), np.arange(n_sets, dtype=np.uint64)
    for b in range(len(points)):
        for n in range(max_iterations):
            move(points[b], starts, poses[b], moved)
            expect(moved, starts, blocks, centres[b], beta[b], table, inverse, moments)
            change[b] = maximise(moments, sets, poses[b], centres[b], prior, epsilon, sizes[b])
            iterations[b] = n + 1
            if change[b] <= still:
                break


def _minimal_rotation(covariance: FloatArray) -> Quaternion:
    xx, xy, xz, yx, yy, yz, zx, zy, zz = covariance.ravel().tolist()
    try:
        return minimal_rotation((xx, xy, xz, yx, yy, yz, zx, zy, zz))
    except ZeroDivisionError:  # no point has weight; compiled code goes on with NaN, and arrives there too
        return IDENTITY


def _matrix(quaternion: FloatArray) -> FloatArray:
    return np.reshape(as_matrix(tuple(quaternion.tolist())), (3, 3))
