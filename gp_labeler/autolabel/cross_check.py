"""Labels that the other labelled scans contradict: far off, exchanged, on the other side, of another scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.autolabel.labelled_scan import LabelledScan
from gp_labeler.autolabel.prediction import Prediction

__all__ = ["FEWEST_SCANS", "LibraryCheck", "LibraryFinding", "check_predictions", "require_enough"]

FEWEST_SCANS = 3
"""Two others say which of two labels that differ is wrong."""

_FAR = 5.0
"""Times the expected distance beyond which a label is far from its prediction (benchmarks/autolabel.py)."""

_GAIN = 12.0
"""How much better two labels must fit each other's places, as a sum of squares over expected ones."""

_LEAST = 0.005
"""Of the size of the labels: nobody labels more exactly than that, so nothing closer is a mistake."""

_OTHER_SCAN = 6.0
_MOST_PAIRS = 0.5


@dataclass(frozen=True)
class LibraryFinding:
    """What is wrong with some labels of one scan.

    Parameters
    ----------
    specimen : str
    kind : str
        ``far``, ``exchanged``, ``sides exchanged`` or ``other scan``.
    names : tuple of str
        The labels; none where it concerns all.
    distance : float
        How far the worst of them lies from where the others expect it, mm.
    expected : float
        How far such labels usually lie, mm.
    """

    specimen: str
    kind: str
    names: tuple[str, ...]
    distance: float
    expected: float

    @property
    def concerns_all(self) -> bool:
        """Whether all labels of the scan are wrong."""
        return self.kind in ("other scan", "sides exchanged")

    @property
    def text(self) -> str:
        """One sentence."""
        usual = f"usually {self.expected:.2f} mm"
        off = f"{self.distance:.2f} mm from the prediction of the other scans, {usual}"
        if self.kind == "exchanged":
            return f"{self.names[0]} and {self.names[1]} seem to be exchanged ({off})"
        if self.kind == "sides exchanged":
            return f"left and right seem to be exchanged ({off})"
        if self.kind == "other scan":
            return f"the labels do not seem to belong to this scan ({off})"
        return f"{self.names[0]} lies {off}"

    def as_json(self) -> dict[str, Any]:
        """Return the finding as JSON values."""
        return {
            "specimen": self.specimen,
            "kind": self.kind,
            "names": list(self.names),
            "distance": round(self.distance, 4),
            "usual": round(self.expected, 4),
            "text": self.text,
        }


