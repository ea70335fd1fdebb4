"""The default atlas, rebuilt from a published table: the distances of Usevitch et al. 2021, Figure 2."""

from __future__ import annotations

import csv
from typing import NamedTuple

import numpy as np

from gp_core.landmarks.anatomy import cochlea_frame
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.resources import resource_path
from gp_core.validation import FloatArray

__all__ = ["N_SIDES", "ROUNDING_MM", "PublishedShape", "published_distances", "published_shape"]

N_SIDES = 22
ROUNDING_MM = 0.1 / 12**0.5
"""Standard deviation of what rounding the table's means to 0.1 mm adds."""


class PublishedShape(NamedTuple):
    """Mean and variances of the placed features, rebuilt from the published table.

    Attributes
    ----------
    codes : tuple of str
        Features, in the table's order, without CO.
    mean : (n, 3) array, mm
        Positions of a left side, in its CO frame.
    variances : (n,) array, mm^2
        Of each coordinate of a feature between animals.
    n_sides : int
        Number of labelled sides behind the table.
    """

    codes: tuple[str, ...]
    mean: FloatArray
    variances: FloatArray
    n_sides: int


def published_distances() -> tuple[FloatArray, FloatArray]:
    """Return the published table of distances between features.

    Returns
    -------
    mean, sd : (20, 20) arrays, mm
        Symmetric, in the feature table's order, over both sides of 11 animals (n - 1).
    """
    mean, sd = np.zeros((2, len(CODES), len(CODES)))
    with resource_path("published_distances.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            i, j = CODES.index(row["feature_a"]), CODES.index(row["feature_b"])
            mean[i, j] = mean[j, i] = float(row["mean_mm"])
            sd[i, j] = sd[j, i] = float(row["sd_mm"])
    return mean, sd


def published_shape() -> PublishedShape:
    """Rebuild mean positions and variances of the features from the published table alone.

    Positions come from multidimensional scaling: classical (Torgerson 1952, doi:10.1007/BF02288916), then
    least squares on the distances, each weighted by its precision in the table. Distances do not distinguish
    an object from its mirror image; anatomy does: on a left side, with x towards CA and y towards the round
    window, the dorsal bulla (DTL, DTM) lies at +z.

    Returns
    -------
    PublishedShape
        Mean, variances and number of sides.
    """
    mean, sd = published_distances()
    variances = _fit_variances(sd)
    positions = _refine(_classical_scaling(mean), mean, sd, variances)
    positions = _left_cochlea_frame(positions)
    placed = [i for i, code in enumerate(CODES) if code != "CO"]
    return PublishedShape(tuple(CODES[i] for i in placed), positions[placed], variances[placed], N_SIDES)


def _classical_scaling(distances: FloatArray) -> FloatArray:
    centring = np.eye(len(distances)) - 1 / len(distances)
    gram = -centring @ distances**2 @ centring / 2
    values, vectors = np.linalg.eigh(gram)
    scaled: FloatArray = vectors[:, -3:] * np.sqrt(values[-3:])
    return scaled


def _fit_variances(sd: FloatArray) -> FloatArray:
    """Fit v_i + v_j to the squared SD of each distance, in ratio, v > 0 (multiplicative updates)."""
    i, j = np.triu_indices(len(sd), 1)
    target = sd[i, j] ** 2
    v = np.full(len(sd), np.median(target) / 2)
    for _ in range(2000):
        ratio = target / (v[i] + v[j])
        pull = np.bincount(i, ratio**2, len(v)) + np.bincount(j, ratio**2, len(v))
        share = np.bincount(i, ratio, len(v)) + np.bincount(j, ratio, len(v))
        v = v * (pull / share) ** 0.5
    return v


def _refine(positions: FloatArray, mean: FloatArray, sd: FloatArray, variances: FloatArray) -> FloatArray:
    """Gauss-Newton on the distances; a mean distance exceeds the distance of the means by (v_i + v_j) / d."""
    i, j = np.triu_indices(len(mean), 1)
    root_weight = 1 / np.hypot(sd[i, j] / N_SIDES**0.5, ROUNDING_MM)
    rows = np.arange(len(i))
    for _ in range(30):
        offset = positions[i] - positions[j]
        distance = np.linalg.norm(offset, axis=1)
        expected = distance + (variances[i] + variances[j]) / distance
        unit = offset / distance[:, None] * root_weight[:, None]
        jacobian = np.zeros((len(i), len(mean), 3))
        jacobian[rows, i], jacobian[rows, j] = unit, -unit
        step = np.linalg.lstsq(
            jacobian.reshape(len(i), -1), root_weight * (mean[i, j] - expected), rcond=1e-9
        )[0]
        positions = positions + step.reshape(-1, 3)
    return positions


def _left_cochlea_frame(positions: FloatArray) -> FloatArray:
    framed = _in_cochlea_frame(positions)
    dorsal = framed[[CODES.index("DTL"), CODES.index("DTM")], 2].mean()
    return framed if dorsal > 0 else _in_cochlea_frame(-framed)


def _in_cochlea_frame(positions: FloatArray) -> FloatArray:
    landmarks = LandmarkSet(positions, Side.LEFT, "table")
    return cochlea_frame(landmarks).inverse().apply(positions)
