"""The optimal rotation between two sets of points, in plain numbers.

Plain Python that Numba can compile; `gp_core.registration.rotation_compiled` does so for the kernels of JRMPC
(`gp_core.registration.jrmpc_kernels`) and of the robust fit (`gp_core.registration.student_t_fit_compiled`).
Rotations are unit quaternions, w first.
"""

from __future__ import annotations

import math
from typing import TypeAlias

__all__ = [
    "CONVERGED_ANGLE2",
    "IDENTITY",
    "NEWTON_STEPS",
    "ROTATIONS",
    "UNDETERMINED",
    "Matrix3",
    "Quaternion",
    "as_matrix",
    "minimal_rotation",
    "optimal_rotation",
    "product",
]

Quaternion: TypeAlias = tuple[float, float, float, float]
Matrix3: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
Symmetric4: TypeAlias = tuple[float, float, float, float, float, float, float, float, float, float]

IDENTITY = (1.0, 0.0, 0.0, 0.0)
"""The identity."""

UNDETERMINED = 1e-10  # relative gap below which a rotation is not determined
CONVERGED_ANGLE2 = 1e-14  # squared angle of a Newton step after which the next would be below rounding
NEWTON_STEPS = 12
_SQUARINGS = 40
_SQUARINGS_OF_TIES = 24  # each doubles the rounding difference between eigenvalues that tie
_ALIGNED = 1.0 - 1e-6  # trace of the square of a matrix of trace 1: only the top eigenvector is left


def optimal_rotation(h: Matrix3, start: Quaternion) -> Quaternion:
    """Return the rotation R that maximises trace(R^T h), by Newton's method on rotations.

    A positive definite Hessian in the last step proves that the maximum is the global one, since all other
    stationary rotations are saddles or minima. Where the Hessian is not positive definite, Newton restarts
    from Horn's eigenvector; where that fails too, the rotation is under-determined.

    Parameters
    ----------
    h : 9 floats
        The (3, 3) cross-covariance, row by row: sum of w (target - centre) (source - centre)^T.
    start : Quaternion
        Where Newton's method starts.

    Returns
    -------
    Quaternion
        Of the rotation; NaN where it is under-determined.
    """
    scale = _size(h)
    quaternion, restarted = start, False
    for _ in range(NEWTON_STEPS):
        definite, x, y, z = _newton_step(h, as_matrix(quaternion), UNDETERMINED * scale)
        if definite:
            quaternion = product((1.0, 0.5 * x, 0.5 * y, 0.5 * z), quaternion)
            if x * x + y * y + z * z < CONVERGED_ANGLE2:
                break
        elif restarted:
            return math.nan, math.nan, math.nan, math.nan
        else:
            quaternion, restarted = _top(_horn(h, scale, _SQUARINGS)), True
    return quaternion


def minimal_rotation(h: Matrix3) -> Quaternion:
    """Return the rotation R that maximises trace(R^T h); among several, the one nearest to the identity.

    Repeated squaring of Horn's matrix converges to the projector onto the eigenvectors with the largest
    eigenvalue; the first row of that projector is the projection of the identity.

    Parameters
    ----------
    h : 9 floats
        The (3, 3) cross-covariance, row by row.

    Returns
    -------
    Quaternion
        Of the rotation, always finite.
    """
    quaternion = optimal_rotation(h, IDENTITY)
    if not math.isnan(quaternion[0]):
        return quaternion
    scale = _size(h)
    if scale == 0.0:
        return IDENTITY
    n = _horn(h, scale, _SQUARINGS_OF_TIES)
    return product(IDENTITY, (n[0], n[1], n[2], n[3])) if n[0] > UNDETERMINED else _top(n)


def _size(h: Matrix3) -> float:
    size = 0.0
    for i in range(9):
        size += abs(h[i])
    return size


def _newton_step(h: Matrix3, r: Matrix3, least: float) -> tuple[bool, float, float, float]:
    """Solve (tr(S) 1 - S) o = b by L D L^T; S is the symmetric part of h R^T, b its axial vector."""
    h0, h1, h2, h3, h4, h5, h6, h7, h8 = h
    r0, r1, r2, r3, r4, r5, r6, r7, r8 = r
    xx, xy, xz = h0 * r0 + h1 * r1 + h2 * r2, h0 * r3 + h1 * r4 + h2 * r5, h0 * r6 + h1 * r7 + h2 * r8
    yx, yy, yz = h3 * r0 + h4 * r1 + h5 * r2, h3 * r3 + h4 * r4 + h5 * r5, h3 * r6 + h4 * r7 + h5 * r8
    zx, zy, zz = h6 * r0 + h7 * r1 + h8 * r2, h6 * r3 + h7 * r4 + h8 * r5, h6 * r6 + h7 * r7 + h8 * r8
    d0 = yy + zz
    if not d0 > least:
        return False, 0.0, 0.0, 0.0
    a, b, c = -0.5 * (xy + yx), -0.5 * (xz + zx), -0.5 * (yz + zy)
    l10, l20 = a / d0, b / d0
    d1 = xx + zz - l10 * a
    if not d1 > least:
        return False, 0.0, 0.0, 0.0
    c -= l20 * a
    l21 = c / d1
    d2 = xx + yy - l20 * b - l21 * c
    if not d2 > least:
        return False, 0.0, 0.0, 0.0
    bx, by, bz = zy - yz, xz - zx, yx - xy
    by -= l10 * bx
    bz -= l20 * bx + l21 * by
    z = bz / d2
    y = by / d1 - l21 * z
    return True, bx / d0 - l10 * y - l20 * z, y, z


