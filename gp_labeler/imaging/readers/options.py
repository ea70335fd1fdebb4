"""The choices of an import, as one value that can be written down and used again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gp_core.errors import GpError

__all__ = ["ImportOptions", "Region", "Spacing", "as_spacing"]

Spacing = tuple[float, float, float]
Region = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]


@dataclass(frozen=True)
class ImportOptions:
    """How a scan shall be read.

    Parameters
    ----------
    spacing : float or (3,) float, mm, optional
        Voxel size along x, y, z (one number: all three); overrules the file.
    series : str, optional
        Which DICOM series or which stack of a folder: its id, or a part of its name that no other has.
    channel : int, optional
        Which colour channel; without it colours become luminance.
    accept : iterable of str
        Codes of problems that are knowingly accepted.
    reverse : bool
        Whether the slices run the other way than the files say; mirrors the volume.
    stride : int
        Keep every n-th voxel along each axis.
    region : ((i0, i1), (j0, j1), (k0, k1)), optional
        Half-open voxel ranges to keep, counted in the whole (reversed, if asked) volume.

    Raises
    ------
    GpError
        A value is out of its range.
    """

    spacing: Spacing | None = None
    series: str | None = None
    channel: int | None = None
    accept: frozenset[str] = frozenset()
    reverse: bool = False
    stride: int = 1
    region: Region | None = None

    @classmethod
    def make(
        cls,
        *,
        spacing: Any = None,
        series: str | None = None,
        channel: int | None = None,
        accept: Iterable[str] = (),
        reverse: bool = False,
        stride: int = 1,
        region: Any = None,
    ) -> ImportOptions:
        """Make options of what a person or a file gave; see the class."""
        if isinstance(stride, bool) or not isinstance(stride, (int, np.integer)) or stride < 1:
            raise GpError(f"stride must be a whole number from 1, got {stride!r}")
        accepted = frozenset([accept] if isinstance(accept, str) else accept)
        return cls(
            spacing=None if spacing is None else as_spacing(spacing),
            series=None if series is None else str(series),
            channel=None if channel is None else int(channel),
            accept=accepted,
            reverse=bool(reverse),
            stride=int(stride),
            region=None if region is None else _as_region(region),
        )

    def as_json(self) -> dict[str, Any]:
        """Return what differs from the defaults, as JSON values that `make` takes."""
        found: dict[str, Any] = {}
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if value != getattr(ImportOptions, name):
                found[name] = sorted(value) if isinstance(value, frozenset) else _as_list(value)
        return found


def as_spacing(value: Any) -> Spacing:
    """Return (x, y, z) mm of one number or three.

    Raises
    ------
    GpError
        Not one or three positive finite numbers.
    """
    try:
        x, y, z = (float(v) for v in np.broadcast_to(np.asarray(value, dtype=np.float64), (3,)))
    except (TypeError, ValueError, OverflowError):
        raise GpError(f"spacing must be one length in mm, or three (x y z), got {value!r}") from None
    if not (np.isfinite([x, y, z]).all() and min(x, y, z) > 0):
        raise GpError(f"spacing must be positive lengths in mm, got {value!r}")
    return x, y, z


def _as_region(value: Any) -> Region:
    try:
        (i0, i1), (j0, j1), (k0, k1) = ((int(low), int(high)) for low, high in value)
    except (TypeError, ValueError, OverflowError):
        raise GpError(f"region must be ((i0, i1), (j0, j1), (k0, k1)) voxels, got {value!r}") from None
    if min(i0, j0, k0) < 0 or i1 <= i0 or j1 <= j0 or k1 <= k0:
        raise GpError(f"region must be ranges of voxels from 0 with low < high, got {value!r}")
    return (i0, i1), (j0, j1), (k0, k1)


def _as_list(value: Any) -> Any:
    return [_as_list(item) for item in value] if isinstance(value, tuple) else value
