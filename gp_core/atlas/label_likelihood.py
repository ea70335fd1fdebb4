"""How likely the labels of a side are: as they are named, with names exchanged, or with some of them wrong.

Model, in the atlas frame (left side). The label of feature j is ``y_j = R (mu_j + s_j + e_j) + t``: the mean
of the atlas, this animal's departure from it with the covariance of the atlas, and the labelling error. All
are Gaussian. The pose (R, t) is free and fitted to each reading of the labels, so the likelihood does not
depend on how the head lies. A wrong label has a large error of its own.

A reading costs -2 log likelihood, and for each mistake that it assumes -2 log of the prior odds of that
mistake. The most probable reading is found by assuming one mistake after the other, while that lowers the
cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gp_core.atlas.atlas import Atlas
from gp_core.registration.named_points import motion_jacobian
from gp_core.validation import FloatArray

__all__ = ["LABELLING_NOISE_MM", "LabelModel", "LeaveOneOut", "Reading", "best_reading"]

LABELLING_NOISE_MM = 0.1
"""Scale of a placed label's error: about a voxel, mm a coordinate."""

WRONG_MM = 5.0
"""Scale of a wrong label's error, mm a coordinate: it lies somewhere else in the ear."""

EXCHANGE_ODDS = 0.01
"""Prior odds that two names of a side are exchanged, shared among its pairs."""

WRONG_ODDS = 0.01
"""Prior odds that a label is wrong."""

_NEWTON_STEPS = 4
_WEAK = 1e-9


@dataclass(frozen=True)
class Reading:
    """One way to read the labels of a side.

    Attributes
    ----------
    points : (n, 3) array, mm
        The labels, each in the row of the feature that this reading takes it for.
    exchanged : tuple of (int, int)
        Rows whose names it exchanges.
    wrong : tuple of int
        Rows of labels that it takes for wrong.
    cost : float
        -2 log posterior up to a constant; lower is better among readings of the same labels.
    certainties : tuple of float
        For each exchange, its probability among the mistakes that could explain the labels instead.
    """

    points: FloatArray
    exchanged: tuple[tuple[int, int], ...] = ()
    wrong: tuple[int, ...] = ()
    cost: float = np.inf
    certainties: tuple[float, ...] = ()

    def swapping(self, pair: tuple[int, int]) -> Reading:
        """Return the reading that also exchanges two names."""
        points = self.points.copy()
        points[list(pair)] = self.points[list(pair[::-1])]
        return replace(self, points=points, exchanged=(*self.exchanged, pair))

    def doubting(self, row: int) -> Reading:
        """Return the reading that also takes a label for wrong."""
        return replace(self, wrong=(*self.wrong, row))


@dataclass(frozen=True)
class LeaveOneOut:
    """Each label held against where the other ones put it; vectors in the frame of the labels.

    Attributes
    ----------
    expected : (n, 3) array, mm
    covariance : (n, 3, 3) array, mm^2
        Of these places.
    """

    expected: FloatArray
    covariance: FloatArray


class LabelModel:
    """What an atlas says of some labelled features in a head that lies anyhow.

    Parameters
    ----------
    atlas : Atlas
    codes : tuple of str
        Features that it holds, at least four.
    """

    def __init__(self, atlas: Atlas, codes: tuple[str, ...]) -> None:
        self.mean = atlas.rows(codes)
        noise = LABELLING_NOISE_MM**2 * np.eye(3 * len(codes))
        self.covariance = atlas.cross_covariance(codes, codes) + noise
        self.jacobian = motion_jacobian(self.mean)

    def fit(self, points: FloatArray, wrong: tuple[int, ...] = ()) -> Fit:
        """Bring labels (n, 3) of a left side into the atlas frame, with some of them taken for wrong."""
        return Fit.of(self, points[None], self.spread(wrong)[None])

    def spread(self, wrong: tuple[int, ...]) -> FloatArray:
        """Return the covariance (3 n, 3 n) of the labels, mm^2."""
        extra = np.zeros(len(self.mean))
        extra[list(wrong)] = WRONG_MM**2
        return self.covariance + np.diag(np.repeat(extra, 3))

    def price(self, reading: Reading) -> float:
        """Return what the mistakes of a reading cost beforehand."""
        n_pairs = len(self.mean) * (len(self.mean) - 1) / 2
        odds = len(reading.exchanged) * np.log(EXCHANGE_ODDS / n_pairs)
        return float(-2 * (odds + len(reading.wrong) * np.log(WRONG_ODDS)))

    def costs(self, readings: Sequence[Reading]) -> FloatArray:
        """Return the cost (m,) of each reading."""
        if not readings:
            return np.empty(0)
        wrong = list(dict.fromkeys(reading.wrong for reading in readings))
        alike = wrong[:1] if len(wrong) == 1 else [reading.wrong for reading in readings]
        labels = np.array([reading.points for reading in readings])
        fit = Fit.of(self, labels, np.array([self.spread(rows) for rows in alike]))
        return fit.misfits + [self.price(reading) for reading in readings]


