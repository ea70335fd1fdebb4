"""Quality of labels: what is missing, what is far from where the atlas expects it, what looks exchanged."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.shape import LABELLING_NOISE_MM, Departure, departures
from gp_core.errors import GpError
from gp_core.frames import mirror_x
from gp_core.landmarks.features import FEATURES, Side, feature
from gp_core.landmarks.sets import LandmarkSet, Specimen, Status
from gp_core.registration.procrustes import align

__all__ = ["Finding", "check_landmarks", "check_specimen"]

DOUBTFUL_SD = 5.0
"""Mahalanobis distance from which a label is doubted: the real labelled sets stay below it."""

_SAME_PLACE_MM = 0.01
_CLEARLY_BETTER = 20.0
"""Drop in -2 log likelihood for which an exchange of names is proposed."""


@dataclass(frozen=True)
class Finding:
    """One thing to look at.

    Attributes
    ----------
    specimen : str
    side : Side
    kind : str
        ``missing``, ``unseen``, ``far``, ``other side``, ``swapped``, ``duplicate``, ``shared point differs``
        or ``unchecked``.
    landmarks : tuple of str
    text : str
        One line for a person.
    departure : Departure or None
        How far, for ``far``.
    """

    specimen: str
    side: Side
    kind: str
    landmarks: tuple[str, ...]
    text: str
    departure: Departure | None = None


def check_specimen(specimen: Specimen, atlas: Atlas) -> list[Finding]:
    """Return everything to look at in the labels of one animal, both sides.

    Parameters
    ----------
    specimen : Specimen
    atlas : Atlas
        What the labels are held against.
    """
    found: list[Finding] = []
    for landmarks in specimen.sides.values():
        found += [replace(finding, specimen=specimen.name) for finding in check_landmarks(landmarks, atlas)]
    return found + list(_shared_points(specimen))


def check_landmarks(landmarks: LandmarkSet, atlas: Atlas) -> list[Finding]:
    """Return everything to look at in the labels of one side."""
    found = [*_not_placed(landmarks), *_duplicates(landmarks)]
    for explain in (_other_side, _exchanged):
        explained = list(explain(landmarks, atlas))
        if explained:  # what else looks wrong follows from it
            return found + explained
    return found + list(_far(landmarks, atlas))


def _finding(landmarks: LandmarkSet, kind: str, codes: tuple[str, ...], text: str) -> Finding:
    return Finding("", landmarks.side, kind, codes, text)


def _not_placed(landmarks: LandmarkSet) -> Iterator[Finding]:
    for row in FEATURES:
        if row.computed or row.code in landmarks:
            continue
        if landmarks.status(row.code) is Status.UNSEEN:
            yield _finding(landmarks, "unseen", (row.code,), "marked as one that cannot be seen")
        else:
            yield _finding(landmarks, "missing", (row.code,), f"not placed: {row.definition}")


def _duplicates(landmarks: LandmarkSet) -> Iterator[Finding]:
    placed = [code for code in landmarks.placed if not feature(code).computed]
    for a, b in combinations(placed, 2):
        if np.linalg.norm(landmarks[a] - landmarks[b]) < _SAME_PLACE_MM:
            yield _finding(landmarks, "duplicate", (a, b), f"{a} and {b} are at the same place")


def _other_side(landmarks: LandmarkSet, atlas: Atlas) -> Iterator[Finding]:
    codes = _usable(landmarks, atlas)
    own, mirrored = _misfit(landmarks, atlas, codes), _misfit(landmarks, atlas, codes, mirrored=True)
    if mirrored < own - _CLEARLY_BETTER:
        text = f"these labels fit the {landmarks.side.other.word} side: left and right are exchanged"
        yield _finding(landmarks, "other side", codes, text)


def _exchanged(landmarks: LandmarkSet, atlas: Atlas) -> Iterator[Finding]:
    codes = _usable(landmarks, atlas)
    if any(_duplicates(landmarks)):
        return
    own = _misfit(landmarks, atlas, codes)
    others = []
    for a, b in combinations(codes, 2):
        swapped = landmarks.with_point(a, landmarks[b]).with_point(b, landmarks[a])
        others.append((_misfit(swapped, atlas, codes), (a, b)))
    best, pair = min(others, default=(own, ("", "")))
    if best < min(own - _CLEARLY_BETTER, 3 * len(codes) + _CLEARLY_BETTER):
        yield _finding(landmarks, "swapped", pair, f"{pair[0]} and {pair[1]} look exchanged")


def _far(landmarks: LandmarkSet, atlas: Atlas) -> Iterator[Finding]:
    try:
        found = departures(atlas, landmarks)
    except GpError as error:
        yield _finding(landmarks, "unchecked", (), f"positions not checked: {error.problem}")
        return
    for code, away in found.items():
        if away.mahalanobis > DOUBTFUL_SD:
            text = f"{away.distance:.1f} mm from where the atlas expects it ({away.mahalanobis:.0f} SD)"
            yield replace(_finding(landmarks, "far", (code,), text), departure=away)


def _usable(landmarks: LandmarkSet, atlas: Atlas) -> tuple[str, ...]:
    codes = tuple(code for code in landmarks.placed if code in atlas.codes)
    return codes if len(codes) >= 4 else ()


def _misfit(landmarks: LandmarkSet, atlas: Atlas, codes: tuple[str, ...], *, mirrored: bool = False) -> float:
    """Return -2 log likelihood, up to a constant, of labels with none misplaced among them."""
    if not codes:
        return 0.0
    points = landmarks.array(codes)
    if (landmarks.side is Side.LEFT) is mirrored:
        points = mirror_x(points)
    mean, precision = atlas.rows(codes), 1 / (atlas.variances(codes) + LABELLING_NOISE_MM**2)
    rotation, translation = align(mean, points, precision)
    away = (points - translation) @ rotation - mean
    return float(np.sum(precision[:, None] * away**2))


def _shared_points(specimen: Specimen) -> Iterator[Finding]:
    if len(specimen.sides) < 2:
        return
    left, right = specimen.side(Side.LEFT), specimen.side(Side.RIGHT)
    if left.frame != right.frame or left.frame == "cochlea":
        return
    for row in FEATURES:
        if row.shared and row.code in left and row.code in right:
            apart = float(np.linalg.norm(left[row.code] - right[row.code]))
            if apart > _SAME_PLACE_MM:
                text = f"{row.code} is one point of both sides, but its labels are {apart:.2f} mm apart"
                yield Finding(specimen.name, Side.LEFT, "shared point differs", (row.code,), text)
