"""Validation of the features and sides of a study."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from gp_core.constants import DEFINING_FEATURES
from gp_core.errors import FeatureError, GpError
from gp_core.landmarks.features import EXTERNAL, Side, check_codes
from gp_core.landmarks.sets import Specimen

__all__ = ["WINDOW_FEATURES", "check_labels", "check_subsets", "sides_of"]

WINDOW_FEATURES = ("RWA", "RWP", "LLI")
"""The RW frame, in which touches enter JRMPC, is built on these, whether or not they are probe features."""

_FEWEST = 3
_FEWEST_ANIMALS = 3


def check_subsets(training: Iterable[str], probe: Iterable[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return training and probe features as the table spells them.

    Parameters
    ----------
    training, probe : iterable of str
        The requested features.

    Returns
    -------
    training, probe : tuple of str
        In the requested order.

    Raises
    ------
    FeatureError
        Unknown, duplicated, fewer than three, or a probe feature that is internal or not a training feature.
    """
    features = check_codes(training, "the training features", at_least=_FEWEST)
    external = [code for code in EXTERNAL if code in features]
    return features, check_codes(probe, "the probe features", allowed=external, at_least=_FEWEST)


def check_labels(specimens: Sequence[Specimen], codes: Iterable[str]) -> None:
    """Check that there are at least three animals whose sides all have these features and the cochlea.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.
    codes : iterable of str
        Required features.

    Raises
    ------
    GpError
        Too few animals, two with the same name, or a missing feature (the message names the animal).
    """
    names = [specimen.name for specimen in specimens]
    if len(names) < _FEWEST_ANIMALS:
        raise GpError(
            f"a study needs at least {_FEWEST_ANIMALS} labelled animals, got {len(names)}",
            remedy="Give more landmark files, or the folder that holds them.",
        )
    for name in names:
        if names.count(name) > 1:
            raise GpError("two animals have this name", specimen=name, remedy="Name them apart.")
    needed = dict.fromkeys([*DEFINING_FEATURES, *WINDOW_FEATURES, *codes])
    for specimen in specimens:
        for side, landmarks in specimen.sides.items():
            for code in needed:
                if code != "CO" and code not in landmarks:
                    raise FeatureError(
                        f"the {side.word} side has no {code}",
                        specimen=specimen.name,
                        landmark=code,
                        remedy="Label it, or leave the feature or the animal out.",
                    )


def sides_of(specimens: Sequence[Specimen]) -> list[tuple[Side, list[int]]]:
    """Return, for each labelled side, which specimens have it; left first.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.

    Returns
    -------
    list of (Side, list of int)
        Rows of the specimens.

    Raises
    ------
    GpError
        A side is labelled in one or two animals only.
    """
    found = [(side, [i for i, s in enumerate(specimens) if side in s.sides]) for side in Side]
    for side, which in found:
        if 0 < len(which) < _FEWEST_ANIMALS:
            raise GpError(
                f"the {side.word} side is labelled in {len(which)} animals only; a study needs "
                f"{_FEWEST_ANIMALS} or none",
                remedy="Label it in more of them, or give the files of the other side only.",
            )
    return [(side, which) for side, which in found if which]
