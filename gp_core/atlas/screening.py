"""Labels that an atlas is fitted to: those of many animals, without the ones known to be wrong.

Every animal is checked by `gp_core.atlas.label_check` against the published atlas. Where that contradicts
many labels of most sides, the animals are of another kind, and they are checked against their own consensus.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.label_check import FEWEST, SHARED_WRONG_MM, Finding, check_specimen
from gp_core.atlas.plain_fit import fit_consensus
from gp_core.errors import GpError
from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.validation import FloatArray

__all__ = ["Screened", "mean_shared_points", "screen_labels"]

DOUBTFUL_WEIGHT = 0.02
"""Weight of an animal with labels left out: where one is wrong, others may be."""

_LEAVES_OUT = ("other side", "exchanged", "duplicate", "far", "shared point wrong")
_FOREIGN = 0.25
"""Fraction of outliers, on most sides, above which the animals are unlike the atlas."""

_FEWEST_SIDES = 3
"""Number of sides that must have a feature elsewhere before that counts as the lab's convention."""


@dataclass(frozen=True)
class Screened:
    """Labelled animals without the labels known to be wrong.

    Attributes
    ----------
    specimens : tuple of Specimen
        The remaining labels; animals with too few of them are left out.
    weights : (n,) array
        Weight of each of these animals.
    findings : tuple of Finding
        Of the check of each animal, the worst first.
    notes : tuple of str
        Further remarks for a person, one sentence each.
    """

    specimens: tuple[Specimen, ...]
    weights: FloatArray
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def problems(self) -> tuple[Finding, ...]:
        """The findings that say that a label is wrong."""
        return tuple(finding for finding in self.findings if finding.is_problem)

    @property
    def left_out(self) -> tuple[Finding, ...]:
        """The findings whose labels are left out."""
        return tuple(finding for finding in self.findings if _is_left_out(finding))


def screen_labels(
    specimens: Sequence[Specimen],
    *,
    confirmed: Collection[tuple[str, Side, str]] = (),
    tell: Callable[[float], object] = lambda fraction: None,
) -> Screened:
    """Check animals, and leave out labels that are exchanged, or more than 5 SD from their prediction.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.
    confirmed : collection of (str, Side, str)
        Labels (animal, side, feature) that a person has reviewed and confirmed: they stay, as do those whose
        provenance says so.
    tell : callable
        Receives the fraction done; it may raise to stop.

    Returns
    -------
    Screened
        The remaining labels, and the findings.
    """
    published = Atlas.published()
    found = []
    for n, specimen in enumerate(specimens):
        tell(n / len(specimens))
        found.append(_found(specimen, published, confirmed))
    notes = []
    if _is_foreign(specimens, found):
        try:
            consensus = fit_consensus(specimens)
        except GpError:  # too few of them for a consensus
            pass
        else:
            found = [_found(specimen, consensus, confirmed) for specimen in specimens]
            notes.append("These animals are unlike the published atlas: each is checked against the others.")
    else:
        found, notes = _without_conventions(specimens, found)
    left = [_without(specimen, findings) for specimen, findings in zip(specimens, found, strict=True)]
    kept = [i for i, specimen in enumerate(left) if specimen.sides]
    weights = np.array([DOUBTFUL_WEIGHT if _leave_out(found[i]) else 1.0 for i in kept])
    return Screened(
        tuple(mean_shared_points(left[i]) for i in kept),
        weights / weights.max(initial=DOUBTFUL_WEIGHT),
        tuple(sorted((f for findings in found for f in findings), key=lambda f: -f.severity)),
        tuple(notes),
    )


def mean_shared_points(specimen: Specimen) -> Specimen:
    """Return an animal with the same IN on both sides: the mean of two labels within the labelling error.

    Parameters
    ----------
    specimen : Specimen
        Its labels, mm.

    Returns
    -------
    Specimen
        Unchanged where the two labels differ by more, or are not in one frame.
    """
    sides = dict(specimen.sides)
    frames = {side.frame for side in sides.values()}
    if len(sides) < 2 or len(frames) > 1 or "cochlea" in frames:  # one frame for each side
        return specimen
    for code in (row.code for row in FEATURES if row.shared):
        if all(code in side for side in sides.values()):
            one, other = (side[code] for side in sides.values())
            if 0 < np.linalg.norm(one - other) <= SHARED_WRONG_MM:
                sides = {key: side.with_point(code, (one + other) / 2) for key, side in sides.items()}
    return Specimen(specimen.name, sides)


