"""How far a label lies from where it comes by way of another labelled scan.

Without errors of the registration, a label of one template reaches the same place of a scan directly, and
through another template: carried onto that one, and from there as far beside that one's own label as it lies
there. It does not matter whether the two labels agree, since the same one goes both ways. What is left is the
registration's error, which templates that share a wrong place show as well.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from itertools import permutations

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.head_pose.surface_fit import SCALES_OF_A_SPECIES, fit_similarity

__all__ = ["Labels", "detours_of"]

Labels = Mapping[str, FloatArray]
"""Positions (3,) by name, LPS mm."""

_FEWEST = 4
"""Landmarks that say how a template lies in a scan."""


def detours_of(
    carried: Mapping[str, Labels], labels: Mapping[str, Labels], between: Mapping[str, Mapping[str, Labels]]
) -> dict[str, float]:
    """Return how far landmarks lie from where they come by way of another template, mm.

    Parameters
    ----------
    carried : mapping of str to mapping of str to (3,) array
        By template, then by landmark: where it was carried, LPS mm in the scan.
    labels : mapping of str to mapping of str to (3,) array
        By template, then by landmark: its label, LPS mm in the template's scan.
    between : mapping of str to mapping of str to mapping of str to (3,) array
        By template, by another template, then by landmark: where the other one's label was carried in the
        first one's scan, LPS mm.

    Returns
    -------
    dict of str to float
        By landmark, root mean square over all pairs of templates, as if of one of the two ways; nothing of a
        landmark that fewer than two templates have.
    """
    squares: dict[str, list[float]] = defaultdict(list)
    for template, other in permutations(carried, 2):
        turned = _turn(labels.get(other, {}), carried[other])
        there = between.get(other, {}).get(template, {})
        if turned is None:
            continue
        for name in carried[template].keys() & carried[other].keys() & there.keys() & labels[other].keys():
            beside = turned @ (there[name] - labels[other][name])
            gap = carried[template][name] - (carried[other][name] + beside)
            squares[name].append(float(gap @ gap) / 2)
    return {name: float(np.sqrt(np.mean(found))) for name, found in squares.items()}


def _turn(labels: Labels, carried: Labels) -> FloatArray | None:
    """Return the matrix (3, 3) that turns and scales a template into a scan; None where too few say it."""
    names = [name for name in labels if name in carried]
    if len(names) < _FEWEST:
        return None
    here, there = (np.array([points[name] for name in names]) for points in (labels, carried))
    fit = fit_similarity(here, there, np.full(len(names), 1 / len(names)), SCALES_OF_A_SPECIES)
    return np.asarray(fit.scale * fit.rotation)
