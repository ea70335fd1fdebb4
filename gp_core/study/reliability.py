"""How repeatable labels are: animals labelled several times, by one observer or by several.

Labels of one animal are compared where they are, in the frame of its scan. For what compares animals
(intraclass correlation, the direction of an offset, the figure), the mean of all labellings of a side is
registered to the atlas, and its labellings move with it: so an observer's error is kept, and the head's
position in the scanner is not taken for a difference between animals.
"""

from __future__ import annotations

import csv
import io
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.disk import write_text
from gp_core.errors import GeometryError, GpError
from gp_core.io import Labelling, landmark_file_name
from gp_core.landmarks.anatomy import cochlea_origin, mirror_right, modiolar_axis
from gp_core.landmarks.features import FEATURES, Side, feature
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.procrustes import weighted_procrustes
from gp_core.study.agreement import (
    AnovaRow,
    ErrorSummary,
    IntraclassCorrelation,
    intraclass_correlation,
    offset_tests,
    procrustes_anova,
    summarise_errors,
)
from gp_core.validation import FloatArray

__all__ = [
    "Disagreement",
    "FeatureReliability",
    "ObserverOffset",
    "PairedDifference",
    "PoseError",
    "ReliabilityReport",
    "reliability",
]

_PLACED = tuple(row.code for row in FEATURES if not row.computed)
_DEFINING = ("CA", "CB", "RWA", "RWP")
_MOST_LISTED = 20
_ALIGNING_STEPS = 50


class _Target(NamedTuple):
    """One side of one animal."""

    specimen: str
    side: Side

    @property
    def text(self) -> str:
        return f"{self.specimen} {self.side.word}"


class _Sitting(NamedTuple):
    """One labelling of a side."""

    observer: str
    round: int

    @property
    def text(self) -> str:
        return f"{self.observer or 'unnamed'}, round {self.round}"


_Labels = dict[_Target, dict[_Sitting, LandmarkSet]]


@dataclass(frozen=True)
class FeatureReliability:
    """How repeatable the labels of one feature are.

    Attributes
    ----------
    code : str
        The feature, or ``all``.
    intra : ErrorSummary or None
        Between the rounds of one observer, over all observers; None where nobody labelled it twice.
    inter : ErrorSummary or None
        Between observers, the first round of each; None where there is one observer.
    icc_intra, icc_inter : IntraclassCorrelation or None
        Of the rounds, and of the observers, over the sides that all of them labelled. None where these are
        fewer than three.
    n_unseen : int
        Sides on which some placed it and others marked it as one that cannot be seen.
    """

    code: str
    intra: ErrorSummary | None
    inter: ErrorSummary | None
    icc_intra: IntraclassCorrelation | None
    icc_inter: IntraclassCorrelation | None
    n_unseen: int = 0

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        parts = {name: getattr(self, name) for name in ("intra", "inter", "icc_intra", "icc_inter")}
        found = {name: None if part is None else part.as_dict() for name, part in parts.items()}
        return {"feature": self.code, **found, "n_unseen": self.n_unseen}


@dataclass(frozen=True)
class ObserverOffset:
    """How far one observer places a feature from where another does, on average.

    Attributes
    ----------
    observers : (str, str)
        The offset is that of the second from the first.
    code : str
        The feature.
    offset_mm : (float, float, float)
        Mean over the sides, mm, forwards, outwards and upwards (the axes of the left CO frame).
    length_mm : float
        Of the mean.
    p, p_corrected : float
        Of no offset, by changing signs animal by animal; corrected for the number of features.
    n_sides, n_animals : int
        That both labelled.
    """

    observers: tuple[str, str]
    code: str
    offset_mm: tuple[float, float, float]
    length_mm: float
    p: float
    p_corrected: float
    n_sides: int
    n_animals: int

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return {**self.__dict__, "observers": list(self.observers), "offset_mm": list(self.offset_mm)}


