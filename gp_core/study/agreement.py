"""Statistics of repeated measurements: Dahlberg, technical error, intraclass correlation, offsets, ANOVA.

Values may be vectors (positions, mm): squares are then squared lengths, and degrees of freedom count
coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gp_core.errors import GpError
from gp_core.validation import FloatArray

__all__ = [
    "AnovaRow",
    "ErrorSummary",
    "IntraclassCorrelation",
    "OffsetTest",
    "intraclass_correlation",
    "offset_tests",
    "procrustes_anova",
    "summarise_errors",
]

_EXACT = 12
"""Up to so many animals all 2^n changes of sign are tried, else a random sample of them."""


@dataclass(frozen=True)
class ErrorSummary:
    """How far repeated labels of the same points lie apart.

    Attributes
    ----------
    n_pairs : int
        Pairs of labels.
    mean_mm, median_mm, max_mm : float
        Distance of the two labels of a pair: mean (the mean radial error), median, largest.
    dahlberg_mm : float
        Root of the sum of the squared distances over twice the number of pairs.
    tem_mm : float
        Technical error of measurement: root mean square distance of a label from the mean of the labels of
        its point, corrected for the degrees of freedom. With two labels a point it is Dahlberg's error.
    tem_95_mm : (float, float)
        Its 95 % interval, for errors that are alike in all directions.
    sd_mm : float
        The same on one coordinate: `tem_mm` over the root of 3.
    """

    n_pairs: int
    mean_mm: float
    median_mm: float
    max_mm: float
    dahlberg_mm: float
    tem_mm: float
    tem_95_mm: tuple[float, float]
    sd_mm: float

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return {**self.__dict__, "tem_95_mm": list(self.tem_95_mm)}


def summarise_errors(groups: Sequence[FloatArray]) -> ErrorSummary | None:
    """Summarise repeated labels of points.

    Parameters
    ----------
    groups : sequence of (k, 3) arrays, mm
        The labels of one point each; those of fewer than two labels say nothing.

    Returns
    -------
    ErrorSummary or None
        None where no point has two labels.

    References
    ----------
    Dahlberg, "Statistical methods for medical and biological students", 1940. Ulijaszek and Kerr,
    "Anthropometric measurement error and the assessment of nutritional status", Br J Nutr 82, 1999.
    https://doi.org/10.1017/S0007114599001348
    """
    from scipy.stats import chi2

    repeated = [np.asarray(group, dtype=np.float64) for group in groups if len(group) > 1]
    if not repeated:
        return None
    apart = np.concatenate(
        [
            np.linalg.norm(group[i] - group[j], axis=-1)
            for group in repeated
            for i, j in [np.triu_indices(len(group), 1)]
        ]
    )
    squares = sum(float(((group - group.mean(axis=0)) ** 2).sum()) for group in repeated)
    freedom = sum(len(group) - 1 for group in repeated)
    tem = np.sqrt(squares / freedom)
    low, high = (float(tem * np.sqrt(3 * freedom / chi2.ppf(p, 3 * freedom))) for p in (0.975, 0.025))
    return ErrorSummary(
        n_pairs=len(apart),
        mean_mm=float(apart.mean()),
        median_mm=float(np.median(apart)),
        max_mm=float(apart.max()),
        dahlberg_mm=float(np.sqrt((apart**2).sum() / (2 * len(apart)))),
        tem_mm=float(tem),
        tem_95_mm=(low, high),
        sd_mm=float(tem / np.sqrt(3)),
    )


@dataclass(frozen=True)
class IntraclassCorrelation:
    """How much of the variance of labels is that of what is labelled.

    Attributes
    ----------
    n_targets, n_raters : int
        Sides, each labelled by every rater.
    icc2, icc3 : float
        ICC(2,1), absolute agreement of single labels by raters who stand for others; and ICC(3,1),
        consistency of single labels by these raters, for whom a constant offset is no error.
    icc2_95, icc3_95 : (float, float)
        95 % intervals.
    """

    n_targets: int
    n_raters: int
    icc2: float
    icc2_95: tuple[float, float]
    icc3: float
    icc3_95: tuple[float, float]

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file; None stands for what cannot be computed.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        numbers = {name: _or_none(value) for name, value in (("icc2", self.icc2), ("icc3", self.icc3))}
        intervals = {"icc2_95": self.icc2_95, "icc3_95": self.icc3_95}
        bounds = {name: [_or_none(bound) for bound in interval] for name, interval in intervals.items()}
        return {"n_targets": self.n_targets, "n_raters": self.n_raters, **numbers, **bounds}


def intraclass_correlation(values: FloatArray, *, independent: int | None = None) -> IntraclassCorrelation:
    """Compute ICC(2,1) and ICC(3,1).

    Parameters
    ----------
    values : (n, k) or (n, k, m) array
        n targets, each measured by k raters; of vectors, the squares of the m coordinates are added up, so
        that large coordinates count more.
    independent : int, optional
        As how many independent coordinates the m count in the intervals; by default as m.

    Returns
    -------
    IntraclassCorrelation

    Raises
    ------
    GpError
        Fewer than two targets or two raters, or a value is missing.

    References
    ----------
    Shrout and Fleiss, "Intraclass correlations: uses in assessing rater reliability", Psychol Bull 86, 1979.
    https://doi.org/10.1037/0033-2909.86.2.420. McGraw and Wong, Psychol Methods 1, 1996.
    https://doi.org/10.1037/1082-989X.1.1.30
    """
    x = np.asarray(values, dtype=np.float64)
    x = x[..., None] if x.ndim == 2 else x
    if x.ndim != 3 or x.shape[0] < 2 or x.shape[1] < 2 or not np.isfinite(x).all():
        raise GpError(
            f"an intraclass correlation needs two targets or more by two raters or more, got shape {x.shape}"
        )
    n, k, m = x.shape
    grand = x.mean(axis=(0, 1))
    rows, columns = x.mean(axis=1) - grand, x.mean(axis=0) - grand
    rest = x - grand - rows[:, None] - columns[None]
    ms_rows = k * float((rows**2).sum()) / (m * (n - 1))
    ms_columns = n * float((columns**2).sum()) / (m * (k - 1))
    ms_error = float((rest**2).sum()) / (m * (n - 1) * (k - 1))
    icc2 = (ms_rows - ms_error) / (ms_rows + (k - 1) * ms_error + k * (ms_columns - ms_error) / n)
    icc3 = (ms_rows - ms_error) / (ms_rows + (k - 1) * ms_error)
    of = (ms_rows, ms_columns, ms_error), n, k, independent or m
    return IntraclassCorrelation(n, k, icc2, _agreement_interval(icc2, *of), icc3, _consistency_interval(*of))


def _consistency_interval(
    mean_squares: tuple[float, float, float], n: int, k: int, m: int
) -> tuple[float, float]:
    from scipy.stats import f

    ms_rows, _, ms_error = mean_squares
    if ms_error == 0:
        return (1.0, 1.0)
    ratio, df_rows, df_error = ms_rows / ms_error, m * (n - 1), m * (n - 1) * (k - 1)
    low, high = ratio / f.ppf(0.975, df_rows, df_error), ratio * f.ppf(0.975, df_error, df_rows)
    return float((low - 1) / (low + k - 1)), float((high - 1) / (high + k - 1))


def _agreement_interval(
    icc2: float, mean_squares: tuple[float, float, float], n: int, k: int, m: int
) -> tuple[float, float]:
    """Return the interval of ICC(2,1) by Satterthwaite's degrees of freedom."""
    from scipy.stats import f

    ms_rows, ms_columns, ms_error = mean_squares
    if ms_error == 0:
        return (icc2, icc2)
    of_raters = k * icc2 * ms_columns / ms_error
    of_error = n * (1 + (k - 1) * icc2) - k * icc2
    freedom = m * (k - 1) * (n - 1) * (of_raters + of_error) ** 2 / ((n - 1) * of_raters**2 + of_error**2)
    wide, narrow = f.ppf(0.975, m * (n - 1), freedom), f.ppf(0.975, freedom, m * (n - 1))
    rest = k * ms_columns + (k * n - k - n) * ms_error
    low = n * (ms_rows - wide * ms_error) / (wide * rest + n * ms_rows)
    high = n * (narrow * ms_rows - ms_error) / (rest + n * narrow * ms_rows)
    return float(low), float(high)


