"""A scan whose landmarks are known: what templates are made of."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.labels import parse_label
from gp_core.landmarks.sets import LandmarkSet
from gp_core.validation import FloatArray
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.volume import Volume

__all__ = ["LabelledScan", "flat_name", "flat_points", "side_and_code", "sides_of_points"]

FEWEST_LANDMARKS = 3


@dataclass(frozen=True, eq=False)
class LabelledScan:
    """A scan and its landmarks, of any scheme.

    Parameters
    ----------
    name : str
        Of the specimen.
    points : mapping of str to (3,) array
        Positions by name, LPS mm in the scan. Features of the guinea pig end in their side: ``CA_L``; what
        both sides share does not: ``IN``.
    path : Path, optional
        File or folder of the scan.
    options : mapping
        How it is read: options of `gp_labeler.imaging.readers.read_volume`.
    volume : Volume, optional
        The scan itself, where it is in memory; else it is read from `path`.
    T_head_scan : RigidTransform, optional
        How the head lies in the scan, where that was said of the specimen; for pictures alone.

    Raises
    ------
    GpError
        There are fewer than three landmarks, or neither a path nor a volume.
    """

    name: str
    points: Mapping[str, FloatArray]
    path: Path | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    volume: Volume | None = None
    T_head_scan: RigidTransform | None = None

    def __post_init__(self) -> None:
        if len(self.points) < FEWEST_LANDMARKS:
            raise GpError(
                f"has {len(self.points)} landmarks, {FEWEST_LANDMARKS} or more are needed", specimen=self.name
            )
        if self.path is None and self.volume is None:
            raise GpError("its scan is not known", specimen=self.name, remedy="Give its file.")

    @property
    def array(self) -> FloatArray:
        """(N, 3) positions in the order of the names, LPS mm."""
        return np.array(list(self.points.values()), dtype=np.float64)

    def load(self, report: Report | None = None) -> Volume:
        """Return the scan, read from its file if it is not in memory.

        Raises
        ------
        VolumeError
            It cannot be read.
        Cancelled
            The report said so.
        """
        if self.volume is not None:
            return self.volume
        from gp_labeler.imaging.readers import read_volume  # here: not all who name scans read them

        assert self.path is not None
        return read_volume(self.path, cancel=None if report is None else report.cancel, **self.options)

    def key(self, checksum: str) -> str:
        """Return 32 hex digits that change with the landmarks and the scan, not with names of files.

        Parameters
        ----------
        checksum : str
            Of the scan; see `gp_labeler.imaging.volume.Volume.checksum`.
        """
        digest = hashlib.blake2b(digest_size=16)
        digest.update(repr((list(self.points), checksum)).encode())
        digest.update((np.round(self.array, 6) + 0.0).tobytes())
        return digest.hexdigest()


def flat_name(side: Side, code: str) -> str:
    """Return the name of a feature of one side: ``CA_L``, or ``IN`` for what both sides share."""
    shared = any(row.code == code and row.shared for row in FEATURES)
    return code if shared else f"{code}_{side.value}"


def flat_points(sides: Mapping[Side, LandmarkSet]) -> dict[str, FloatArray]:
    """Return the placed features of both sides by name; CO, which is computed, is left out."""
    return {
        flat_name(side, row.code): landmarks[row.code]
        for side, landmarks in sides.items()
        for row in FEATURES
        if not row.computed and row.code in landmarks
    }


def side_and_code(name: str) -> tuple[Side, str] | None:
    """Return the side and the code of the feature that a name stands for, None where it is no feature.

    What both sides share is of the left side.
    """
    label = parse_label(name)
    row = next((row for row in FEATURES if row.code == label.name and not row.computed), None)
    if row is None:
        return None
    if row.shared:
        return Side.LEFT, row.code
    return None if label.side is None else (label.side, row.code)


def sides_of_points(points: Mapping[str, FloatArray]) -> dict[Side, dict[str, FloatArray]] | None:
    """Return points by side and code, None where one of them is no feature of the guinea pig."""
    found: dict[Side, dict[str, FloatArray]] = {side: {} for side in Side}
    for name, position in points.items():
        known = side_and_code(name)
        if known is None:
            return None
        found[known[0]][known[1]] = position
    return found
