"""95 % regions over several hypotheses on the same touches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray, freeze_arrays

__all__ = ["UNDECIDED", "Hypothesis", "MixturePart", "axis_part", "mixture_radius_95", "origin_part"]

UNDECIDED = 0.005
"""Probability from which on another hypothesis is not ruled out."""

_SHARE = 0.95
_STEPS = 60


@dataclass(frozen=True)
class Hypothesis:
    """An alternative hypothesis on the touches: the other ear, or the names of two touches exchanged.

    Attributes
    ----------
    side : Side
        The ear under this hypothesis.
    exchanged : (str, str) or None
        The two features whose names are exchanged.
    probability : float
        Of this hypothesis, given the touches; the probabilities of all hypotheses add up to 1.
    transform_to_touches : RigidTransform
        ``T_tracker_cochlea`` under this hypothesis, as in `CochleaPose`.
    covariance : (6, 6) array
        Of the origin (mm) and of a small rotation vector (rad), in the frame of the touches.
    """

    side: Side
    exchanged: tuple[str, str] | None
    probability: float
    transform_to_touches: RigidTransform
    covariance: FloatArray

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def origin(self) -> FloatArray:
        """(3,) cochlea origin CO, mm."""
        return self.transform_to_touches.translation

    @property
    def axis(self) -> FloatArray:
        """(3,) unit modiolar axis."""
        return self.transform_to_touches.rotation[:, 0]

    def as_dict(self) -> dict[str, Any]:
        """Return the hypothesis as the JSON file of a pose holds it.

        Returns
        -------
        dict
            Plain values for JSON, mm and rad.
        """
        return {
            "side": self.side.value,
            "exchanged": None if self.exchanged is None else list(self.exchanged),
            "probability": self.probability,
            "transform": self.transform_to_touches.matrix.tolist(),
            "covariance": self.covariance.tolist(),
        }

    @property
    def label(self) -> str:
        """A short description, such as ``RWA and RWP exchanged``."""
        if self.exchanged is None:
            return f"the {self.side.word} ear"
        return f"{' and '.join(self.exchanged)} exchanged"


class MixturePart(NamedTuple):
    """Distribution of the true pose, relative to the reported one, under one hypothesis.

    Attributes
    ----------
    probability : float
        Of the hypothesis.
    offset : (n,) array
        From the reported pose to that of the hypothesis.
    covariance : (n, n) array
        About the pose of the hypothesis.
    """

    probability: float
    offset: FloatArray
    covariance: FloatArray


def origin_part(
    probability: float, origin: FloatArray, shown: FloatArray, covariance: FloatArray
) -> MixturePart:
    """Return the distribution of the origin, relative to the reported one, under one hypothesis.

    Parameters
    ----------
    probability : float
        Of the hypothesis.
    origin, shown : (3,) arrays, mm
        The origin of the hypothesis, and the reported one.
    covariance : (6, 6) array
        Of the pose of the hypothesis; mm and rad.

    Returns
    -------
    MixturePart
        In mm.
    """
    return MixturePart(probability, origin - shown, covariance[:3, :3])


def axis_part(probability: float, axis: FloatArray, shown: FloatArray, covariance: FloatArray) -> MixturePart:
    """Return the distribution of the axis, as a rotation vector from the reported one, under one hypothesis.

    Parameters
    ----------
    probability : float
        Of the hypothesis.
    axis, shown : (3,) arrays
        The unit axis of the hypothesis, and the reported one.
    covariance : (6, 6) array
        Of the pose of the hypothesis; mm and rad.

    Returns
    -------
    MixturePart
        In rad.
    """
    across = np.cross(shown, axis)
    sine = float(np.linalg.norm(across))
    angle = math.atan2(sine, float(shown @ axis))
    if sine < 1e-12:  # the same direction, or the opposite one, which a rotation about any normal reaches
        across, sine = np.cross(shown, np.eye(3)[np.abs(shown).argmin()]), 1.0
    flat = np.eye(3) - np.outer(axis, axis)
    return MixturePart(probability, across * (angle / sine), flat @ covariance[3:, 3:] @ flat)


def mixture_radius_95(parts: Sequence[MixturePart]) -> float:
    """Return the smallest distance from the reported pose that contains the truth with 95 % probability.

    For a single part about the reported pose it equals `gp_core.pose.covariance.radius_95`. Every hypothesis
    that is not ruled out must also be contained with 95 % on its own: the union of their regions lies within.

    Parameters
    ----------
    parts : sequence of MixturePart
        One for each hypothesis; the first is the reported one.

    Returns
    -------
    float
        In the unit of the parts.

    Notes
    -----
    A squared distance is approximated by a scaled chi-squared distribution of the same mean and variance
    (Satterthwaite 1946, doi:10.2307/3002019), and its cube root by a normal one (Wilson and Hilferty 1931,
    doi:10.1073/pnas.17.12.684).
    """
    distributions = [_squared_distance(part) for part in parts]
    least = [
        _quantile([(1.0, distribution)])
        for part, distribution in zip(parts, distributions, strict=True)
        if part is parts[0] or part.probability >= UNDECIDED
    ]
    total = sum(part.probability for part in parts)
    shares = [
        (part.probability / total, distribution)
        for part, distribution in zip(parts, distributions, strict=True)
    ]
    return max(*least, _quantile(shares), 0.0)


def _squared_distance(part: MixturePart) -> tuple[float, float]:
    """Return mean, and degrees of freedom, of the squared distance as a scaled chi-squared variable."""
    square = float(part.offset @ part.offset)
    mean = square + float(np.trace(part.covariance))
    along = float(part.offset @ part.covariance @ part.offset)
    variance = 2 * float((part.covariance * part.covariance).sum()) + 4 * along
    return mean, 2 * mean**2 / variance if variance > 0 else math.inf


def _quantile(shares: Sequence[tuple[float, tuple[float, float]]]) -> float:
    """Return the 95 % quantile of the distance under a mixture of such squared distances, by bisection."""
    low, high = 0.0, 1.0
    largest = max(mean for _, (mean, _) in shares)
    high = 8 * math.sqrt(largest) if math.isfinite(largest) else math.inf
    if not 0 < high < math.inf:
        return high
    for _ in range(_STEPS):
        middle = (low + high) / 2
        if sum(share * _within(middle, distribution) for share, distribution in shares) < _SHARE:
            low = middle
        else:
            high = middle
    return high


def _within(distance: float, distribution: tuple[float, float]) -> float:
    mean, freedom = distribution
    if math.isinf(freedom):
        return 1.0 if distance * distance >= mean else 0.0
    spread = 2 / (9 * freedom)
    deviation = ((distance * distance / mean) ** (1 / 3) - 1 + spread) / math.sqrt(spread)
    return 0.5 * math.erfc(-deviation / math.sqrt(2))
