"""Which grey values a slice shows as black and as white."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_labeler.imaging.volume import Volume

__all__ = ["WindowLevel"]

Grey = NDArray[np.uint8]

_TABLED = (np.dtype(np.uint8), np.dtype(np.int8), np.dtype(np.uint16), np.dtype(np.int16))


@dataclass(frozen=True)
class WindowLevel:
    """A linear grey scale.

    Parameters
    ----------
    low, high : float
        Values shown as black and as white, `low` below `high`.
    """

    low: float
    high: float

    @classmethod
    def of(cls, volume: Volume) -> WindowLevel:
        """Propose the scale that suits a whole volume."""
        low, high = volume.intensity_range
        return cls(low, high if high > low else low + 1.0)

    @property
    def width(self) -> float:
        """Range of values from black to white."""
        return self.high - self.low

    @property
    def level(self) -> float:
        """The value shown as middle grey."""
        return (self.low + self.high) / 2

    def moved(self, width: float, level: float, *, smallest: float = 1e-6) -> WindowLevel:
        """Return the scale with its width and level changed by so much."""
        half, middle = max(self.width + width, smallest) / 2, self.level + level
        return WindowLevel(middle - half, middle + half)

    def grey(self, values: NDArray[Any]) -> Grey:
        """Return values as 8-bit grey values, black for NaN."""
        if values.dtype in _TABLED:
            unsigned = values.view(f"u{values.dtype.itemsize}")
            shown: Grey = _table(self, values.dtype.str).take(unsigned)  # half the time that brackets take
            return shown
        return _scaled(self, values)


@lru_cache(maxsize=8)
def _table(scale: WindowLevel, dtype: str) -> Grey:
    """Grey values of all values of a small integer type, in the order of their bit patterns."""
    size = np.dtype(dtype).itemsize
    table = _scaled(scale, np.arange(256**size, dtype=f"u{size}").view(dtype))
    table.setflags(write=False)
    return table


def _scaled(scale: WindowLevel, values: NDArray[Any]) -> Grey:
    wide = values.dtype.itemsize > 2 and values.dtype != np.float32  # float32 would lose small differences
    above = (
        values.astype(np.float64) - scale.low if wide else values.astype(np.float32) - np.float32(scale.low)
    )
    shown = above * above.dtype.type(255 / scale.width)
    whole: Grey = np.nan_to_num(shown, nan=0.0, posinf=255.0, neginf=0.0).clip(0, 255).astype(np.uint8)
    return whole
