"""Specimen files of drawn animals, each labelled by two observers, one of them twice."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gp_core import Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.landmarks.features import FEATURES, Side
from gp_labeler.document.specimen_file import SUFFIX, write_specimen
from gp_labeler.document.state import How, Landmark, Provenance, SpecimenState, StoredLabelling, point_key

SITTINGS = (("AB", 1), ("AB", 2), ("CD", 1))
CODES = tuple(row.code for row in FEATURES if not row.computed)


def write_repeated(
    folder: Path, n: int = 4, *, sd: float = 0.1, codes: Sequence[str] = CODES, sittings=SITTINGS
) -> list[Path]:
    """Write GP0, GP1, ...; CD places OS half a millimetre too high."""
    rng, files = np.random.default_rng(4), []
    for i in range(n):
        animal = draw_animal(Atlas.published(), rng=rng, name=f"GP{i}", tilt_deg=10)
        stored = [labelling(animal, *sitting, sd, codes, rng) for sitting in sittings]
        state = SpecimenState(animal.name).with_labelling(stored[0], tuple(stored[1:]))
        files.append(folder / f"{animal.name}{SUFFIX}")
        write_specimen(files[-1], state)
    return files


def labelling(animal, observer, number, sd, codes, rng) -> StoredLabelling:
    marks = {}
    for side in Side:
        for code in codes:
            where = animal.sides[side][code] + rng.normal(0, sd, 3)
            where += [0, 0, 0.5] if (observer, code) == ("CD", "OS") else 0
            about = Provenance(How.MESH, f"2026-11-{10 + number}T10:00:00+00:00", observer)
            marks[point_key(side, code)] = Landmark(tuple(where.tolist()), provenance=about)
    return StoredLabelling(observer, number, marks, blind=(observer, number) != ("AB", 1))
