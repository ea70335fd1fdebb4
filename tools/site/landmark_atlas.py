"""The landmark atlas: a page for each feature, with its definition, its pictures and its common mistakes.

Words come from the feature table, distances from the published table, and pictures from the window without
a display, over the synthetic head: no page is written by hand, and no picture is kept in the repository.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gp_core.atlas.published import published_distances
from gp_core.landmarks.features import CODES, FEATURES, Feature, index_of
from gp_labeler.models.anatomical_planes import ANATOMICAL_PLANES, FEATURE_PLANES

FOLDER = "reference/features"
SIZE = (1400, 1000)
ZOOM = 1.5
N_NEAREST = 4

FROM_OUTSIDE = {"IN": (0.0, 0.5, 1.0), "MN": (-1.0, 0.0, 0.0), "OI": "L", "OS": "L", "ZL": "L"}
"""From where the 3D view looks at features outside the bone; at all others, it is cut open."""


def pages() -> Iterator[tuple[str, str]]:
    """Yield path and text of the page of each feature, and of their index."""
    for row in FEATURES:
        yield f"{FOLDER}/{row.code}.md", page(row)
    yield f"{FOLDER}/index.md", index()


def index() -> str:
    """Return the page that lists the features."""
    lines = [
        "# Landmark atlas\n",
        "A page for each of the 20 features, over the synthetic head of seed 0 (`gp-labeler phantom`): a",
        "drawing of anatomy, not a scan of an animal. [The 20 features](../../landmarks.md) lists all",
        "definitions in one table.\n",
        "```{toctree}",
        ":maxdepth: 1\n",
        *CODES,
        "```\n",
    ]
    return "\n".join(lines)


def page(row: Feature) -> str:
    """Return the page of a feature."""
    return "\n".join(
        [
            f"# {row.code}: {row.name}\n",
            f"{kind(row)}\n",
            f"**Definition.** {row.definition}\n",
            f"**Where to look.** {row.where}\n",
            f"**Best plane.** {best_plane(row)}\n",
            f"![{row.name} in three slices and in 3D]({row.code}.png)\n",
            f"{caption(row)}\n",
            "## Common mistakes\n",
            f"{row.mistakes}\n",
            "## Nearest features\n",
            "Mean distance and standard deviation over 22 sides of 11 animals (Usevitch et al. 2021).",
            "The window compares your own with them ([Measure](../../measure.md)).\n",
            "| feature | mean, mm | SD, mm |",
            "|---|---|---|",
            *nearest(row),
            "",
        ]
    )


def kind(row: Feature) -> str:
    """Return in a sentence what sort of feature it is."""
    if row.computed:
        return "Computed from other features; never placed by hand."
    reach = "External: a probe can touch it." if row.external else "Internal: seen in a scan only."
    both = " One point for both sides." if row.shared else ""
    inside = "" if row.on_bone else " It lies in a space, not on bone."
    return reach + both + inside


def best_plane(row: Feature) -> str:
    """Return in a sentence in which plane a feature is judged."""
    plane = FEATURE_PLANES.get(row.code)
    seen = "the 3D view" if row.view == "3D" else f"the {row.view} slices"
    if plane is None:
        return f"It is found in {seen}."
    return f"It is found in {seen}, and judged in the slices {ANATOMICAL_PLANES[plane]} (key 2)."


def caption(row: Feature) -> str:
    """Return what the picture shows."""
    mark = "diamond" if row.computed else "ringed mark"
    words = [
        f"The {mark} at the crosshair is the true position on the left side of the synthetic head;",
        "a hollow mark lies in another slice. The header of each view names its plane.",
    ]
    if row.code not in FROM_OUTSIDE:
        words += ["In 3D the bone is cut open at the feature."]
    return " ".join(words)


def nearest(row: Feature) -> Iterator[str]:
    """Yield the nearest features as rows of a table."""
    mean, sd = published_distances()
    here = index_of(row.code)
    for other in np.argsort(mean[here])[1 : N_NEAREST + 1]:
        code = CODES[other]
        name = f"[{code}]({code}.md) {FEATURES[other].name}"
        yield f"| {name} | {mean[here, other]:.1f} | {sd[here, other]:.2f} |"


def script() -> Iterator[dict[str, object]]:
    """Yield the steps that draw all pictures; features that need no cut come first, since a cut stays."""
    yield {"do": "open", "path": "head.nrrd"}
    yield {"do": "observer", "name": "truth"}
    yield {"do": "import", "files": ["head_L.mrk.json"]}
    yield {"do": "view", "theme": "light", "advance": False, "glyphs": 0.2}
    for row in sorted(FEATURES, key=lambda row: row.code not in FROM_OUTSIDE):
        yield from steps(row)


def steps(row: Feature) -> Iterator[dict[str, object]]:
    """Yield the steps that draw one feature; CO, which cannot be chosen, is drawn beside CB."""
    yield {"do": "choose", "feature": "CB" if row.computed else row.code, "side": "L"}
    yield {"do": "view", "reset": True, "plane": FEATURE_PLANES.get(row.code, "straight")}
    yield {"do": "view", "go_to": f"{row.code} L", "camera": FROM_OUTSIDE.get(row.code, "L")}
    yield {"do": "action", "id": "view.zoom_to_point"}
    if row.code not in FROM_OUTSIDE:
        yield {"do": "action", "id": "view.cut_open"}
    yield {"do": "view", "go_to": f"{row.code} L", "zoom": ZOOM}
    yield {"do": "screenshot", "path": f"{FOLDER}/{row.code}.png", "what": "views", "size": SIZE}
