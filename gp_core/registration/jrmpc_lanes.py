"""The inner loops of JRMPC for eight problems at a time, one in each lane of a vector.

The arithmetic is that of `gp_core.registration.jrmpc_kernels`, where each step is explained. There, vectors
run along the points of one problem, and what is done once for each pose is scalar; here nothing is. Flat
arrays have the lane as their last index.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.registration.compiling import compiled
from gp_core.registration.jrmpc_limits import LEAST_SPREAD, NOTHING
from gp_core.registration.lanes import (
    LANES,
    above,
    all_above,
    choose,
    exponential,
    lanes_of,
    larger,
    magnitude,
    not_at_most,
    put,
    square_root,
    take,
)
from gp_core.registration.rotation import CONVERGED_ANGLE2, NEWTON_STEPS, UNDETERMINED
from gp_core.registration.rotation_compiled import as_matrix, minimal_rotation, product
from gp_core.validation import FloatArray

__all__ = ["run_batch"]

IndexArray = NDArray[np.uint64]


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
    """Run many problems whose sets are of the same sizes, eight at a time.

    The answer to a problem does not depend on those beside it, to the last bit.

    Parameters
    ----------
    points : (B, 3, P) array, mm
        Points of all sets, each set about its own centroid.
    starts : (M + 1,) array of uint64
        Where each set starts.
    poses : (B, M, 7) array
        Start in, answer out; see `jrmpc_kernels.maximise`.
    centres : (B, 5, K) array
        Start in, answer out; see `jrmpc_kernels.maximise`.
    beta, sizes : (B,) array
        Outlier term and size of each problem.
    prior, epsilon : float
        As `jrmpc_kernels.maximise` takes them.
    max_iterations : int
        Iterations at most.
    still : float
        Change below which a problem is at rest and stops.
    iterations, change : (B,) array
        Out: how many iterations were run, and the largest change of the last.
    """
    begins = starts.astype(np.int64)
    for first in range(0, len(points), LANES):
        here = slice(first, min(first + LANES, len(points)))
        n = here.stop - first
        filled = np.minimum(np.arange(first, first + LANES), here.stop - 1)  # the last one fills up
        pose, centre = _in_lanes(poses[filled]), _in_lanes(centres[filled])
        n_done, last = np.zeros(LANES, np.int64), np.full(LANES, np.inf)
        limits = (prior, epsilon, float(still), max_iterations)
        _run(
            _in_lanes(points[filled]), begins, pose, centre, beta[filled], sizes[filled], limits, n_done, last
        )
        poses[here] = _from_lanes(pose, poses.shape[1:])[:n]
        centres[here] = _from_lanes(centre, centres.shape[1:])[:n]
        iterations[here], change[here] = n_done[:n], last[:n]


def _in_lanes(values: FloatArray) -> FloatArray:
    """Return the values of eight problems flat, with the problem as the last index."""
    return np.ascontiguousarray(np.moveaxis(values, 0, -1)).reshape(-1)


def _from_lanes(values: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    return np.moveaxis(values.reshape(*shape, LANES), -1, 0)


@compiled(cache=True)
def _run(
    points: FloatArray,
    starts: NDArray[np.int64],
    pose: FloatArray,
    centres: FloatArray,
    beta: FloatArray,
    sizes: FloatArray,
    limits: tuple[float, float, float, int],
    iterations: NDArray[np.int64],
    change: FloatArray,
) -> None:
    """Run eight problems; one that is at rest stays as it is while others go on."""
    prior, epsilon, still, max_iterations = limits
    n_centres = centres.size // (5 * LANES)
    most = np.max(starts[1:] - starts[:-1])
    moved, inverse = np.empty(3 * most * LANES), np.empty(most * LANES)
    table, scratch = np.empty(most * n_centres * LANES), np.empty(14 * LANES)
    moments, sums = np.empty(5 * n_centres * LANES), np.empty(5 * n_centres * LANES)
    outlier, size = take(beta, 0), take(sizes, 0)
    for n in range(max_iterations):
        active, running = not_at_most(take(change, 0), still), False
        for lane in range(LANES):
            if not change[lane] <= still:
                iterations[lane], running = n + 1, True
        if not running:
            break
        sums[:] = 0.0
        worst = lanes_of(0.0)
        for j in range(len(starts) - 1):
            begin, end = starts[j], starts[j + 1]
            _move(points, begin, end, pose, j, moved)
            _responsibilities(end - begin, centres, outlier, moved, table, inverse)
            _moments(end - begin, centres, moved, table, inverse, moments)
            worst = larger(worst, _pose_step(moments, centres, pose, j, sums, active, size, scratch))
        worst = larger(worst, _centre_step(sums, centres, prior, epsilon, active, size))
        put(change, 0, choose(active, worst, take(change, 0)))


@compiled()
def _pose_of(pose: Any, j: int) -> Any:
    at = j * 7 * LANES
    return take(pose, at), take(pose, at + LANES), take(pose, at + 2 * LANES), take(pose, at + 3 * LANES)


@compiled()
def _move(points: Any, begin: int, end: int, pose: Any, j: int, moved: Any) -> None:
    """Write the points of one set under its pose, coordinates of a point side by side."""
    r0, r1, r2, r3, r4, r5, r6, r7, r8 = as_matrix(_pose_of(pose, j))
    at, step = (j * 7 + 4) * LANES, points.size // 3
    tx, ty, tz = take(pose, at), take(pose, at + LANES), take(pose, at + 2 * LANES)
    for n in range(end - begin):
        i, out = (begin + n) * LANES, 3 * n * LANES
        x, y, z = take(points, i), take(points, step + i), take(points, 2 * step + i)
        put(moved, out, r0 * x + r1 * y + r2 * z + tx)
        put(moved, out + LANES, r3 * x + r4 * y + r5 * z + ty)
        put(moved, out + 2 * LANES, r6 * x + r7 * y + r8 * z + tz)


@compiled()
def _responsibilities(n_points: int, centres: Any, beta: Any, moved: Any, table: Any, inverse: Any) -> None:
    row = centres.size // 5
    for n in range(n_points):
        at = 3 * n * LANES
        x, y, z, total = take(moved, at), take(moved, at + LANES), take(moved, at + 2 * LANES), beta
        for k in range(0, row, LANES):
            dx, dy, dz = x - take(centres, k), y - take(centres, row + k), z - take(centres, 2 * row + k)
            minus_half_q, weight = take(centres, 3 * row + k) * -0.5, take(centres, 4 * row + k)
            likelihood = weight * exponential(minus_half_q * (dx * dx + dy * dy + dz * dz))
            put(table, n * row + k, likelihood)
            total = total + likelihood
        put(inverse, n * LANES, 1.0 / total)


@compiled()
def _moments(n_points: int, centres: Any, moved: Any, table: Any, inverse: Any, out: Any) -> None:
    row = centres.size // 5
    for k in range(0, row, LANES):
        x, y, z = take(centres, k), take(centres, row + k), take(centres, 2 * row + k)
        s0 = s1 = s2 = s3 = s4 = lanes_of(0.0)
        for n in range(n_points):
            at = 3 * n * LANES
            a = take(table, n * row + k) * take(inverse, n * LANES)
            dx, dy = take(moved, at) - x, take(moved, at + LANES) - y
            dz = take(moved, at + 2 * LANES) - z
            s0 = s0 + a
            s1 = s1 + a * dx
            s2 = s2 + a * dy
            s3 = s3 + a * dz
            s4 = s4 + a * (dx * dx + dy * dy + dz * dz)
        put(out, k, s0)
        put(out, row + k, s1)
        put(out, 2 * row + k, s2)
        put(out, 3 * row + k, s3)
        put(out, 4 * row + k, s4)


@compiled()
def _pose_step(
    moments: Any, centres: Any, pose: Any, j: int, sums: Any, active: Any, size: Any, scratch: Any
) -> Any:
    """Take the weighted means of one set's points to the centres, and add what it gives to these."""
    x, y, z, dx, dy, dz = _weighted_means(moments, centres)
    turn = _rotation(_covariance(moments, centres, x, y, z), scratch)
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = as_matrix(turn)
    ax, ay, az = x + dx, y + dy, z + dz
    m03 = x - (m00 * ax + m01 * ay + m02 * az)
    m13 = y - (m10 * ax + m11 * ay + m12 * az)
    m23 = z - (m20 * ax + m21 * ay + m22 * az)
    before, at = _pose_of(pose, j), j * 7 * LANES
    tx, ty, tz = take(pose, at + 4 * LANES), take(pose, at + 5 * LANES), take(pose, at + 6 * LANES)
    w0, w1, w2, w3 = product(turn, before)
    put(pose, at, choose(active, w0, before[0]))
    put(pose, at + LANES, choose(active, w1, before[1]))
    put(pose, at + 2 * LANES, choose(active, w2, before[2]))
    put(pose, at + 3 * LANES, choose(active, w3, before[3]))
    put(pose, at + 4 * LANES, choose(active, m00 * tx + m01 * ty + m02 * tz + m03, tx))
    put(pose, at + 5 * LANES, choose(active, m10 * tx + m11 * ty + m12 * tz + m13, ty))
    put(pose, at + 6 * LANES, choose(active, m20 * tx + m21 * ty + m22 * tz + m23, tz))
    _add_set(moments, (m00, m01, m02, m03, m10, m11, m12, m13, m20, m21, m22, m23), centres, sums)
    angle = 2.0 * square_root(turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3])
    return larger(angle, square_root(dx * dx + dy * dy + dz * dz) / size)


