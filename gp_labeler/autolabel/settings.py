"""The few numbers of the transfer, chosen on some heads and measured on others (benchmarks/autolabel.py)."""

from __future__ import annotations

import hashlib
from dataclasses import astuple, dataclass

__all__ = ["Settings"]


@dataclass(frozen=True)
class Settings:
    """How fine heads are registered; lengths relative to the radius of the head's bone.

    Parameters
    ----------
    whole, fine : float
        Steps in a radius: of the whole head, and of its regions; never finer than the scan's voxels.
    reach : float
        Landmarks within so many radii of each other are one region, such as an ear.
    margin : float
        Radii around a region's landmarks.
    fewest : int
        Landmarks that make a region.
    iterations, fine_iterations : str
        Of greedy, from coarse to fine: for the whole head, and for regions. After a space, those of a
        second pass that smooths less.
    """

    whole: float = 30.0
    fine: float = 95.0
    reach: float = 0.8
    margin: float = 0.15
    fewest: int = 3
    iterations: str = "60x40x8"
    fine_iterations: str = "60x40x15 0x0x15"

    @property
    def key(self) -> str:
        """Eight hex digits that change with the settings."""
        return hashlib.blake2b(repr(astuple(self)).encode(), digest_size=4).hexdigest()