@dataclass(frozen=True)
class OffsetTest:
    """Mean of paired differences, and whether it may be zero.

    Attributes
    ----------
    mean : (3,) array, mm
    n_values, n_animals : int
        Differences, and animals that they are of.
    p : float
        Share of the changes of sign under which the mean is as long or longer.
    p_corrected : float
        The same for the largest of all features that are tested together, each in units of its own scatter.
    """

    mean: FloatArray
    n_values: int
    n_animals: int
    p: float
    p_corrected: float


def offset_tests(
    differences: Sequence[Mapping[str, FloatArray]], rng: np.random.Generator, n_permutations: int = 10_000
) -> list[OffsetTest]:
    """Test whether means of paired differences are zero, by changing signs.

    Parameters
    ----------
    differences : sequence of mapping of str to (s, 3) array, mm
        For each feature, by animal: second observer minus first, for each of its sides. All features and both
        sides of an animal change sign together, since they are no independent samples.
    rng : numpy Generator
        Of the changes of sign, where there are too many to try all.
    n_permutations : int
        How many are tried then, beyond 12 animals.

    Returns
    -------
    list of OffsetTest
        For each feature. With n animals no p is less than 2 / 2^n.

    References
    ----------
    Westfall and Young, "Resampling-based multiple testing", 1993. Winkler et al., "Permutation inference for
    the general linear model", NeuroImage 92, 2014. https://doi.org/10.1016/j.neuroimage.2014.01.060
    """
    animals = sorted({name for of_animals in differences for name in of_animals})
    if not animals:
        return []
    none = np.zeros((1, 3))
    totals = np.array([[of.get(name, none).sum(axis=0) for name in animals] for of in differences])
    signs = _changes_of_sign(len(animals), rng, n_permutations)
    lengths: FloatArray = np.linalg.norm(np.einsum("pa,fac->pfc", signs, totals), axis=2)
    scatter = np.sqrt((totals**2).sum(axis=(1, 2)))
    scores = lengths / np.where(scatter > 0, scatter, 1.0)
    reached = scores[0] * (1 - 1e-9)
    p = (scores >= reached).mean(axis=0)
    p_corrected = (scores.max(axis=1)[:, None] >= reached).mean(axis=0)
    found = []
    for i, of in enumerate(differences):
        n = sum(map(len, of.values()))
        mean = totals[i].sum(axis=0) / n
        found.append(OffsetTest(mean, n, len(of), float(p[i]), float(p_corrected[i])))
    return found


