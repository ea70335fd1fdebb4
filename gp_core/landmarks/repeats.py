"""Features that were touched more than once: the mean of their touches, their spread, and outliers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.validation import FloatArray, as_points, freeze_arrays

__all__ = ["RepeatedTouches", "combine_repeats", "repeat_noise", "repeat_warnings"]

_OUTLIER_SQUARED = 20.0
"""Squared Mahalanobis distance, chi-squared with 3 degrees of freedom: of ordinary touches, 1 in 6000."""

_LEAST_SPREAD_MM = 0.1
"""Smallest standard deviation assumed for a repeated touch, mm per coordinate."""

_APART_MM = 2.5
"""Distance of two touches of one feature that ordinary ones of 0.4 mm per coordinate hardly ever have."""

_PRIOR_SPREAD_MM = 0.25
"""What one touch more, of this spread, says beforehand: two repeats alone hardly determine it."""


@dataclass(frozen=True)
class RepeatedTouches:
    """The touches of one feature that was touched more than once.

    Parameters
    ----------
    points : (n, 3) array
        All of them, mm, in the order of touching.
    used : (n,) array of bool
        Which of them make up `mean`; outliers do not.
    mean : (3,) array
        Mean of those used, mm.
    spread_mm : float
        RMS distance of those used from their mean, mm.
    """

    points: FloatArray
    used: NDArray[np.bool_]
    mean: FloatArray
    spread_mm: float

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def as_dict(self) -> dict[str, Any]:
        """Return the touches as the JSON file of a pose holds them, mm.

        Returns
        -------
        dict
            Plain values for JSON.
        """
        return {
            "points": self.points.tolist(),
            "used": self.used.tolist(),
            "mean": self.mean.tolist(),
            "spread_mm": self.spread_mm,
        }

    @property
    def n_used(self) -> int:
        """How many touches make up the mean."""
        return int(self.used.sum())

    def moved(self, T_dst_src: RigidTransform) -> RepeatedTouches:
        """Return the touches in another frame.

        Parameters
        ----------
        T_dst_src : RigidTransform
            From their frame.

        Returns
        -------
        RepeatedTouches
            In the frame `dst`.
        """
        points, mean = T_dst_src.apply(self.points), T_dst_src.apply(self.mean[None])[0]
        return RepeatedTouches(points, self.used, mean, self.spread_mm)

    @property
    def outliers(self) -> tuple[int, ...]:
        """Which touches are outliers; the first is 1."""
        return tuple(int(i) + 1 for i in np.flatnonzero(~self.used))


def combine_repeats(touches: Mapping[str, ArrayLike]) -> dict[str, RepeatedTouches]:
    """Return every feature that was touched more than once, with the mean of its touches.

    An outlier is a touch that lies farther from the others of its feature than the spread of all repeated
    touches explains. Of two touches nothing says which one is wrong, so both are used.

    Parameters
    ----------
    touches : mapping of str to (3,) or (n, 3) array_like
        Positions of each feature, mm.

    Returns
    -------
    dict of str to RepeatedTouches
        Features with one touch are left out.

    Raises
    ------
    GpError
        A feature without a touch, or a position that is not three finite numbers.
    """
    several = {name: _several(points, name) for name, points in touches.items() if _is_several(points)}
    variance = _pooled_variance([points for points in several.values() if len(points) > 1])
    return {name: _combined(points, variance) for name, points in several.items()}


def repeat_noise(repeats: Mapping[str, RepeatedTouches]) -> float:
    """Return the standard deviation of one touch, as the touches that are used show it.

    Parameters
    ----------
    repeats : mapping of str to RepeatedTouches
        Features that were touched more than once.

    Returns
    -------
    float
        mm per coordinate; 0 where no feature has two touches that are used.
    """
    freedom = 3 * sum(one.n_used - 1 for one in repeats.values())
    squares = sum(one.n_used * one.spread_mm**2 for one in repeats.values())
    return float(np.sqrt(squares / freedom)) if freedom else 0.0


def repeat_warnings(repeats: Mapping[str, RepeatedTouches]) -> Iterator[str]:
    """Yield a sentence on each outlier among repeated touches, and on two touches that disagree.

    Parameters
    ----------
    repeats : mapping of str to RepeatedTouches
        Features that were touched more than once.

    Yields
    ------
    str
        A sentence without a full stop.
    """
    for code, one in repeats.items():
        for number in one.outliers:
            off = float(np.linalg.norm(one.points[number - 1] - one.mean))
            yield (
                f"touch {number} of {len(one.points)} of {code} lies {off:.1f} mm from the others and is "
                "left out: check that all are of the same point"
            )
        if one.n_used == 2 and (apart := 2 * one.spread_mm) > _APART_MM:
            yield (
                f"the two touches of {code} lie {apart:.1f} mm apart, so one of them is wrong: "
                "touch it a third time"
            )


def _is_several(points: ArrayLike) -> bool:
    try:
        return np.ndim(points) == 2
    except ValueError:  # rows of different lengths
        return True


def _several(points: ArrayLike, name: str) -> FloatArray:
    try:
        found = as_points(points, "touches")
    except GpError as error:
        raise GpError(error.problem, landmark=name, remedy=error.remedy) from None
    if not len(found):
        raise GpError("there is no touch of it", landmark=name, remedy="Leave the feature out.")
    return found


def _pooled_variance(repeats: list[FloatArray]) -> float:
    """Return the variance of a touch, mm^2 per coordinate; a wrong touch hardly changes it."""
    squares = [_PRIOR_SPREAD_MM**2 * 3.0]
    for points in repeats:
        middle = np.median(points, axis=0)
        squares += (((points - middle) ** 2).sum(axis=1) * len(points) / (len(points) - 1)).tolist()
    typical = float(np.median(squares)) / 2.366  # the median of chi-squared with 3 degrees of freedom
    return max(typical, _LEAST_SPREAD_MM**2)


def _combined(points: FloatArray, variance: float) -> RepeatedTouches:
    used = np.ones(len(points), dtype=bool)
    while used.sum() > 2:
        n = int(used.sum())
        mean = points[used].mean(axis=0)
        # a touch and the mean of the others: its distance from the mean of all, times n / (n - 1)
        squared = ((points - mean) ** 2).sum(axis=1) * n / (n - 1) / variance
        squared[~used] = 0
        worst = int(squared.argmax())
        if squared[worst] <= _OUTLIER_SQUARED:
            break
        used[worst] = False
    mean = points[used].mean(axis=0)
    spread = float(np.sqrt(((points[used] - mean) ** 2).sum(axis=1).mean()))
    return RepeatedTouches(points, used, mean, spread)
