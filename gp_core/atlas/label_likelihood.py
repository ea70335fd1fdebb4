"""The likelihood of the labels of a side: as they are named, with names exchanged, or with outliers.

Model, in the atlas frame (left side). The label of feature j is ``y_j = R (mu_j + s_j + e_j) + t``: the mean
of the atlas, this animal's deviation from it with the covariance of the atlas, and the labelling error. All
are Gaussian. The pose (R, t) is free and fitted under each hypothesis, so the likelihood does not depend on
how the head lies. An outlier has a large error of its own.

The cost of a hypothesis is -2 log likelihood, plus -2 log of the prior odds of each mistake that it assumes.
The most probable hypothesis is found greedily: one mistake is added at a time while that lowers the cost.
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

__all__ = ["LabelHypothesis", "LabelModel", "LeaveOneOut", "best_hypothesis"]

WRONG_MM = 5.0
"""Scale of an outlier's error, mm per coordinate: the label lies elsewhere in the ear."""

EXCHANGE_ODDS = 0.01
"""Prior odds that two names of a side are exchanged, divided among its pairs."""

WRONG_ODDS = 0.01
"""Prior odds that a label is wrong."""

_NEWTON_STEPS = 4
_WEAK = 1e-9


@dataclass(frozen=True)
class LabelHypothesis:
    """One hypothesis on the labels of a side.

    Attributes
    ----------
    points : (n, 3) array, mm
        The labels, each in the row of the feature that it is taken for.
    exchanged : tuple of (int, int)
        Rows whose names are exchanged.
    wrong : tuple of int
        Rows of labels that are taken as outliers.
    cost : float
        -2 log posterior up to a constant; the lower, the better, among hypotheses on the same labels.
    certainties : tuple of float
        For each exchange, its probability among the mistakes that could explain the labels instead.
    """

    points: FloatArray
    exchanged: tuple[tuple[int, int], ...] = ()
    wrong: tuple[int, ...] = ()
    cost: float = np.inf
    certainties: tuple[float, ...] = ()

    def with_exchange(self, pair: tuple[int, int]) -> LabelHypothesis:
        """Return the hypothesis with one more exchange of names.

        Parameters
        ----------
        pair : (int, int)
            The two rows.

        Returns
        -------
        LabelHypothesis
            Its cost is still to be computed.
        """
        points = self.points.copy()
        points[list(pair)] = self.points[list(pair[::-1])]
        return replace(self, points=points, exchanged=(*self.exchanged, pair))

    def with_outlier(self, row: int) -> LabelHypothesis:
        """Return the hypothesis with one more outlier.

        Parameters
        ----------
        row : int
            The row of the label.

        Returns
        -------
        LabelHypothesis
            Its cost is still to be computed.
        """
        return replace(self, wrong=(*self.wrong, row))


@dataclass(frozen=True)
class LeaveOneOut:
    """Where the other labels predict each label; in the frame of the labels.

    Attributes
    ----------
    expected : (n, 3) array, mm
        Predicted positions.
    covariance : (n, 3, 3) array, mm^2
        Of the predicted positions.
    """

    expected: FloatArray
    covariance: FloatArray


class LabelModel:
    """The atlas's prediction for some labelled features in a head of unknown pose.

    Parameters
    ----------
    atlas : Atlas
        Mean shape and its variation.
    codes : tuple of str
        Features that it holds, at least four.
    """

    def __init__(self, atlas: Atlas, codes: tuple[str, ...]) -> None:
        self.mean = atlas.rows(codes)
        self.labelling_sd = atlas.labelling_error.of(codes)
        noise = np.diag(np.repeat(self.labelling_sd**2, 3))
        self.covariance = atlas.cross_covariance(codes, codes) + noise
        self.jacobian = motion_jacobian(self.mean)

    def fit(self, points: FloatArray, wrong: tuple[int, ...] = ()) -> LabelFit:
        """Move labels of a left side into the atlas frame, with some of them taken as outliers.

        Parameters
        ----------
        points : (n, 3) array, mm
            The labels, row j feature j.
        wrong : tuple of int
            Rows of the outliers.

        Returns
        -------
        LabelFit
            Of one set of labels.
        """
        return LabelFit.of(self, points[None], self.spread(wrong)[None])

    def spread(self, wrong: tuple[int, ...]) -> FloatArray:
        """Return the covariance of the labels.

        Parameters
        ----------
        wrong : tuple of int
            Rows of the outliers.

        Returns
        -------
        (3 n, 3 n) array, mm^2
            Coordinates feature by feature.
        """
        extra = np.zeros(len(self.mean))
        extra[list(wrong)] = WRONG_MM**2
        total: FloatArray = self.covariance + np.diag(np.repeat(extra, 3))
        return total

    def prior_cost(self, hypothesis: LabelHypothesis) -> float:
        """Return -2 log of the prior odds of the mistakes that a hypothesis assumes.

        Parameters
        ----------
        hypothesis : LabelHypothesis
            A hypothesis.

        Returns
        -------
        float
            0 where it assumes none.
        """
        n_pairs = len(self.mean) * (len(self.mean) - 1) / 2
        odds = len(hypothesis.exchanged) * np.log(EXCHANGE_ODDS / n_pairs)
        return float(-2 * (odds + len(hypothesis.wrong) * np.log(WRONG_ODDS)))

    def costs(self, hypotheses: Sequence[LabelHypothesis]) -> FloatArray:
        """Return the cost of each hypothesis.

        Parameters
        ----------
        hypotheses : sequence of LabelHypothesis
            m hypotheses on the same labels.

        Returns
        -------
        (m,) array
            -2 log posterior, up to a constant.
        """
        if not hypotheses:
            return np.empty(0)
        wrong = list(dict.fromkeys(hypothesis.wrong for hypothesis in hypotheses))
        alike = wrong[:1] if len(wrong) == 1 else [hypothesis.wrong for hypothesis in hypotheses]
        labels = np.array([hypothesis.points for hypothesis in hypotheses])
        fit = LabelFit.of(self, labels, np.array([self.spread(rows) for rows in alike]))
        return fit.deviances + [self.prior_cost(hypothesis) for hypothesis in hypotheses]