def _found(specimen: Specimen, atlas: Atlas, confirmed: Collection[tuple[str, Side, str]]) -> list[Finding]:
    return [
        finding
        for finding in check_specimen(specimen, atlas)
        if not finding.landmarks
        or not all((specimen.name, finding.side, code) in confirmed for code in finding.landmarks)
    ]


def _leave_out(findings: Sequence[Finding]) -> bool:
    return any(_is_left_out(finding) for finding in findings)


def _is_left_out(finding: Finding) -> bool:
    return finding.kind in _LEAVES_OUT and not finding.is_checked


def _is_foreign(specimens: Sequence[Specimen], found: Sequence[Sequence[Finding]]) -> bool:
    """Whether most sides have many labels far from where the atlas predicts them."""
    foreign = []
    for specimen, findings in zip(specimens, found, strict=True):
        for side, landmarks in specimen.sides.items():
            n_far = sum(finding.kind == "far" for finding in findings if finding.side is side)
            foreign.append(n_far > _FOREIGN * len(landmarks.placed))
    return sum(foreign) > len(foreign) / 2


def _without_conventions(
    specimens: Sequence[Specimen], found: Sequence[Sequence[Finding]]
) -> tuple[list[list[Finding]], list[str]]:
    """Drop the findings on a feature that most sides have elsewhere: this lab labels it so."""
    labelled = Counter(
        code for specimen in specimens for side in specimen.sides.values() for code in side.placed
    )
    far = Counter(f.landmarks[0] for findings in found for f in findings if f.kind == "far")
    conventions = {code for code, n in far.items() if n >= _FEWEST_SIDES and n > labelled[code] / 2}
    notes = [
        f"{code} is far from its published place on {far[code]} of {labelled[code]} sides: it is kept."
        for code in sorted(conventions)
    ]
    kept = [
        [f for f in findings if f.kind != "far" or f.landmarks[0] not in conventions] for findings in found
    ]
    return kept, notes


def _without(specimen: Specimen, findings: Sequence[Finding]) -> Specimen:
    """Return the remaining labels of an animal."""
    if not _leave_out(findings):
        return specimen
    sides = {}
    for side, landmarks in specimen.sides.items():
        left = _side_without(landmarks, [finding for finding in findings if finding.side is side])
        if sum(code != "CO" for code in left.placed) >= FEWEST:
            sides[side] = left
    return Specimen(specimen.name, _without_shared(sides, findings))


def _without_shared(
    sides: Mapping[Side, LandmarkSet], findings: Sequence[Finding]
) -> Mapping[Side, LandmarkSet]:
    """Leave out a midline point whose two labels cannot both be right, unless one is already left out."""
    for finding in filter(_is_left_out, findings):
        if finding.kind == "shared point wrong" and all(finding.landmarks[0] in s for s in sides.values()):
            sides = {key: side.with_point(finding.landmarks[0], None) for key, side in sides.items()}
    return sides


def _side_without(landmarks: LandmarkSet, findings: Sequence[Finding]) -> LandmarkSet:
    findings = [finding for finding in findings if _is_left_out(finding)]
    far = {code for finding in findings if finding.kind in ("far", "exchanged") for code in finding.landmarks}
    for finding in findings:
        if finding.kind == "other side":
            return LandmarkSet.empty(landmarks.side, frame=landmarks.frame)
        if finding.kind == "duplicate" and far.intersection(finding.landmarks):
            continue  # another finding already tells which of the two is wrong
        if finding.kind != "shared point wrong":
            for code in finding.landmarks:
                landmarks = landmarks.with_point(code, None)
    return landmarks