@compiled()
def _weighted_means(moments: Any, centres: Any) -> Any:
    row = centres.size // 5
    w = x = y = z = dx = dy = dz = lanes_of(0.0)
    for k in range(0, row, LANES):
        q = take(centres, 3 * row + k)
        u = q * take(moments, k)
        w = w + u
        x = x + u * take(centres, k)
        y = y + u * take(centres, row + k)
        z = z + u * take(centres, 2 * row + k)
        dx = dx + q * take(moments, row + k)
        dy = dy + q * take(moments, 2 * row + k)
        dz = dz + q * take(moments, 3 * row + k)
    there = above(w, NOTHING)
    w = choose(there, w, 1.0)
    none = 0.0
    return (
        choose(there, x / w, none),
        choose(there, y / w, none),
        choose(there, z / w, none),
        choose(there, dx / w, none),
        choose(there, dy / w, none),
        choose(there, dz / w, none),
    )


@compiled()
def _covariance(moments: Any, centres: Any, x: Any, y: Any, z: Any) -> Any:
    row = centres.size // 5
    xx = xy = xz = yx = yy = yz = zx = zy = zz = lanes_of(0.0)
    for k in range(0, row, LANES):
        q = take(centres, 3 * row + k)
        u = q * take(moments, k)
        ex, ey, ez = take(centres, k) - x, take(centres, row + k) - y, take(centres, 2 * row + k) - z
        mx = u * ex + q * take(moments, row + k)
        my = u * ey + q * take(moments, 2 * row + k)
        mz = u * ez + q * take(moments, 3 * row + k)
        xx = xx + ex * mx
        xy = xy + ex * my
        xz = xz + ex * mz
        yx = yx + ey * mx
        yy = yy + ey * my
        yz = yz + ey * mz
        zx = zx + ez * mx
        zy = zy + ez * my
        zz = zz + ez * mz
    return xx, xy, xz, yx, yy, yz, zx, zy, zz


