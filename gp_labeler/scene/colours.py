"""Colours of the scene, dark and light."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

__all__ = ["DARK", "LIGHT", "SceneColours", "rgb"]

Rgb = tuple[float, float, float]


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
        "path": "#F0E442",
    }
)


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
            "path": "#F0E442",
        }
    ),
)
