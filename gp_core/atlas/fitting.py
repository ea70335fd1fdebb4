"""Fit an atlas to labelled specimens: generalised Procrustes, then a shrunk covariance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from gp_core.atlas.atlas import DEFINING, PLACED, Atlas
from gp_core.checks import FloatArray
from gp_core.errors import FeatureError, GeometryError, GpError
from gp_core.landmarks.anatomy import cochlea_frame, mirror_right
from gp_core.landmarks.features import CODES, Side, check_codes
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.registration.procrustes import weighted_procrustes

__all__ = ["fit_atlas", "left_shapes", "per_feature_covariance"]

_MAX_ITERATIONS = 50
_TOLERANCE_MM = 1e-9
_LABELLING_SD_MM = 0.05
"""Floor of a feature's scatter, mm: no hand labels finer than this, and no weight grows without bound."""


def fit_atlas(
    specimens: Sequence[Specimen], *, features: Iterable[str] | None = None, name: str | None = None
) -> Atlas:
    """Fit an atlas to labelled specimens, both sides pooled through the mirror.

    Parameters
    ----------
    specimens : sequence of Specimen
        One or both sides of each; features may be missing here and there.
    features : iterable of str, optional
        What the atlas holds; by default every placed feature that at least two sides have.
    name : str, optional
        By default says how many specimens there are.

    Returns
    -------
    Atlas
        Mean of a generalised Procrustes alignment in which each feature weighs by its scatter, and the
        covariance of the deviations, shrunk towards independent features.

    Raises
    ------
    GpError
        Fewer than three sides, CA, CB, RWA or RWP on fewer than two of them, or sides that share too few
        features to be put together.

    References
    ----------
    Gower, "Generalized Procrustes analysis", Psychometrika 40, 1975. https://doi.org/10.1007/BF02291478
    Schäfer and Strimmer, "A shrinkage approach to large-scale covariance matrix estimation", 2005
    (target D). https://doi.org/10.2202/1544-6115.1175
    """
    owners, shapes = left_shapes(specimens)
    if len(shapes) < 3:
        raise GpError(f"an atlas needs at least three labelled sides, got {len(shapes)}")
    codes = _choose(shapes, features)
    rows = [CODES.index(code) for code in codes]
    mean, aligned = _generalised_procrustes(shapes[:, rows], codes, owners)
    animals = [i for i, specimen in enumerate(specimens) for _ in specimen.sides]
    scatter, covariance = _covariances(aligned - mean, animals)
    return Atlas(
        name=name or f"{len(specimens)} specimens",
        codes=codes,
        mean=mean,
        covariance=covariance,
        scatter=scatter,
        n_samples=len(shapes),
        specimens=tuple(specimen.name for specimen in specimens),
    )


def left_shapes(specimens: Sequence[Specimen]) -> tuple[list[str], FloatArray]:
    """Return every labelled side as a left side.

    Returns
    -------
    owners : list of str
        Whose side it is, for messages.
    shapes : (S, 20, 3) array, mm
        Points in the table's order, right sides mirrored in x, NaN where missing.
    """
    sides = [(s.name, landmarks) for s in specimens for landmarks in s.sides.values()]
    owners = [f"{name} {landmarks.side.word}" for name, landmarks in sides]
    shapes = [as_left(landmarks) for _, landmarks in sides]
    return owners, np.array(shapes).reshape(-1, len(CODES), 3)


def as_left(landmarks: LandmarkSet) -> FloatArray:
    """Return the points (20, 3) of a set, mirrored in x if they are of a right side."""
    return mirror_right(landmarks.points, landmarks.side)


def per_feature_covariance(covariance: FloatArray) -> FloatArray:
    """Return the covariance with every feature on its own, its variance the same in all directions."""
    variances = covariance.diagonal().reshape(-1, 3).mean(axis=1)
    return np.diag(np.repeat(variances, 3))


def _choose(shapes: FloatArray, features: Iterable[str] | None) -> tuple[str, ...]:
    counts = np.isfinite(shapes).all(axis=2).sum(axis=0)
    common = tuple(code for code in PLACED if counts[CODES.index(code)] >= 2)
    wanted = common if features is None else check_codes(features, "the features of an atlas", allowed=CODES)
    chosen = tuple(code for code in CODES if code in wanted and code != "CO")
    for code in (*DEFINING, *chosen):
        if code not in common:
            raise FeatureError(
                f"fewer than two sides have {code}", landmark=code, remedy="Label it in more specimens."
            )
    return tuple(code for code in PLACED if code in {*chosen, *DEFINING})


def _generalised_procrustes(
    shapes: FloatArray, codes: tuple[str, ...], owners: list[str]
) -> tuple[FloatArray, FloatArray]:
    """Align the shapes (S, n, 3) to their mean; return it (n, 3) in its own CO frame, and them."""
    placed = ~np.isnan(shapes[:, :, 0])
    mean = shapes[int(np.argmax(placed.sum(axis=1)))]
    mean = _complete_start(mean, shapes, placed, codes, owners)
    weights = np.ones(len(codes))
    for _ in range(_MAX_ITERATIONS):
        aligned = np.array(
            [_align(s, p, mean, weights, o, codes) for s, p, o in zip(shapes, placed, owners, strict=True)]
        )
        updated = np.nanmean(aligned, axis=0)
        variances = np.nansum((aligned - updated) ** 2, axis=(0, 2)) / (
            3 * np.maximum(placed.sum(axis=0) - 1, 1)
        )
        weights = 1 / (variances + _LABELLING_SD_MM**2)
        moved = np.abs(updated - mean).max()
        mean = updated
        if moved < _TOLERANCE_MM:
            break
    T_cochlea_mean = cochlea_frame(_as_landmarks(mean, codes)).inverse()
    turned = [T_cochlea_mean.apply(shape) for shape in aligned]
    return T_cochlea_mean.apply(mean), np.array(turned)


def _complete_start(
    mean: FloatArray,
    shapes: FloatArray,
    placed: NDArray[np.bool_],
    codes: tuple[str, ...],
    owners: list[str],
) -> FloatArray:
    """Fill features that the first shape lacks from the shapes that have them, aligned to it."""
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
                f"{codes[row]} cannot be put to the others: {error.problem}",
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


def _covariances(deviations: FloatArray, animals: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Return the sample covariance (3 n, 3 n) of deviations (S, n, 3), and the same shrunk.

    NaN marks missing features; `animals` (S,) says whose sides they are: the two sides of an animal are
    alike, so animals, not sides, are what the shrinkage counts as independent.
    """
    flat = deviations.reshape(len(deviations), -1)
    known = np.isfinite(flat).astype(np.float64)
    filled = np.nan_to_num(flat)
    scatter = filled.T @ filled / np.maximum(known.T @ known - 1, 1)
    floor = _LABELLING_SD_MM**2 / 10 * np.eye(len(scatter))
    target = per_feature_covariance(scatter) + floor
    intensity = _shrinkage(filled / np.sqrt(target.diagonal()), np.asarray(animals))
    return _positive(scatter), _positive((1 - intensity) * scatter + intensity * target)


def _shrinkage(unit: FloatArray, animals: NDArray[np.intp]) -> float:
    """Return the share of the target that minimises the expected squared error of the correlations.

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
    """Lift eigenvalues that pairwise-complete sums leave at or below zero."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    floor = 1e-6 * values.max()
    lifted: FloatArray = (vectors * np.maximum(values, floor)) @ vectors.T
    return lifted
