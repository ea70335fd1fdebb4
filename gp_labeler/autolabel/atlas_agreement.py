"""Guesses that the atlas contradicts: where labelled scans and atlas disagree, it is said of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.label_check import Deviation, check_side
from gp_core.atlas.labelling_error import LABELLING_NOISE_MM, LabellingError
from gp_core.constants import CHI2_3_95
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.autolabel.labelled_scan import side_and_code
from gp_labeler.autolabel.proposal import Guess

__all__ = ["compare_with_atlas", "disagreement_text"]

_RADIUS_95_PER_SD = CHI2_3_95**0.5
"""95 % radius over the standard deviation of one coordinate, of a Gaussian error in three dimensions."""

_LARGEST_SD_MM = 5.0


def compare_with_atlas(guesses: Sequence[Guess], atlas: Atlas) -> tuple[Guess, ...]:
    """Return the guesses with their distance from where the atlas expects them, where the two disagree.

    Each guess of a guinea pig's feature is predicted by the atlas from the other guesses of its side. They
    disagree where it lies farther off than the atlas and the radii of the guesses allow. What is no feature
    of the guinea pig, and a side with fewer than four guesses, is not compared.

    Parameters
    ----------
    guesses : sequence of Guess
    atlas : Atlas

    Returns
    -------
    tuple of Guess
        In the same order; those that disagree are doubtful.
    """
    known = [side_and_code(guess.name) for guess in guesses]
    if not all(known):  # another scheme, which the atlas does not know
        return tuple(guesses)
    away: dict[tuple[Side, str], Deviation] = {}
    for side in Side:
        own = {at[1]: guess for at, guess in zip(known, guesses, strict=True) if at and at[0] is side}
        away |= {(side, code): found for code, found in _outliers(side, own, atlas).items()}
    return tuple(
        replace(guess, atlas_distance=away[at].distance, is_doubtful=True) if at in away else guess
        for at, guess in zip(known, guesses, strict=True)
    )


def disagreement_text(guesses: Sequence[Guess]) -> str:
    """Return one sentence on the guesses with which the atlas disagrees; empty where there is none."""
    others = [guess for guess in guesses if guess.atlas_distance is not None]
    others.sort(key=lambda guess: -(guess.atlas_distance or 0.0))
    if not others:
        return ""
    where = ", ".join(f"{guess.name} by {guess.atlas_distance:.1f} mm" for guess in others)
    return f"the atlas and the labelled scans disagree on {where}: look closely"


def _outliers(side: Side, guesses: dict[str, Guess], atlas: Atlas) -> dict[str, Deviation]:
    """Return the guesses of one side that lie where the atlas does not expect them, by feature."""
    if not guesses:
        return {}
    points = LandmarkSet.from_mapping({code: guess.position for code, guess in guesses.items()}, side)
    errors = LabellingError({code: _sd_mm(guess) for code, guess in guesses.items()})
    check = check_side(points, atlas.with_labelling_error(errors))
    return {code: away for code, away in check.deviations.items() if away.is_outlier and code in guesses}


def _sd_mm(guess: Guess) -> float:
    """Return how far a coordinate of a guess may be off, mm; no less than that of a label."""
    known = 0.0 if guess.radius_95 is None else guess.radius_95 / _RADIUS_95_PER_SD
    return float(np.clip(known, LABELLING_NOISE_MM, _LARGEST_SD_MM))