@dataclass(frozen=True)
class PoseError:
    """What labelling errors do to the cochlea: its origin CO and the modiolar axis CB->CA.

    Attributes
    ----------
    n_pairs : int
        Pairs of labellings of one side that both have CA, CB, RWA and RWP.
    origin_mm, axis_deg : dict of str to float
        ``mean``, ``median`` and ``max`` of the difference of two labellings.
    """

    n_pairs: int
    origin_mm: dict[str, float]
    axis_deg: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return dict(self.__dict__)


@dataclass(frozen=True)
class Disagreement:
    """Two labels of one point that lie far apart.

    Attributes
    ----------
    specimen : str
    side : Side
    code : str
        Feature.
    labellings : (str, str)
        Such as ``AB, round 1``.
    distance_mm : float
    ratio : float
        Of the distance to the median distance of two labels of that feature.
    """

    specimen: str
    side: Side
    code: str
    labellings: tuple[str, str]
    distance_mm: float
    ratio: float

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return {**self.__dict__, "side": self.side.value, "labellings": list(self.labellings)}


@dataclass(frozen=True)
class PairedDifference:
    """Two labels of one point, in the frame of the atlas; for the figure.

    Attributes
    ----------
    code : str
    is_inter : bool
        Whether they are by two observers.
    mean, difference : (3,) tuple of float, mm
        Middle of the two labels, from the feature's place in the atlas, and second minus first; forwards,
        outwards, upwards.
    """

    code: str
    is_inter: bool
    mean: tuple[float, ...]
    difference: tuple[float, ...]


