"""Fit an atlas to labels as they are: generalised Procrustes, then a shrunk covariance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from gp_core.atlas.atlas import PLACED, Atlas
from gp_core.atlas.certainty_weights import certainty_weights
from gp_core.atlas.generalised_procrustes import align_shapes, covariances, label_weights
from gp_core.constants import DEFINING_FEATURES
from gp_core.errors import FeatureError, GpError
from gp_core.landmarks.anatomy import mirror_right
from gp_core.landmarks.features import CODES, check_codes
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.validation import FloatArray

__all__ = ["as_left", "fit_consensus", "fit_plain_atlas", "fit_weighted_atlas", "left_shapes"]


def fit_plain_atlas(
    specimens: Sequence[Specimen],
    *,
    features: Iterable[str] | None = None,
    name: str | None = None,
    by_certainty: Mapping[str, float] | None = None,
) -> Atlas:
    """Fit an atlas in which every label of every animal has the same weight, as the study of the paper needs.

    Parameters
    ----------
    specimens, features, name
        As for `fit_atlas`.
    by_certainty : mapping of str to float, optional
        As for `fit_weighted_atlas`.

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
    return fit_weighted_atlas(specimens, np.ones(len(specimens)), features, name, by_certainty)


def fit_consensus(specimens: Sequence[Specimen], *, name: str = "these animals") -> Atlas:
    """Fit an atlas to the consensus of animals some of whose labels are wrong; only to check them against.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.
    name : str
        Of the atlas.

    Returns
    -------
    Atlas
        The robust consensus.

    Raises
    ------
    GpError
        As for `fit_plain_atlas`.
    """
    owners, shapes, codes = _shapes_of(specimens, None)
    weights = label_weights(shapes, codes, owners)
    return _fit_shapes(specimens, shapes, codes, owners, weights, name)


def fit_weighted_atlas(
    specimens: Sequence[Specimen],
    of_animals: FloatArray,
    features: Iterable[str] | None,
    name: str | None,
    by_certainty: Mapping[str, float] | None = None,
) -> Atlas:
    """Fit an atlas to labels as they are, each animal with its weight.

    Parameters
    ----------
    specimens, features, name
        As for `fit_plain_atlas`.
    of_animals : (n,) array
        Weight of each specimen; with ones, this is `fit_plain_atlas`.
    by_certainty : mapping of str to float, optional
        Weight of each label by its certainty; by default certainty does not count.

    Returns
    -------
    Atlas
        The fitted atlas.

    Raises
    ------
    GpError
        As `fit_plain_atlas`.
    """
    owners, shapes, codes = _shapes_of(specimens, features)
    weights = None
    if not (of_animals == 1).all():
        of_sides = np.repeat(of_animals, [len(specimen.sides) for specimen in specimens])
        weights = np.repeat(of_sides[:, None], len(codes), axis=1)
    if by_certainty is not None:
        of_labels = certainty_weights(specimens, codes, by_certainty)
        if not (of_labels == 1).all():
            weights = of_labels if weights is None else weights * of_labels
    return _fit_shapes(specimens, shapes, codes, owners, weights, name or f"{len(specimens)} specimens")


def _shapes_of(
    specimens: Sequence[Specimen], features: Iterable[str] | None
) -> tuple[list[str], FloatArray, tuple[str, ...]]:
    owners, shapes = left_shapes(specimens)
    if len(shapes) < 3:
        raise GpError(f"an atlas needs at least three labelled sides, got {len(shapes)}")
    codes = _choose(shapes, features)
    return owners, shapes[:, [CODES.index(code) for code in codes]], codes


def _fit_shapes(
    specimens: Sequence[Specimen],
    shapes: FloatArray,
    codes: tuple[str, ...],
    owners: list[str],
    weights: FloatArray | None,
    name: str,
) -> Atlas:
    mean, aligned = align_shapes(shapes, codes, owners, weights)
    animals = [i for i, specimen in enumerate(specimens) for _ in specimen.sides]
    scatter, covariance = covariances(aligned - mean, animals, weights)
    return Atlas(
        name=name,
        codes=codes,
        mean=mean,
        covariance=covariance,
        scatter=scatter,
        n_samples=len(shapes),
        specimens=tuple(specimen.name for specimen in specimens),
    )


def left_shapes(specimens: Sequence[Specimen]) -> tuple[list[str], FloatArray]:
    """Return every labelled side as a left side.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.

    Returns
    -------
    owners : list of str
        Specimen and side, for messages.
    shapes : (S, 20, 3) array, mm
        Points in the table's order, right sides mirrored in x, NaN where missing.
    """
    sides = [(s.name, landmarks) for s in specimens for landmarks in s.sides.values()]
    owners = [f"{name} {landmarks.side.word}" for name, landmarks in sides]
    shapes = [as_left(landmarks) for _, landmarks in sides]
    return owners, np.array(shapes).reshape(-1, len(CODES), 3)


def as_left(landmarks: LandmarkSet) -> FloatArray:
    """Return the points of a set, mirrored in x if they are of a right side.

    Parameters
    ----------
    landmarks : LandmarkSet
        One side.

    Returns
    -------
    (20, 3) array, mm
        Points as of a left side.
    """
    return mirror_right(landmarks.points, landmarks.side)


def _choose(shapes: FloatArray, features: Iterable[str] | None) -> tuple[str, ...]:
    counts = np.isfinite(shapes).all(axis=2).sum(axis=0)
    common = tuple(code for code in PLACED if counts[CODES.index(code)] >= 2)
    wanted = common if features is None else check_codes(features, "the features of an atlas", allowed=CODES)
    chosen = tuple(code for code in CODES if code in wanted and code != "CO")
    for code in (*DEFINING_FEATURES, *chosen):
        if code not in common:
            raise FeatureError(
                f"fewer than two sides have {code}", landmark=code, remedy="Label it in more specimens."
            )
    return tuple(code for code in PLACED if code in {*chosen, *DEFINING_FEATURES})
