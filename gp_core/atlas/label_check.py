"""Check labels: missing, exchanged, of the other side, or not where the atlas expects them.

The one checker of the shell, the window, scripts, Python and the fit of an atlas. A side labelled under the
name of the other, and exchanged names, are found by likelihood (`gp_core.atlas.label_likelihood`); a single
label is compared with its prediction from the other labels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from types import MappingProxyType
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.atlas.label_likelihood import (
    WRONG_MM,
    LabelHypothesis,
    LabelModel,
    best_hypothesis,
)
from gp_core.atlas.labelling_error import LABELLING_NOISE_MM
from gp_core.errors import GpError
from gp_core.extensions import Extensions
from gp_core.landmarks.anatomy import mirror_right
from gp_core.landmarks.features import FEATURES, Side, feature
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.sets import LandmarkSet, Specimen, Status
from gp_core.validation import FloatArray, freeze_arrays

__all__ = [
    "CHECKS",
    "OUTLIER_SD",
    "SHARED_WRONG_MM",
    "Deviation",
    "Finding",
    "SideCheck",
    "check_landmarks",
    "check_side",
    "check_specimen",
    "deviation",
    "far_finding",
]

OUTLIER_SD = 5.0
"""Distance from the predicted position, in standard deviations, beyond which a label is an outlier."""

OTHER_SIDE_ODDS = 0.015
"""Prior odds that a side is labelled under the name of the other."""

FEWEST = 4
"""Three labels or fewer cannot contradict each other."""

SAME_PLACE_MM = 0.05
"""Half a voxel: no two features are that close."""

SHARED_MM = 0.5
"""Largest ordinary difference between two labels of the same point."""

SHARED_WRONG_MM = 1.0
"""From this difference on, one of two labels of the same point is wrong: 7 SD of the difference."""

HEAD_MM = 40.0
"""No two features of a head are farther apart than this."""

_LEAST_WIDTH = 0.1
"""Fraction of the width in the atlas below which the placed features count as collinear."""

NEAR_BONE_MM = 3.0
"""Largest distance from bone of a feature in the spaces of the cochlea."""

_NOT_PROBLEMS = ("missing", "suggested", "unseen", "unchecked")


@dataclass(frozen=True, eq=False)
class Deviation:
    """Deviation of a label from where the other labels of its side predict it.

    Attributes
    ----------
    code : str
        Feature.
    distance : float
        From the predicted position, mm.
    expected : (3,) array
        Predicted position, mm, in the frame of the labels.
    covariance : (3, 3) array
        Of the predicted position, mm^2.
    n_sd : float
        The distance in standard deviations (Mahalanobis).
    labelling_sd : float
        Error of the label itself that these allow for, mm per coordinate.
    """

    code: str
    distance: float
    expected: FloatArray
    covariance: FloatArray
    n_sd: float
    labelling_sd: float = LABELLING_NOISE_MM

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def is_outlier(self) -> bool:
        """Whether a person should review the label."""
        return self.n_sd > OUTLIER_SD

    @property
    def word(self) -> str:
        """Such as ``2.6 mm``, or ``far off`` where a number would mean nothing."""
        if self.distance > HEAD_MM:
            return "far off"
        return f"{self.distance:.{1 if self.distance > 0.995 else 2}f} mm"

    @property
    def text(self) -> str:
        """Such as ``2.6 mm from the position that the atlas predicts``."""
        if self.distance > HEAD_MM:
            return "far from any plausible position: check names, side and units"
        return f"{self.word} from the position that the atlas predicts"

    def as_dict(self) -> dict[str, Any]:
        """Return the deviation for a JSON file.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        numbers = {"distance": self.distance, "n_sd": self.n_sd, "expected": self.expected.tolist()}
        return {"landmark": self.code, **numbers}


