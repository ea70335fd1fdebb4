"""Generalised Procrustes analysis: labelled sides aligned to their mean, and their scatter about it.

All labels have the same weight, or each its own: small for an animal with rejected labels, and for a label
that does not fit the others (Student-t). Missing features are NaN.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gp_core.constants import CHI2_3_MEDIAN
from gp_core.errors import GeometryError
from gp_core.landmarks.anatomy import cochlea_frame
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.procrustes import weighted_procrustes
from gp_core.validation import FloatArray

__all__ = ["align_shapes", "covariances", "label_weights", "per_feature_covariance"]

_MAX_ITERATIONS = 50
_TOLERANCE_MM = 1e-9
_LABELLING_SD_MM = 0.05
"""Floor of a feature's scatter, mm: nobody labels more precisely, and it bounds the weights."""

_NU = 4.0
"""Degrees of freedom of the Student-t distribution of a label's deviation."""

_N_REWEIGHTED = 20


def align_shapes(
    shapes: FloatArray, codes: tuple[str, ...], owners: Sequence[str], weights: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Align shapes to their mean.

    Parameters
    ----------
    shapes : (S, n, 3) array, mm
        Points of S sides, as of left ones.
    codes : tuple of str
        The n features, including those that define the cochlea.
    owners : sequence of str
        Specimen and side of each shape, for messages.
    weights : (S, n) array, optional
        Weight of each label in the mean; by default all equal.

    Returns
    -------
    mean : (n, 3) array, mm
        In its own CO frame.
    aligned : (S, n, 3) array, mm
        The shapes, aligned to it.

    Raises
    ------
    GeometryError
        A shape has too few features in common with the others.
    """
    placed = ~np.isnan(shapes[:, :, 0])
    best = placed.sum(axis=1) if weights is None else np.where(placed, weights, 0.0).sum(axis=1)
    mean = shapes[int(np.argmax(best))]
    mean = _complete_start(mean, shapes, placed, codes, owners)
    precision = np.ones(len(codes))
    for _ in range(_MAX_ITERATIONS):
        aligned = _all_aligned(shapes, placed, mean, precision, codes, owners)
        updated = _mean(aligned, weights)
        precision = 1 / (_variances(aligned - updated, placed, weights) + _LABELLING_SD_MM**2)
        moved = np.abs(updated - mean).max()
        mean = updated
        if moved < _TOLERANCE_MM:
            break
    T_cochlea_mean = cochlea_frame(_as_landmarks(mean, codes)).inverse()
    rotated = [T_cochlea_mean.apply(shape) for shape in aligned]
    return T_cochlea_mean.apply(mean), np.array(rotated)


def label_weights(shapes: FloatArray, codes: tuple[str, ...], owners: Sequence[str]) -> FloatArray:
    """Return how well each label agrees with the other shapes: 1 or more where it does, towards 0 where not.

    The scatter of each feature is modelled as Student-t. The start is the shape nearest to most others, so
    that a few wrong ones do not matter.

    Parameters
    ----------
    shapes : (S, n, 3) array, mm
        Points of S sides, as of left ones.
    codes : tuple of str
        The n features.
    owners : sequence of str
        Specimen and side of each shape, for messages.

    Returns
    -------
    (S, n) array
        0 where a feature is missing.

    References
    ----------
    Lange, Little and Taylor, "Robust statistical modeling using the t distribution", JASA 84, 1989.
    https://doi.org/10.1080/01621459.1989.10478852
    """
    placed = ~np.isnan(shapes[:, :, 0])
    mean = _complete_start(shapes[_most_typical(shapes, placed)], shapes, placed, codes, owners)
    weights, precision = placed.astype(np.float64), np.ones(len(codes))
    variances: FloatArray | None = None
    for _ in range(_N_REWEIGHTED):
        aligned = _all_aligned(shapes, weights > 0, mean, precision * weights, codes, owners)
        squared = ((aligned - mean) ** 2).sum(axis=2)
        if variances is None:
            variances = np.nanmedian(squared, axis=0) / CHI2_3_MEDIAN + _LABELLING_SD_MM**2
        else:
            variances = np.nansum(weights * squared, axis=0) / (3 * placed.sum(axis=0)) + _LABELLING_SD_MM**2
        weights = np.where(placed, (_NU + 3) / (_NU + np.nan_to_num(squared) / variances), 0.0)
        mean, precision = _mean(aligned, weights), 1 / variances
    return weights


def _most_typical(shapes: FloatArray, placed: NDArray[np.bool_]) -> int:
    """Return the shape with the smallest median distance to the other shapes."""
    off = []
    for shape, has in zip(shapes, placed, strict=True):
        apart = [_apart(shape, other, has & also) for other, also in zip(shapes, placed, strict=True)]
        off.append(np.median(apart))
    return int(np.argmin(off))


def _apart(shape: FloatArray, other: FloatArray, shared: NDArray[np.bool_]) -> float:
    """Return the median distance of the labels that two shapes share, mm; infinite where they are too few."""
    try:
        rotation, translation = weighted_procrustes(other[shared], shape[shared])
    except GeometryError:
        return np.inf
    away = other[shared] @ rotation.T + translation - shape[shared]
    return float(np.median(np.linalg.norm(away, axis=1)))


def _all_aligned(
    shapes: FloatArray,
    placed: NDArray[np.bool_],
    mean: FloatArray,
    precision: FloatArray,
    codes: tuple[str, ...],
    owners: Sequence[str],
) -> FloatArray:
    """Align all shapes to a mean; `precision` (n,) or (S, n) of each feature."""
    every = np.broadcast_to(precision, placed.shape)
    return np.array(
        [_align(s, p, mean, w, o, codes) for s, p, w, o in zip(shapes, placed, every, owners, strict=True)]
    )


def _mean(aligned: FloatArray, weights: FloatArray | None) -> FloatArray:
    if weights is None:
        mean: FloatArray = np.nanmean(aligned, axis=0)
        return mean
    shares = np.where(np.isnan(aligned[:, :, 0]), 0.0, weights)[..., None]
    weighted: FloatArray = (shares * np.nan_to_num(aligned)).sum(axis=0) / shares.sum(axis=0)
    return weighted


def _variances(deviations: FloatArray, placed: NDArray[np.bool_], weights: FloatArray | None) -> FloatArray:
    """Return the variance (n,) of each feature, mm^2 per coordinate."""
    if weights is None:
        variances: FloatArray = np.nansum(deviations**2, axis=(0, 2)) / (
            3 * np.maximum(placed.sum(axis=0) - 1, 1)
        )
        return variances
    shares = np.where(placed, weights, 0.0)
    squared = np.nansum(shares[..., None] * deviations**2, axis=(0, 2))
    weighted: FloatArray = squared / (3 * _freedom(shares.sum(axis=0), (shares**2).sum(axis=0)))
    return weighted


def _freedom(total: FloatArray, squares: FloatArray) -> FloatArray:
    """Return the divisor of a weighted sum of squares about its mean: n - 1 where all weights are 1."""
    freedom = total - squares / np.maximum(total, 1e-12)
    return np.where(freedom > 1e-9, freedom, 1.0)  # a single label has no variance


def _complete_start(
    mean: FloatArray,
    shapes: FloatArray,
    placed: NDArray[np.bool_],
    codes: tuple[str, ...],
    owners: Sequence[str],
) -> FloatArray:
    """Fill features that the first shape lacks from shapes that have them, aligned to it."""
    start = mean.copy()
    for row in np.flatnonzero(np.isnan(mean).any(axis=1)):
        known = np.isfinite(start).all(axis=1)
        donor = int(np.argmax(np.where(placed[:, row], (placed & known).sum(axis=1), -1)))
        shared = placed[donor] & known
        names = [code for code, has in zip(codes, shared, strict=True) if has]
        try:
            rotation, translation = weighted_procrustes(shapes[donor][shared], start[shared], names=names)
        except GeometryError as error:
            raise GeometryError(
                f"{codes[row]} cannot be placed among the others: {error.problem}",
                specimen=owners[donor],
                remedy="Label more features on each side.",
            ) from None
        start[row] = rotation @ shapes[donor][row] + translation
    return start


def _align(
    shape: FloatArray,
    placed: NDArray[np.bool_],
    mean: FloatArray,
    weights: FloatArray,
    owner: str,
    codes: tuple[str, ...],
) -> FloatArray:
    names = [code for code, has in zip(codes, placed, strict=True) if has]
    try:
        rotation, translation = weighted_procrustes(shape[placed], mean[placed], weights[placed], names=names)
    except GeometryError as error:
        raise GeometryError(error.problem, specimen=owner, remedy=error.remedy) from None
    return shape @ rotation.T + translation


def _as_landmarks(points: FloatArray, codes: tuple[str, ...]) -> LandmarkSet:
    return LandmarkSet.from_mapping(dict(zip(codes, points, strict=True)), Side.LEFT, frame="mean")


def covariances(
    deviations: FloatArray, animals: Sequence[int], weights: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the sample covariance of deviations, and its shrunk version.

    Parameters
    ----------
    deviations : (S, n, 3) array, mm
        Aligned shapes minus their mean; NaN where missing.
    animals : sequence of int
        The animal of each side. The two sides of an animal are correlated, so the shrinkage counts animals,
        not sides, as independent.
    weights : (S, n) array, optional
        As for `align_shapes`.

    Returns
    -------
    scatter, shrunk : (3 n, 3 n) arrays, mm^2
        Coordinates feature by feature.

    References
    ----------
    Schäfer and Strimmer, "A shrinkage approach to large-scale covariance matrix estimation", 2005
    (target D). https://doi.org/10.2202/1544-6115.1175
    """
    flat = deviations.reshape(len(deviations), -1)
    known = np.isfinite(flat).astype(np.float64)
    filled = np.nan_to_num(flat)
    if weights is None:
        freedom = np.maximum(known.T @ known - 1, 1)
    else:
        root = np.sqrt(np.repeat(weights, 3, axis=1)) * known
        filled = root * filled
        freedom = _freedom(root.T @ root, (root**2).T @ (root**2))
    scatter = filled.T @ filled / freedom
    floor = _LABELLING_SD_MM**2 / 10 * np.eye(len(scatter))
    target = per_feature_covariance(scatter) + floor
    intensity = _shrinkage(filled / np.sqrt(target.diagonal()), np.asarray(animals))
    return _positive(scatter), _positive((1 - intensity) * scatter + intensity * target)


def _shrinkage(unit: FloatArray, animals: NDArray[np.intp]) -> float:
    """Return the weight of the target that minimises the expected squared error of the correlations.

    `unit` (S, 3 n): deviations in units of each feature's own SD.
    """
    products = np.array(
        [unit[animals == animal].T @ unit[animals == animal] for animal in np.unique(animals)]
    )
    n, sides = len(products), len(unit)
    mean = products.mean(axis=0)
    variance = ((products - mean) ** 2).sum(axis=0) * n / (n - 1) / max(sides - 1, 1) ** 2
    correlation = products.sum(axis=0) / max(sides - 1, 1)
    off = ~np.eye(len(mean), dtype=bool)
    return float(np.clip(variance[off].sum() / (correlation[off] ** 2).sum(), 0.0, 1.0))


def _positive(covariance: FloatArray) -> FloatArray:
    """Raise eigenvalues that pairwise-complete sums leave at or below zero."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    floor = 1e-6 * values.max()
    lifted: FloatArray = (vectors * np.maximum(values, floor)) @ vectors.T
    return lifted


def per_feature_covariance(covariance: FloatArray) -> FloatArray:
    """Return the covariance with independent features, each with the same variance in all directions.

    Parameters
    ----------
    covariance : (3 n, 3 n) array, mm^2
        Coordinates feature by feature.

    Returns
    -------
    (3 n, 3 n) array, mm^2
        Diagonal.
    """
    variances = covariance.diagonal().reshape(-1, 3).mean(axis=1)
    return np.diag(np.repeat(variances, 3))
