"""How far a guess may be off: from how the templates differ, and from how it went with the labelled heads.

Every labelled head is predicted from the others. How far such predictions lay from the labels, feature by
feature, is the history of the features. It also says how far off a guess is, over what templates and history
let expect; so that the radii hold for any scheme of landmarks, species and scanner.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gp_core.validation import FloatArray

__all__ = ["GuessConfidence", "HeldOut", "centre_of", "spread_of"]

_SHARE_OF_SPREAD = 0.5
_PRIOR_HEADS = 3.0
"""The history of one feature counts as if so many more heads had erred as all features do on average."""

_LEVEL = 0.95
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
    errors, spreads : mapping of str to float
        By landmark, mm; a spread is NaN where one template alone predicted.
    """

    name: str
    errors: Mapping[str, float]
    spreads: Mapping[str, float]


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

    def radius_95(self, name: str, spread: float) -> float | None:
        """Return the radius that holds a landmark with 95 %, mm; None while nothing is known.

        Parameters
        ----------
        name : str
            Of the landmark.
        spread : float
            How the templates differ, mm; see `spread_of`.
        """
        expected = self._expected(name, spread)
        return None if expected is None else self.factor * expected

    @cached_property
    def factor(self) -> float:
        """The 95 % radius over the expected error, as it was with the labelled heads."""
        ratios = []
        for head in self.history:
            for name, error in head.errors.items():
                expected = self._expected(name, head.spreads.get(name, float("nan")), without=head.name)
                if expected is not None and expected > 0:
                    ratios.append(error / expected)
        if len(ratios) < _FEWEST:
            return _GAUSSIAN_RADIUS
        return max(float(np.quantile(ratios, _LEVEL)), 1.0)

    def _expected(self, name: str, spread: float, *, without: str | None = None) -> float | None:
        """Return the expected error of a guess, mm, root mean square."""
        known = self.history_of(name, without=without)
        if known is None:
            return None
        if np.isnan(spread):
            return known
        return float(np.sqrt(_SHARE_OF_SPREAD * spread**2 + (1 - _SHARE_OF_SPREAD) * known**2))
