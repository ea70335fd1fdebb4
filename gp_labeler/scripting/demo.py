"""The demo: a phantom labelled, exported and checked, and a cochlea estimated from touches.

On the left, suggestions are judged one by one: confirmed where they lie within a voxel of the truth, else
re-placed by a click. On the right, everything is placed by clicks. A ruler and an angle are measured on a
thick slab. Some features are labelled again, blind,
to show how repeatable labels are, and a contact sheet shows all of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gp_core.landmarks.features import FEATURES, Side
from gp_labeler.models.workflow import OPENING
from gp_labeler.scripting.script import Script, make_script

__all__ = ["demo_script"]

AGAIN = (*OPENING, "CB")
"""Features that are labelled a second time."""


def demo_script(seed: int = 0, voxel_mm: float = 0.2) -> Script:
    """Return the demo as a script like any other.

    Parameters
    ----------
    seed : int
        Of the phantom.
    voxel_mm : float
        Of the phantom; every feature must come to lie so near to its true place.
    """
    return make_script(list(_tables(seed, voxel_mm)), name="demo")


def _tables(seed: int, voxel_mm: float) -> Iterator[dict[str, Any]]:
    yield {"do": "observer", "name": "demo"}
    yield {"do": "open", "phantom": seed, "spacing": voxel_mm}
    left, right = list(_order(Side.LEFT)), list(_order(Side.RIGHT))
    yield from _placed(left[: len(OPENING)], Side.LEFT, voxel_mm)
    yield {"do": "action", "id": "point.accept_all"}
    n_suggested = len(left) - len(OPENING)
    yield {"do": "expect", "side": "L", "placed": len(OPENING), "suggested": n_suggested}
    yield {"do": "screenshot", "path": "suggestions.png", "what": "window"}
    for code in left[len(OPENING) :]:
        judged = {"within": voxel_mm, "correct": True}
        yield {"do": "confirm", "feature": code, "side": "L", **judged}
    yield from _placed(right, Side.RIGHT, voxel_mm)
    yield {"do": "expect", "placed": 2 * len(FEATURES), "suggested": 0}
    note = "deep in the joint, hard to see"
    yield {"do": "annotate_point", "side": "L", "code": "MN", "certainty": "fair", "note": note}
    yield {"do": "export", "complete": True}
    yield {"do": "check", "path": "check.json", "strict": True}
    yield {"do": "save"}
    yield {"do": "view", "go_to": "RWA L", "camera": [-0.75, 0.55, -0.38]}
    yield {"do": "view", "reset": True}
    yield {"do": "screenshot", "path": "window.png", "what": "window"}
    yield {"do": "screenshot", "path": "mesh.png", "what": "3d", "size": [1200, 900]}
    yield {"do": "view", "zoom": 3.0, "go_to": "CO L"}
    yield {"do": "screenshot", "path": "slices.png", "what": "slices", "size": [1800, 600]}
    yield {"do": "straighten", "by": "landmarks", "left_confirmed": True}
    yield {"do": "choose", "feature": "CA", "side": "L"}
    yield {"do": "view", "plane": "along"}
    yield {"do": "screenshot", "path": "modiolus.png", "what": "views", "size": [1400, 1000]}
    yield {"do": "view", "plane": "straight", "frame": "scan"}
    yield from _measured()
    for side in (Side.RIGHT, Side.LEFT):
        files = [f"pose_{side.value}.json", *(["pose.json"] if side is Side.LEFT else [])]
        yield {"do": "estimate", "side": side.value, "noise": 0.1, "seed": seed, "path": files}
    yield {"do": "overlay"}
    yield {"do": "view", "opacity": 0.5}
    yield {"do": "screenshot", "path": "overlay.png", "what": "views", "size": [1400, 1000]}
    yield {"do": "view", "opacity": 1.0}
    yield {"do": "overlay", "visible": False}
    yield from _again(voxel_mm)


def _measured() -> Iterator[dict[str, Any]]:
    """Measure the round window and the modiolar axis on a thick slab; write distances beside the paper's."""
    yield {"do": "view", "slab": {"mean": 1.0}}
    yield {"do": "measure", "tool": "ruler", "at": ["RWA L", "RWP L"], "name": "round window"}
    yield {"do": "measure", "tool": "angle", "at": ["CA L", "CB L", "RWA L"], "name": "axis and window"}
    yield {"do": "view", "go_to": "CB L"}
    yield {"do": "screenshot", "path": "measured.png", "what": "views", "size": [1400, 1000]}
    yield {"do": "export_measurements"}
    yield {"do": "distances", "side": "L", "path": "distances.json"}
    yield {"do": "view", "slab": "off"}


def _again(voxel_mm: float) -> Iterator[dict[str, Any]]:
    """Label some features again, blind, and compare both labellings; make a contact sheet of the first."""
    yield {"do": "label_again"}
    yield from _placed(list(AGAIN), Side.LEFT, voxel_mm)
    yield {"do": "labelling", "observer": "demo"}
    yield {"do": "save"}
    yield {"do": "reliability", "path": ["reliability.csv", "reliability.json"]}
    yield {"do": "contact_sheet", "path": "contact.pdf"}
    yield {"do": "list", "path": "specimens.json"}


def _placed(codes: list[str], side: Side, voxel_mm: float) -> Iterator[dict[str, Any]]:
    for code in codes:
        yield {"do": "place", "feature": code, "side": side.value, "at": "truth", "within": voxel_mm}


def _order(side: Side) -> Iterator[str]:
    """Yield the features that the atlas needs to predict the others, then these; shared ones once."""
    codes = [row.code for row in FEATURES if not row.computed and not (row.shared and side is Side.RIGHT)]
    yield from OPENING
    yield from (code for code in codes if code not in OPENING)
