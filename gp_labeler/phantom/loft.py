"""Skin and skull of a phantom as bodies along the midline of the head: a cross-section at each place."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gp_core.validation import FloatArray
from gp_labeler.phantom.layout import HeadLayout
from gp_labeler.phantom.solids import Grid, Solid, Values, component, implicit, moved

__all__ = ["roof_heights", "skin", "skull_body"]

# Cross-sections: anterior position, half width, top, bottom (mm of the mean head, see HeadLayout)
_SKIN = (
    (-17.6, 3.0, 4.0, -4.0),
    (-17.0, 15.0, 14.5, -18.0),
    (-14.0, 17.5, 17.0, -20.5),
    (-6.0, 19.3, 18.2, -21.5),
    (4.0, 20.0, 18.6, -21.8),
    (14.0, 19.8, 18.0, -21.5),
    (22.0, 18.0, 16.6, -20.8),
    (30.0, 14.5, 14.8, -19.5),
    (38.0, 11.2, 12.6, -17.8),
    (45.0, 8.8, 10.2, -14.8),
    (49.5, 7.2, 8.6, -11.8),
    (52.5, 5.6, 7.0, -7.5),
    (54.4, 3.4, 4.6, -2.5),
    (55.0, 0.5, 2.0, 0.4),
)
_SKULL = (
    (-12.4, 1.5, 6.8, 3.8),
    (-12.1, 5.8, 10.0, 0.6),
    (-10.5, 9.0, 12.0, -0.5),
    (-6.0, 10.3, 13.1, -0.6),
    (0.0, 10.5, 13.8, -0.6),
    (6.0, 10.4, 13.9, -0.9),
    (12.0, 10.0, 13.6, -1.4),
    (17.0, 9.2, 13.0, -1.8),
    (22.0, 8.6, 12.3, -2.4),
    (28.0, 8.2, 11.3, -3.4),
    (34.0, 7.2, 9.9, -4.3),
    (40.0, 6.1, 8.4, -4.8),
    (45.0, 5.5, 7.3, -4.8),
    (47.6, 5.2, 6.8, -4.5),
    (49.2, 5.0, 6.5, -3.6),
    (50.6, 4.6, 6.2, -1.6),
    (52.0, 4.0, 5.8, 1.0),
    (53.0, 3.2, 5.4, 3.2),
    (53.4, 0.5, 5.0, 4.2),
)

_ROUND, _BOXY = 2.3, 2.5
_SNOUT = (16.0, 46.0)
_FINE = 8192


def skin(head: HeadLayout) -> Solid:
    """Return the soft outline of the head without the outer ears."""
    return _loft(head, _SKIN, _ROUND)


def skull_body(head: HeadLayout) -> Solid:
    """Return braincase and snout as one solid body, without the orbits."""
    return _loft(head, _SKULL, _BOXY)


def roof_heights(lateral: FloatArray, anterior: FloatArray) -> FloatArray:
    """Return how high (n,) the roof of the mean head's skull is at places (n,) aside and ahead, mm."""
    table = np.array(_SKULL)
    half, top, low = (np.interp(anterior, table[:, 0], table[:, c]) for c in (1, 2, 3))
    aside = np.minimum(np.abs(lateral) / half, 1.0)
    height: FloatArray = (top + low) / 2 + (top - low) / 2 * (1 - aside**_BOXY) ** (1 / _BOXY)
    return height


def _loft(head: HeadLayout, sections: ArrayLike, power: float) -> Solid:
    """Return the body with superelliptic cross-sections along the midline of the head."""
    from scipy.interpolate import PchipInterpolator

    table = _with_own_snout(head, np.array(sections, dtype=np.float64))
    profile = PchipInterpolator(table[:, 0], table[:, 1:])
    first, last = table[0, 0], table[-1, 0]
    lateral, back, up = head.rotation.T / head.scale
    half, low, high = table[:, 1].max(), table[:, 3].min(), table[:, 2].max()
    corners = head.roughly(
        np.array([(x, -a, z) for x in (-half, half) for a in (first, last) for z in (low, high)])
    )
    widths, tops, bottoms = profile(np.linspace(first, last, _FINE)).astype(np.float32).T
    scale, per_mm = np.float32(head.scale), np.float32((_FINE - 1) / (last - first))

    def value(grid: Grid) -> Values:
        here = moved(grid, head.shift)
        place = -component(here, back)
        index = ((place - np.float32(first)) * per_mm).clip(0, _FINE - 1).astype(np.int16)
        width, top, bottom = widths[index], tops[index], bottoms[index]
        a = np.abs(component(here, lateral)) / width
        b = np.abs(component(here, up) - (top + bottom) / 2) / ((top - bottom) / 2)
        across = ((a**power + b**power) ** np.float32(1 / power) - 1) * width
        ends = np.maximum(np.float32(first) - place, place - np.float32(last))
        outside: Values = scale * np.maximum(across, ends)
        return outside

    return implicit(value, corners.min(axis=0), corners.max(axis=0))


def _with_own_snout(head: HeadLayout, table: FloatArray) -> FloatArray:
    """Return cross-sections drawn out so that the snout comes to this animal's IN."""
    tip = head.snout_shift
    share = np.clip((table[:, 0] - _SNOUT[0]) / (_SNOUT[1] - _SNOUT[0]), 0, 1)
    share = (share * share * (3 - 2 * share))[:, None]
    return table + share * (tip[1], 0.0, tip[2], tip[2])
