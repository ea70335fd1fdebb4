"""Check labels: what is missing, exchanged, of the other side, or not where the atlas expects it.

The one checker of the shell, the window, the script, Python and the fit of an atlas. A whole side under the
name of the other, and exchanged names, are found by likelihood (`gp_core.atlas.label_likelihood`); a single
label is held against where the other labels put it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from types import MappingProxyType
from typing import Any

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.label_likelihood import LABELLING_NOISE_MM, WRONG_MM, LabelModel, Reading, best_reading
from gp_core.errors import GpError
from gp_core.landmarks.anatomy import mirror_right
from gp_core.landmarks.features import FEATURES, Side, feature
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.sets import LandmarkSet, Specimen, Status
from gp_core.validation import FloatArray

__all__ = [
    "DOUBTFUL_SD",
    "SHARED_WRONG_MM",
    "Departure",
    "Finding",
    "SideCheck",
    "check_landmarks",
    "check_side",
    "check_specimen",
    "departure",
    "far",
]

DOUBTFUL_SD = 5.0
"""Distance from the expected place, in standard deviations, beyond which a label is doubted."""

OTHER_SIDE_ODDS = 0.015
"""Prior odds that a side is labelled under the name of the other."""

FEWEST = 4
"""With three labels or fewer, each of them fits wherever the others are."""

SAME_PLACE_MM = 0.05
"""Half a voxel: no two features are so close."""

SHARED_MM = 0.5
"""Up to here two labels of one point differ as labels do."""

SHARED_WRONG_MM = 1.0
"""From here on one of two labels of one point is wrong: 7 SD of the difference of two labels."""

HEAD_MM = 40.0
"""No two features of a head are farther apart."""

_LEAST_WIDTH = 0.1
"""Of the width that the atlas gives the placed features: narrower, they are a heap or a line."""

NEAR_BONE_MM = 3.0
"""A feature in the cochlea's spaces is nearer to some bone than this."""

_HARMLESS = ("missing", "suggested", "unseen", "unchecked")


@dataclass(frozen=True, eq=False)
class Departure:
    """How far a label is from where the other labels of its side put it.

    Attributes
    ----------
    code : str
        Feature.
    distance : float
        From the expected place, mm.
    expected : (3,) array
        That place, mm, in the frame of the labels.
    covariance : (3, 3) array
        Of that place, mm^2.
    n_sd : float
        The distance in standard deviations (Mahalanobis).
    """

    code: str
    distance: float
    expected: FloatArray
    covariance: FloatArray
    n_sd: float

    @property
    def is_doubtful(self) -> bool:
        """Whether a person should look at the label again."""
        return self.n_sd > DOUBTFUL_SD

    @property
    def word(self) -> str:
        """Such as ``2.6 mm``, or ``far off`` where a number would mean nothing."""
        if self.distance > HEAD_MM:
            return "far off"
        return f"{self.distance:.{1 if self.distance > 0.995 else 2}f} mm"

    @property
    def text(self) -> str:
        """Such as ``2.6 mm from where the atlas expects it``."""
        if self.distance > HEAD_MM:
            return "nowhere near where the other points put it: check names, side and units"
        return f"{self.word} from where the atlas expects it"

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file."""
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
        ``unchecked``.
    landmarks : tuple of str
        Features concerned.
    text : str
        One line for a person.
    remedy : str
        What to do about it, one sentence.
    certainty : float or None
        For ``other side`` and ``exchanged``, its probability among the explanations that were considered.
    departures : tuple of Departure
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
    departures: tuple[Departure, ...] = ()
    checked_by: str | None = None

    @property
    def is_checked(self) -> bool:
        """Whether a person looked at these labels again and found them right."""
        return self.checked_by is not None

    @property
    def is_doubt(self) -> bool:
        """Whether it says that a label is wrong, not just that there is none or that it cannot be checked."""
        return self.kind not in _HARMLESS

    @property
    def severity(self) -> float:
        """Grows with how wrong the labels are, for sorting."""
        if not self.is_doubt:
            return -1.0
        farthest = max((away.n_sd for away in self.departures), default=0.0)
        return 1e6 * _RANKS.get(self.kind, 0) + farthest

    @property
    def word(self) -> str:
        """For a cell of a table, such as ``2.6 mm`` or ``exchanged``."""
        return self.departures[0].word if self.kind == "far" else self.kind

    def departure_of(self, code: str) -> Departure | None:
        """Return how far one of the landmarks is from where the others put it, where that is known."""
        return next((away for away in self.departures if away.code == code), None)

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file."""
        return {
            "specimen": self.specimen,
            "side": self.side.value,
            "kind": self.kind,
            "landmarks": list(self.landmarks),
            "text": self.text,
            "remedy": self.remedy,
            "certainty": self.certainty,
            "departures": [away.as_dict() for away in self.departures],
            "checked_by": self.checked_by,
        }


_RANKS = {"other side": 5, "exchanged": 4, "duplicate": 3, "outside": 2, "off bone": 1}


def _nothing() -> Mapping[str, Departure]:
    return MappingProxyType({})


