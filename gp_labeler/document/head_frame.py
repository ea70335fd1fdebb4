"""How the head lies in its scan, as the specimen file keeps it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from gp_core.frames import RigidTransform
from gp_core.validation import FloatArray, check_option

__all__ = ["FOUND_BY", "HeadFrame", "Matrix"]

FOUND_BY = ("symmetry", "points", "landmarks", "hand")
"""What a head frame can have been found by."""

Row = tuple[float, float, float, float]
Matrix = tuple[Row, Row, Row, Row]


@dataclass(frozen=True)
class HeadFrame:
    """The frame of the head in its scan.

    Parameters
    ----------
    matrix : (4, 4) tuple of float
        ``T_head_scan``: from the scan (LPS, mm) to the head, x left, y posterior, z superior; x = 0 is the
        mid-sagittal plane.
    found_by : str
        One of `FOUND_BY`.
    pitch, left : str
        What they were taken from, in words.
    left_confirmed : bool
        Whether a person has confirmed which side is left: nothing in a scan can prove it.
    shown : bool
        Whether the views are turned into it. How one looks at a specimen is no change of it.

    Raises
    ------
    GpError
        The matrix is not rigid, or `found_by` is unknown.
    """

    matrix: Matrix
    found_by: str = "hand"
    pitch: str = ""
    left: str = ""
    left_confirmed: bool = False
    shown: bool = field(default=True, compare=False)

    def __post_init__(self) -> None:
        check_option(self.found_by, "found_by", FOUND_BY)
        rigid = RigidTransform(np.array(self.matrix, dtype=np.float64), "head", "scan")
        rows = tuple(tuple(row) for row in rigid.matrix.tolist())
        object.__setattr__(self, "matrix", rows)

    @classmethod
    def of(cls, T_head_scan: RigidTransform, **rest: str) -> HeadFrame:
        """Make the frame of a transform; see the class for the rest."""
        rows: Matrix = tuple(tuple(row) for row in T_head_scan.matrix.tolist())  # type: ignore[assignment]
        return cls(rows, **rest)  # type: ignore[arg-type]

    @property
    def T_head_scan(self) -> RigidTransform:  # noqa: N802 - a transform keeps its name
        """From the scan to the head."""
        return RigidTransform(np.array(self.matrix), "head", "scan")

    def heights(self, points: ArrayLike) -> FloatArray:
        """Return how far (N, 3) scan positions lie left of the mid-sagittal plane, (N,) mm."""
        left: FloatArray = self.T_head_scan.apply(points)[:, 0]
        return left

    def seen(self, shown: bool) -> HeadFrame:
        """Return the same, shown or not."""
        return replace(self, shown=shown)