@dataclass(frozen=True)
class LibraryCheck:
    """What was found in a library.

    Parameters
    ----------
    findings : tuple of LibraryFinding
        By scan, the worst first.
    checked : tuple of str
        Scans that were predicted from the others.
    unchecked : tuple of str
        Scans in which the head was not found.
    """

    findings: tuple[LibraryFinding, ...]
    checked: tuple[str, ...]
    unchecked: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return the check as JSON values, as it is written to a file."""
        return {
            "schema": "gp-labeler library check",
            "version": 1,
            "checked": list(self.checked),
            "notFound": list(self.unchecked),
            "findings": [finding.as_json() for finding in self.findings],
        }

    def of(self, specimen: str) -> tuple[LibraryFinding, ...]:
        """Return what was found in one scan."""
        return tuple(finding for finding in self.findings if finding.specimen == specimen)


@dataclass(frozen=True, eq=False)
class _Head:
    """Labels of one scan, where the others expect them, and how these differ."""

    name: str
    names: tuple[str, ...]
    labels: FloatArray
    expected: FloatArray
    spreads: FloatArray
    least: float

    @property
    def distances(self) -> FloatArray:
        found: FloatArray = np.linalg.norm(self.labels - self.expected, axis=1)
        return found


def require_enough(scans: Sequence[LabelledScan]) -> None:
    """Raise `GpError` where scans are too few to be checked against each other."""
    if len(scans) < FEWEST_SCANS:
        remedy = "Name more of them, or the folder that holds them."
        raise GpError(f"three labelled scans or more are needed, got {len(scans)}", remedy=remedy)


def check_predictions(scans: Sequence[LabelledScan], predictions: dict[str, Prediction]) -> LibraryCheck:
    """Compare labels with where the other scans expect them.

    Parameters
    ----------
    scans : sequence of LabelledScan
    predictions : dict of str to Prediction
        Each scan predicted from the others, by name.

    Returns
    -------
    LibraryCheck
    """
    heads = [_head(scan, predictions[scan.name]) for scan in scans if scan.name in predictions]
    findings: list[LibraryFinding] = []
    for head in heads:
        findings += _findings(head, _usual(head, [other for other in heads if other is not head]))
    unchecked = tuple(scan.name for scan in scans if scan.name not in predictions)
    return LibraryCheck(tuple(findings), tuple(head.name for head in heads), unchecked)


def _head(scan: LabelledScan, prediction: Prediction) -> _Head:
    names = tuple(name for name in prediction.names if name in scan.points)
    return _Head(
        scan.name,
        names,
        np.array([scan.points[name] for name in names]).reshape(-1, 3),
        np.array([prediction.centres[name] for name in names]).reshape(-1, 3),
        np.nan_to_num(np.array([prediction.spreads[name] for name in names])),
        _LEAST * _size(scan.array),
    )


def _size(points: FloatArray) -> float:
    """Return the root mean square distance of points (N, 3) from their centre, mm; 1 of one place."""
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())) or 1.0


def _usual(head: _Head, others: list[_Head]) -> FloatArray:
    """Return how far each label may be expected to lie, mm; medians, since other labels may be wrong too."""
    every = np.concatenate([other.distances for other in others] or [head.distances])
    overall = max(float(np.median(every)) if len(every) else 1.0, head.least)
    own = []
    for name in head.names:
        known = [other.distances[other.names.index(name)] for other in others if name in other.names]
        own.append((np.sum(np.minimum(known, 4 * overall)) + 2 * overall) / (len(known) + 2))
    return np.sqrt(np.square(own) / 2 + head.spreads**2 / 2 + (0.5 * overall) ** 2)


def _findings(head: _Head, usual: FloatArray) -> list[LibraryFinding]:
    """Return what is wrong with one head, the worst first."""
    ratio = head.distances / usual
    if len(ratio) == 0:
        return []
    gains = _exchange_gains(head, usual)
    worst = int(ratio.argmax())

    def finding(kind: str, *at: int) -> LibraryFinding:
        most = max(at or (worst,), key=lambda n: head.distances[n])
        names = tuple(head.names[n] for n in at)
        return LibraryFinding(head.name, kind, names, float(head.distances[most]), float(usual[most]))

    pairs = _side_pairs(head.names)
    crossed = [pair for pair in pairs if gains.get(pair, 0.0) > _GAIN]
    if len(crossed) >= 3 and len(crossed) > _MOST_PAIRS * len(pairs):
        return [finding("sides exchanged")]
    if float(np.median(ratio)) > _OTHER_SCAN:
        return [finding("other scan")]
    found, taken = [], set[int]()
    for (a, b), gain in sorted(gains.items(), key=lambda item: -item[1]):
        if gain > _GAIN and not {a, b} & taken:
            taken |= {a, b}
            found.append((max(ratio[a], ratio[b]), finding("exchanged", a, b)))
    found += [(ratio[n], finding("far", n)) for n in range(len(ratio)) if ratio[n] > _FAR and n not in taken]
    return [one for _, one in sorted(found, key=lambda pair: -pair[0])]


def _exchange_gains(head: _Head, usual: FloatArray) -> dict[tuple[int, int], float]:
    """Return by how much two labels fit better under each other's names, where they fit well there."""
    across = np.linalg.norm(head.labels[:, None] - head.expected[None], axis=2) / usual[None]
    squares = across**2
    gains = {}
    for a, b in combinations(range(len(head.names)), 2):
        crossed = squares[a, b] + squares[b, a]
        gain = squares[a, a] + squares[b, b] - crossed
        if gain > 0 and max(across[a, b], across[b, a]) < _FAR:
            gains[a, b] = float(gain)
    return gains


def _side_pairs(names: Sequence[str]) -> list[tuple[int, int]]:
    """Return the pairs of a left and a right landmark, as their names say."""
    at = {name: n for n, name in enumerate(names)}
    lefts = [name for name in names if name.endswith("_L") and f"{name[:-2]}_R" in at]
    pairs = [(at[name], at[f"{name[:-2]}_R"]) for name in lefts]
    return [(min(pair), max(pair)) for pair in pairs]
