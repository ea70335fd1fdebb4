"""Edits a specimen and prints each confirmed state, until it is killed. Run by `test_session_kill`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.document.edits import ClearPoint, LockPoints, MarkUnseen, PlacePoint, SwapPoints, SwapSides
from gp_labeler.document.opening import new_specimen
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_edits import SetNotes, SetThreshold
from gp_labeler.document.specimen_json import document_of
from gp_labeler.document.state import How, Provenance

CODES = ("CA", "CB", "RWA", "RWP", "IN", "ZL", "OS", "MN")


def random_edit(rng):
    side, code = rng.choice(list(Side)), str(rng.choice(CODES))
    place = PlacePoint(side, code, tuple(rng.normal(size=3) * 10), Provenance(How.MESH, "now", "AB"))
    others = (
        ClearPoint(side, code),
        MarkUnseen(side, code),
        SwapPoints(side, code, str(rng.choice(CODES))),
        SwapSides(),
        LockPoints(((side, code),), bool(rng.integers(2))),
        SetThreshold(float(rng.normal())),
        SetNotes("n" * int(rng.integers(3000))),
    )
    return place if rng.random() < 0.6 else others[rng.integers(len(others))]


def main(folder: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    document = SpecimenDocument(new_specimen(folder / "state", specimen="GP-014"), author="AB")
    while True:
        chance = rng.random()
        try:
            if chance < 0.05:
                document.save(folder / "GP-014")
            elif chance < 0.15:
                document.undo()
            elif chance < 0.2:
                document.redo()
            else:
                document.do(random_edit(rng))
        except GpError:
            continue
        sys.stdout.write(json.dumps(document_of(document.state), sort_keys=True) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
