"""Scans in formats that installed packages read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.imaging.progress import Cancelled, Report
from gp_labeler.imaging.readers.options import ImportOptions, Spacing
from gp_labeler.imaging.readers.plan import Geometry, ImportPlan, ScanReader
from gp_labeler.imaging.readers.problems import VolumeError

__all__ = ["Read", "ScanData", "added_reader"]


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


Read = Callable[[Path], ScanData]
"""A function that reads a whole scan."""


def added_reader(
    ending: str, read: ScanReader | Read, described: str, failure: Callable[[Exception], GpError]
) -> ScanReader:
    """Return the reader that an installed package adds; whatever it raises becomes an error that names it.

    Parameters
    ----------
    ending : str
        Of the names of its files.
    read : ScanReader or callable
        What the package names.
    described : str
        The reader and its package in words.
    failure : callable
        Makes an error of the program of one that the package raised.
    """
    reader = read if isinstance(read, ScanReader) else _reading_all(ending, read, described)

    @contextmanager
    def named(path: Path) -> Iterator[None]:
        try:
            yield
        except (Cancelled, VolumeError):
            raise
        except Exception as error:
            failed = failure(error)
            raise VolumeError(failed.problem, file=path, remedy=failed.remedy) from error

    def knows(path: Path) -> bool:
        with named(path):
            return reader.knows(path)

    def inspect(path: Path, options: ImportOptions, report: Report) -> ImportPlan:
        with named(path):
            return reader.inspect(path, options, report)

    return ScanReader(reader.endings, knows, inspect)


def _reading_all(ending: str, read: Read, described: str) -> ScanReader:
    """Return the reader of a function that reads a whole scan."""
    package = described.rpartition(" ")[2]

    def inspect(path: Path, options: ImportOptions, report: Report) -> ImportPlan:
        data = read(path)
        values = np.asarray(data.values)
        if values.ndim != 3 or values.dtype.kind not in "iuf":
            raise TypeError(f"it gave values of shape {values.shape} and type {values.dtype}")
        return ImportPlan(
            path=path,
            format=f".{ending} ({package})",
            files=(path,),
            size=values.shape[::-1],
            stored_dtype=values.dtype,
            source=_Planes(values),
            geometry=Geometry(data.spacing, data.origin, np.asarray(data.direction, float), data.sides_known),
            options=options,
            name=path.name.partition(".")[0],
        )

    return ScanReader((ending,), lambda path: path.name.lower().endswith(f".{ending.lower()}"), inspect)


@dataclass(frozen=True, eq=False)
class _Planes:
    values: NDArray[Any]

    def planes(self, wanted: Sequence[int]) -> Iterator[NDArray[Any]]:
        """Yield the (y, x) planes with the numbers `wanted`."""
        return (self.values[number] for number in wanted)
