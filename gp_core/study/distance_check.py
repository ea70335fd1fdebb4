"""The distances between the landmarks of one side beside the published ones (Figure 2 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.atlas.published import N_SIDES, ROUNDING_MM, published_distances
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.sets import LandmarkSet

__all__ = ["DISAGREES_SD", "DistanceCheck", "PairDistance", "check_distances"]

DISAGREES_SD = 4.0
"""A distance disagrees beyond so many standard deviations of what is expected.

With the table made without the animal, 1 of the authors' 22 sides has such a distance (0.1 % of all); of
landmarks moved by 1 mm in any direction, 74 % have one.
"""


@dataclass(frozen=True)
class PairDistance:
    """The distance between two landmarks, and the published one.

    Attributes
    ----------
    feature_a, feature_b : str
        The pair, `feature_a` after `feature_b` in the feature table.
    measured_mm : float or None
        None where one of the two is not placed.
    mean_mm, sd_mm : float
        Published mean and standard deviation between animals.
    deviation_sd : float or None
        How far the measured distance is from the mean, in standard deviations of the distance that is
        expected in another animal; positive where it is longer.
    """

    feature_a: str
    feature_b: str
    measured_mm: float | None
    mean_mm: float
    sd_mm: float
    deviation_sd: float | None

    @property
    def disagrees(self) -> bool:
        """Whether it deviates by more than `DISAGREES_SD`."""
        return self.deviation_sd is not None and abs(self.deviation_sd) > DISAGREES_SD

    @property
    def text(self) -> str:
        """Such as ``CA-CB 5.91 mm, published 4.7 ± 0.13 mm: longer``."""
        pair = f"{self.feature_a}-{self.feature_b}"
        published = f"published {self.mean_mm:.1f} ± {self.sd_mm:.2f} mm"
        if self.measured_mm is None or self.deviation_sd is None:
            return f"{pair}, {published}: not measured"
        verdict = ("longer" if self.deviation_sd > 0 else "shorter") if self.disagrees else "agrees"
        return f"{pair} {self.measured_mm:.2f} mm, {published}: {verdict}"


@dataclass(frozen=True)
class DistanceCheck:
    """All pairs of features of one side.

    Attributes
    ----------
    side : Side
        Side of the head.
    pairs : tuple of PairDistance
        In the order of the feature table, 190 of them.
    """

    side: Side
    pairs: tuple[PairDistance, ...]

    @property
    def disagreeing(self) -> tuple[PairDistance, ...]:
        """Pairs that disagree, the worst first."""
        found = [pair for pair in self.pairs if pair.disagrees]
        return tuple(sorted(found, key=lambda pair: -abs(pair.deviation_sd or 0.0)))

    @checks_arguments
    def suspect(self, pair: PairDistance) -> str:
        """Return which landmark of a pair to look at first: that with more distances that disagree.

        Parameters
        ----------
        pair : PairDistance
            One of the pairs.

        Returns
        -------
        str
            Its feature code.
        """
        counts = dict.fromkeys(CODES, 0)
        for each in self.disagreeing:
            counts[each.feature_a] += 1
            counts[each.feature_b] += 1
        return max((pair.feature_b, pair.feature_a), key=lambda code: counts[code])

    def as_dict(self) -> dict[str, Any]:
        """Return the check as JSON holds it.

        Returns
        -------
        dict
            Plain values; lengths in mm.
        """
        pairs = [vars(pair) | {"disagrees": pair.disagrees} for pair in self.pairs]
        return {"side": self.side.value, "disagrees_beyond_sd": DISAGREES_SD, "pairs": pairs}


@checks_arguments
def check_distances(landmarks: LandmarkSet) -> DistanceCheck:
    """Measure all distances of one labelled side, and compare each with the published one.

    Parameters
    ----------
    landmarks : LandmarkSet
        One side; some features may be missing.

    Returns
    -------
    DistanceCheck
        All pairs of features.

    Examples
    --------
    >>> from gp_core.landmarks.sets import LandmarkSet
    >>> check = check_distances(LandmarkSet.from_mapping({"CA": [0, 0, 0], "CB": [6, 0, 0]}, "L"))
    >>> check.disagreeing[0].text
    'CB-CA 6.00 mm, published 4.7 ± 0.13 mm: longer'
    """
    mean, sd = published_distances()
    lengths = np.linalg.norm(landmarks.points[:, None] - landmarks.points[None], axis=2)
    expected_sd = np.sqrt(sd**2 * (1 + 1 / N_SIDES) + ROUNDING_MM**2)
    deviations = (lengths - mean) / expected_sd
    return DistanceCheck(
        landmarks.side,
        tuple(
            PairDistance(
                CODES[i],
                CODES[j],
                float(lengths[i, j]) if np.isfinite(lengths[i, j]) else None,
                float(mean[i, j]),
                float(sd[i, j]),
                float(deviations[i, j]) if np.isfinite(deviations[i, j]) else None,
            )
            for i in range(len(CODES))
            for j in range(i)
        ),
    )
