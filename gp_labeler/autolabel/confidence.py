"""How far a guess may be off: from how the templates differ, and from how it went with the labelled heads.

Every labelled head is predicted from the others. How far such predictions lay from the labels, feature by
feature, is the history of the features. With it go two signs of the scan itself: the spread between
templates, and their detours (`gp_labeler.autolabel.detours`). How far off guesses are, over what these three
let expect, is known of the labelled heads as well; so that the radii hold for any scheme of landmarks,
species and scanner.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np

from gp_core.validation import FloatArray

__all__ = ["GuessConfidence", "HeldOut", "centre_of", "spread_of"]

_PRIOR_HEADS = 1.0
"""The history of one feature counts as if so many more heads had erred as all features do on average."""

_LEAST_SIGN = 0.1
"""Of the history: what templates that agree by chance count for, at least."""

_LEVEL_OVER_MEDIAN = 2.9
"""95th percentile of errors over the expected ones, over their median, which varies less (dev-mice)."""

_TO_HISTORY = 1.75
"""Expected errors of one template by their history, over those of two by history and signs (dev-mice)."""

_FEWEST = 12
_GAUSSIAN_RADIUS = 1.61
"""95 % radius over root mean square, of an error that is Gaussian in three dimensions."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How far predictions of one labelled head from the others lay from its labels.

    Parameters
    ----------
    name : str
        Of the specimen.
    errors, spreads, detours : mapping of str to float
        By landmark, mm; a spread or detour is NaN, or not there, where one template alone predicted.
    """

    name: str
    errors: Mapping[str, float]
    spreads: Mapping[str, float]
    detours: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))


def centre_of(points: FloatArray) -> FloatArray:
    """Return the geometric median (3,) of points (k, 3): the least sum of distances."""
    centre = np.median(points, axis=0)
    if len(points) < 3:
        return np.asarray(points.mean(axis=0))
    for _ in range(60):
        distances = np.maximum(np.linalg.norm(points - centre, axis=1), 1e-6)
        moved = (points / distances[:, None]).sum(axis=0) / (1 / distances).sum()
        if np.abs(moved - centre).max() < 1e-5:
            return np.asarray(moved)
        centre = moved
    return np.asarray(centre)


def spread_of(points: FloatArray) -> float:
    """Return the root mean square distance of points (k, 3) from their centre, mm; NaN of one point."""
    if len(points) < 2:
        return float("nan")
    squares = ((points - centre_of(points)) ** 2).sum(axis=1)
    return float(np.sqrt(squares.sum() / (len(points) - 1)))


@dataclass(frozen=True, eq=False)
class GuessConfidence:
    """What the labelled heads say of guesses.

    Parameters
    ----------
    history : sequence of HeldOut
        Each labelled head predicted from the others.
    """

    history: Sequence[HeldOut]

    def history_of(self, name: str, *, without: str | None = None) -> float | None:
        """Return the root mean square error of a landmark, mm, drawn towards that of all; None while unknown.

        Parameters
        ----------
        name : str
            Of the landmark.
        without : str, optional
            A head that does not count.
        """
        heads = [head for head in self.history if head.name != without]
        everything = [error for head in heads for error in head.errors.values()]
        if not everything:
            return None
        own = [head.errors[name] for head in heads if name in head.errors]
        prior = float(np.mean(np.square(everything)))
        return float(np.sqrt((np.sum(np.square(own)) + _PRIOR_HEADS * prior) / (len(own) + _PRIOR_HEADS)))

    def radius_95(self, name: str, spread: float, detour: float = np.nan) -> float | None:
        """Return the radius that holds a landmark with 95 %, mm; None while nothing is known.

        Parameters
        ----------
        name : str
            Of the landmark.
        spread : float
            How the templates differ, mm; see `spread_of`.
        detour : float
            How they differ by way of each other, mm; see `gp_labeler.autolabel.detours.detours_of`.
        """
        expected = self._expected(name, spread, detour)
        return None if expected is None else self.factor * expected

    @cached_property
    def factor(self) -> float:
        """The 95 % radius over the expected error, as it was with the labelled heads."""
        ratios = [ratio for head in self.history for ratio in self._ratios(head)]
        if len(ratios) < _FEWEST:
            return _GAUSSIAN_RADIUS
        factor = max(_LEVEL_OVER_MEDIAN * float(np.median(ratios)), 1.0)
        return factor if self._has_signs else _TO_HISTORY * factor

    @property
    def _has_signs(self) -> bool:
        """Whether labelled heads were predicted by more than one template each."""
        return not all(np.isnan(spread) for head in self.history for spread in head.spreads.values())

    def _ratios(self, head: HeldOut) -> Iterator[float]:
        """Yield the errors of one labelled head over what the other heads let expect."""
        for name, error in head.errors.items():
            signs = head.spreads.get(name, np.nan), head.detours.get(name, np.nan)
            expected = self._expected(name, *signs, without=head.name)
            if expected is not None and expected > 0:
                yield error / expected

    def _expected(self, name: str, *signs: float, without: str | None = None) -> float | None:
        """Return how far off a guess is expected, mm: the geometric mean of its history and its signs."""
        history = self.history_of(name, without=without)
        if history is None:
            return None
        known = [max(sign, _LEAST_SIGN * history) for sign in signs if not np.isnan(sign)]
        return float(np.prod([history, *known]) ** (1 / (1 + len(known))))
