"""Voxels that stay in their file: mapped into memory, and watched for what other programs do to the file."""

from __future__ import annotations

import contextlib
import mmap
import os
import sys
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.array_utils import byte_bounds
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from gp_labeler.imaging.map_guard import GuardedMap, maps_can_be_guarded
from gp_labeler.imaging.memory import available_memory

__all__ = ["MappedFile", "can_map"]


def can_map() -> bool:
    """Whether files can be mapped so that the program survives whatever is done to them."""
    return maps_can_be_guarded()


_LEAST_AHEAD, _MOST_AHEAD = 1 << 16, 1 << 28
"""Bytes that are worth it, and that the system's cache can take at once."""

_FAR_APART = 16
"""A part is sparse if the file has so many times its pages from its beginning to its end."""


class MappedFile:
    """A file whose bytes are read by the system, page by page, where they are asked for.

    Parameters
    ----------
    path : Path
        The file.
    n_bytes : int
        Bytes that are needed, from its beginning.
    thrown_away : bool
        Whether the file is removed with this object, where its name does not go before.

    Raises
    ------
    OSError
        It cannot be mapped.
    ValueError
        It is shorter.
    """

    def __init__(self, path: Path, n_bytes: int, *, thrown_away: bool = False) -> None:
        self._n_bytes = n_bytes
        self._thrown_away = path if thrown_away else None
        self._file = path.open("rb")
        self._map = GuardedMap(self._file.fileno(), n_bytes, page_by_page=n_bytes > available_memory() / 2)
        self._written = os.fstat(self._file.fileno()).st_mtime_ns

    def array(
        self, dtype: np.dtype[Any], offset: int, shape: tuple[int, ...], step: int | None = None
    ) -> NDArray[Any]:
        """Return values of the file as an array, which cannot be written to.

        Parameters
        ----------
        dtype : dtype
            Of one value.
        offset : int
            Byte of the first one.
        shape : tuple of int
            Of the array.
        step : int, optional
            Bytes from one index of the first axis to the next, where they do not follow each other.
        """
        inner = int(np.prod(shape[1:])) * dtype.itemsize
        step = inner if step is None else step
        values = np.asarray(self._map)[offset : offset + step * (shape[0] - 1) + inner]
        if step == inner:
            return values.view(dtype).reshape(shape)
        first = values[:inner].view(dtype).reshape(shape[1:])
        return as_strided(first, shape, (step, *first.strides), writeable=False)

    def fetch(self, part: NDArray[Any]) -> None:
        """Have the system read ahead what will be read of the file, where that lies densely and is not huge.

        Parameters
        ----------
        part : array
            A view of `array`.
        """
        low, high = byte_bounds(part)
        if part.nbytes >= _LEAST_AHEAD and high - low <= min(2 * part.nbytes, _MOST_AHEAD):
            self._map.fetch(low, high - low)

    def is_sparse(self, part: NDArray[Any]) -> bool:
        """Return whether a part takes few pages, far from each other.

        Parameters
        ----------
        part : array
            A view of `array`.
        """
        low, high = byte_bounds(part)
        in_a_row = part.shape[-1] if part.strides[-1] == part.itemsize else 1
        pages = part.size / in_a_row * (in_a_row * part.itemsize + mmap.PAGESIZE)
        return bool(high - low > _FAR_APART * pages)

    def page_by_page(self) -> AbstractContextManager[None]:
        """Return a context in which the system reads no more than the pages that are asked for.

        A sparse part takes a thousand of them; the system would read ahead after each, and so the whole file.
        """
        return self._map.page_by_page()

    @property
    def problem(self) -> str | None:
        """What happened to the file since it was opened; None where nothing did."""
        try:
            now = os.fstat(
                self._file.fileno()
            )  # of the file that is mapped, also where another took its name
        except OSError as error:
            return f"cannot be read any more ({error.strerror or error})"
        if now.st_size < self._n_bytes:
            return f"was truncated while it was open: {now.st_size:,} of its {self._n_bytes:,} bytes are left"
        if self._map.broken:
            return "cannot be read any more: its disk failed, or is not connected"
        return "was changed while it was open" if now.st_mtime_ns != self._written else None

    def __del__(self) -> None:
        if hasattr(self, "_file"):
            self._file.close()
        if self._thrown_away is not None and sys.platform == "win32":
            self._map.close()
            with contextlib.suppress(OSError):
                self._thrown_away.unlink()
