"""Simulated users who label drawn animals with ghosts, and how often the ghosts' regions hold the truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from document_cases import Editing

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.prediction import predict
from gp_core.atlas.sampling import draw_animal
from gp_core.constants import CHI2_3_95
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.models.workflow import OPENING, Active, next_point

SEES_MM = 0.1
"""Standard deviation of a coordinate of where the user sees a feature."""

CONFIRMS_MM = 0.3
"""A ghost is confirmed so near to where the user sees the feature; else the feature is placed there."""


@dataclass
class Coverage:
    """How often the 95 % region of a ghost held its feature, by number of observations and by feature."""

    by_stage: dict[int, list[bool]] = field(default_factory=dict)
    by_feature: dict[str, list[bool]] = field(default_factory=dict)
    n_confirmed: int = 0
    n_placed: int = 0

    @property
    def whole(self) -> float:
        """Of all ghosts at all stages."""
        return float(np.mean([held for group in self.by_stage.values() for held in group]))

    def note(self, editing: Editing, side: Side, truth: LandmarkSet) -> None:
        """Take down every ghost of one side, with all other ghosts accepted."""
        stage = sum(code != "CO" for code in editing.document.landmarks(side).placed)
        for code in editing.document.landmarks(side).suggested:
            editing.labels.clear(side=side, code=code)
            ghost = editing.labels.ghosts(side)[code]
            editing.labels.accept_ghost(side=side, code=code)
            off = ghost.position - truth[code]
            held = bool(off @ np.linalg.solve(ghost.covariance, off) <= CHI2_3_95)
            self.by_stage.setdefault(stage, []).append(held)
            self.by_feature.setdefault(code, []).append(held)


def label(editing: Editing, side: Side, truth: LandmarkSet, rng: np.random.Generator) -> Iterator[None]:
    """Label one side as the program proposes it; stop at each stage, once all ghosts are accepted."""
    for code in OPENING:
        editing.labels.place(_seen(truth, code, rng), side=side, code=code)
    code = OPENING[-1]
    while ghosts := editing.labels.ghosts(side):
        code = next_point(editing.document.state, Active(side, code), editing.labels.ghosts).code
        editing.labels.accept_all_ghosts(side=side)
        yield
        seen = _seen(truth, code, rng)
        if np.linalg.norm(ghosts[code].position - seen) <= CONFIRMS_MM:
            editing.labels.confirm(side=side, code=code)
        else:
            editing.labels.place(seen, side=side, code=code)
        for other in editing.document.landmarks(side).suggested:
            editing.labels.clear(side=side, code=other)  # to be accepted again, where it is now expected


def measured(n_animals: int, seed: int = 0) -> Coverage:
    """Let a user label the left sides of drawn animals; the atlas is the published one."""
    atlas, rng, found = Atlas.published(), np.random.default_rng(seed), Coverage()
    for _ in range(n_animals):
        truth = draw_animal(atlas, rng=rng, tilt_deg=5.0).side("L")
        editing = Editing(predict=partial(predict, atlas))
        for _ in label(editing, Side.LEFT, truth, rng):
            found.note(editing, Side.LEFT, truth)
        hows = [
            mark.provenance.how.value for mark in editing.document.state.landmarks.values() if mark.provenance
        ]
        found.n_confirmed += hows.count("confirmed suggestion")
        found.n_placed += len(hows) - hows.count("confirmed suggestion")
    return found


def mirrored(n_animals: int, seed: int = 0) -> Coverage:
    """Return the same of ghosts mirrored from a labelled left side, with one or two features of the right."""
    atlas, rng, found = Atlas.published(), np.random.default_rng(seed), Coverage()
    for _ in range(n_animals):
        animal, editing = draw_animal(atlas, rng=rng, tilt_deg=5.0), Editing()
        left, right = animal.side("L"), animal.side("R")
        for code in left.placed:
            if code not in ("CO", "IN"):
                editing.labels.place(_seen(left, code, rng), side="L", code=code)
        for code in OPENING[:2]:
            editing.labels.place(_seen(right, code, rng), side="R", code=code)
            if editing.labels.ghosts(Side.RIGHT):
                editing.labels.accept_all_ghosts(side="R")
            found.note(editing, Side.RIGHT, right)
    return found


def _seen(truth: LandmarkSet, code: str, rng: np.random.Generator) -> np.ndarray:
    return truth[code] + SEES_MM * rng.standard_normal(3)
