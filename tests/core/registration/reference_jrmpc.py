"""JRMPC in plain NumPy, written the obvious way: the compiled version must agree, and is timed against it.

Follows Evangelidis and Horaud (IEEE TPAMI 2018, https://doi.org/10.1109/TPAMI.2017.2717829), one line of
algebra per line of code, and holds every (points × centres) table in memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class ReferenceResult(NamedTuple):
    rotations: FloatArray
    translations: FloatArray
    centres: FloatArray
    variances: FloatArray
    objective: FloatArray


def reference_jrmpc(
    point_sets: Sequence[FloatArray],
    centres: FloatArray | None = None,
    *,
    max_iterations: int = 100,
    gamma: float | None = None,
    epsilon: float = 1e-6,
) -> ReferenceResult:
    """Run every iteration; the arguments are those of `gp_core.registration.jrmpc.jrmpc`."""
    sets = [np.asarray(points, dtype=float) for points in point_sets]
    x = (
        np.array([points.mean(axis=0) for points in sets])
        if centres is None
        else np.array(centres, dtype=float)
    )
    n_centres = len(x)
    gamma = 1.0 / n_centres if gamma is None else gamma
    rotations = [np.eye(3) for _ in sets]
    translations = [x.mean(axis=0) - points.mean(axis=0) for points in sets]
    moved = [points + t for points, t in zip(sets, translations, strict=True)]
    everything = np.vstack([*moved, x])
    variances = np.full(n_centres, np.sum((everything.max(axis=0) - everything.min(axis=0)) ** 2))
    prior = 1.0 / (n_centres * (gamma + 1.0))
    beta = gamma / (2.0 / np.mean(1.0 / variances) * (gamma + 1.0))
    history = []
    for _ in range(max_iterations):
        q = 1.0 / variances
        tables = []
        objective = 0.0
        for points in moved:
            squared = np.sum((points[:, None, :] - x[None, :, :]) ** 2, axis=2)
            likelihood = prior * q**1.5 * np.exp(-0.5 * q * squared)
            total = likelihood.sum(axis=1) + beta
            objective += np.sum(np.log(total))
            tables.append(likelihood / total[:, None])
        history.append(objective)
        for j, (points, a) in enumerate(zip(sets, tables, strict=True)):
            lam = a.sum(axis=0)
            rotations[j], translations[j] = _pose(a.T @ points, lam, x, q)
            moved[j] = points @ rotations[j].T + translations[j]
        weight = sum(a.sum(axis=0) for a in tables)
        x = sum(a.T @ points for a, points in zip(tables, moved, strict=True)) / weight[:, None]
        spread = np.zeros(n_centres)
        for points, a in zip(moved, tables, strict=True):
            spread += np.sum(a * np.sum((points[:, None, :] - x[None, :, :]) ** 2, axis=2), axis=0)
        variances = spread / (3.0 * weight) + epsilon
    return ReferenceResult(np.array(rotations), np.array(translations), x, variances, np.array(history))


def _pose(sums: FloatArray, lam: FloatArray, x: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Take the means ``sums / lam`` to `x` with weights ``lam * q``."""
    means = sums / np.where(lam > 0, lam, 1.0)[:, None]
    weights = lam * q / np.sum(lam * q)
    from_, to = weights @ means, weights @ x
    u, _, vt = np.linalg.svd((x - to).T @ (weights[:, None] * (means - from_)))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u) * np.linalg.det(vt)]) @ vt
    return rotation, to - rotation @ from_
