"""What is written at estimates, and which pixels other labels should leave free."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gp_core.checks import FloatArray
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.labels import Label
from gp_labeler.scene.pose_data import PoseScene
from gp_labeler.scene.sprites import Text
from gp_labeler.scene.stage import Stage

__all__ = ["Name", "Spot", "names_of", "spots_of", "texts_of"]

Spot = tuple[FloatArray, float]
"""A (3,) scan position that labels leave free, and how far about it, logical pixels."""

Name = tuple[str, FloatArray, str, float, float]
"""Text, the (3,) scan position it belongs to, its colour (a state), gap (logical pixels), and rank."""

_ALONG = 16


def texts_of(scene: PoseScene) -> Iterator[Name]:
    """Yield what is written in the scene."""
    if not scene.shows("names"):
        return
    seen = scene.seen
    if scene.shows("estimate"):
        for pose in seen.poses:
            yield scene.text_of(pose), pose.tip, pose.role, 15.0, 1.5
    for truth in seen.truths:
        if truth.label:
            yield truth.label, truth.tail, "truth", 7.0, 1.0
    for touch in seen.touches:
        if touch.suspect:
            yield f"{touch.code} ?", touch.position, "doubtful", 15.0, 1.2
        elif not seen.truths:  # beside labels of the same names, more of them would only crowd
            yield touch.code, touch.position, "touch" if touch.used else "unseen", 8.0, -0.5
    for vector in seen.vectors:
        if vector.is_long:
            yield f"{vector.code} {vector.length:.1f} mm".strip(), vector.end, vector.role, 7.0, 0.5
    if seen.tip is not None and seen.tip.label:
        role = "touch" if seen.tip.visible else "unseen"
        yield seen.tip.label, seen.tip.position, role, 10.0, 1.8


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


def names_of(scene: PoseScene, view: Viewpoint, stage: Stage) -> list[Label]:
    """Return the labels of the 3D view; spots to leave free are labels without a text."""
    names, spots = list(texts_of(scene)), list(spots_of(scene))
    places = [name[1] for name in names] + [place for place, _ in spots]
    if not places:
        return []
    pixels = view.display(np.array(places))[:, :2]
    states, scale = stage.colours.states, stage.scale
    labels = [
        Label(Text(text, states[role]), pixel, gap * scale, rank)
        for (text, _, role, gap, rank), pixel in zip(names, pixels[: len(names)], strict=True)
    ]
    free = [
        Label(Text("", stage.colours.text), pixel, gap * scale, -2.0)
        for (_, gap), pixel in zip(spots, pixels[len(names) :], strict=True)
    ]
    return labels + free