@dataclass(frozen=True)
class LabelFit:
    """Sets of labels, each moved into the atlas frame by its most likely pose.

    Attributes
    ----------
    rotations : (m, 3, 3) array
        From the labels' frame into the atlas frame.
    labels, points : (m, n, 3) arrays, mm
        The labels, and their positions in the atlas frame.
    residual : (m, 3 n) array, mm
        The latter minus the mean.
    projected : (m or 1, 3 n, 3 n) array
        Inverse covariance of the residuals, with the free pose projected out.
    log_det : (m or 1,) array
        Logarithm of the determinant of that covariance.
    """

    rotations: FloatArray
    labels: FloatArray
    points: FloatArray
    residual: FloatArray
    projected: FloatArray
    log_det: FloatArray

    @classmethod
    def of(cls, model: LabelModel, labels: FloatArray, spread: FloatArray) -> LabelFit:
        """Fit by weighted Procrustes, then by Newton's method with all correlations.

        Parameters
        ----------
        model : LabelModel
            Of the n labelled features.
        labels : (m, n, 3) array, mm
            Sets of labels.
        spread : (m, 3 n, 3 n) or (1, 3 n, 3 n) array, mm^2
            Covariance of the labels; one for all sets, or one for each.

        Returns
        -------
        LabelFit
            Of all sets.
        """
        precision = np.linalg.inv(spread)
        weighted = model.jacobian.T @ precision
        gain = np.linalg.solve(weighted @ model.jacobian + _WEAK * np.eye(6), weighted)
        variances = np.diagonal(spread, axis1=1, axis2=2).reshape(len(spread), -1, 3).mean(axis=2)
        rotations, points = _procrustes(labels, model.mean, 1 / variances)
        for _ in range(_NEWTON_STEPS):
            step = (gain @ (points - model.mean).reshape(len(points), -1, 1))[..., 0]
            rotation = _rotations(np.asarray(-step[:, 3:], dtype=np.float64))
            points = (points - step[:, None, :3]) @ np.swapaxes(rotation, 1, 2)
            rotations = rotation @ rotations
        residual = (points - model.mean).reshape(len(points), -1)
        projected = precision - np.swapaxes(weighted, 1, 2) @ gain
        return cls(rotations, labels, points, residual, projected, np.linalg.slogdet(spread)[1])

    @property
    def deviances(self) -> FloatArray:
        """(m,) -2 log likelihood, up to a constant."""
        deviances: FloatArray = np.einsum("mi,mi->m", self.residual, self.weighted_residual) + self.log_det
        return deviances

    @cached_property
    def weighted_residual(self) -> FloatArray:
        """(m, 3 n) residuals, weighted by the precision and with the free pose projected out."""
        weighted_residual: FloatArray = (self.projected @ self.residual[..., None])[..., 0]
        return weighted_residual

    def gain_without(self, rows: NDArray[np.intp]) -> FloatArray:
        """Return the decrease of the squared residuals of the first set if some labels are left out.

        Parameters
        ----------
        rows : (k, r) array of int
            r labels for each of k answers.

        Returns
        -------
        (k,) array
            Decreases, not negative.
        """
        coordinates = (3 * rows[..., None] + np.arange(3)).reshape(len(rows), -1)
        block = self.projected[0][coordinates[:, :, None], coordinates[:, None, :]]
        weighted_residual = self.weighted_residual[0][coordinates]
        block = block + _WEAK * np.eye(block.shape[1])
        gain: FloatArray = np.einsum(
            "ki,ki->k", weighted_residual, np.linalg.solve(block, weighted_residual[..., None])[..., 0]
        )
        return gain

    def leave_one_out(self, own_variances: FloatArray) -> LeaveOneOut:
        """Predict each label of the first set from the others.

        Parameters
        ----------
        own_variances : (n,) array, mm^2
            Variance of each label's own error, mm^2 per coordinate.

        Returns
        -------
        LeaveOneOut
            Predicted positions and their covariances.
        """
        n, rotation = len(own_variances), self.rotations[0]
        blocks = self.projected[0].reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n)]
        spread = np.linalg.inv(blocks + _WEAK * np.eye(3))
        away = (spread @ self.weighted_residual[0].reshape(n, 3, 1))[..., 0] @ rotation
        covariance = spread - own_variances[:, None, None] * np.eye(3)
        return LeaveOneOut(self.labels[0] - away, rotation.T @ covariance @ rotation)