@dataclass(frozen=True)
class Fit:
    """Sets of labels (m, n, 3), each brought into the atlas frame by its most likely pose.

    Attributes
    ----------
    turns : (m, 3, 3) array
        Rotations from the labels' frame into the atlas frame.
    labels, points : (m, n, 3) arrays, mm
        The labels, and where they are in the atlas frame.
    residual : (m, 3 n) array, mm
        The latter minus the mean.
    projected : (m or 1, 3 n, 3 n) array
        Inverse covariance of the residuals, with the free pose projected out.
    log_det : (m or 1,) array
        Logarithm of the determinant of that covariance.
    """

    turns: FloatArray
    labels: FloatArray
    points: FloatArray
    residual: FloatArray
    projected: FloatArray
    log_det: FloatArray

    @classmethod
    def of(cls, model: LabelModel, labels: FloatArray, spread: FloatArray) -> Fit:
        """Fit by weighted Procrustes, then by Newton's method with all correlations.

        `spread` is the covariance of the labels, (m, 3 n, 3 n), or (1, 3 n, 3 n) for all of them, mm^2.
        """
        precision = np.linalg.inv(spread)
        weighted = model.jacobian.T @ precision
        gain = np.linalg.solve(weighted @ model.jacobian + _WEAK * np.eye(6), weighted)
        variances = np.diagonal(spread, axis1=1, axis2=2).reshape(len(spread), -1, 3).mean(axis=2)
        turns, points = _procrustes(labels, model.mean, 1 / variances)
        for _ in range(_NEWTON_STEPS):
            step = (gain @ (points - model.mean).reshape(len(points), -1, 1))[..., 0]
            turn = _rotations(-step[:, 3:])
            points = (points - step[:, None, :3]) @ np.swapaxes(turn, 1, 2)
            turns = turn @ turns
        residual = (points - model.mean).reshape(len(points), -1)
        projected = precision - np.swapaxes(weighted, 1, 2) @ gain
        return cls(turns, labels, points, residual, projected, np.linalg.slogdet(spread)[1])

    @property
    def misfits(self) -> FloatArray:
        """(m,) -2 log likelihood, up to a constant."""
        misfits: FloatArray = np.einsum("mi,mi->m", self.residual, self.pull) + self.log_det
        return misfits

    @cached_property
    def pull(self) -> FloatArray:
        """(m, 3 n) residuals, weighted by the precision and with the free pose projected out."""
        pull: FloatArray = (self.projected @ self.residual[..., None])[..., 0]
        return pull

    def gain_without(self, rows: NDArray[np.intp]) -> FloatArray:
        """Return by how much the squared misfit of the first set would fall without some labels.

        `rows` (k, r): r labels for each of k answers.
        """
        coordinates = (3 * rows[..., None] + np.arange(3)).reshape(len(rows), -1)
        block = self.projected[0][coordinates[:, :, None], coordinates[:, None, :]]
        pull = self.pull[0][coordinates]
        block = block + _WEAK * np.eye(block.shape[1])
        gain: FloatArray = np.einsum("ki,ki->k", pull, np.linalg.solve(block, pull[..., None])[..., 0])
        return gain

    def leave_one_out(self, own_variances: FloatArray) -> LeaveOneOut:
        """Hold each label of the first set against where the others put it.

        `own_variances` (n,): of each label's own error, mm^2 a coordinate.
        """
        n, turn = len(own_variances), self.turns[0]
        blocks = self.projected[0].reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n)]
        spread = np.linalg.inv(blocks + _WEAK * np.eye(3))
        away = (spread @ self.pull[0].reshape(n, 3, 1))[..., 0] @ turn
        covariance = spread - own_variances[:, None, None] * np.eye(3)
        return LeaveOneOut(self.labels[0] - away, turn.T @ covariance @ turn)