def _changes_of_sign(n: int, rng: np.random.Generator, n_permutations: int) -> FloatArray:
    """Return changes of the signs of n animals, one a row, the first of them none."""
    if n > _EXACT:
        return np.vstack([np.ones(n), rng.choice([-1.0, 1.0], (n_permutations, n))])
    bits = (np.arange(2**n)[:, None] >> np.arange(n)) & 1
    return np.where(bits == 0, 1.0, -1.0)


@dataclass(frozen=True)
class AnovaRow:
    """One source of variation of a Procrustes ANOVA.

    Attributes
    ----------
    source : str
        ``individual``, ``observer``, ``individual x observer``, ``residual``.
    freedom : int
        Degrees of freedom, counted over the coordinates.
    sum_of_squares, mean_square : float
        mm^2.
    share : float
        Of the whole sum of squares.
    f, p : float or None
        Test against the variation within individuals; None where there is nothing to test.
    """

    source: str
    freedom: int
    sum_of_squares: float
    mean_square: float
    share: float
    f: float | None = None
    p: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return dict(self.__dict__)


def procrustes_anova(
    shapes: FloatArray, individuals: Sequence[str], observers: Sequence[str]
) -> tuple[tuple[AnovaRow, ...], float | None]:
    """Split the variation of aligned shapes into individuals, observers, their interaction and the rest.

    Parameters
    ----------
    shapes : (N, p, 3) array, mm
        Shapes aligned to their mean (without scaling), one for each labelling.
    individuals, observers : sequence of str
        What each of them is of, and by whom.

    Returns
    -------
    rows : tuple of AnovaRow
        Sums of squares are sequential (type I), in this order. Individuals and observers are tested against
        their interaction where that can be told from the rest, the interaction against the rest.
    repeatability : float or None
        Share of the variance between labellings that is that of individuals, all error taken together.

    References
    ----------
    Klingenberg and McIntyre, "Geometric morphometrics of developmental instability", Evolution 52, 1998.
    https://doi.org/10.1111/j.1558-5646.1998.tb02018.x. Fruciano, "Measurement error in geometric
    morphometrics", Dev Genes Evol 226, 2016. https://doi.org/10.1007/s00427-016-0537-4
    """
    y = shapes.reshape(len(shapes), -1)
    y = y - y.mean(axis=0)
    per_shape = 3 * shapes.shape[1] - 6  # position and turn are fitted away
    one, other = _dummies(individuals), _dummies(observers)
    both = _dummies([f"{a}\n{b}" for a, b in zip(individuals, observers, strict=True)])
    designs = {
        "individual": one,
        "observer": np.hstack([one, other]),
        "individual x observer": both,
    }
    found, left, rank = [], float((y**2).sum()), 1
    total = left
    for source, design in designs.items():
        rest, now = _unexplained(y, design)
        if now > rank:
            found.append((source, (now - rank) * per_shape, max(left - rest, 0.0)))
            left, rank = rest, now
    if len(y) > rank:
        found.append(("residual", (len(y) - rank) * per_shape, left))
    return _tested(found, total), _repeatability(found, individuals)


