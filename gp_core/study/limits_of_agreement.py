"""Differences of repeated labels, and their limits of agreement: a picture after Bland and Altman."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gp_core.validation import FloatArray

__all__ = ["AgreementKind", "AgreementPanel", "PairedMeans", "agreement_panels"]

_DIRECTIONS = ("forwards", "outwards", "upwards")


class PairedMeans(Protocol):
    """Two labels of one point: what `agreement_panels` needs of them."""

    @property
    def is_inter(self) -> bool:
        """Whether they are by two observers."""
        ...

    @property
    def mean(self) -> tuple[float, ...]:
        """(3,) middle of the two, mm."""
        ...

    @property
    def difference(self) -> tuple[float, ...]:
        """(3,) second minus first, mm."""
        ...


@dataclass(frozen=True)
class AgreementKind:
    """The differences of one kind in one direction.

    Attributes
    ----------
    is_inter : bool
        Between observers, or between the rounds of one.
    points : (n, 2) array, mm
        Means and differences.
    limits : tuple of float
        Mean difference, lower and upper limit of agreement (mean +- 1.96 SD), mm; empty for fewer than two.
    """

    is_inter: bool
    points: FloatArray
    limits: tuple[float, ...]


@dataclass(frozen=True)
class AgreementPanel:
    """What a picture after Bland and Altman shows of one direction.

    Attributes
    ----------
    direction : str
        ``forwards``, ``outwards`` or ``upwards``.
    kinds : tuple of AgreementKind
        Within observers, then between them; what there is.
    largest : float
        Largest difference in any direction, mm: the same scale for all panels.
    mean_range : (float, float)
        Smallest and largest mean, mm, apart.
    """

    direction: str
    kinds: tuple[AgreementKind, ...]
    largest: float
    mean_range: tuple[float, float]


def agreement_panels(differences: Sequence[PairedMeans]) -> tuple[AgreementPanel, ...]:
    """Return what a picture after Bland and Altman shows, a panel for each direction.

    Parameters
    ----------
    differences : sequence of PairedDifference
        Of a `gp_core.ReliabilityReport`.

    Returns
    -------
    tuple of AgreementPanel
        Three, or none without differences.

    References
    ----------
    Bland and Altman, "Statistical methods for assessing agreement", Lancet 327, 1986.
    https://doi.org/10.1016/S0140-6736(86)90837-8
    """
    if not differences:
        return ()
    largest = max(abs(x) for row in differences for x in row.difference) or 1.0
    panels = []
    for i, direction in enumerate(_DIRECTIONS):
        kinds = []
        for is_inter in (False, True):
            rows = [(r.mean[i], r.difference[i]) for r in differences if r.is_inter is is_inter]
            if rows:
                kinds.append(_agreement_kind(np.array(rows), is_inter))
        means = np.concatenate([kind.points[:, 0] for kind in kinds])
        low, high = float(means.min()), float(means.max())
        margin = max(0.05 * (high - low), 0.05)
        panels.append(AgreementPanel(direction, tuple(kinds), largest, (low - margin, high + margin)))
    return tuple(panels)


def _agreement_kind(points: FloatArray, is_inter: bool) -> AgreementKind:
    if len(points) < 2:
        return AgreementKind(is_inter, points, ())
    mean, spread = float(points[:, 1].mean()), float(points[:, 1].std(ddof=1))
    return AgreementKind(is_inter, points, (mean, mean - 1.96 * spread, mean + 1.96 * spread))