@dataclass(frozen=True)
class ReliabilityReport:
    """How repeatable the labels of some animals are.

    Attributes
    ----------
    observers : tuple of str
    n_animals, n_sides, n_labellings : int
        Animals and sides that were labelled more than once, and labellings of these sides.
    features : tuple of FeatureReliability
        In the table's order.
    overall : FeatureReliability
        Of all features together; its intraclass correlations are of deviations from each feature's mean, and
        their intervals as wide as those of one feature, since features vary together.
    offsets : tuple of ObserverOffset
        The most certain first.
    anova : tuple of AnovaRow
        Procrustes ANOVA of the whole sets; empty where too few share enough features.
    anova_features : tuple of str
        Features that it is made of.
    repeatability : float or None
        Share of the variance of shapes that is that of the animals' sides.
    pose_intra, pose_inter : PoseError or None
    disagreements : tuple of Disagreement
        The farthest apart first, at most 20.
    differences : tuple of PairedDifference
    """

    observers: tuple[str, ...]
    n_animals: int
    n_sides: int
    n_labellings: int
    features: tuple[FeatureReliability, ...]
    overall: FeatureReliability
    offsets: tuple[ObserverOffset, ...]
    anova: tuple[AnovaRow, ...]
    anova_features: tuple[str, ...]
    repeatability: float | None
    pose_intra: PoseError | None
    pose_inter: PoseError | None
    disagreements: tuple[Disagreement, ...]
    differences: tuple[PairedDifference, ...]

    @property
    def rows(self) -> tuple[FeatureReliability, ...]:
        """The features, then all together."""
        return (*self.features, self.overall)

    def as_dict(self) -> dict[str, Any]:
        """Return the report as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        poses = {"intra": self.pose_intra, "inter": self.pose_inter}
        return {
            "observers": list(self.observers),
            "n_animals": self.n_animals,
            "n_sides": self.n_sides,
            "n_labellings": self.n_labellings,
            "features": [row.as_dict() for row in self.features],
            "overall": self.overall.as_dict(),
            "offsets": [row.as_dict() for row in self.offsets],
            "procrustes_anova": {
                "features": list(self.anova_features),
                "rows": [row.as_dict() for row in self.anova],
                "repeatability": self.repeatability,
            },
            "pose": {name: None if pose is None else pose.as_dict() for name, pose in poses.items()},
            "disagreements": [row.as_dict() for row in self.disagreements],
        }

    @checks_arguments
    def save_csv(self, path: str | PathLike[str]) -> None:
        """Write one line for each feature, and one for all; with full precision.

        Parameters
        ----------
        path : path
            The file to write.
        """
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        errors = ("n_pairs", "mean_mm", "median_mm", "max_mm", "dahlberg_mm", "tem_mm", "sd_mm")
        correlations = ("icc2", "icc3")
        writer.writerow(
            [
                "feature",
                *(f"{kind}_{name}" for kind in ("intra", "inter") for name in errors),
                *(
                    f"{kind}_{name}{end}"
                    for kind in ("intra", "inter")
                    for name in correlations
                    for end in ("", "_low", "_high")
                ),
                "n_unseen",
            ]
        )
        for row in self.rows:
            cells = [_cell(part, name) for part in (row.intra, row.inter) for name in errors]
            for icc in (row.icc_intra, row.icc_inter):
                for name in correlations:
                    low, high = (None, None) if icc is None else getattr(icc, f"{name}_95")
                    cells += [_cell(icc, name), *("" if v is None else v for v in (low, high))]
            writer.writerow([row.code, *cells, row.n_unseen])
        write_text(path, stream.getvalue())


def _cell(part: object, name: str) -> object:
    return "" if part is None else getattr(part, name)


@checks_arguments
def reliability(
    labellings: Iterable[Labelling],
    *,
    rng: np.random.Generator | None = None,
    n_permutations: int = 10_000,
) -> ReliabilityReport:
    """Measure how repeatable labels are, within observers and between them.

    Parameters
    ----------
    labellings : iterable of Labelling
        As `gp_core.load_labellings` reads them. Sides that were labelled once are left out.
    rng : numpy Generator, optional
    n_permutations : int
        Of the tests of offsets, where there are more than 12 animals; below, every change of sign is tried.

    Returns
    -------
    ReliabilityReport

    Raises
    ------
    GpError
        No side was labelled twice, or labels of one side are in different frames or in the CO frame, in
        which labelling errors of the cochlea cannot be seen.

    Examples
    --------
    >>> labelled = gp_core.load_labellings("labelled/")  # doctest: +SKIP
    >>> gp_core.reliability(labelled).overall.inter.mean_mm  # doctest: +SKIP
    0.21
    """
    labels = _repeated(labellings)
    if not labels:
        name = landmark_file_name("GP01", Side.LEFT, observer="AB", round_=2)
        raise GpError(
            "no side was labelled twice, so repeatability cannot be measured",
            remedy=f"Label some animals again, and name the files {name} (observer, round).",
        )
    placed = {target: _registered(target, sittings) for target, sittings in labels.items()}
    features = tuple(_feature(code, labels, placed) for code in _codes(labels))
    offsets = _offsets(placed, rng or np.random.default_rng(0), n_permutations)
    anova, repeatability, used = _anova(labels)
    return ReliabilityReport(
        observers=tuple(sorted({s.observer for sittings in labels.values() for s in sittings})),
        n_animals=len({target.specimen for target in labels}),
        n_sides=len(labels),
        n_labellings=sum(len(sittings) for sittings in labels.values()),
        features=features,
        overall=_overall(labels, placed, features),
        offsets=offsets,
        anova=anova,
        anova_features=used,
        repeatability=repeatability,
        pose_intra=_pose_error(labels, inter=False),
        pose_inter=_pose_error(labels, inter=True),
        disagreements=_disagreements(labels),
        differences=tuple(_differences(placed)),
    )


def _repeated(labellings: Iterable[Labelling]) -> _Labels:
    """Return the sides that were labelled more than once; a point of both sides stays with one of them."""
    found: _Labels = defaultdict(dict)
    for each in labellings:
        shared: set[str] = set()
        for side in Side:
            if side not in each.specimen.sides:
                continue
            landmarks = each.specimen.sides[side]
            if not landmarks.placed:
                continue
            for code in shared & set(landmarks.placed):
                landmarks = landmarks.with_point(code, None)
            shared |= {code for code in landmarks.placed if feature(code).shared}
            found[_Target(each.specimen.name, side)][_Sitting(each.observer, each.round)] = landmarks
    repeated = {target: sittings for target, sittings in found.items() if len(sittings) > 1}
    for target, sittings in repeated.items():
        frames = {landmarks.frame for landmarks in sittings.values()}
        if len(frames) > 1 or "cochlea" in frames:
            raise GpError(
                f"the labels of the {target.side.word} side are in the frame {', '.join(sorted(frames))}, "
                "and can be compared in that of the scan alone",
                specimen=target.specimen,
                remedy="Export them in the frame of the scan.",
            )
    return repeated


def _codes(labels: _Labels) -> tuple[str, ...]:
    """Return the features that some side has twice."""
    return tuple(
        code
        for code in _PLACED
        if any(sum(code in marks for marks in sittings.values()) > 1 for sittings in labels.values())
    )


def _groups(labels: _Labels, code: str, *, inter: bool) -> list[FloatArray]:
    """Return the labels (k, 3) of a feature that are compared: rounds of an observer, or first rounds."""
    groups = []
    for sittings in labels.values():
        has = {sitting: marks[code] for sitting, marks in sittings.items() if code in marks}
        groups += [np.array(list(group)) for group in _compared(has, inter=inter)]
    return groups


def _compared(has: dict[_Sitting, Any], *, inter: bool) -> Iterator[list[Any]]:
    """Yield what is compared of the labellings of a side: observers' first rounds, or one's own rounds."""
    of_observers: dict[str, list[Any]] = defaultdict(list)
    for sitting in sorted(has):
        of_observers[sitting.observer].append(has[sitting])
    if inter:
        yield [rounds[0] for rounds in of_observers.values()]
    else:
        yield from of_observers.values()


_Placed = dict[_Target, dict[_Sitting, dict[str, FloatArray]]]


def _registered(
    target: _Target, sittings: dict[_Sitting, LandmarkSet]
) -> dict[_Sitting, dict[str, FloatArray]]:
    """Return the labels of a side in the frame of the atlas, as a left side; empty if they cannot be."""
    atlas = Atlas.published()
    as_left = {
        sitting: dict(zip(marks.placed, mirror_right(marks.array(marks.placed), target.side), strict=True))
        for sitting, marks in sittings.items()
    }
    every = {
        code: np.mean([of[code] for of in as_left.values() if code in of], axis=0)
        for code in atlas.codes
        if any(code in of for of in as_left.values())
    }
    codes = tuple(every)
    try:
        rotation, translation = weighted_procrustes(
            np.array([every[code] for code in codes]).reshape(-1, 3),
            atlas.rows(codes),
            1 / (atlas.variances(codes) + 0.01),
        )
    except GeometryError:
        return {}
    return {
        sitting: {code: rotation @ point + translation for code, point in of.items() if code in every}
        for sitting, of in as_left.items()
    }


def _feature(code: str, labels: _Labels, placed: dict[_Target, Any]) -> FeatureReliability:
    n_unseen = sum(
        any(code in marks.unseen for marks in sittings.values())
        and any(code in marks for marks in sittings.values())
        for sittings in labels.values()
    )
    return FeatureReliability(
        code=code,
        intra=summarise_errors(_groups(labels, code, inter=False)),
        inter=summarise_errors(_groups(labels, code, inter=True)),
        icc_intra=_correlation(placed, [code], inter=False),
        icc_inter=_correlation(placed, [code], inter=True),
        n_unseen=n_unseen,
    )


def _overall(
    labels: _Labels, placed: dict[_Target, Any], features: Sequence[FeatureReliability]
) -> FeatureReliability:
    codes = [row.code for row in features]
    return FeatureReliability(
        code="all",
        intra=summarise_errors([g for code in codes for g in _groups(labels, code, inter=False)]),
        inter=summarise_errors([g for code in codes for g in _groups(labels, code, inter=True)]),
        icc_intra=_correlation(placed, codes, inter=False),
        icc_inter=_correlation(placed, codes, inter=True),
        n_unseen=sum(row.n_unseen for row in features),
    )


def _correlation(
    placed: dict[_Target, Any], codes: Sequence[str], *, inter: bool
) -> IntraclassCorrelation | None:
    """Correlate the labels of some features, each as a deviation from its mean, over complete targets."""
    tables = [table for code in codes if (table := _table(placed, code, inter=inter)) is not None]
    if not tables:
        return None
    usual = Counter(table.shape for table in tables).most_common(1)[0][0]
    whole = [table - table.mean(axis=(0, 1)) for table in tables if table.shape == usual]
    return intraclass_correlation(np.concatenate(whole, axis=2), independent=3)


def _table(placed: dict[_Target, Any], code: str, *, inter: bool) -> FloatArray | None:
    """Return the labels (n, k, 3) of a feature, of n targets by the k raters that labelled most of them."""
    groups: list[dict[Any, FloatArray]] = []
    for sittings in placed.values():
        has = {sitting: of[code] for sitting, of in sittings.items() if code in of}
        if inter:
            firsts: dict[str, FloatArray] = {}
            for sitting in sorted(has):
                firsts.setdefault(sitting.observer, has[sitting])
            groups.append(firsts)
        else:
            groups += [dict(enumerate(rounds)) for rounds in _compared(has, inter=False) if len(rounds) > 1]
    raters = sorted({rater for group in groups for rater in group}, key=str)
    if inter and len(raters) > 1:  # those who labelled at least half as many sides as the busiest one
        n_of = {rater: sum(rater in group for group in groups) for rater in raters}
        raters = [rater for rater in raters if n_of[rater] * 2 >= max(n_of.values())]
    elif not inter:
        raters = raters[:2]
    complete = [[group[rater] for rater in raters] for group in groups if all(r in group for r in raters)]
    return np.array(complete) if len(complete) > 2 and len(raters) > 1 else None


def _offsets(
    placed: dict[_Target, Any], rng: np.random.Generator, n_permutations: int
) -> tuple[ObserverOffset, ...]:
    observers = sorted({sitting.observer for sittings in placed.values() for sitting in sittings})
    found: list[ObserverOffset] = []
    for one, other in combinations(observers, 2):
        of_features = _paired(placed, one, other)
        tests = offset_tests(list(of_features.values()), rng, n_permutations)
        for code, test in zip(of_features, tests, strict=True):
            x, y, z = test.mean.tolist()
            found.append(
                ObserverOffset(
                    observers=(one, other),
                    code=code,
                    offset_mm=(x, y, z),
                    length_mm=float(np.linalg.norm(test.mean)),
                    p=test.p,
                    p_corrected=test.p_corrected,
                    n_sides=test.n_values,
                    n_animals=test.n_animals,
                )
            )
    return tuple(sorted(found, key=lambda row: (row.p_corrected, row.p, -row.length_mm)))


def _paired(placed: dict[_Target, Any], one: str, other: str) -> dict[str, dict[str, FloatArray]]:
    """Return by feature and animal how far the second observer is from the first, (s, 3) of its sides."""
    found: dict[str, dict[str, FloatArray]] = {}
    for code in _PLACED:
        of_animals: dict[str, list[FloatArray]] = defaultdict(list)
        for target, sittings in placed.items():
            means = [_mean_of(sittings, observer, code) for observer in (one, other)]
            if means[0] is not None and means[1] is not None:
                of_animals[target.specimen].append(means[1] - means[0])
        if len(of_animals) > 1:
            found[code] = {name: np.array(group) for name, group in of_animals.items()}
    return found


def _mean_of(sittings: dict[_Sitting, dict[str, FloatArray]], observer: str, code: str) -> FloatArray | None:
    rounds = [of[code] for sitting, of in sittings.items() if sitting.observer == observer and code in of]
    return np.mean(rounds, axis=0) if rounds else None


def _anova(labels: _Labels) -> tuple[tuple[AnovaRow, ...], float | None, tuple[str, ...]]:
    """Split the variation of whole sets, aligned without scaling, of the features that all of them have."""
    rows = [(target, s, marks) for target, sittings in labels.items() for s, marks in sittings.items()]
    codes = tuple(c for c in _PLACED if not feature(c).shared and all(c in marks for _, _, marks in rows))
    individuals = [target.text for target, _, _ in rows]
    if len(codes) < 4 or len(set(individuals)) < 2:
        return (), None, ()
    shapes = np.array([mirror_right(marks.array(codes), target.side) for target, _, marks in rows])
    table, repeatability = procrustes_anova(
        _aligned(shapes), individuals, [sitting.observer for _, sitting, _ in rows]
    )
    return table, repeatability, codes


def _aligned(shapes: FloatArray) -> FloatArray:
    """Align shapes (N, p, 3) to their mean by generalised Procrustes, without scaling."""
    mean, aligned = shapes[0] - shapes[0].mean(axis=0), shapes
    for _ in range(_ALIGNING_STEPS):
        fits = [weighted_procrustes(shape, mean) for shape in shapes]
        aligned = np.array([s @ turn.T + shift for s, (turn, shift) in zip(shapes, fits, strict=True)])
        updated = aligned.mean(axis=0)
        moved = np.abs(updated - mean).max()
        mean = updated
        if moved < 1e-9:
            break
    return aligned


def _pose_error(labels: _Labels, *, inter: bool) -> PoseError | None:
    origins, angles = [], []
    for sittings in labels.values():
        has = {s: marks for s, marks in sittings.items() if all(code in marks for code in _DEFINING)}
        for group in _compared(has, inter=inter):
            for one, other in combinations(group, 2):
                places = [cochlea_origin(*(marks[code] for code in _DEFINING)) for marks in (one, other)]
                axes = [modiolar_axis(marks["CA"], marks["CB"]) for marks in (one, other)]
                origins.append(float(np.linalg.norm(places[0] - places[1])))
                angles.append(float(np.degrees(np.arccos(np.clip(axes[0] @ axes[1], -1, 1)))))
    if not origins:
        return None
    return PoseError(len(origins), _spread(origins), _spread(angles))


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {"mean": float(np.mean(values)), "median": float(np.median(values)), "max": float(max(values))}


def _disagreements(labels: _Labels) -> tuple[Disagreement, ...]:
    found = []
    for target, sittings in labels.items():
        for (one, a), (other, b) in combinations(sorted(sittings.items(), key=lambda item: item[0]), 2):
            for code in _PLACED:
                if code in a and code in b:
                    apart = float(np.linalg.norm(a[code] - b[code]))
                    found.append((target, code, (one.text, other.text), apart))
    of_features: dict[str, list[float]] = defaultdict(list)
    for _, code, _, apart in found:
        of_features[code].append(apart)
    usual = {code: float(np.median(values)) for code, values in of_features.items()}
    found.sort(key=lambda row: -row[3])
    return tuple(
        Disagreement(
            target.specimen, target.side, code, who, apart, apart / usual[code] if usual[code] else 1.0
        )
        for target, code, who, apart in found[:_MOST_LISTED]
    )


def _differences(placed: dict[_Target, Any]) -> Iterator[PairedDifference]:
    atlas = Atlas.published()
    for sittings in placed.values():
        for code in atlas.codes:
            has = {sitting: of[code] for sitting, of in sittings.items() if code in of}
            for inter in (False, True):
                for group in _compared(has, inter=inter):
                    for one, other in combinations(group, 2):
                        mean = (one + other) / 2 - atlas[code]
                        yield PairedDifference(
                            code, inter, tuple(mean.tolist()), tuple((other - one).tolist())
                        )
