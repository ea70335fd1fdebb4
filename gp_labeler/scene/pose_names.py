"""What is written at estimates, and which pixels other labels should leave free."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.scene.pose_data import PoseScene

__all__ = ["REACH_MM", "Name", "Spot", "Written", "texts_of", "written_in"]

Spot = tuple[FloatArray, float]
"""A (3,) scan position that labels leave free, and how far about it, logical pixels."""

REACH_MM = 1.5
"""Points farther off a slice are not drawn on it, and so not named."""


class Name(NamedTuple):
    """Something written in a scene.

    Parameters
    ----------
    text : str
        What it says.
    place : (3,) float array
        What it belongs to, scan frame, mm.
    role : str
        Colour: a state of the theme.
    gap : float
        How far from there it begins, logical pixels.
    rank : float
        As in `place_labels`.
    reach_mm : float
        How far off a slice it is still written.
    """

    text: str
    place: FloatArray
    role: str
    gap: float
    rank: float
    reach_mm: float = 4.0


class Written(NamedTuple):
    """All that is written in a scene.

    Parameters
    ----------
    names : tuple of Name
    places : (N, 3) float array
        Of the names, and of the spots that they leave free, scan frame, mm.
    gaps : tuple of float
        How far about each of those spots, logical pixels.
    """

    names: tuple[Name, ...]
    places: FloatArray
    gaps: tuple[float, ...]


_ALONG = 16
_KEPT = 4


def texts_of(scene: PoseScene) -> Iterator[Name]:
    """Yield what is written in the scene."""
    if not scene.shows("names"):
        return
    seen = scene.seen
    if scene.shows("estimate"):
        for pose in seen.poses:
            yield Name(scene.text_of(pose), pose.tip, pose.role, 15.0, 1.5)
    for truth in seen.truths:
        if truth.label:
            yield Name(truth.label, truth.tail, "truth", 7.0, 1.0)
    for touch in seen.touches:
        if touch.suspect:
            yield Name(f"{touch.code} ?", touch.position, "doubtful", 15.0, 1.2, REACH_MM)
        elif not seen.truths:  # beside labels of the same names, more of them would only crowd
            role = "touch" if touch.used else "unseen"
            yield Name(touch.code, touch.position, role, 8.0, -0.5, REACH_MM)
    for vector in seen.vectors:
        if vector.is_long:
            text = f"{vector.code} {vector.length:.1f} mm".strip()
            yield Name(text, vector.end, vector.role, 7.0, 0.5, REACH_MM)
    if seen.tip is not None and seen.tip.label:
        role = "touch" if seen.tip.visible else "unseen"
        yield Name(seen.tip.label, seen.tip.position, role, 10.0, 1.8)


def spots_of(scene: PoseScene) -> Iterator[Spot]:
    """Yield what labels should not cover: the axes, the markers."""
    seen = scene.seen
    axes = [(pose.tail, pose.tip) for pose in seen.poses if scene.shows("estimate")]
    axes += [(truth.tail, truth.tip) for truth in seen.truths]
    for tail, tip in axes:
        for share in np.linspace(0.0, 1.0, _ALONG):
            yield tail + share * (tip - tail), 14.0
    for feature in seen.features:
        yield feature.position, 5.0


@lru_cache(_KEPT)
def written_in(scene: PoseScene) -> Written:
    """Return what is written in a scene, which every view of it asks."""
    names, spots = tuple(texts_of(scene)), tuple(spots_of(scene))
    places = [name.place for name in names] + [place for place, _ in spots]
    return Written(names, np.array(places).reshape(-1, 3), tuple(gap for _, gap in spots))
