"""Shared by the tests of the atlas: labelled animals drawn from the published one, as files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.io import write_markups
from gp_core.landmarks.sets import LandmarkSet, Specimen


def drawn_animals(n: int, seed: int = 0) -> list[Specimen]:
    """Draw animals GP01, GP02, ..., both sides of each."""
    rng = np.random.default_rng(seed)
    return [draw_animal(Atlas.published(), rng=rng, name=f"GP{i + 1:02}") for i in range(n)]


def write_side(folder: Path, name: str, landmarks: LandmarkSet) -> Path:
    """Write one side as 3D Slicer's markups."""
    path = folder / f"{name}_{landmarks.side.value}.mrk.json"
    write_markups(path, landmarks, specimen=name)
    return path


def write_animals(folder: Path, animals: list[Specimen]) -> Path:
    """Write all sides into a folder, made if need be."""
    folder.mkdir(exist_ok=True)
    for animal in animals:
        for landmarks in animal.sides.values():
            write_side(folder, animal.name, landmarks)
    return folder
