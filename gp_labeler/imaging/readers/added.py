"""Scans in formats that installed packages read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GpError
from gp_core.extensions import Extensions
from gp_core.validation import FloatArray
from gp_labeler.imaging.readers.options import ImportOptions, Spacing
from gp_labeler.imaging.readers.plan import Geometry, ImportPlan
from gp_labeler.imaging.readers.problems import VolumeError

__all__ = ["READERS", "ScanData", "inspect_added"]


@dataclass(frozen=True, eq=False)
class ScanData:
    """What a reader of an installed package gives.

    Parameters
    ----------
    values : (nz, ny, nx) array
        Grey values.
    spacing : (3,) float, mm, optional
        Voxel size along x, y, z; None where the file does not say, and the person is asked.
    origin : (3,) float
        LPS mm: the centre of the first voxel.
    direction : (3, 3) array
        Columns: where x, y, z of the grid point in LPS.
    sides_known : bool
        Whether the file says which side is left.
    """

    values: NDArray[Any]
    spacing: Spacing | None = None
    origin: Spacing = (0.0, 0.0, 0.0)
    direction: FloatArray = field(default_factory=lambda: np.eye(3))
    sides_known: bool = False


READERS: Extensions[Callable[[Path], ScanData]] = Extensions("gp_labeler.readers", {})
"""Readers by the ending of a file's name."""


def inspect_added(path: Path, options: ImportOptions) -> ImportPlan | None:
    """Return the plan for a scan that an installed package reads, or None where none does.

    Raises
    ------
    VolumeError
        The package fails on it; the error names the package.
    """
    name = path.name.lower()
    ending = next((e for e in READERS.added if name.endswith(f".{e.lower()}")), None)
    if ending is None:
        return None
    try:
        data = READERS.get(ending)(path)
        values = np.asarray(data.values)
        if values.ndim != 3 or values.dtype.kind not in "iuf":
            raise TypeError(f"it gave values of shape {values.shape} and type {values.dtype}")
    except Exception as error:
        failure = READERS.failure(ending, error)
        raise VolumeError(failure.problem, file=path, remedy=failure.remedy) from error
    nz, ny, nx = values.shape
    try:
        geometry = Geometry(data.spacing, data.origin, np.asarray(data.direction, float), data.sides_known)
    except GpError as error:
        raise VolumeError(error.problem, file=path, remedy=error.remedy) from error
    return ImportPlan(
        path=path,
        format=f".{ending} ({READERS.described(ending).rpartition(' ')[2]})",
        files=(path,),
        size=(nx, ny, nz),
        stored_dtype=values.dtype,
        source=_Planes(values),
        geometry=geometry,
        options=options,
        name=path.name.partition(".")[0],
    )


@dataclass(frozen=True, eq=False)
class _Planes:
    values: NDArray[Any]

    def planes(self, wanted: Sequence[int]) -> Iterator[NDArray[Any]]:
        """Yield the (y, x) planes with the numbers `wanted`."""
        return (self.values[number] for number in wanted)