def best_reading(model: LabelModel, points: FloatArray, *, below: float = np.inf) -> Reading:
    """Find the most probable reading of the labels of a left side.

    Parameters
    ----------
    model : LabelModel
    points : (n, 3) array, mm
        In any frame of the atlas's handedness; row j is feature j of the model.
    below : float
        Cost from which on a reading is of no interest; the search stops where none can come below.
    """
    reading = Reading(points)
    fit = model.fit(points)
    reading = replace(reading, cost=float(fit.misfits[0]))
    for _ in range(len(points) // 2):
        if model.price(reading) + float(fit.log_det[0]) > below:  # the misfit adds to this
            break
        exchanges, doubts = _with_one_more_mistake(model, reading, fit)
        costs = np.concatenate([model.costs(exchanges), model.costs(doubts)])
        if not len(costs) or not costs.min() < reading.cost:
            break
        best = int(costs.argmin())
        found = replace([*exchanges, *doubts][best], cost=float(costs[best]))
        if best < len(exchanges):
            rivals = np.append(costs, reading.cost)
            certainty = float(1 / np.exp((found.cost - rivals) / 2).sum())
            found = replace(found, certainties=(*reading.certainties, certainty))
        reading, fit = found, model.fit(found.points, found.wrong)
    return reading


def _with_one_more_mistake(
    model: LabelModel, reading: Reading, fit: Fit
) -> tuple[list[Reading], list[Reading]]:
    """Return the readings with one exchange more, or one wrong label more, that could be more probable.

    Neither lowers the misfit by more than leaving out the labels concerned, so few need be tried.
    """
    taken = {*reading.wrong, *(row for pair in reading.exchanged for row in pair)}
    free = np.array([row for row in range(len(reading.points)) if row not in taken])
    if len(free) < 2:
        return [], []
    before = model.price(reading)
    pairs = np.array(list(combinations(free.tolist(), 2)))
    worth = fit.gain_without(pairs) > model.price(reading.swapping((0, 1))) - before
    exchanges = [reading.swapping((int(i), int(j))) for i, j in pairs[worth]]
    worth = fit.gain_without(free[:, None]) > model.price(reading.doubting(0)) - before
    return exchanges, [reading.doubting(int(row)) for row in free[worth]]


def _procrustes(labels: FloatArray, aims: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bring sets of labels (m, n, 3) onto aims (n, 3) with weights (m, n); return the rotations, and them."""
    shares = (weights / weights.sum(axis=1, keepdims=True))[..., None]
    points = labels - (shares * labels).sum(axis=1, keepdims=True)
    centre = (shares * aims).sum(axis=1, keepdims=True)
    left, _, right = np.linalg.svd(np.swapaxes(aims - centre, 1, 2) @ (shares * points))
    left[:, :, 2] *= np.where(np.linalg.det(left @ right) > 0, 1.0, -1.0)[:, None]
    turns = left @ right
    return turns, points @ np.swapaxes(turns, 1, 2) + centre


def _rotations(vectors: FloatArray) -> FloatArray:
    """Return the rotations (m, 3, 3) of rotation vectors (m, 3), rad."""
    angle = np.maximum(np.linalg.norm(vectors, axis=1), 1e-12)[:, None, None]
    cross = np.zeros((len(vectors), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[:, j, i], cross[:, i, j] = vectors[:, k], -vectors[:, k]
    rotations: FloatArray = (
        np.eye(3) + np.sin(angle) / angle * cross + (1 - np.cos(angle)) / angle**2 * (cross @ cross)
    )
    return rotations
