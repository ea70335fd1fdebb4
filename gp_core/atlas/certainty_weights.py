"""Weights of labels in a fit, by how certain their observers were."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from gp_core.errors import GpError
from gp_core.landmarks.provenance import Certainty
from gp_core.landmarks.sets import Specimen
from gp_core.validation import FloatArray, check_option

__all__ = ["CERTAINTY_WEIGHTS", "certainty_weights", "checked_weights"]

CERTAINTY_WEIGHTS: Mapping[str, float] = MappingProxyType({"sure": 1.0, "fair": 0.5, "guess": 0.2})
"""Weights where weights by certainty are asked for: errors 1.4 and 2.2 times those of a sure label. A label
without a certainty counts as a sure one."""


def checked_weights(weights: Mapping[str, float] | bool | None) -> Mapping[str, float] | None:
    """Return weights by certainty as numbers above 0.

    Parameters
    ----------
    weights : mapping of str to float, or bool, optional
        Weights that differ from `CERTAINTY_WEIGHTS`, or True for these; None or False for none.

    Returns
    -------
    mapping of str to float, or None
        A weight for each certainty.

    Raises
    ------
    GpError
        A name is no certainty, or a weight is not above 0 and at most 1.
    """
    if weights is None or weights is False:
        return None
    given = {} if weights is True else dict(weights)
    for name, weight in given.items():
        check_option(name, "certainty", [each.value for each in Certainty])
        if isinstance(weight, bool) or not isinstance(weight, (int, float)) or not 0 < weight <= 1:
            raise GpError(f"the weight of {name!s} must be above 0 and at most 1, got {weight!r:.40}")
    return MappingProxyType({**CERTAINTY_WEIGHTS, **{Certainty(k).value: float(v) for k, v in given.items()}})


def certainty_weights(
    specimens: Sequence[Specimen], codes: tuple[str, ...], weights: Mapping[str, float]
) -> FloatArray:
    """Return the weight of each label.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.
    codes : tuple of str
        n features.
    weights : mapping of str to float
        By certainty.

    Returns
    -------
    (S, n) array
        A row for each side of each animal; 1 where no certainty is known.
    """
    rows = [
        [
            weights[about.certainty.value] if about and about.certainty else 1.0
            for about in map(known.get, codes)
        ]
        for specimen in specimens
        for known in (landmarks.provenance for landmarks in specimen.sides.values())
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, len(codes))
