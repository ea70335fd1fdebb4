"""Animals for the tests of the study."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gp_core import Atlas, Specimen
from gp_core.atlas.sampling import draw_animal
from gp_core.frames import RigidTransform


def cohort(n: int, seed: int = 0) -> list[Specimen]:
    """Draw animals from the published atlas."""
    rng = np.random.default_rng(seed)
    atlas = Atlas.published()
    return [draw_animal(atlas, rng=rng, tilt_deg=10.0, name=f"D{i + 1:02}") for i in range(n)]


def moved(specimen: Specimen, rng: np.random.Generator) -> Specimen:
    """Move each side somewhere else, by a motion of its own."""
    sides = {}
    for side, landmarks in specimen.sides.items():
        rotation = Rotation.random(random_state=rng).as_matrix()
        there = RigidTransform.from_parts(rotation, 50 * rng.normal(size=3), dst="scan", src=landmarks.frame)
        sides[side] = landmarks.moved(there)
    return Specimen(specimen.name, sides)
