"""Compiled rotations: the best one for a (3, 3) covariance, without LAPACK's cost for so small a matrix.

`gp_core.registration.kernels` compiles these into its own. numba's cache looks at the file of the caller
only: after a change here, touch that file too.
"""

from __future__ import annotations

import math

import numpy as np

from gp_core.checks import FloatArray
from gp_core.registration.compiling import compiled

__all__ = ["best_turn", "product", "write_rotation"]

# Other threads may run meanwhile; a division by zero gives inf, as in NumPy, and so costs no branch.

_OPEN = 1e-10  # relative gap below which a rotation is not determined
_SETTLED = 1e-17  # squared angle of a Newton step whose successor would be below rounding
_NEWTON_STEPS = 8
_JACOBI_SWEEPS = 8


@compiled(cache=True)
def best_turn(h: FloatArray, turned: FloatArray) -> tuple[float, float, float, float]:
    """Return the unit quaternion (w first) of the rotation R that makes trace(R^T h) largest.

    Newton's method on rotations, from the identity: at home when a pose has nearly settled. That the matrix
    of its last step is positive definite proves the maximum to be the global one, since all other stationary
    rotations are saddles or minima. Where it is not, `_horn` decides. `turned` (3, 3) is scratch.
    """
    scale = 0.0
    for a in range(3):
        for b in range(3):
            turned[a, b] = h[a, b]
            scale += abs(h[a, b])
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    for _ in range(_NEWTON_STEPS):
        definite, ox, oy, oz = _newton_step(turned, _OPEN * scale)
        if not definite:
            break
        w, x, y, z = product(1.0, 0.5 * ox, 0.5 * oy, 0.5 * oz, w, x, y, z)
        if ox * ox + oy * oy + oz * oz < _SETTLED:
            return w, x, y, z
        _turn_back(h, w, x, y, z, turned)
    return _horn(h)


@compiled()
def _newton_step(g: FloatArray, least: float) -> tuple[bool, float, float, float]:
    """Solve (tr(S) I - S) o = b by L D L^T; S is the symmetric part of `g`, b its axial vector."""
    bx, by, bz = g[2, 1] - g[1, 2], g[0, 2] - g[2, 0], g[1, 0] - g[0, 1]
    xy, xz, yz = -0.5 * (g[0, 1] + g[1, 0]), -0.5 * (g[0, 2] + g[2, 0]), -0.5 * (g[1, 2] + g[2, 1])
    d0 = g[1, 1] + g[2, 2]
    if not d0 > least:
        return False, 0.0, 0.0, 0.0
    l10, l20 = xy / d0, xz / d0
    d1 = g[0, 0] + g[2, 2] - l10 * xy
    if not d1 > least:
        return False, 0.0, 0.0, 0.0
    rest = yz - l20 * xy
    l21 = rest / d1
    d2 = g[0, 0] + g[1, 1] - l20 * xz - l21 * rest
    if not d2 > least:
        return False, 0.0, 0.0, 0.0
    by -= l10 * bx
    bz -= l20 * bx + l21 * by
    oz = bz / d2
    oy = by / d1 - l21 * oz
    return True, bx / d0 - l10 * oy - l20 * oz, oy, oz


@compiled()
def _horn(h: FloatArray) -> tuple[float, float, float, float]:
    """Return the top eigenvector of Horn's (4, 4) matrix; of many that fit, the one nearest to no turn.

    Horn, J. Opt. Soc. Am. A 4(4), 1987. https://doi.org/10.1364/JOSAA.4.000629
    """
    n = np.empty((4, 4))
    n[0, 0] = h[0, 0] + h[1, 1] + h[2, 2]
    n[1, 0], n[2, 0], n[3, 0] = h[2, 1] - h[1, 2], h[0, 2] - h[2, 0], h[1, 0] - h[0, 1]
    for a in range(3):
        n[0, a + 1] = n[a + 1, 0]
        for b in range(3):
            n[a + 1, b + 1] = h[a, b] + h[b, a]
        n[a + 1, a + 1] -= n[0, 0]
    vectors = _diagonalise(n)
    top = max(n[0, 0], n[1, 1], n[2, 2], n[3, 3])
    bottom = min(n[0, 0], n[1, 1], n[2, 2], n[3, 3])
    w = x = y = z = 0.0
    best = 0
    for k in range(4):
        best = k if n[k, k] == top else best
        if top - n[k, k] <= _OPEN * (top - bottom):
            share = vectors[0, k]
            w += share * share
            x += share * vectors[1, k]
            y += share * vectors[2, k]
            z += share * vectors[3, k]
    if w <= _OPEN:
        w, x, y, z = vectors[0, best], vectors[1, best], vectors[2, best], vectors[3, best]
    return product(1.0, 0.0, 0.0, 0.0, w, x, y, z)


@compiled()
def _diagonalise(n: FloatArray) -> FloatArray:
    """Make a symmetric (4, 4) matrix diagonal in place, and return its eigenvectors in columns (Jacobi)."""
    v = np.eye(4)
    for _ in range(_JACOBI_SWEEPS):
        for p in range(3):
            for q in range(p + 1, 4):
                if n[p, q] == 0.0:
                    continue
                ratio = (n[q, q] - n[p, p]) / (2.0 * n[p, q])
                t = math.copysign(1.0, ratio) / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
                c = 1.0 / math.sqrt(t * t + 1.0)
                _mix(n, p, q, c, t * c)
                _mix(n.T, p, q, c, t * c)
                _mix(v, p, q, c, t * c)
    return v


@compiled()
def _mix(columns: FloatArray, p: int, q: int, c: float, s: float) -> None:
    """Turn columns `p` and `q` into each other."""
    for k in range(4):
        a, b = columns[k, p], columns[k, q]
        columns[k, p], columns[k, q] = c * a - s * b, s * a + c * b


@compiled()
def product(
    aw: float, ax: float, ay: float, az: float, bw: float, bx: float, by: float, bz: float
) -> tuple[float, float, float, float]:
    """Multiply two quaternions and make the product unit: the turn b, then the turn a."""
    w = aw * bw - ax * bx - ay * by - az * bz
    x = aw * bx + ax * bw + ay * bz - az * by
    y = aw * by - ax * bz + ay * bw + az * bx
    z = aw * bz + ax * by - ay * bx + az * bw
    scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return w * scale, x * scale, y * scale, z * scale


@compiled(cache=True)
def write_rotation(w: float, x: float, y: float, z: float, out: FloatArray) -> None:
    """Write the rotation matrix of a unit quaternion into the first three columns of `out`."""
    out[0, 0], out[0, 1], out[0, 2] = (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
    )
    out[1, 0], out[1, 1], out[1, 2] = (
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
    )
    out[2, 0], out[2, 1], out[2, 2] = (
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


@compiled()
def _turn_back(h: FloatArray, w: float, x: float, y: float, z: float, out: FloatArray) -> None:
    """Write h R^T: the covariance after the source has been turned by R."""
    write_rotation(w, x, y, z, out)
    r00, r01, r02, r10, r11, r12 = out[0, 0], out[0, 1], out[0, 2], out[1, 0], out[1, 1], out[1, 2]
    r20, r21, r22 = out[2, 0], out[2, 1], out[2, 2]
    for a in range(3):
        x, y, z = h[a, 0], h[a, 1], h[a, 2]
        out[a, 0] = x * r00 + y * r01 + z * r02
        out[a, 1] = x * r10 + y * r11 + z * r12
        out[a, 2] = x * r20 + y * r21 + z * r22