@compiled()
def _rotation(h: Any, scratch: Any) -> Any:
    """Return the minimal rotation in each lane, as `rotation.minimal_rotation` does.

    Newton's method starts from the identity, and each lane stops by itself: so no problem is changed by those
    beside it. Where the method fails, the rotation is found one by one.
    """
    h0, h1, h2, h3, h4, h5, h6, h7, h8 = h
    size = magnitude(h0) + magnitude(h1) + magnitude(h2) + magnitude(h3) + magnitude(h4)
    least = (size + magnitude(h5) + magnitude(h6) + magnitude(h7) + magnitude(h8)) * UNDETERMINED
    one, zero = lanes_of(1.0), lanes_of(0.0)
    turn, going, failed = (one, zero, zero, zero), one, zero
    for _ in range(NEWTON_STEPS):
        definite, x, y, z = _newton_step(h, as_matrix(turn), least)
        failed = choose(above(going, definite), 1.0, failed)
        going = going * definite
        turned = product((one, x * 0.5, y * 0.5, z * 0.5), turn)
        moves = above(going, 0.5)
        turn = (
            choose(moves, turned[0], turn[0]),
            choose(moves, turned[1], turn[1]),
            choose(moves, turned[2], turn[2]),
            choose(moves, turned[3], turn[3]),
        )
        going = choose(above(CONVERGED_ANGLE2, x * x + y * y + z * z), 0.0, going)
        if all_above(0.5, going):
            break
    return turn if all_above(0.5, failed) else _one_by_one(h, turn, failed, scratch)