def best_hypothesis(model: LabelModel, points: FloatArray, *, below: float = np.inf) -> LabelHypothesis:
    """Find the most probable hypothesis on the labels of a left side.

    Parameters
    ----------
    model : LabelModel
        Of the n labelled features.
    points : (n, 3) array, mm
        In any frame of the atlas's handedness; row j is feature j of the model.
    below : float
        Cost from which on a hypothesis is of no interest; the search stops where none can be below.

    Returns
    -------
    LabelHypothesis
        With its cost.
    """
    hypothesis = LabelHypothesis(points)
    fit = model.fit(points)
    hypothesis = replace(hypothesis, cost=float(fit.deviances[0]))
    for _ in range(len(points) // 2):
        if model.prior_cost(hypothesis) + float(fit.log_det[0]) > below:  # squared residuals only add to it
            break
        exchanges, outliers = _candidates(model, hypothesis, fit)
        costs = np.concatenate([model.costs(exchanges), model.costs(outliers)])
        if not len(costs) or not costs.min() < hypothesis.cost:
            break
        best = int(costs.argmin())
        found = replace([*exchanges, *outliers][best], cost=float(costs[best]))
        if best < len(exchanges):
            rivals = np.append(costs, hypothesis.cost)
            certainty = float(1 / np.exp((found.cost - rivals) / 2).sum())
            found = replace(found, certainties=(*hypothesis.certainties, certainty))
        hypothesis, fit = found, model.fit(found.points, found.wrong)
    return hypothesis


def _candidates(
    model: LabelModel, hypothesis: LabelHypothesis, fit: LabelFit
) -> tuple[list[LabelHypothesis], list[LabelHypothesis]]:
    """Return the hypotheses with one more exchange, or one more outlier, that could be more probable.

    Neither lowers the squared residuals by more than leaving out the labels concerned, so few need be tried.
    """
    used = {*hypothesis.wrong, *(row for pair in hypothesis.exchanged for row in pair)}
    free = np.array([row for row in range(len(hypothesis.points)) if row not in used])
    if len(free) < 2:
        return [], []
    before = model.prior_cost(hypothesis)
    pairs = np.array(list(combinations(free.tolist(), 2)))
    promising = fit.gain_without(pairs) > model.prior_cost(hypothesis.with_exchange((0, 1))) - before
    exchanges = [hypothesis.with_exchange((int(i), int(j))) for i, j in pairs[promising]]
    promising = fit.gain_without(free[:, None]) > model.prior_cost(hypothesis.with_outlier(0)) - before
    return exchanges, [hypothesis.with_outlier(int(row)) for row in free[promising]]


def _procrustes(
    labels: FloatArray, targets: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Align sets of labels (m, n, 3) to targets (n, 3) with weights (m, n).

    Returns the rotations and the aligned labels.
    """
    unit_weights = (weights / weights.sum(axis=1, keepdims=True))[..., None]
    points = labels - (unit_weights * labels).sum(axis=1, keepdims=True)
    centre = (unit_weights * targets).sum(axis=1, keepdims=True)
    left, _, right = np.linalg.svd(np.swapaxes(targets - centre, 1, 2) @ (unit_weights * points))
    left[:, :, 2] *= np.where(np.linalg.det(left @ right) > 0, 1.0, -1.0)[:, None]
    rotations = left @ right
    return rotations, points @ np.swapaxes(rotations, 1, 2) + centre


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
