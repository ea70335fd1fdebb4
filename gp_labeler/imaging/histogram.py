"""How often each grey value occurs in a scan, and grey windows that suit it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.imaging.volume import Volume

__all__ = ["Histogram", "histogram_of", "window_presets"]

_SAMPLES = 400_000
_BINS = 160


@dataclass(frozen=True, eq=False)
class Histogram:
    """Counts of grey values.

    Parameters
    ----------
    heights : (n,) float array
        Square roots of the counts, the highest 1: so that rare bone shows beside frequent air.
    edges : (n + 1,) float array
        Borders of the bins, grey values.
    """

    heights: FloatArray
    edges: FloatArray

    @property
    def low(self) -> float:
        """The lowest value."""
        return float(self.edges[0])

    @property
    def high(self) -> float:
        """The highest value."""
        return float(self.edges[-1])

    def fraction(self, value: float) -> float:
        """Return where a value lies from the lowest (0) to the highest (1)."""
        return float(np.clip((value - self.low) / (self.high - self.low), 0.0, 1.0))

    def value(self, fraction: float) -> float:
        """Return the value at a fraction of the way from the lowest to the highest, in sensible steps."""
        value = self.low + min(max(fraction, 0.0), 1.0) * (self.high - self.low)
        return float(np.round(np.round(value / self.step) * self.step, 10))

    @property
    def step(self) -> float:
        """A sensible step between values: a power of ten, some thousandth of the whole."""
        return float(10.0 ** np.floor(np.log10((self.high - self.low) / 500)))


def histogram_of(volume: Volume, *, bins: int = _BINS) -> Histogram:
    """Count the grey values of a regular subsample of a scan, without the few brightest; takes some 10 ms."""
    sample = volume.measured(volume.voxels.sample(_SAMPLES).astype(np.float64))
    low, high = float(sample.min()), float(np.percentile(sample, 99.97))
    if not high > low:
        high = low + 1.0
    if volume.dtype.kind in "iu":  # bins of as many whole numbers each, or some would look rarer than others
        width = max(1, round((high - low) / bins))
        bins = max(1, int(np.ceil((high - low) / width)))
        high = low + bins * width
    counts, edges = np.histogram(sample.clip(low, high), bins=bins, range=(low, high))
    heights = np.sqrt(counts.astype(np.float64))
    return Histogram(heights / max(1.0, float(heights[1:-1].max(initial=1.0))), edges)


def window_presets(volume: Volume, threshold: float | None) -> Mapping[str, tuple[float, float]]:
    """Return grey windows, (level, width), by name.

    Parameters
    ----------
    volume : Volume
        The scan.
    threshold : float, optional
        Where bone begins; without it there are none for bone and for soft tissue.
    """
    low, high = volume.intensity_range
    full = max(high - low, 1e-6)
    presets = {"Full": ((low + high) / 2, full)}
    if threshold is not None and low < threshold < high:
        top = high - threshold
        presets["Bone"] = (threshold + 0.35 * top, max(1.3 * top, 1e-6))
        presets["Soft"] = ((low + threshold) / 2, threshold - low)
        presets["Edge"] = (threshold, 0.4 * full)
    return presets