def _horn(h: Matrix3, scale: float, n_squarings: int) -> Symmetric4:
    """Square Horn's (4, 4) matrix until only its top eigenvector, or those that tie with it, are left.

    Horn, J. Opt. Soc. Am. A 4(4), 1987. https://doi.org/10.1364/JOSAA.4.000629
    """
    xx, xy, xz, yx, yy, yz, zx, zy, zz = h
    shift = 2.0 * scale  # makes all eigenvalues positive, so that the top one is the largest in magnitude
    n = (
        shift + xx + yy + zz,
        zy - yz,
        xz - zx,
        yx - xy,
        shift + xx - yy - zz,
        xy + yx,
        xz + zx,
        shift + yy - xx - zz,
        yz + zy,
        shift + zz - xx - yy,
    )
    for _ in range(n_squarings):
        n = _squared(n)
        if n[0] + n[4] + n[7] + n[9] > _ALIGNED:
            break
    return n


def _top(n: Symmetric4) -> Quaternion:
    """Return the row of the largest diagonal element, as a unit quaternion."""
    a, b, c, d, e, f, g, i, k, m = n
    top = max(a, e, i, m)
    if a == top:
        return product(IDENTITY, (a, b, c, d))
    if e == top:
        return product(IDENTITY, (b, e, f, g))
    if i == top:
        return product(IDENTITY, (c, f, i, k))
    return product(IDENTITY, (d, g, k, m))


def _squared(n: Symmetric4) -> Symmetric4:
    """Return the square of a symmetric matrix, given by its upper triangle, over its trace."""
    a, b, c, d, e, f, g, i, k, m = n
    size = 1.0 / (a + e + i + m)
    a, b, c, d, e = a * size, b * size, c * size, d * size, e * size
    f, g, i, k, m = f * size, g * size, i * size, k * size, m * size
    return (
        a * a + b * b + c * c + d * d,
        a * b + b * e + c * f + d * g,
        a * c + b * f + c * i + d * k,
        a * d + b * g + c * k + d * m,
        b * b + e * e + f * f + g * g,
        b * c + e * f + f * i + g * k,
        b * d + e * g + f * k + g * m,
        c * c + f * f + i * i + k * k,
        c * d + f * g + i * k + k * m,
        d * d + g * g + k * k + m * m,
    )


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Multiply two quaternions and normalise the product: first the rotation b, then the rotation a.

    Parameters
    ----------
    a, b : Quaternion
        Factors, w first.

    Returns
    -------
    Quaternion
        The unit product.
    """
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    w = aw * bw - ax * bx - ay * by - az * bz
    x = aw * bx + ax * bw + ay * bz - az * by
    y = aw * by - ax * bz + ay * bw + az * bx
    z = aw * bz + ax * by - ay * bx + az * bw
    size = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return w * size, x * size, y * size, z * size


def as_matrix(quaternion: Quaternion) -> Matrix3:
    """Return the rotation matrix of a unit quaternion, row by row.

    Parameters
    ----------
    quaternion : Quaternion
        Of unit length, w first.

    Returns
    -------
    Matrix3
        The (3, 3) matrix, row by row.
    """
    w, x, y, z = quaternion
    x2, y2, z2 = 2.0 * x, 2.0 * y, 2.0 * z
    wx, wy, wz, xx, xy, xz = w * x2, w * y2, w * z2, x * x2, x * y2, x * z2
    yy, yz, zz = y * y2, y * z2, z * z2
    return 1.0 - yy - zz, xy - wz, xz + wy, xy + wz, 1.0 - xx - zz, yz - wx, xz - wy, yz + wx, 1.0 - xx - yy


ROTATIONS = (
    _size,
    product,
    as_matrix,
    _squared,
    _horn,
    _top,
    _newton_step,
    optimal_rotation,
    minimal_rotation,
)
"""All functions of this module, each after those it calls."""
