"""Where the grey values of a scan are: in memory, or in the file itself until they are read."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GeometryError
from gp_labeler.imaging.fill import Fill

__all__ = ["ArrayVoxels", "GreyArray", "MappedVoxels", "Voxels"]

GreyArray = NDArray[Any]
_Index = NDArray[np.intp]


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

    def whole(self) -> GreyArray:
        """Return all of them as one (z, y, x) array."""
        return self.read(slice(None), slice(None), slice(None))

    def planes(self) -> Iterator[GreyArray]:
        """Yield the (y, x) planes, one after the other."""
        for k in range(self.shape[0]):
            yield self.read(slice(k, k + 1), slice(None), slice(None))[0]

    def plane(self, axis: int, index: int) -> GreyArray:
        """Return the plane of one index along the axis x (0), y (1) or z (2), (z, y, x) without that axis."""
        kji: list[slice] = [slice(None)] * 3
        kji[2 - axis] = slice(index, index + 1)
        plane: GreyArray = self.read(*kji).squeeze(axis=2 - axis)
        return plane

    def every(self, step: int) -> GreyArray:
        """Return every so many-th value in the order of the file, (N,)."""
        kept, start = [], 0
        for plane in self.planes():
            kept.append(np.ravel(plane)[start::step])
            start = (start - plane.size) % step
        return np.concatenate(kept)

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

    def every(self, step: int) -> GreyArray:
        """Return every so many-th value."""
        return self._array.reshape(-1)[::step]


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
    """

    def __init__(self, stored: GreyArray, fills: tuple[Fill, ...] = (), below: float = 0.0) -> None:
        self._stored, self._fills, self._below = stored, fills, below
        self.shape, self.dtype = stored.shape, stored.dtype.newbyteorder("=")

    def read(self, k: slice, j: slice, i: slice) -> GreyArray:
        """Return the values of a box: a view of the map where nothing has to be changed."""
        values = self._stored[k, j, i]
        here = tuple(
            Fill(fill.value, None if fill.outside is None else fill.outside[j, i]) for fill in self._fills
        )
        return self._converted(values, here)

    def at(self, k: _Index, j: _Index, i: _Index) -> GreyArray:
        """Return the values of single voxels."""
        here = tuple(
            Fill(fill.value, None if fill.outside is None else fill.outside[j, i]) for fill in self._fills
        )
        return self._converted(self._stored[k, j, i], here)

    def _converted(self, values: GreyArray, fills: tuple[Fill, ...]) -> GreyArray:
        """Bring values to native byte order, and put one value where nothing was measured."""
        native = values.astype(self.dtype, copy=False)
        if not fills:
            return native.view(np.ndarray)
        nothing = np.logical_or.reduce([fill.where(native) for fill in fills])
        return np.where(nothing, self.dtype.type(self._below), native)
