"""A ghost is as sure as it says, though users confirm what lies near it.

`benchmarks/suggestions.py` measures the same on 100 animals.
"""

from __future__ import annotations

import numpy as np
from suggestion_users import measured, mirrored

from gp_core import Atlas, LabellingError, LandmarkSet, Side
from gp_core.atlas.sampling import draw_animal
from gp_core.constants import CHI2_3_95
from gp_labeler.models.ghosts import mirror_ghosts


def test_ghosts_keep_their_coverage_while_they_are_accepted_and_confirmed() -> None:
    found = measured(8, seed=5)
    assert found.n_confirmed > 40  # many were selected because they lay near
    assert 0.90 <= found.whole <= 0.99


def test_ghosts_mirrored_from_the_other_side_are_as_sure_as_they_say() -> None:
    found = mirrored(40, seed=5)
    assert set(found.by_stage) == {1, 2}
    assert 0.90 <= found.whole <= 0.99


def test_mirrored_ghosts_allow_for_the_measured_error_of_labels() -> None:
    rough = LabellingError({}, 0.5)
    rng, held = np.random.default_rng(6), {"measured": [], "assumed": []}
    for _ in range(60):
        animal = draw_animal(Atlas.published(), rng=rng)
        left, right = (_labelled_roughly(animal.side(side), 0.5, rng) for side in Side)
        one = LandmarkSet.from_mapping({"RWA": right["RWA"]}, "R")
        for name, error in (("measured", rough), ("assumed", None)):
            ghosts = mirror_ghosts(one, left, error)
            held[name] += [
                (off := ghost.position - right[code]) @ np.linalg.solve(ghost.covariance, off) <= CHI2_3_95
                for code, ghost in ghosts.items()
                if code not in ("RWA", "CO")
            ]
    assert 0.92 < np.mean(held["measured"]) < 0.98
    assert np.mean(held["assumed"]) < 0.3


def _labelled_roughly(side: LandmarkSet, error_mm: float, rng: np.random.Generator) -> LandmarkSet:
    points = {code: point + error_mm * rng.standard_normal(3) for code, point in side.as_mapping().items()}
    return LandmarkSet.from_mapping(points, side.side)