@dataclass(frozen=True)
class SideCheck:
    """What the labels of one side look like.

    Attributes
    ----------
    findings : tuple of Finding
        The worst first; missing labels last.
    departures : mapping of str to Departure
        Of every label that can be held against the others, in the table's order.
    """

    findings: tuple[Finding, ...] = ()
    departures: Mapping[str, Departure] = field(default_factory=_nothing)

    @property
    def is_other_side(self) -> bool:
        """Whether the side is labelled under the name of the other."""
        return any(finding.kind == "other side" for finding in self.findings)

    @property
    def doubts(self) -> dict[str, Finding]:
        """The worst finding of each label that is doubted, by feature."""
        found: dict[str, Finding] = {}
        for finding in self.findings:
            if finding.is_doubt:
                for code in finding.landmarks:
                    found.setdefault(code, finding)
        return found


def check_specimen(
    specimen: Specimen, atlas: Atlas, *, scan: Mapping[Side, ScanEvidence] | None = None
) -> list[Finding]:
    """Return everything to look at in the labels of one animal, both sides.

    Parameters
    ----------
    specimen : Specimen
    atlas : Atlas
        What the labels are held against.
    scan : mapping of Side to ScanEvidence, optional
        What the scan says of each side; by default what was kept with its labels.
    """
    found: list[Finding] = []
    for side, landmarks in specimen.sides.items():
        of_side = check_side(landmarks, atlas, scan=(scan or {}).get(side)).findings
        found += [replace(finding, specimen=specimen.name) for finding in of_side]
    return found + list(_shared_points(specimen))


def check_landmarks(landmarks: LandmarkSet, atlas: Atlas) -> list[Finding]:
    """Return everything to look at in the labels of one side; see `check_side`."""
    return list(check_side(landmarks, atlas).findings)


def check_side(landmarks: LandmarkSet, atlas: Atlas, *, scan: ScanEvidence | None = None) -> SideCheck:
    """Check the labels of one side.

    Parameters
    ----------
    landmarks : LandmarkSet
        In any frame, mm; from four placed features on they are held against the atlas.
    atlas : Atlas
    scan : ScanEvidence, optional
        What the scan says of the same labels: those off the bone are named, however few there are. By
        default what was kept with the labels.

    Returns
    -------
    SideCheck
        It takes 1 ms for a side in order and 10 ms for one that is not.
    """
    scan = scan or landmarks.scan_evidence
    found = [*_duplicates(landmarks), *(() if scan is None else _against_scan(landmarks, scan))]
    departures: dict[str, Departure] = {}
    codes = tuple(code for code in landmarks.placed if code in atlas.codes)
    try:
        _require_enough(landmarks, atlas, codes)
        explained, departures = _explain(landmarks, atlas, codes)
        found += explained
    except GpError as error:
        text = f"positions not checked: {error.problem}"
        found.append(_finding(landmarks, "unchecked", (), text, error.remedy or ""))
    found = [_as_checked(finding, landmarks) for finding in found]
    found.sort(key=lambda finding: -finding.severity)
    return SideCheck((*found, *_not_placed(landmarks)), MappingProxyType(departures))


def _as_checked(finding: Finding, *sets: LandmarkSet) -> Finding:
    """Say who looked at all labels of a finding again, and found them right."""
    names = {landmarks.checked.get(code) for landmarks in sets for code in finding.landmarks}
    if not finding.is_doubt or not names or None in names:
        return finding
    who = ", ".join(sorted(name for name in names if name))
    return replace(finding, checked_by=who)


def departure(code: str, position: FloatArray, expected: FloatArray, covariance: FloatArray) -> Departure:
    """Hold a label (3,) against where it is expected, mm, known with a covariance (3, 3), mm^2."""
    off = position - expected
    spread = covariance + LABELLING_NOISE_MM**2 * np.eye(3)
    n_sd = float(np.sqrt(off @ np.linalg.solve(spread, off)))
    return Departure(code, float(np.linalg.norm(off)), expected, covariance, n_sd)


def far(side: Side, away: Departure) -> Finding:
    """Return the finding that a label is far from where it is expected."""
    text = f"{away.text} ({away.n_sd:.0f} SD)" if away.distance <= HEAD_MM else away.text
    remedy = f"Look at {away.code} again; move it, or mark it as checked."
    return Finding("", side, "far", (away.code,), text, remedy, departures=(away,))


def _finding(
    landmarks: LandmarkSet, kind: str, codes: tuple[str, ...], text: str, remedy: str = "", **more: Any
) -> Finding:
    return Finding("", landmarks.side, kind, codes, text, remedy, **more)


def _not_placed(landmarks: LandmarkSet) -> Iterator[Finding]:
    for row in FEATURES:
        if row.computed or row.code in landmarks:
            continue
        if landmarks.status(row.code) is Status.UNSEEN:
            yield _finding(landmarks, "unseen", (row.code,), "marked as one that cannot be seen")
        elif landmarks.status(row.code) is Status.SUGGESTED:
            yield _finding(landmarks, "suggested", (row.code,), "suggested, but nobody has confirmed it yet")
        else:
            yield _finding(landmarks, "missing", (row.code,), f"not placed: {row.definition}")