def _dummies(names: Sequence[str]) -> FloatArray:
    levels = list(dict.fromkeys(names))
    return np.array([[float(name == level) for level in levels] for name in names])


def _unexplained(y: FloatArray, design: FloatArray) -> tuple[float, int]:
    """Return the sum of squares that a design leaves, and its rank."""
    left, values, _ = np.linalg.svd(design, full_matrices=False)
    basis = left[:, values > 1e-9 * values[0]]
    return float(((y - basis @ (basis.T @ y)) ** 2).sum()), basis.shape[1]


def _tested(found: list[tuple[str, int, float]], total: float) -> tuple[AnovaRow, ...]:
    from scipy.stats import f as f_distribution

    known = {source: (freedom, squares / freedom) for source, freedom, squares in found}
    within = known.get("individual x observer", known.get("residual"))
    against = {"individual": within, "observer": within, "individual x observer": known.get("residual")}
    rows = []
    for source, freedom, squares in found:
        error, f, p = against.get(source), None, None
        if error is not None and error[1] > 0:
            f = known[source][1] / error[1]
            p = float(f_distribution.sf(f, freedom, error[0]))
        share = squares / total if total else 0.0
        rows.append(AnovaRow(source, freedom, squares, squares / freedom, share, f, p))
    return tuple(rows)


def _repeatability(found: list[tuple[str, int, float]], individuals: Sequence[str]) -> float | None:
    of = {source: (freedom, squares) for source, freedom, squares in found}
    errors = [value for source, value in of.items() if source != "individual"]
    if "individual" not in of or not errors:
        return None
    error = sum(squares for _, squares in errors) / sum(freedom for freedom, _ in errors)
    counts = np.unique(list(individuals), return_counts=True)[1].astype(np.float64)
    each = (counts.sum() - (counts**2).sum() / counts.sum()) / (len(counts) - 1)
    between = (of["individual"][1] / of["individual"][0] - error) / each
    whole = between + error
    return float(between / whole) if whole > 0 else None


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
