"""Packed scans that are too large for the memory: unpacked once into a file, which goes with the scan."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_path

from gp_core.errors import GpError
from gp_core.settings import setting
from gp_labeler.imaging.mapped_file import MappedFile, can_map
from gp_labeler.imaging.memory import available_memory

__all__ = ["available_memory", "cache_folder", "needs_cache", "space_problem", "unpacked"]

_PREFIX, _SUFFIX = "gp-labeler-", ".voxels"
_DEFAULT_GB = 100
_SPARE_BYTES = 1 << 28
"""Of the disk, which other programs need too."""


def needs_cache(n_bytes: int) -> bool:
    """Return whether voxels that must be unpacked do so into a file: more than half of the free memory."""
    return can_map() and n_bytes > available_memory() / 2


def cache_folder() -> Path:
    """Return where the files are: the setting ``cache``, or the user's folder for such files."""
    chosen = setting("cache")
    return Path(chosen) if chosen else user_cache_path("gp-labeler", appauthor=False)


def space_problem(n_bytes: int) -> str | None:
    """Return why so many bytes cannot be put there; None where they can."""
    limit, folder = setting("cache_gb") or _DEFAULT_GB, cache_folder()
    if n_bytes > limit * 1e9:
        return f"unpacked it takes {n_bytes / 1e9:.1f} GB, but the limit of the cache is {limit} GB"
    there = next((place for place in (folder, *folder.parents) if place.is_dir()), None)
    free = shutil.disk_usage(there).free if there is not None else 0
    if n_bytes + _SPARE_BYTES > free:
        return f"unpacked it takes {n_bytes / 1e9:.1f} GB, and {folder} has {free / 1e9:.1f} GB free"
    return None


def unpacked(
    planes: Iterable[NDArray[Any]], shape: tuple[int, int, int], dtype: np.dtype[Any]
) -> tuple[NDArray[Any], MappedFile]:
    """Write planes into a new file of the cache, and map it.

    The file has no name any more when this returns (on Windows it is removed with the scan): it takes no
    space once the scan is closed, however the program ends.

    Parameters
    ----------
    planes : iterable of (y, x) array
        In the order in which they lie.
    shape : (z, y, x)
        Of the whole.
    dtype : dtype
        Of the values as they are kept.

    Returns
    -------
    (z, y, x) array, MappedFile

    Raises
    ------
    GpError
        The disk is full, or the folder cannot be written to.
    """
    folder = cache_folder()
    n_bytes = int(np.prod(shape)) * dtype.itemsize
    path: Path | None = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _remove_left_over(folder)
        number, name = tempfile.mkstemp(_SUFFIX, _PREFIX, folder)
        path = Path(name)
        with os.fdopen(number, "wb") as file:
            for plane in planes:
                file.write(np.ascontiguousarray(plane, dtype).data)
        mapped = MappedFile(path, n_bytes, thrown_away=True)
    except OSError as error:
        raise GpError(
            f"cannot hold the unpacked scan of {n_bytes / 1e9:.1f} GB ({error.strerror or error})",
            file=folder,
            remedy="Free space, set another folder (the setting cache), or load every second voxel.",
        ) from None
    finally:
        if path is not None and sys.platform != "win32":
            path.unlink(missing_ok=True)
    return mapped.array(dtype, 0, shape), mapped


def _remove_left_over(folder: Path) -> None:
    """Remove what a program that was killed left there; files in use cannot be removed on Windows."""
    if sys.platform == "win32":
        for path in folder.glob(f"{_PREFIX}*{_SUFFIX}"):
            with contextlib.suppress(OSError):
                path.unlink()
