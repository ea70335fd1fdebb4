"""Simulated users who label drawn animals with ghosts, and how often the ghosts' regions hold the truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.prediction import predict
from gp_core.atlas.sampling import draw_animal
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.models import labelling
from gp_labeler.models.ghosts import CHI2_95
from gp_labeler.models.session import Session
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

    def note(self, session: Session, side: Side, truth: LandmarkSet) -> None:
        """Take down every ghost of one side, with all other ghosts accepted."""
        stage = sum(code != "CO" for code in session.landmarks(side).placed)
        for code in session.landmarks(side).suggested:
            labelling.clear(session, side=side, code=code)
            ghost = session.ghosts(side)[code]
            labelling.accept_ghost(session, side=side, code=code)
            off = ghost.position - truth[code]
            held = bool(off @ np.linalg.solve(ghost.covariance, off) <= CHI2_95)
            self.by_stage.setdefault(stage, []).append(held)
            self.by_feature.setdefault(code, []).append(held)


def label(session: Session, side: Side, truth: LandmarkSet, rng: np.random.Generator) -> Iterator[None]:
    """Label one side as the program proposes it; stop at each stage, once all ghosts are accepted."""
    for code in OPENING:
        labelling.place(session, _seen(truth, code, rng), side=side, code=code)
    code = OPENING[-1]
    while ghosts := session.ghosts(side):
        code = next_point(session.state, Active(side, code), session.ghosts).code
        labelling.accept_all_ghosts(session, side=side)
        yield
        seen = _seen(truth, code, rng)
        if np.linalg.norm(ghosts[code].position - seen) <= CONFIRMS_MM:
            labelling.confirm(session, side=side, code=code)
        else:
            labelling.place(session, seen, side=side, code=code)
        for other in session.landmarks(side).suggested:
            labelling.clear(session, side=side, code=other)  # to be accepted anew, where it is now expected


def measured(n_animals: int, seed: int = 0) -> Coverage:
    """Let a user label the left sides of drawn animals; the atlas is the published one."""
    atlas, rng, found = Atlas.published(), np.random.default_rng(seed), Coverage()
    for _ in range(n_animals):
        truth = draw_animal(atlas, rng=rng, tilt_deg=5.0).side("L")
        session = Session(predict=partial(predict, atlas))
        for _ in label(session, Side.LEFT, truth, rng):
            found.note(session, Side.LEFT, truth)
        hows = [mark.provenance.how.value for mark in session.state.landmarks.values() if mark.provenance]
        found.n_confirmed += hows.count("confirmed suggestion")
        found.n_placed += len(hows) - hows.count("confirmed suggestion")
    return found


def mirrored(n_animals: int, seed: int = 0) -> Coverage:
    """Return the same of ghosts mirrored from a labelled left side, with one or two features of the right."""
    atlas, rng, found = Atlas.published(), np.random.default_rng(seed), Coverage()
    for _ in range(n_animals):
        animal, session = draw_animal(atlas, rng=rng, tilt_deg=5.0), Session()
        left, right = animal.side("L"), animal.side("R")
        for code in left.placed:
            if code not in ("CO", "IN"):
                labelling.place(session, _seen(left, code, rng), side="L", code=code)
        for code in OPENING[:2]:
            labelling.place(session, _seen(right, code, rng), side="R", code=code)
            if session.ghosts(Side.RIGHT):
                labelling.accept_all_ghosts(session, side="R")
            found.note(session, Side.RIGHT, right)
    return found


def _seen(truth: LandmarkSet, code: str, rng: np.random.Generator) -> np.ndarray:
    return truth[code] + SEES_MM * rng.standard_normal(3)
