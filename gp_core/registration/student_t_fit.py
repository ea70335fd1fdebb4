"""The inner loop of the fit to named points, in plain Python that Numba can compile.

One source runs in two ways with the same results: as it stands, with no start-up time, in a few milliseconds;
or compiled by `gp_core.registration.student_t_fit_compiled`, which takes half a second to load and then runs
forty times faster. `gp_core.registration.named_points` decides which.

Therefore everything here is a number or a one-dimensional buffer (a memoryview in plain Python, an array when
compiled) with x, y, z of each point in a row. Powers are avoided, and nothing but an overflow divides by
zero, because the two would differ there.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence
from typing import TypeAlias

from gp_core.registration.rotation import as_matrix, optimal_rotation

__all__ = [
    "KERNELS",
    "NU",
    "POSE_SIZE",
    "PRIOR_WEIGHT",
    "TOLERANCE",
    "TYPICAL_NOISE_MM",
    "best_exchange",
    "fit_student_t",
]

Buffer: TypeAlias = MutableSequence[float]
Vector: TypeAlias = tuple[float, float, float]
Symmetric3: TypeAlias = tuple[float, float, float, float, float, float]

TYPICAL_NOISE_MM = 0.05
"""Scale of a careful touch, mm per coordinate: the prior of sigma."""

NU = 4.0
"""Degrees of freedom of a touch error."""

PRIOR_WEIGHT = 2.0
"""Weight of the prior of sigma, in coordinates."""

POSE_SIZE = 16
"""Quaternion (4), translation (3), rotation matrix row by row (9)."""

TOLERANCE = 1e-5
"""Change of a weight, and relative change of the squared scale, below which a fit has converged."""

_STRIDE, _LONGEST_STRIDE = 2.0, 8.0
_NEAR = 0.1  # step of the logarithm of the squared scale
_SCREENING_ITERATIONS = 3
_SLACK = 4.0


def fit_student_t(
    mean: Buffer,
    variances: Buffer,
    touches: Buffer,
    counts: Buffer,
    weights: Buffer,
    precision: Buffer,
    points: Buffer,
    errors: Buffer,
    pose: Buffer,
    noise: float,
    n_iterations: int,
) -> tuple[float, float, float]:
    """Find pose, weights and scale for one assignment of names to touches; `named_points` explains the model.

    Parameters
    ----------
    mean, touches : (3 n,)
        Mean of the atlas, and the touches, mm.
    variances : (n,)
        Variances of the features between animals, mm^2 per coordinate.
    counts : (n,)
        Of how many touches each one is the mean: the squared scale of its error is that much smaller.
    weights : (n,)
        In: start values. Out: about 1 for an ordinary touch, towards 0 for an outlier.
    precision, points, errors : (n,), (3 n,), (n,)
        Out: inverse variances of the touches, the touches in the atlas frame, expected squared touch errors.
    pose : (16,)
        In: a quaternion to start from. Out: quaternion, translation (mm), rotation matrix row by row.
    noise : float
        Scale of the touch errors, mm; 0: to be estimated.
    n_iterations : int
        Maximum number of iterations.

    Returns
    -------
    sigma2, change, neg_log_posterior : float
        Squared scale of the touch errors (mm^2), largest change that one more iteration would make,
        negative log posterior.
    """
    given = noise > 0.0
    sigma2 = noise * noise if given else TYPICAL_NOISE_MM * TYPICAL_NOISE_MM
    change, shift, stride = math.inf, 0.0, _STRIDE
    for iteration in range(n_iterations + 1):
        total = _update_precision(variances, counts, weights, sigma2, precision)
        centre, touch_centre = _mean_of(mean, precision, total), _mean_of(touches, precision, total)
        _update_rotation(mean, centre, touches, touch_centre, precision, total, pose)
        _to_atlas_frame(touches, touch_centre, pose, centre, points)
        change = _expected_errors(mean, centre, counts, weights, sigma2, total, precision, points, errors)
        if not given:
            previous, shift = shift, _log_scale_step(counts, errors, sigma2)
            stride = _next_stride(stride, previous, shift)
            change = max(change, abs(shift))
        if change < TOLERANCE or iteration == n_iterations:
            break
        for k in range(len(weights)):
            weights[k] = (NU + 3.0) / (NU + counts[k] * errors[k] / sigma2)
        sigma2 *= math.exp(stride * shift)
    for a in range(3):
        r = 7 + 3 * a
        pose[4 + a] = touch_centre[a] - (
            pose[r] * centre[0] + pose[r + 1] * centre[1] + pose[r + 2] * centre[2]
        )
    return (
        sigma2,
        change,
        _neg_log_posterior(mean, variances, counts, weights, precision, points, sigma2, given),
    )


def best_exchange(
    mean: Buffer,
    variances: Buffer,
    touches: Buffer,
    counts: Buffer,
    weights: Buffer,
    precision: Buffer,
    points: Buffer,
    errors: Buffer,
    pose: Buffer,
    noise: float,
    n_iterations: int,
    below: float,
) -> tuple[float, float, float]:
    """Fit the touches with every pair of names exchanged, and return the best pair.

    A few iterations reject most exchanges: in early iterations the negative log posterior is hardly ever
    above its value at convergence, and never by `_SLACK` in some thousands of real and simulated sets of
    touches.

    Parameters
    ----------
    mean, variances, touches, counts, weights, precision, points, errors, pose, noise, n_iterations
        As for `fit_student_t`.
    below : float
        Negative log posterior below which an exchange is of interest.

    Returns
    -------
    i, j : float
        The touches whose exchange fits best.
    neg_log_posterior : float
        With them exchanged; infinite where none comes near `below`.
    """
    n = len(variances)
    first = second = 0
    least = math.inf
    start = (pose[0], pose[1], pose[2], pose[3])
    for i in range(n):
        for j in range(i + 1, n):
            _exchange(touches, counts, i, j)
            neg_log_posterior = below + _SLACK
            for n_most in (_SCREENING_ITERATIONS, n_iterations):
                if neg_log_posterior > below + _SLACK:
                    break
                for k in range(n):
                    weights[k] = 1.0
                pose[0], pose[1], pose[2], pose[3] = start
                _, _, neg_log_posterior = fit_student_t(
                    mean, variances, touches, counts, weights, precision, points, errors, pose, noise, n_most
                )
            if neg_log_posterior < least:
                least, first, second = neg_log_posterior, i, j
            _exchange(touches, counts, i, j)
    return 1.0 * first, 1.0 * second, least


def _exchange(touches: Buffer, counts: Buffer, i: int, j: int) -> None:
    counts[i], counts[j] = counts[j], counts[i]
    for a in range(3):
        touches[3 * i + a], touches[3 * j + a] = touches[3 * j + a], touches[3 * i + a]


def _update_precision(
    variances: Buffer, counts: Buffer, weights: Buffer, sigma2: float, precision: Buffer
) -> float:
    """Write the inverse variance of each touch, with the shape integrated out, and return their sum."""
    total = 0.0
    for j in range(len(variances)):
        p = 1.0 / (variances[j] + sigma2 / (counts[j] * weights[j]))
        precision[j] = p
        total += p
    return total


def _mean_of(points: Buffer, precision: Buffer, total: float) -> Vector:
    x = y = z = 0.0
    for j in range(len(precision)):
        p = precision[j]
        x += p * points[3 * j]
        y += p * points[3 * j + 1]
        z += p * points[3 * j + 2]
    return x / total, y / total, z / total


def _update_rotation(
    mean: Buffer,
    centre: Vector,
    touches: Buffer,
    touch_centre: Vector,
    precision: Buffer,
    total: float,
    pose: Buffer,
) -> None:
    """Rotate the mean to the touches, both about their weighted centres (weighted Procrustes)."""
    cx, cy, cz = centre
    tx, ty, tz = touch_centre
    xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
    for j in range(len(precision)):
        share = precision[j] / total
        x, y, z = mean[3 * j] - cx, mean[3 * j + 1] - cy, mean[3 * j + 2] - cz
        u = share * (touches[3 * j] - tx)
        v = share * (touches[3 * j + 1] - ty)
        w = share * (touches[3 * j + 2] - tz)
        xx += u * x
        xy += u * y
        xz += u * z
        yx += v * x
        yy += v * y
        yz += v * z
        zx += w * x
        zy += w * y
        zz += w * z
    quaternion = optimal_rotation((xx, xy, xz, yx, yy, yz, zx, zy, zz), (pose[0], pose[1], pose[2], pose[3]))
    pose[0], pose[1], pose[2], pose[3] = quaternion
    rotation = as_matrix(quaternion)
    for i in range(9):
        pose[7 + i] = rotation[i]


def _to_atlas_frame(
    touches: Buffer, touch_centre: Vector, pose: Buffer, centre: Vector, points: Buffer
) -> None:
    """Write the touches in the atlas frame."""
    tx, ty, tz = touch_centre
    cx, cy, cz = centre
    r0, r1, r2, r3, r4 = pose[7], pose[8], pose[9], pose[10], pose[11]
    r5, r6, r7, r8 = pose[12], pose[13], pose[14], pose[15]
    for i in range(0, len(touches), 3):
        x, y, z = touches[i] - tx, touches[i + 1] - ty, touches[i + 2] - tz
        points[i] = r0 * x + r3 * y + r6 * z + cx
        points[i + 1] = r1 * x + r4 * y + r7 * z + cy
        points[i + 2] = r2 * x + r5 * y + r8 * z + cz


def _expected_errors(
    mean: Buffer,
    centre: Vector,
    counts: Buffer,
    weights: Buffer,
    sigma2: float,
    total: float,
    precision: Buffer,
    points: Buffer,
    errors: Buffer,
) -> float:
    """Write the expected squared error of each touch, and return the largest change of a weight."""
    cx, cy, cz = centre
    ixx, ixy, ixz, iyy, iyz, izz = _inverse(_inertia(points, centre, precision))
    trace = ixx + iyy + izz
    change = 0.0
    for j in range(len(precision)):
        px, py, pz = points[3 * j], points[3 * j + 1], points[3 * j + 2]
        x, y, z = px - cx, py - cy, pz - cz
        through_rotation = (
            (x * x + y * y + z * z) * trace
            - (ixx * x * x + iyy * y * y + izz * z * z)
            - 2.0 * (ixy * x * y + ixz * x * z + iyz * y * z)
        )
        x, y, z = px - mean[3 * j], py - mean[3 * j + 1], pz - mean[3 * j + 2]
        p, w = precision[j], weights[j]
        noise = sigma2 / (counts[j] * w)
        squared = x * x + y * y + z * z + 3.0 / total + through_rotation
        error = noise * noise * p * p * squared + 3.0 * noise * (1.0 - noise * p)
        errors[j] = error
        step = abs((NU + 3.0) / (NU + counts[j] * error / sigma2) - w)
        if not step <= change:
            change = step
    return change


def _inertia(points: Buffer, centre: Vector, precision: Buffer) -> Symmetric3:
    cx, cy, cz = centre
    xx = xy = xz = yy = yz = zz = 0.0
    for j in range(len(precision)):
        p = precision[j]
        x, y, z = points[3 * j] - cx, points[3 * j + 1] - cy, points[3 * j + 2] - cz
        xx += p * x * x
        xy += p * x * y
        xz += p * x * z
        yy += p * y * y
        yz += p * y * z
        zz += p * z * z
    return yy + zz, -xy, -xz, xx + zz, -yz, xx + yy


def _inverse(n: Symmetric3) -> Symmetric3:
    """Return the inverse of a symmetric matrix, given by its upper triangle."""
    a, b, c, d, e, f = n
    af, bf, cf = d * f - e * e, c * e - b * f, b * e - c * d
    size = 1.0 / (a * af + b * bf + c * cf)
    return (
        af * size,
        bf * size,
        cf * size,
        (a * f - c * c) * size,
        (b * c - a * e) * size,
        (a * d - b * b) * size,
    )


def _log_scale_step(counts: Buffer, errors: Buffer, sigma2: float) -> float:
    """Return the change of the logarithm of the squared scale that the expected errors suggest."""
    total = PRIOR_WEIGHT * TYPICAL_NOISE_MM * TYPICAL_NOISE_MM
    for k in range(len(errors)):
        error = counts[k] * errors[k]
        total += (NU + 3.0) / (NU + error / sigma2) * error
    return math.log(total / ((PRIOR_WEIGHT + 3.0 * len(errors)) * sigma2))


def _next_stride(stride: float, previous: float, shift: float) -> float:
    """Return the over-relaxation factor of the next step of the scale."""
    if abs(shift) > _NEAR:
        return _STRIDE
    if previous * shift > 0.0:
        return min(1.3 * stride, _LONGEST_STRIDE)
    return max(0.5 * stride, 1.0)


def _neg_log_posterior(
    mean: Buffer,
    variances: Buffer,
    counts: Buffer,
    weights: Buffer,
    precision: Buffer,
    points: Buffer,
    sigma2: float,
    given: bool,
) -> float:
    """Return the negative log posterior of shapes, touch errors and their scale."""
    shape = touch = 0.0
    for j in range(len(weights)):
        x, y, z = (
            points[3 * j] - mean[3 * j],
            points[3 * j + 1] - mean[3 * j + 1],
            points[3 * j + 2] - mean[3 * j + 2],
        )
        squared = precision[j] * precision[j] * (x * x + y * y + z * z)
        noise = sigma2 / (counts[j] * weights[j])
        shape += variances[j] * squared
        touch += math.log1p(counts[j] * noise * noise * squared / (NU * sigma2))
    neg_log_posterior = 0.5 * (shape + (NU + 3.0) * touch)
    if given:
        return neg_log_posterior
    freedom = PRIOR_WEIGHT + 3.0 * len(weights)
    prior = PRIOR_WEIGHT * TYPICAL_NOISE_MM * TYPICAL_NOISE_MM / sigma2
    return neg_log_posterior + 0.5 * (freedom * math.log(sigma2) + prior)


KERNELS = (
    _update_rotation,
    _update_precision,
    _mean_of,
    _to_atlas_frame,
    _inertia,
    _inverse,
    _expected_errors,
    _log_scale_step,
    _next_stride,
    _neg_log_posterior,
    fit_student_t,
    _exchange,
    best_exchange,
)
"""All functions of this module, each after those of it that it calls."""