def _duplicates(landmarks: LandmarkSet) -> Iterator[Finding]:
    placed = [code for code in landmarks.placed if not feature(code).computed]
    for a, b in combinations(placed, 2):
        if np.linalg.norm(landmarks[a] - landmarks[b]) < SAME_PLACE_MM:
            text, remedy = f"{a} and {b} are at the same place", "Place one of them again."
            yield _finding(landmarks, "duplicate", (a, b), text, remedy)


def _against_scan(landmarks: LandmarkSet, scan: ScanEvidence) -> Iterator[Finding]:
    for code, away in scan.bone_distances.items():
        if code not in landmarks or feature(code).computed:
            continue
        distance = f"{away:.1f} mm" if np.isfinite(away) else "far"
        if code in scan.outside:
            text, remedy = f"{code} is outside the scan", f"Place {code} again, in the scan."
            yield _finding(landmarks, "outside", (code,), text, remedy)
        elif feature(code).on_bone and away > scan.tolerance:
            text, remedy = f"{code} is {distance} from bone", f"Place {code} on bone, or mark it as checked."
            yield _finding(landmarks, "off bone", (code,), text, remedy)
        elif away > NEAR_BONE_MM:
            text, remedy = f"{code} is {distance} from any bone: outside the head", f"Place {code} again."
            yield _finding(landmarks, "outside", (code,), text, remedy)


def _require_enough(landmarks: LandmarkSet, atlas: Atlas, codes: tuple[str, ...]) -> None:
    """Refuse labels that cannot be held against each other."""
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
            "the placed features lie at one place or on one line, and do not tell how the head is turned",
            remedy="Place one that lies apart, and check that the labels are in mm.",
        )


def _explain(
    landmarks: LandmarkSet, atlas: Atlas, codes: tuple[str, ...]
) -> tuple[list[Finding], dict[str, Departure]]:
    """Find the most probable reading of the labels; return what it says, and each label against the rest."""
    model, labels, side = LabelModel(atlas, codes), landmarks.array(codes), landmarks.side
    own, other = (mirror_right(labels, named) for named in (side, side.other))
    reading, price = best_reading(model, own), -2 * np.log(OTHER_SIDE_ODDS)
    mirrored = best_reading(model, other, below=reading.cost - price)
    surplus = mirrored.cost + price - reading.cost
    found = []
    if surplus < 0:
        reading, side = mirrored, side.other
        found.append(_other_side(landmarks, codes, certainty=float(1 / (1 + np.exp(surplus / 2)))))
    departures = _departures(model, codes, labels, reading, side)
    for (i, j), certainty in zip(reading.exchanged, reading.certainties, strict=True):
        found.append(_exchanged(landmarks, departures, (codes[i], codes[j]), certainty))
    explained = {code for finding in found if finding.kind == "exchanged" for code in finding.landmarks}
    found += [
        far(landmarks.side, away)
        for away in departures.values()
        if away.is_doubtful and away.code not in explained
    ]
    return found, departures


def _other_side(landmarks: LandmarkSet, codes: tuple[str, ...], certainty: float) -> Finding:
    text = f"these labels fit the {landmarks.side.other.word} side: left and right are exchanged"
    remedy = "Exchange left and right."
    return _finding(landmarks, "other side", codes, text, remedy, certainty=certainty)


def _exchanged(
    landmarks: LandmarkSet, departures: Mapping[str, Departure], pair: tuple[str, str], certainty: float
) -> Finding:
    names = " and ".join(pair)
    away = tuple(departures[code] for code in pair)
    text, remedy = f"{names} look exchanged", f"Exchange the names of {names}."
    return _finding(landmarks, "exchanged", pair, text, remedy, certainty=certainty, departures=away)


def _departures(
    model: LabelModel, codes: tuple[str, ...], labels: FloatArray, reading: Reading, side: Side
) -> dict[str, Departure]:
    """Hold each label (n, 3) against where the others put it, read as labels of this side."""
    own_variances = np.full(len(codes), LABELLING_NOISE_MM**2)
    own_variances[list(reading.wrong)] += WRONG_MM**2
    rest = model.fit(reading.points, reading.wrong).leave_one_out(own_variances)
    flip = np.diag([-1.0, 1.0, 1.0]) if side is Side.RIGHT else np.eye(3)
    places = zip(codes, labels, rest.expected @ flip, flip @ rest.covariance @ flip, strict=True)
    return {code: departure(code, *place) for code, *place in places}


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
                text = f"{row.code} is one point of both sides, but its labels are {apart:.2f} mm apart"
                kind, what = "shared point differs", "takes the mean"
                if apart > SHARED_WRONG_MM:
                    text += ": one of them is wrong"
                    kind, what = "shared point wrong", "leaves it out"
                remedy = f"Place {row.code} once more; a fit {what}."
                found = Finding(specimen.name, Side.LEFT, kind, (row.code,), text, remedy)
                yield _as_checked(found, left, right)