@compiled()
def _newton_step(h: Any, r: Any, least: Any) -> Any:
    """Return whether the step is to a maximum, as 1 or 0, and the step; see `rotation`."""
    h0, h1, h2, h3, h4, h5, h6, h7, h8 = h
    r0, r1, r2, r3, r4, r5, r6, r7, r8 = r
    xx, xy, xz = h0 * r0 + h1 * r1 + h2 * r2, h0 * r3 + h1 * r4 + h2 * r5, h0 * r6 + h1 * r7 + h2 * r8
    yx, yy, yz = h3 * r0 + h4 * r1 + h5 * r2, h3 * r3 + h4 * r4 + h5 * r5, h3 * r6 + h4 * r7 + h5 * r8
    zx, zy, zz = h6 * r0 + h7 * r1 + h8 * r2, h6 * r3 + h7 * r4 + h8 * r5, h6 * r6 + h7 * r7 + h8 * r8
    d0, a, b, c = yy + zz, (xy + yx) * -0.5, (xz + zx) * -0.5, (yz + zy) * -0.5
    l10, l20 = a / d0, b / d0
    d1, c = xx + zz - l10 * a, c - l20 * a
    l21 = c / d1
    d2 = xx + yy - l20 * b - l21 * c
    definite = choose(above(d1, least), choose(above(d2, least), 1.0, 0.0), 0.0)
    bx = zy - yz
    by = xz - zx - l10 * bx
    z = (yx - xy - (l20 * bx + l21 * by)) / d2
    y = by / d1 - l21 * z
    return choose(above(d0, least), definite, 0.0), bx / d0 - l10 * y - l20 * z, y, z


@compiled()
def _one_by_one(h: Any, turn: Any, failed: Any, scratch: Any) -> Any:
    for n in range(9):
        put(scratch, n * LANES, h[n])
    for n in range(4):
        put(scratch, (9 + n) * LANES, turn[n])
    put(scratch, 13 * LANES, failed)
    for lane in range(LANES):
        s = scratch[lane::LANES]
        if s[13] > 0.5:
            s[9], s[10], s[11], s[12] = minimal_rotation(
                (s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8])
            )
    at = 9 * LANES
    return (
        take(scratch, at),
        take(scratch, at + LANES),
        take(scratch, at + 2 * LANES),
        take(scratch, at + 3 * LANES),
    )


@compiled()
def _add_set(moments: Any, motion: Any, centres: Any, sums: Any) -> None:
    row = centres.size // 5
    m00, m01, m02, m03, m10, m11, m12, m13, m20, m21, m22, m23 = motion
    for k in range(0, row, LANES):
        x, y, z = take(centres, k), take(centres, row + k), take(centres, 2 * row + k)
        a, px, py = take(moments, k), take(moments, row + k), take(moments, 2 * row + k)
        pz = take(moments, 3 * row + k)
        cx = m00 * x + m01 * y + m02 * z + m03 - x
        cy = m10 * x + m11 * y + m12 * z + m13 - y
        cz = m20 * x + m21 * y + m22 * z + m23 - z
        rx = m00 * px + m01 * py + m02 * pz
        ry = m10 * px + m11 * py + m12 * pz
        rz = m20 * px + m21 * py + m22 * pz
        put(sums, k, take(sums, k) + a)
        put(sums, row + k, take(sums, row + k) + rx + a * cx)
        put(sums, 2 * row + k, take(sums, 2 * row + k) + ry + a * cy)
        put(sums, 3 * row + k, take(sums, 3 * row + k) + rz + a * cz)
        square = take(moments, 4 * row + k) + 2.0 * (rx * cx + ry * cy + rz * cz)
        put(sums, 4 * row + k, take(sums, 4 * row + k) + square + a * (cx * cx + cy * cy + cz * cz))


@compiled()
def _centre_step(sums: Any, centres: Any, prior: float, epsilon: float, active: Any, size: Any) -> Any:
    """Move each centre to the mean of its moved points, then set its variance about that mean."""
    row = centres.size // 5
    floor = (size * LEAST_SPREAD) * (size * LEAST_SPREAD)
    change = lanes_of(0.0)
    for k in range(0, row, LANES):
        there = above(take(sums, k), NOTHING)  # else no point has weight here: the centre stays
        w = choose(there, take(sums, k), 1.0)
        x, y = choose(there, take(sums, row + k) / w, 0.0), choose(there, take(sums, 2 * row + k) / w, 0.0)
        z = choose(there, take(sums, 3 * row + k) / w, 0.0)
        moved = x * x + y * y + z * z
        variance = larger((take(sums, 4 * row + k) / w - moved) / 3.0, 0.0) + epsilon
        before, weight = take(centres, 3 * row + k), take(centres, 4 * row + k)
        precision = choose(there, 1.0 / larger(variance, floor), before)
        change = larger(change, larger(square_root(moved) / size, magnitude(1.0 - before / precision)))
        put(centres, k, take(centres, k) + choose(active, x, 0.0))
        put(centres, row + k, take(centres, row + k) + choose(active, y, 0.0))
        put(centres, 2 * row + k, take(centres, 2 * row + k) + choose(active, z, 0.0))
        put(centres, 3 * row + k, choose(active, precision, before))
        made = choose(there, prior * precision * square_root(precision), weight)
        put(centres, 4 * row + k, choose(active, made, weight))
    return change
