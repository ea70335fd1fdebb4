"""What a scan says of labels: how far they are from bone. Measured where the scan is; see `gp_labeler`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["ScanEvidence"]


@dataclass(frozen=True)
class ScanEvidence:
    """What a scan says of the labels of one side.

    Attributes
    ----------
    bone_distances : mapping of str to float
        Distance of each placed feature from the nearest bone, mm; 0 in bone, infinite where there is none.
    tolerance : float
        What a feature on bone may be away from it, mm: a voxel, or 0.3 mm.
    outside : frozenset of str
        Features that lie outside the scan.
    """

    bone_distances: Mapping[str, float]
    tolerance: float
    outside: frozenset[str] = frozenset()