@dataclass(frozen=True)
class Finding:
    """One thing to look at.

    Attributes
    ----------
    specimen : str
    side : Side
    kind : str
        ``other side``, ``exchanged``, ``duplicate``, ``outside``, ``off bone``, ``far``,
        ``shared point differs``, ``shared point wrong``, ``missing``, ``suggested``, ``unseen`` or
        ``unchecked``; of a check that a package adds, its name and ``(added)``.
    landmarks : tuple of str
        Features concerned.
    text : str
        One line for a person.
    remedy : str
        What to do about it, one sentence.
    certainty : float or None
        For ``other side`` and ``exchanged``, its probability among the explanations that were considered.
    deviations : tuple of Deviation
        How far each of the landmarks is from where the others put it, for ``far`` and ``exchanged``.
    checked_by : str or None
        Who looked at all of these labels again and found them right, empty where no name is known; None
        where nobody did. It is a finding all the same.
    """

    specimen: str
    side: Side
    kind: str
    landmarks: tuple[str, ...]
    text: str
    remedy: str = ""
    certainty: float | None = None
    deviations: tuple[Deviation, ...] = ()
    checked_by: str | None = None

    @property
    def is_checked(self) -> bool:
        """Whether a person looked at these labels again and found them right."""
        return self.checked_by is not None

    @property
    def is_problem(self) -> bool:
        """Whether it says that a label is wrong, not merely that it is missing or cannot be checked."""
        return self.kind not in _NOT_PROBLEMS

    @property
    def severity(self) -> float:
        """Grows with how wrong the labels are; a sorting key."""
        if not self.is_problem:
            return -1.0
        farthest = max((away.n_sd for away in self.deviations), default=0.0)
        return 1e6 * _RANKS.get(self.kind, 0) + farthest

    @property
    def word(self) -> str:
        """For a cell of a table, such as ``2.6 mm`` or ``exchanged``."""
        return self.deviations[0].word if self.kind == "far" else self.kind

    @checks_arguments
    def deviation_of(self, code: str) -> Deviation | None:
        """Return the deviation of one of the landmarks, where it is known.

        Parameters
        ----------
        code : str
            A feature.

        Returns
        -------
        Deviation or None
            None where it was not compared.
        """
        return next((away for away in self.deviations if away.code == code), None)

    def as_dict(self) -> dict[str, Any]:
        """Return the finding for a JSON file.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return {
            "specimen": self.specimen,
            "side": self.side.value,
            "kind": self.kind,
            "landmarks": list(self.landmarks),
            "text": self.text,
            "remedy": self.remedy,
            "certainty": self.certainty,
            "departures": [away.as_dict() for away in self.deviations],
            "checked_by": self.checked_by,
        }


_RANKS = {"other side": 5, "exchanged": 4, "duplicate": 3, "outside": 2, "off bone": 1}


def _nothing() -> Mapping[str, Deviation]:
    return MappingProxyType({})


@dataclass(frozen=True)
class SideCheck:
    """Result of the check of one side.

    Attributes
    ----------
    findings : tuple of Finding
        The worst first; missing labels last.
    deviations : mapping of str to Deviation
        Of every label that can be compared with the others, in the table's order.
    """

    findings: tuple[Finding, ...] = ()
    deviations: Mapping[str, Deviation] = field(default_factory=_nothing)

    @property
    def is_other_side(self) -> bool:
        """Whether the side is labelled under the name of the other."""
        return any(finding.kind == "other side" for finding in self.findings)

    @property
    def problems(self) -> dict[str, Finding]:
        """The worst finding of each label that may be wrong, by feature."""
        found: dict[str, Finding] = {}
        for finding in self.findings:
            if finding.is_problem:
                for code in finding.landmarks:
                    found.setdefault(code, finding)
        return found


@checks_arguments
def check_specimen(
    specimen: Specimen, atlas: Atlas, *, scan: Mapping[Side, ScanEvidence] | None = None
) -> list[Finding]:
    """Return all findings on the labels of one animal, both sides.

    Parameters
    ----------
    specimen : Specimen
        Its labels, mm.
    atlas : Atlas
        What the labels are compared with.
    scan : mapping of Side to ScanEvidence, optional
        Evidence from the scan on each side; by default what is stored with its labels.

    Returns
    -------
    list of Finding
        The worst of each side first.
    """
    found: list[Finding] = []
    for side, landmarks in specimen.sides.items():
        of_side = check_side(landmarks, atlas, scan=(scan or {}).get(side)).findings
        found += [replace(finding, specimen=specimen.name) for finding in of_side]
    return found + list(_shared_points(specimen))


def check_landmarks(landmarks: LandmarkSet, atlas: Atlas) -> list[Finding]:
    """Return all findings on the labels of one side; see `check_side`.

    Parameters
    ----------
    landmarks : LandmarkSet
        One side, mm.
    atlas : Atlas
        What the labels are compared with.

    Returns
    -------
    list of Finding
        The worst first.
    """
    return list(check_side(landmarks, atlas).findings)


@checks_arguments
def check_side(landmarks: LandmarkSet, atlas: Atlas, *, scan: ScanEvidence | None = None) -> SideCheck:
    """Check the labels of one side.

    Parameters
    ----------
    landmarks : LandmarkSet
        In any frame, mm; from four placed features on they are compared with the atlas.
    atlas : Atlas
        What the labels are compared with.
    scan : ScanEvidence, optional
        Evidence from the scan on the same labels: those off the bone are named, however few there are. By
        default what is stored with the labels.

    Returns
    -------
    SideCheck
        Computed in 1 ms for a side in order, and in 10 ms for one that is not.
    """
    labels = landmarks
    if scan is not None:
        labels = replace(landmarks, scan_evidence=scan.measured_at(landmarks.as_mapping()))
    found: list[Finding] = []
    deviations: Mapping[str, Deviation] = MappingProxyType({})
    for name in CHECKS.names():
        result = _run_check(name, labels, atlas)
        found += (_as_checked(finding, landmarks) for finding in result)
        if isinstance(result, _Comparison):
            deviations = result.deviations
    found.sort(key=lambda finding: -finding.severity)
    return SideCheck(tuple(found), deviations)


def _run_check(name: str, landmarks: LandmarkSet, atlas: Atlas) -> Iterable[Finding]:
    """Run one of `CHECKS`; one of a package that fails says so in a finding, and stops no other."""
    if not CHECKS.is_added(name):
        return CHECKS.get(name)(landmarks, atlas)
    try:
        found = list(CHECKS.get(name)(landmarks, atlas))
        if not all(isinstance(finding, Finding) for finding in found):
            raise TypeError("it did not return findings")
    except Exception as error:
        failure = CHECKS.failure(name, error)
        return [_finding(landmarks, "unchecked", (), failure.problem, failure.remedy or "")]
    # under a kind of its own, so that no label is left out of an atlas because of it
    return [replace(finding, kind=f"{name} (added)") for finding in found]


def _as_checked(finding: Finding, *sets: LandmarkSet) -> Finding:
    """Add who reviewed all labels of a finding and confirmed them."""
    names = {landmarks.checked.get(code) for landmarks in sets for code in finding.landmarks}
    if not finding.is_problem or not names or None in names:
        return finding
    who = ", ".join(sorted(name for name in names if name))
    return replace(finding, checked_by=who)


def deviation(
    code: str,
    position: FloatArray,
    expected: FloatArray,
    covariance: FloatArray,
    labelling_sd: float = LABELLING_NOISE_MM,
) -> Deviation:
    """Compare a label with its predicted position.

    Parameters
    ----------
    code : str
        The feature.
    position : (3,) array, mm
        The label.
    expected : (3,) array, mm
        Its predicted position.
    covariance : (3, 3) array, mm^2
        Of the predicted position.
    labelling_sd : float
        Standard deviation of the label itself, mm per coordinate.

    Returns
    -------
    Deviation
        Distance in mm and in standard deviations.
    """
    off = position - expected
    spread = covariance + labelling_sd**2 * np.eye(3)
    n_sd = float(np.sqrt(off @ np.linalg.solve(spread, off)))
    return Deviation(code, float(np.linalg.norm(off)), expected, covariance, n_sd, labelling_sd)


def far_finding(side: Side, away: Deviation) -> Finding:
    """Return the finding that a label is far from its predicted position.

    Parameters
    ----------
    side : Side
        Of the label.
    away : Deviation
        Of the label.

    Returns
    -------
    Finding
        Of kind ``far``.
    """
    text = f"{away.text} ({away.n_sd:.0f} SD)" if away.distance <= HEAD_MM else away.text
    remedy = f"Review {away.code}: move it, or mark it as checked."
    return Finding("", side, "far", (away.code,), text, remedy, deviations=(away,))


def _finding(
    landmarks: LandmarkSet, kind: str, codes: tuple[str, ...], text: str, remedy: str = "", **more: Any
) -> Finding:
    return Finding("", landmarks.side, kind, codes, text, remedy, **more)


def _not_placed(landmarks: LandmarkSet, atlas: Atlas) -> Iterator[Finding]:
    for row in FEATURES:
        if row.computed or row.code in landmarks:
            continue
        if landmarks.status(row.code) is Status.UNSEEN:
            yield _finding(landmarks, "unseen", (row.code,), "marked as one that cannot be seen")
        elif landmarks.status(row.code) is Status.SUGGESTED:
            yield _finding(landmarks, "suggested", (row.code,), "suggested, but nobody has confirmed it yet")
        else:
            yield _finding(landmarks, "missing", (row.code,), f"not placed: {row.definition}")


def _duplicates(landmarks: LandmarkSet, atlas: Atlas) -> Iterator[Finding]:
    placed = [code for code in landmarks.placed if not feature(code).computed]
    for a, b in combinations(placed, 2):
        if np.linalg.norm(landmarks[a] - landmarks[b]) < SAME_PLACE_MM:
            text, remedy = f"{a} and {b} are at the same place", "Place one of them again."
            yield _finding(landmarks, "duplicate", (a, b), text, remedy)


def _against_scan(landmarks: LandmarkSet, atlas: Atlas) -> Iterator[Finding]:
    scan = landmarks.scan_evidence
    if scan is None:
        return
    for code, distance_mm in scan.bone_distances.items():
        if code not in landmarks or feature(code).computed:
            continue
        distance = f"{distance_mm:.1f} mm" if np.isfinite(distance_mm) else "far"
        if code in scan.outside:
            text, remedy = f"{code} is outside the scan", f"Place {code} again, in the scan."
            yield _finding(landmarks, "outside", (code,), text, remedy)
        elif feature(code).on_bone and distance_mm > scan.tolerance:
            text, remedy = f"{code} is {distance} from bone", f"Place {code} on bone, or mark it as checked."
            yield _finding(landmarks, "off bone", (code,), text, remedy)
        elif distance_mm > NEAR_BONE_MM:
            text, remedy = f"{code} is {distance} from any bone: outside the head", f"Place {code} again."
            yield _finding(landmarks, "outside", (code,), text, remedy)


def _require_enough(landmarks: LandmarkSet, atlas: Atlas, codes: tuple[str, ...]) -> None:
    """Reject labels that are too few, or collinear, to be compared with each other."""
    if len(codes) < FEWEST:
        raise GpError(
            f"at least {FEWEST} placed features are needed to check one against the rest, got {len(codes)}",
            remedy="Place more features.",
        )
    width, expected = (
        np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1]
        for points in (landmarks.array(codes), atlas.rows(codes))
    )
    if width < _LEAST_WIDTH * expected:
        raise GpError(
            "the placed features are at one position or on a line, so they do not determine the "
            "orientation of the head",
            remedy="Place a feature away from them, and check that the labels are in mm.",
        )


@dataclass(frozen=True)
class _Comparison:
    """What the labels of a side tell about each other: findings, and the deviation of every label."""

    findings: tuple[Finding, ...]
    deviations: Mapping[str, Deviation] = field(default_factory=_nothing)

    def __iter__(self) -> Iterator[Finding]:
        return iter(self.findings)


def _compared_with_atlas(landmarks: LandmarkSet, atlas: Atlas) -> _Comparison:
    codes = tuple(code for code in landmarks.placed if code in atlas.codes)
    try:
        _require_enough(landmarks, atlas, codes)
        return _explain(landmarks, atlas, codes)
    except GpError as error:
        text = f"positions not checked: {error.problem}"
        return _Comparison((_finding(landmarks, "unchecked", (), text, error.remedy or ""),))


def _explain(landmarks: LandmarkSet, atlas: Atlas, codes: tuple[str, ...]) -> _Comparison:
    """Find the most probable hypothesis on the labels; return its findings, and all deviations."""
    model, labels, side = LabelModel(atlas, codes), landmarks.array(codes), landmarks.side
    own, other = (mirror_right(labels, named) for named in (side, side.other))
    hypothesis, price = best_hypothesis(model, own), -2 * np.log(OTHER_SIDE_ODDS)
    mirrored = best_hypothesis(model, other, below=hypothesis.cost - price)
    surplus = mirrored.cost + price - hypothesis.cost
    found = []
    if surplus < 0:
        hypothesis, side = mirrored, side.other
        found.append(_other_side(landmarks, codes, certainty=float(1 / (1 + np.exp(surplus / 2)))))
    deviations = _deviations(model, codes, labels, hypothesis, side)
    for (i, j), certainty in zip(hypothesis.exchanged, hypothesis.certainties, strict=True):
        found.append(_exchanged(landmarks, deviations, (codes[i], codes[j]), certainty))
    explained = {code for finding in found if finding.kind == "exchanged" for code in finding.landmarks}
    found += [
        far_finding(landmarks.side, away)
        for away in deviations.values()
        if away.is_outlier and away.code not in explained
    ]
    return _Comparison(tuple(found), MappingProxyType(deviations))


def _other_side(landmarks: LandmarkSet, codes: tuple[str, ...], certainty: float) -> Finding:
    text = f"these labels fit the {landmarks.side.other.word} side: left and right are exchanged"
    remedy = "Exchange left and right."
    return _finding(landmarks, "other side", codes, text, remedy, certainty=certainty)


def _exchanged(
    landmarks: LandmarkSet, deviations: Mapping[str, Deviation], pair: tuple[str, str], certainty: float
) -> Finding:
    names = " and ".join(pair)
    away = tuple(deviations[code] for code in pair)
    text, remedy = f"{names} look exchanged", f"Exchange the names of {names}."
    return _finding(landmarks, "exchanged", pair, text, remedy, certainty=certainty, deviations=away)


def _deviations(
    model: LabelModel, codes: tuple[str, ...], labels: FloatArray, hypothesis: LabelHypothesis, side: Side
) -> dict[str, Deviation]:
    """Compare each label (n, 3) with its prediction from the others, as labels of this side."""
    own_variances = model.labelling_sd**2
    own_variances[list(hypothesis.wrong)] += WRONG_MM**2
    rest = model.fit(hypothesis.points, hypothesis.wrong).leave_one_out(own_variances)
    flip = np.diag([-1.0, 1.0, 1.0]) if side is Side.RIGHT else np.eye(3)
    covariances, errors = flip @ rest.covariance @ flip, model.labelling_sd.tolist()
    places = zip(codes, labels, rest.expected @ flip, covariances, errors, strict=True)
    return {code: deviation(code, *place) for code, *place in places}


CHECKS: Extensions[Callable[[LandmarkSet, Atlas], Iterable[Finding]]] = Extensions(
    "gp_labeler.checks",
    {
        "duplicates": _duplicates,
        "bone": _against_scan,
        "atlas": _compared_with_atlas,
        "not placed": _not_placed,
    },
)
"""All checks of the labels of one side, those of installed packages among them.

What the scan tells of the labels is in `LandmarkSet.scan_evidence`.
"""


def _shared_points(specimen: Specimen) -> Iterator[Finding]:
    if len(specimen.sides) < 2:
        return
    left, right = specimen.side(Side.LEFT), specimen.side(Side.RIGHT)
    if left.frame != right.frame or left.frame == "cochlea":
        return
    for row in FEATURES:
        if row.shared and row.code in left and row.code in right:
            apart = float(np.linalg.norm(left[row.code] - right[row.code]))
            if apart > SHARED_MM:
                text = (
                    f"{row.code} is one point shared by both sides, but its labels are {apart:.2f} mm apart"
                )
                kind, what = "shared point differs", "uses the mean"
                if apart > SHARED_WRONG_MM:
                    text += ": one of them is wrong"
                    kind, what = "shared point wrong", "leaves it out"
                remedy = f"Place {row.code} again; a fit {what}."
                found = Finding(specimen.name, Side.LEFT, kind, (row.code,), text, remedy)
                yield _as_checked(found, left, right)
