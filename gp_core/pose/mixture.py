"""Several readings of the same touches at once, and the region around one pose that holds them all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray

__all__ = ["UNDECIDED", "Hypothesis", "Part", "axis_part", "holding_radius", "origin_part"]

UNDECIDED = 0.005
"""Probability of another reading from which it is not ruled out."""

_SHARE = 0.95
_STEPS = 60


@dataclass(frozen=True)
class Hypothesis:
    """Another reading of the touches: of the other ear, or with the names of two exchanged.

    Attributes
    ----------
    side : Side
        The ear that the touches are read as.
    exchanged : (str, str) or None
        The two features whose names are exchanged.
    probability : float
        Of this reading, given the touches; those of all readings together add up to 1.
    transform_to_touches : RigidTransform
        ``T_tracker_cochlea`` of this reading, as of a pose.
    covariance : (6, 6) array
        Of the origin (mm) and of a small rotation vector (rad), in the frame of the touches.
    """

    side: Side
    exchanged: tuple[str, str] | None
    probability: float
    transform_to_touches: RigidTransform
    covariance: FloatArray

    @property
    def origin(self) -> FloatArray:
        """(3,) cochlea origin CO, mm."""
        return self.transform_to_touches.translation

    @property
    def axis(self) -> FloatArray:
        """(3,) unit modiolar axis."""
        return self.transform_to_touches.rotation[:, 0]

    def as_dict(self) -> dict[str, Any]:
        """Return the reading as the JSON file of a pose holds it, mm."""
        return {
            "side": self.side.value,
            "exchanged": None if self.exchanged is None else list(self.exchanged),
            "probability": self.probability,
            "transform": self.transform_to_touches.matrix.tolist(),
            "covariance": self.covariance.tolist(),
        }

    @property
    def label(self) -> str:
        """A few words, such as ``RWA and RWP exchanged``."""
        if self.exchanged is None:
            return f"the {self.side.word} ear"
        return f"{' and '.join(self.exchanged)} exchanged"


class Part(NamedTuple):
    """How far from the shown pose the truth may be under one reading.

    Attributes
    ----------
    probability : float
    offset : (n,) array
        From the shown pose to that of the reading.
    covariance : (n, n) array
        About the latter.
    """

    probability: float
    offset: FloatArray
    covariance: FloatArray


def origin_part(probability: float, origin: FloatArray, shown: FloatArray, covariance: FloatArray) -> Part:
    """Return the part of an origin (3,) in mm, its pose's covariance (6, 6), about the shown origin."""
    return Part(probability, origin - shown, covariance[:3, :3])


def axis_part(probability: float, axis: FloatArray, shown: FloatArray, covariance: FloatArray) -> Part:
    """Return the part of an axis, a unit (3,), as a rotation vector in rad from the shown axis."""
    across = np.cross(shown, axis)
    sine = float(np.linalg.norm(across))
    angle = math.atan2(sine, float(shown @ axis))
    if sine < 1e-12:  # the same direction, or the opposite one, which any turn across reaches
        across, sine = np.cross(shown, np.eye(3)[np.abs(shown).argmin()]), 1.0
    flat = np.eye(3) - np.outer(axis, axis)
    return Part(probability, across * (angle / sine), flat @ covariance[3:, 3:] @ flat)


def holding_radius(parts: Sequence[Part]) -> float:
    """Return the least distance from the shown pose within which the truth is with 95 %.

    Of a single part about the shown pose it is `gp_core.pose.covariance.radius_95`. Where a reading other
    than the first, the shown one, is not ruled out, it reaches far enough for 95 % of that one alone too: the
    union of their regions lies within.

    Notes
    -----
    A squared distance is taken as a scaled chi-square of the same mean and variance (Satterthwaite 1946,
    doi:10.2307/3002019), and its cube root as normal (Wilson and Hilferty 1931, doi:10.1073/pnas.17.12.684).
    """
    laws = [_squared_distance(part) for part in parts]
    least = [
        _quantile([(1.0, law)])
        for part, law in zip(parts, laws, strict=True)
        if part is parts[0] or part.probability >= UNDECIDED
    ]
    total = sum(part.probability for part in parts)
    shares = [(part.probability / total, law) for part, law in zip(parts, laws, strict=True)]
    return max(*least, _quantile(shares), 0.0)


def _squared_distance(part: Part) -> tuple[float, float]:
    """Return mean, and degrees of freedom, of the squared distance as a scaled chi-square."""
    square = float(part.offset @ part.offset)
    mean = square + float(np.trace(part.covariance))
    along = float(part.offset @ part.covariance @ part.offset)
    variance = 2 * float((part.covariance * part.covariance).sum()) + 4 * along
    return mean, 2 * mean**2 / variance if variance > 0 else math.inf


def _quantile(shares: Sequence[tuple[float, tuple[float, float]]]) -> float:
    """Return the distance within which a mixture of such squared distances is with 95 %, by bisection."""
    low, high = 0.0, 1.0
    largest = max(mean for _, (mean, _) in shares)
    high = 8 * math.sqrt(largest) if math.isfinite(largest) else math.inf
    if not 0 < high < math.inf:
        return high
    for _ in range(_STEPS):
        middle = (low + high) / 2
        if sum(share * _within(middle, law) for share, law in shares) < _SHARE:
            low = middle
        else:
            high = middle
    return high


def _within(distance: float, law: tuple[float, float]) -> float:
    mean, freedom = law
    if math.isinf(freedom):
        return 1.0 if distance * distance >= mean else 0.0
    spread = 2 / (9 * freedom)
    deviation = ((distance * distance / mean) ** (1 / 3) - 1 + spread) / math.sqrt(spread)
    return 0.5 * math.erfc(-deviation / math.sqrt(2))
