"""Commands on animals that were labelled several times: kept apart by check, one animal to a fit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from gp_core import Atlas, LandmarkSet
from gp_core.atlas.sampling import draw_animal
from gp_core.cli.entry import main
from gp_core.io import landmark_file_name, write_markups
from gp_core.landmarks.provenance import LabelProvenance


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three animals by two observers; CD has OS of GP1 3 mm off, and says that it was looked at again."""
    place, rng = tmp_path_factory.mktemp("labelled"), np.random.default_rng(3)
    for name in ("GP0", "GP1", "GP2"):
        animal = draw_animal(Atlas.published(), rng=rng, name=name, tilt_deg=10)
        for observer in ("AB", "CD"):
            for side, drawn in animal.sides.items():
                points = drawn.points + 0.05 * rng.standard_normal(drawn.points.shape)
                marks = LandmarkSet(points, side, observer=observer)
                if (name, observer, side.value) == ("GP1", "CD", "L"):
                    marks = marks.with_point("OS", marks["OS"] + [0, 3, 0])
                    marks = marks.with_provenance({"OS": LabelProvenance(checked_by="CD")})
                file = place / landmark_file_name(name, side, observer=observer, round_=1)
                write_markups(file, marks, specimen=name)
    return place


def test_check_judges_each_labelling_and_says_who_looked_again(folder: Path, tmp_path: Path, capsys) -> None:
    assert main(["check", str(folder), "--json", str(tmp_path / "check.json")]) == 1, "it silences nothing"
    said = capsys.readouterr().out
    assert "GP1 (AB, round 1): all labels placed, none doubtful" in said
    assert "from the position that the atlas predicts (11 SD). Checked by CD." in said
    assert "Look at OS again" not in said
    found = json.loads((tmp_path / "check.json").read_text())
    assert [(f["landmarks"], f["checked_by"]) for f in found["GP1 (CD, round 1)"]] == [(["OS"], "CD")]
    assert main(["check", str(folder), "--observer", "ab"]) == 0


def test_an_animal_of_two_observers_is_one_to_a_fit(folder: Path, tmp_path: Path, capsys, caplog) -> None:
    assert main(["fit", str(folder), "-o", str(tmp_path / "atlas.json")]) == 0
    assert "Atlas of 3 animals, 6 sides" in capsys.readouterr().out
    assert "GP1: labelled 2 times, the mean is taken (AB, round 1; CD, round 1)" in caplog.text
    caplog.clear()
    assert main(["fit", str(folder), "-o", str(tmp_path / "one.json"), "--observer", "AB"]) == 0
    assert "the mean" not in caplog.text
    capsys.readouterr()
    assert main(["fit", str(folder), "-o", str(tmp_path / "no.json"), "--round", "2"]) == 2
    assert "no labels of round 2 are among the files. There are: AB, round 1" in capsys.readouterr().err
