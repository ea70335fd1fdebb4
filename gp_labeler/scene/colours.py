"""Colours of the scene, dark and light."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType

import numpy as np

__all__ = ["DARK", "LIGHT", "SceneColours", "contrast", "legible", "rgb"]

Rgb = tuple[float, float, float]

_WORD_CONTRAST = 6.0
"""Of words in the scene with the edge around them, and with the background; small ones need at least 4.5."""


def rgb(text: str) -> Rgb:
    """Return a colour such as ``"#F34A33"`` as red, green, blue from 0 to 1."""
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


_STATES = MappingProxyType(
    {
        "placed": "#F6A43C",
        "computed": "#6FE3B4",
        "doubtful": "#F2575F",
        "active": "#FFFFFF",
        "other": "#4F9FC4",
        "ghost": "#5CB8F5",
        "suggested": "#5CB8F5",
        "pose": "#2B8AD6",
        "pose_2": "#D55E00",
        "truth": "#009E73",
        "touch": "#C8619F",
        "unseen": "#8A929B",
        "reference": "#B4BCC4",
        "free point": "#E39CF0",
        "path": "#F0E442",
        "measure": "#B9E34B",
    }
)


def contrast(one: str, other: str) -> float:
    """Return the contrast of two colours ``#RRGGBB``, 1 to 21.

    References
    ----------
    Web Content Accessibility Guidelines 2.1, relative luminance; 4.5 is its level AA for text.
    """
    lighter, darker = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (lighter + 0.05) / (darker + 0.05)


def _luminance(colour: str) -> float:
    channels = (c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in rgb(colour))
    red, green, blue = channels
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@lru_cache(256)
def legible(colour: str, grounds: tuple[str, ...], least: float) -> str:
    """Return a colour made lighter or darker until words in it have a contrast on every ground."""
    towards = 1.0 if _luminance(grounds[0]) < 0.5 else 0.0
    for share in np.linspace(0.0, 1.0, 41):
        mixed = "#" + "".join(f"{round(255 * (c + share * (towards - c))):02X}" for c in rgb(colour))
        if min(contrast(mixed, ground) for ground in grounds) >= least:
            return mixed
    return mixed


@dataclass(frozen=True, eq=False)
class SceneColours:
    """The colours of one theme, as ``#RRGGBB``.

    Parameters
    ----------
    top, bottom : str
        Background, a gentle gradient.
    bone : str
        The mesh.
    text, halo : str
        Labels without a state, and the edge that keeps any label legible on bone and background.
    states : mapping
        Colour of a mark by state.
    """

    top: str = "#1B222B"
    bottom: str = "#10151B"
    bone: str = "#E2D8C3"
    text: str = "#E8EDF2"
    halo: str = "#0B0F14"
    states: Mapping[str, str] = field(default_factory=lambda: _STATES)

    def word(self, state: str) -> str:
        """Return the colour of words about a state: as its marks, but legible on all that is behind."""
        return legible(self.states.get(state, self.text), (self.halo, self.top, self.bottom), _WORD_CONTRAST)


DARK = SceneColours()
LIGHT = SceneColours(
    top="#FBFCFD",
    bottom="#DDE4EA",
    bone="#DDCFB4",
    text="#1C2630",
    halo="#FFFFFF",
    states=MappingProxyType(
        {
            "placed": "#C66A00",
            "computed": "#0E8A5B",
            "doubtful": "#C5202B",
            "active": "#101820",
            "other": "#2E6F94",
            "ghost": "#1273BE",
            "suggested": "#1273BE",
            "pose": "#0072B2",
            "pose_2": "#CC5500",
            "truth": "#0A7F5D",
            "touch": "#A8397F",
            "unseen": "#6B747E",
            "reference": "#5B646D",
            "free point": "#8A3BA0",
            "path": "#F0E442",
            "measure": "#5C7F00",
        }
    ),
)
