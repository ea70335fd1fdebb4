"""Where the grey values of a scan are: in memory, or in the file itself until they are read."""

from __future__ import annotations

import math
import mmap
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GeometryError
from gp_labeler.imaging.fill import Fill
from gp_labeler.imaging.mapped_file import MappedFile
from gp_labeler.imaging.memory import available_memory
from gp_labeler.imaging.progress import Report

__all__ = ["ArrayVoxels", "GreyArray", "MappedVoxels", "Voxels"]

GreyArray = NDArray[Any]
_Index = NDArray[np.intp]

_MOST_READ = 4e9
"""Bytes of a file that one slice may read."""

_MOST_AT_ONCE = 1 << 28
"""Bytes that a slice may read for the first time while the window waits for it."""

_GLANCE = 1 << 22
"""Bytes that are read in place of more: a thousand pages, from all over the file."""

_LAYERS_AT_A_TIME = 16


class Voxels(ABC):
    """Grey values on a grid, indexed ``[k, j, i]``, that are read where they are needed.

    A scan may be larger than the memory, so whoever shows, measures or meshes it asks for boxes, planes or
    single voxels.
    """

    shape: tuple[int, int, int]
    """(z, y, x)."""
    dtype: np.dtype[Any]
    """Of what is read, in native byte order."""

    @abstractmethod
    def read(self, k: slice, j: slice, i: slice) -> GreyArray:
        """Return the (z, y, x) values of a box; leave them as they are: they may be the scan's own memory."""

    @abstractmethod
    def at(self, k: _Index, j: _Index, i: _Index) -> GreyArray:
        """Return the values of single voxels; the index arrays and the result have one shape."""

    @property
    def size(self) -> int:
        """How many there are."""
        nz, ny, nx = self.shape
        return nz * ny * nx

    @property
    def nbytes(self) -> int:
        """Bytes that all of them take once they are read."""
        return self.size * self.dtype.itemsize

    @property
    def in_file(self) -> bool:
        """Whether they stay in their file until they are read."""
        return False

    @property
    def problem(self) -> str | None:
        """What happened to the file that holds them, since it was opened; None where nothing did.

        What was cut off reads as zeros. So whoever has read asks for the problem afterwards.
        """
        return None

    def uncopied(self) -> GreyArray | None:
        """Return all of them as one C-contiguous (z, y, x) array, or None where that would need a copy."""
        return None

    def rows_apart(self, x: int, *, at_once: bool = False) -> int:
        """Return every how many-th row and layer a slice of one x takes: it has one voxel of each row.

        To read a voxel of a file is to read its page: in a scan that is larger than the memory, such a slice
        would read it all.

        Parameters
        ----------
        x : int
            Column of voxels.
        at_once : bool
            Where much of the file is still to be read for it, take so few rows that nobody waits for them.
        """
        return 1

    def is_unread(self, x: int) -> bool:
        """Whether a slice of one x takes long: much is to be read for it, and was not by `read_ahead`."""
        return False

    def read_ahead(self, x: int, report: Report) -> None:
        """Read what a slice of one x needs, so that the next ones there come at once."""
        report(1.0)

    def whole(self) -> GreyArray:
        """Return all of them as one (z, y, x) array."""
        return self.read(slice(None), slice(None), slice(None))

    def planes(self) -> Iterator[GreyArray]:
        """Yield the (y, x) planes, one after the other."""
        for k in range(self.shape[0]):
            yield self.read(slice(k, k + 1), slice(None), slice(None))[0]

    def rows(self, n: int) -> GreyArray:
        """Return the values of about `n` voxels at most, (N,): whole rows, spread over planes and columns.

        Single voxels would take as long: a file is read in pages, which hold rows.
        """
        nz, ny, nx = self.shape
        step = max(1, -(-nz * ny * nx // n))
        while math.gcd(step, ny) > 1 and step < nz * ny:  # else the rows would lie on few planes' same lines
            step += 1
        places = (divmod(row, ny) for row in range(0, nz * ny, step))
        rows = [self.read(slice(k, k + 1), slice(j, j + 1), slice(None)).reshape(-1) for k, j in places]
        return np.concatenate(rows)

    def sample(self, n: int) -> GreyArray:
        """Return a regular subsample of about `n` values at most, (z, y, x)."""
        stride = max(1, int(np.ceil((self.size / n) ** (1 / 3))))
        return self.read(*[slice(None, None, stride)] * 3)


class ArrayVoxels(Voxels):
    """Voxels in memory.

    Parameters
    ----------
    array : (z, y, x) array
        Made C-contiguous, of native byte order and read-only.

    Raises
    ------
    GeometryError
        It is not three-dimensional, or empty.
    """

    def __init__(self, array: GreyArray) -> None:
        array = np.asarray(array)
        if array.ndim != 3 or 0 in array.shape:
            raise GeometryError(f"a volume must be (z, y, x), got shape {array.shape}")
        self._array = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("=")).view()
        self._array.setflags(write=False)
        self.shape, self.dtype = self._array.shape, self._array.dtype

    def read(self, k: slice, j: slice, i: slice) -> GreyArray:
        """Return a view of a box."""
        return self._array[k, j, i]

    def at(self, k: _Index, j: _Index, i: _Index) -> GreyArray:
        """Return the values of single voxels."""
        values: GreyArray = self._array[k, j, i]
        return values

    def uncopied(self) -> GreyArray:
        """Return the array."""
        return self._array


class MappedVoxels(Voxels):
    """Voxels that stay in their file, which the system reads page by page where they are asked for.

    Parameters
    ----------
    stored : (z, y, x) array
        The file, mapped; of any byte order, and perhaps a view with steps.
    fills : tuple of Fill
        Values that stand where nothing was measured.
    below : float, optional
        What is read in their place.
    file : MappedFile, optional
        The file, to know what happens to it.
    """

    def __init__(
        self,
        stored: GreyArray,
        fills: tuple[Fill, ...] = (),
        below: float = 0.0,
        file: MappedFile | None = None,
    ) -> None:
        self._stored, self._fills, self._below, self._file = stored, fills, below, file
        self.shape, self.dtype = stored.shape, stored.dtype.newbyteorder("=")
        nz, ny, _ = stored.shape
        self._slice_bytes = min(self.nbytes, nz * ny * mmap.PAGESIZE)
        self._apart = _apart(self._slice_bytes, min(_MOST_READ, available_memory() / 2))
        self._pages_read: set[int] = set()

    @property
    def in_file(self) -> bool:
        """They stay in their file."""
        return True

    @property
    def problem(self) -> str | None:
        """What happened to the file since it was opened."""
        return None if self._file is None else self._file.problem

    def uncopied(self) -> GreyArray | None:
        """Return the map, where its values are shown as they are stored, but for some that are not finite."""
        as_they_are = all(np.isnan(fill.value) for fill in self._fills) and self._stored.dtype.isnative
        return self._stored if as_they_are and self._stored.flags.c_contiguous else None

    def rows_apart(self, x: int, *, at_once: bool = False) -> int:
        """Return every how many-th row and layer a slice of one x takes."""
        return _apart(self._slice_bytes, _GLANCE) if at_once and self.is_unread(x) else self._apart

    def is_unread(self, x: int) -> bool:
        """Whether a slice of one x takes long."""
        return self._slice_bytes > _MOST_AT_ONCE and self._page_of(x) not in self._pages_read

    def read_ahead(self, x: int, report: Report) -> None:
        """Read what a slice of one x needs; the interpreter is free while NumPy copies."""
        n, step = _LAYERS_AT_A_TIME * self._apart, slice(None, None, self._apart)
        for k in range(0, self.shape[0], n):
            report(k / self.shape[0])
            self._stored[k : k + n, :, x][step, step].copy()
        self._pages_read.add(self._page_of(x))

    @property
    def _is_mostly_unread(self) -> bool:
        """Whether the file is large, and no slice has brought all of its rows into memory."""
        return self._slice_bytes > _MOST_AT_ONCE and not self._pages_read

    def _page_of(self, x: int) -> int:
        """Return in which page of its row a voxel lies: whoever reads it has its neighbours, too."""
        return x * self.dtype.itemsize // mmap.PAGESIZE

    def read(self, k: slice, j: slice, i: slice) -> GreyArray:
        """Return the values of a box: a view of the map where nothing has to be changed."""
        values = self._stored[k, j, i]
        if self._file is not None and self._is_mostly_unread and self._file.is_sparse(values):
            with self._file.page_by_page():
                values = values.copy()
        elif self._file is not None:
            self._file.fetch(values)
        return self._converted(values, [fill.part(j, i) for fill in self._fills])

    def rows(self, n: int) -> GreyArray:
        """Return the values of about `n` voxels at most; no other rows are read of the file."""
        with nullcontext() if self._file is None else self._file.page_by_page():
            return super().rows(n)

    def at(self, k: _Index, j: _Index, i: _Index) -> GreyArray:
        """Return the values of single voxels."""
        return self._converted(self._stored[k, j, i], [fill.part(j, i) for fill in self._fills])

    def _converted(self, values: GreyArray, fills: list[Fill]) -> GreyArray:
        """Bring values to native byte order, and put one value where nothing was measured."""
        native = values.astype(self.dtype, copy=False)
        if not any(fill.occurs(native) for fill in fills):
            return native
        nothing = np.logical_or.reduce([fill.where(native) for fill in fills])
        return np.where(nothing, self.dtype.type(self._below), native)


def _apart(n_bytes: float, most: float) -> int:
    """Return every how many-th row and layer is read, where all of them are so many bytes."""
    return max(1, math.ceil(math.sqrt(n_bytes / most)))
