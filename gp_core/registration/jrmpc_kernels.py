"""Compiled inner loops of JRMPC; imported on first use only, since numba takes half a second to start.

Everything is laid out so that the innermost loop runs over the points of one coordinate row, which LLVM turns
into vector code. Indices of pieces are unsigned: numba then drops its check for negative ones, which would
keep these loops scalar. Shapes: P points, M sets, K centres. A *piece* is a run of points of one set; a
*block* is a run of pieces whose table of responsibilities fits the cache.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from gp_core.registration.compiling import compiled
from gp_core.registration.jrmpc_limits import LEAST_SPREAD, NOTHING
from gp_core.registration.rotation import Matrix3, Quaternion
from gp_core.registration.rotation_compiled import as_matrix, minimal_rotation, product
from gp_core.validation import FloatArray

__all__ = ["expect", "maximise", "move", "run_batch"]

IndexArray = NDArray[np.uint64]

# Other threads may run meanwhile; a division by zero gives inf, as in NumPy, and so costs no branch.

# Sums may be reordered in the kernels below; the exponential relies on the order of its additions.
_SUMS = {"contract", "reassoc", "nsz"}
_EXACT = {"contract"}


_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it rounds to an integer held in the low bits
_LOWEST = -708.0  # below, exp is not a normal number and counts as 0


def _to_bits(typing: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], context.get_value_type(types.int64))

    return types.int64(types.float64), generate


def _to_float(typing: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], context.get_value_type(types.float64))

    return types.float64(types.int64), generate


_as_bits: Any = intrinsic(_to_bits)
_from_bits: Any = intrinsic(_to_float)


@compiled(fastmath=_EXACT, cache=True)
def exp_negative(u: float) -> float:
    """Compute exp(u) to one unit in the last place, without branches; 0 below -708.

    With u = n ln 2 + r, a polynomial of degree 11 with the least worst error on |r| <= ln 2 / 2 gives exp(r),
    and n is added to the exponent bits.

    Parameters
    ----------
    u : float
        Not positive.

    Returns
    -------
    float
        exp(u).
    """
    held = max(u, _LOWEST)
    shifted = held * _LOG2_E + _ROUND
    n = shifted - _ROUND
    r = (held - n * _LN2_HIGH) - n * _LN2_LOW
    p = 2.5110037605963777712e-8
    p = p * r + 2.7632639639041029749e-7
    p = p * r + 2.7557240918578969823e-6
    p = p * r + 2.4801485482328492419e-5
    p = p * r + 1.9841269890047113707e-4
    p = p * r + 1.3888888952314774652e-3
    p = p * r + 8.3333333333196006109e-3
    p = p * r + 4.1666666666488095495e-2
    p = p * r + 1.6666666666666680806e-1
    p = p * r + 5.0000000000000183855e-1
    p = (p * r * r + r) + 1.0
    value: float = _from_bits(_as_bits(p) + (_as_bits(shifted) << 52))
    return value if u >= _LOWEST else 0.0


@compiled(cache=True)
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
    moved : (3, P)
        Points under the present poses.
    pieces : (S + 1,) uint64
        Where each piece starts.
    blocks : (B + 1,) uint64
        The first piece of each block to do.
    centres : (5, K)
        Rows x, y, z, precision q, prior times q^1.5.
    beta : float
        Outlier term.
    table : (K, at least the points of a block)
        Scratch.
    inverse : (P,)
        Out: 1 / (mixture density + outlier term) at each point.
    moments : (S, 5, K)
        Out: by piece and centre, sums of a, a d (three), a |d|^2, with d from the centre to the point.
    """
    for b in range(blocks.size - 1):
        first, last = blocks[b], blocks[b + 1]
        start, stop = pieces[first], pieces[last]
        _responsibilities(moved, start, stop, centres, beta, table, inverse)
        for s in range(first, last):
            _moments(moved, start, pieces[s], pieces[s + np.uint64(1)], centres, table, inverse, moments[s])


@compiled(fastmath=_EXACT)
def _responsibilities(
    moved: FloatArray,
    start: int,
    stop: int,
    centres: FloatArray,
    beta: float,
    table: FloatArray,
    inverse: FloatArray,
) -> None:
    for i in range(start, stop):
        inverse[i] = beta
    for k in range(centres.shape[1]):
        x, y, z = centres[0, k], centres[1, k], centres[2, k]
        minus_half_q, weight = -0.5 * centres[3, k], centres[4, k]
        for i in range(start, stop):
            dx, dy, dz = moved[0, i] - x, moved[1, i] - y, moved[2, i] - z
            likelihood = weight * exp_negative(minus_half_q * (dx * dx + dy * dy + dz * dz))
            table[k, i - start] = likelihood
            inverse[i] += likelihood
    for i in range(start, stop):
        inverse[i] = 1.0 / inverse[i]


@compiled(fastmath=_SUMS)
def _moments(
    moved: FloatArray,
    origin: int,
    start: int,
    stop: int,
    centres: FloatArray,
    table: FloatArray,
    inverse: FloatArray,
    out: FloatArray,
) -> None:
    for k in range(centres.shape[1]):
        x, y, z = centres[0, k], centres[1, k], centres[2, k]
        s0 = s1 = s2 = s3 = s4 = 0.0
        for i in range(start, stop):
            a = table[k, i - origin] * inverse[i]
            dx, dy, dz = moved[0, i] - x, moved[1, i] - y, moved[2, i] - z
            s0 += a
            s1 += a * dx
            s2 += a * dy
            s3 += a * dz
            s4 += a * (dx * dx + dy * dy + dz * dz)
        out[0, k], out[1, k], out[2, k], out[3, k], out[4, k] = s0, s1, s2, s3, s4


@compiled(cache=True)
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
    moments : (S, 5, K)
        From `expect`; used up.
    piece_sets : (S,) uint64
        The set of each piece, ascending.
    poses : (M, 7)
        Unit quaternion (w first) and translation of each set.
    centres : (5, K)
        Rows x, y, z, precision q, prior times q^1.5.
    prior, epsilon : float
        Prior of each centre; what is added to each variance.
    size : float
        Size of the whole, against which changes of length are held.

    Returns
    -------
    float
        Largest change: of angles (radians), of lengths / size, of variances relative.
    """
    n_sets = poses.shape[0]
    if piece_sets.size > n_sets:
        _gather(moments, piece_sets)
    motion, sums = np.empty((3, 4)), np.zeros((5, centres.shape[1]))
    change = 0.0
    for j in range(n_sets):
        change = max(change, _pose_step(moments, j, centres, poses, motion, size))
        _add_set(moments, j, motion, centres, sums)
    return max(change, _centre_step(sums, centres, prior, epsilon, size))


@compiled()
def _gather(moments: FloatArray, piece_sets: IndexArray) -> None:
    """Add the pieces of each set up, in order, into the row of the set."""
    for s in range(1, piece_sets.size):
        j = piece_sets[s]
        kept = 1.0 if j == piece_sets[s - 1] else 0.0
        for c in range(moments.shape[1]):
            for k in range(moments.shape[2]):
                moments[j, c, k] = kept * moments[j, c, k] + moments[s, c, k]


@compiled()
def _pose_step(
    moments: FloatArray,
    j: int,
    centres: FloatArray,
    poses: FloatArray,
    motion: FloatArray,
    size: float,
) -> float:
    """Take the weighted means of one set's points to the centres (weighted Procrustes).

    `motion` receives the step (3, 4) in common coordinates.
    """
    x, y, z, dx, dy, dz = _weighted_means(moments, j, centres)
    turn = minimal_rotation(_covariance(moments, j, centres, x, y, z))
    _write_rotation(turn, motion)
    for a in range(3):
        motion[a, 3] = -(motion[a, 0] * (x + dx) + motion[a, 1] * (y + dy) + motion[a, 2] * (z + dz))
    motion[0, 3] += x
    motion[1, 3] += y
    motion[2, 3] += z
    tx, ty, tz = poses[j, 4], poses[j, 5], poses[j, 6]
    for a in range(3):
        poses[j, 4 + a] = motion[a, 0] * tx + motion[a, 1] * ty + motion[a, 2] * tz + motion[a, 3]
    before = (poses[j, 0], poses[j, 1], poses[j, 2], poses[j, 3])
    poses[j, 0], poses[j, 1], poses[j, 2], poses[j, 3] = product(turn, before)
    angle = 2.0 * math.sqrt(turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3])
    return max(angle, math.sqrt(dx * dx + dy * dy + dz * dz) / size)


@compiled(fastmath=_SUMS)
def _weighted_means(
    moments: FloatArray, j: int, centres: FloatArray
) -> tuple[float, float, float, float, float, float]:
    """Return the weighted mean of the centres a set reaches, and how far its points lie off that."""
    w = x = y = z = dx = dy = dz = 0.0
    for k in range(centres.shape[1]):
        q = centres[3, k]
        u = q * moments[j, 0, k]
        w += u
        x += u * centres[0, k]
        y += u * centres[1, k]
        z += u * centres[2, k]
        dx += q * moments[j, 1, k]
        dy += q * moments[j, 2, k]
        dz += q * moments[j, 3, k]
    if w <= NOTHING:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return x / w, y / w, z / w, dx / w, dy / w, dz / w


@compiled(fastmath=_SUMS)
def _covariance(moments: FloatArray, j: int, centres: FloatArray, x: float, y: float, z: float) -> Matrix3:
    """Return the sum of w (x_k - mean) m_k^T, where the weighted mean w m_k is q (a x_k + sum of a d)."""
    xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
    for k in range(centres.shape[1]):
        q = centres[3, k]
        u = q * moments[j, 0, k]
        ex, ey, ez = centres[0, k] - x, centres[1, k] - y, centres[2, k] - z
        mx, my, mz = (
            u * ex + q * moments[j, 1, k],
            u * ey + q * moments[j, 2, k],
            u * ez + q * moments[j, 3, k],
        )
        xx += ex * mx
        xy += ex * my
        xz += ex * mz
        yx += ey * mx
        yy += ey * my
        yz += ey * mz
        zx += ez * mx
        zy += ez * my
        zz += ez * mz
    return xx, xy, xz, yx, yy, yz, zx, zy, zz


@compiled()
def _write_rotation(turn: Quaternion, out: FloatArray) -> None:
    """Write the rotation matrix into the first three columns of `out`."""
    r = as_matrix(turn)
    for a in range(3):
        out[a, 0], out[a, 1], out[a, 2] = r[3 * a], r[3 * a + 1], r[3 * a + 2]


@compiled(fastmath=_SUMS)
def _add_set(moments: FloatArray, j: int, motion: FloatArray, centres: FloatArray, sums: FloatArray) -> None:
    """Add what one set gives to each centre: weight, displacement from the old centre (three), its square.

    Everything is relative to the old centre, against cancellation: c is the displacement of the centre by the
    motion, and R D + a c the sum of the displacements of the moved points from it.
    """
    m00, m01, m02, m03 = motion[0, 0], motion[0, 1], motion[0, 2], motion[0, 3]
    m10, m11, m12, m13 = motion[1, 0], motion[1, 1], motion[1, 2], motion[1, 3]
    m20, m21, m22, m23 = motion[2, 0], motion[2, 1], motion[2, 2], motion[2, 3]
    for k in range(centres.shape[1]):
        x, y, z = centres[0, k], centres[1, k], centres[2, k]
        a, px, py, pz = moments[j, 0, k], moments[j, 1, k], moments[j, 2, k], moments[j, 3, k]
        cx = m00 * x + m01 * y + m02 * z + m03 - x
        cy = m10 * x + m11 * y + m12 * z + m13 - y
        cz = m20 * x + m21 * y + m22 * z + m23 - z
        rx = m00 * px + m01 * py + m02 * pz
        ry = m10 * px + m11 * py + m12 * pz
        rz = m20 * px + m21 * py + m22 * pz
        sums[0, k] += a
        sums[1, k] += rx + a * cx
        sums[2, k] += ry + a * cy
        sums[3, k] += rz + a * cz
        sums[4, k] += (
            moments[j, 4, k] + 2.0 * (rx * cx + ry * cy + rz * cz) + a * (cx * cx + cy * cy + cz * cz)
        )


@compiled()
def _centre_step(sums: FloatArray, centres: FloatArray, prior: float, epsilon: float, size: float) -> float:
    """Move each centre to the mean of its moved points, then set its variance about that mean."""
    floor = (LEAST_SPREAD * size) ** 2
    change = 0.0
    for k in range(centres.shape[1]):
        weight = sums[0, k]
        if weight <= NOTHING:
            continue  # no point has weight here: the centre stays
        x, y, z = sums[1, k] / weight, sums[2, k] / weight, sums[3, k] / weight
        moved = x * x + y * y + z * z
        variance = max((sums[4, k] / weight - moved) / 3.0, 0.0) + epsilon
        precision = 1.0 / max(variance, floor)
        change = max(change, math.sqrt(moved) / size, abs(1.0 - centres[3, k] / precision))
        centres[0, k] += x
        centres[1, k] += y
        centres[2, k] += z
        centres[3, k], centres[4, k] = precision, prior * precision * math.sqrt(precision)
    return change


@compiled(fastmath=_EXACT, cache=True)
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
    rotation = np.empty((3, 3))
    for j in range(poses.shape[0]):
        _write_rotation((poses[j, 0], poses[j, 1], poses[j, 2], poses[j, 3]), rotation)
        for a in range(3):
            rx, ry, rz, t = rotation[a, 0], rotation[a, 1], rotation[a, 2], poses[j, 4 + a]
            for i in range(starts[j], starts[j + 1]):
                moved[a, i] = rx * points[0, i] + ry * points[1, i] + rz * points[2, i] + t


@compiled(cache=True)
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
    points : (B, 3, P)
        Points of all sets, each set about its own centroid.
    starts : (M + 1,) uint64
        Where each set starts.
    poses : (B, M, 7)
        Start in, answer out; see `maximise`.
    centres : (B, 5, K)
        Start in, answer out; see `maximise`.
    beta, sizes : (B,)
        Outlier term and size of each problem.
    prior, epsilon : float
        As `maximise` takes them.
    max_iterations : int
        Iterations at most.
    still : float
        Change below which a problem is at rest and stops.
    iterations, change : (B,)
        Out: how many iterations were run, and the largest change of the last.
    """
    n_points, n_sets, n_centres = points.shape[2], poses.shape[1], centres.shape[2]
    moved, inverse = np.empty((3, n_points)), np.empty(n_points)
    table, moments = np.empty((n_centres, n_points)), np.empty((n_sets, 5, n_centres))
    blocks = np.array([0, n_sets], dtype=np.uint64)
    sets = np.arange(n_sets).astype(np.uint64)
    for b in range(points.shape[0]):
        for n in range(max_iterations):
            move(points[b], starts, poses[b], moved)
            expect(moved, starts, blocks, centres[b], beta[b], table, inverse, moments)
            change[b] = maximise(moments, sets, poses[b], centres[b], prior, epsilon, sizes[b])
            iterations[b] = n + 1
            if change[b] <= still:
                break
