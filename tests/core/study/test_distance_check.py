"""Distances of one labelled side beside the published ones."""

from __future__ import annotations

import json

import numpy as np
import pytest

from gp_core import Atlas, LandmarkSet, check_distances
from gp_core.atlas.published import published_distances
from gp_core.cli import main
from gp_core.io import write_markups
from gp_core.landmarks.features import CODES


@pytest.fixture(scope="module")
def mean_animal() -> LandmarkSet:
    atlas = Atlas.published()
    return LandmarkSet.from_mapping({code: atlas[code] for code in atlas.codes}, "L")


def test_the_mean_animal_agrees_with_the_table(mean_animal):
    check = check_distances(mean_animal)
    assert len(check.pairs) == 190
    assert check.disagreeing == ()
    mean, sd = published_distances()
    pair = check.pairs[0]
    assert (pair.feature_a, pair.feature_b) == (CODES[1], CODES[0])
    assert (pair.mean_mm, pair.sd_mm) == (mean[1, 0], sd[1, 0])


def test_a_landmark_that_was_moved_is_the_suspect_of_its_distances(mean_animal):
    moved = mean_animal.with_point("OS", mean_animal["OS"] + np.array([0.0, 0.0, 3.0]))
    check = check_distances(moved)
    assert check.disagreeing
    for pair in check.disagreeing:
        assert "OS" in (pair.feature_a, pair.feature_b)
        assert check.suspect(pair) == "OS"
        longer = pair.measured_mm > pair.mean_mm
        assert pair.text.endswith("longer" if longer else "shorter")
    sizes = [abs(pair.deviation_sd) for pair in check.disagreeing]
    assert sizes == sorted(sizes, reverse=True)


def test_what_is_not_placed_is_not_judged():
    check = check_distances(LandmarkSet.from_mapping({"CA": [0, 0, 0], "CB": [6, 0, 0]}, "R"))
    measured = [pair for pair in check.pairs if pair.measured_mm is not None]
    assert [pair.text for pair in measured] == ["CB-CA 6.00 mm, published 4.7 ± 0.13 mm: longer"]
    assert {pair.deviation_sd for pair in check.pairs} - {measured[0].deviation_sd} == {None}


def test_the_command_lists_them(tmp_path, capsys, mean_animal):
    moved = mean_animal.with_point("MH", mean_animal["MH"] + np.array([0.0, 2.0, 0.0]))
    for name, landmarks in (("GP01", mean_animal), ("GP02", moved)):
        write_markups(tmp_path / f"{name}_L.mrk.json", landmarks, specimen=name)
    assert main(["distances", str(tmp_path), "--check", "--json", str(tmp_path / "d.json")]) == 0
    printed = capsys.readouterr().out
    assert "  GP01 L\n    none\n" in printed
    assert "MH" in printed.partition("GP02 L")[2]
    sides = json.loads((tmp_path / "d.json").read_text(encoding="utf-8"))["sides"]
    assert [side["specimen"] for side in sides] == ["GP01", "GP02"]
    assert sum(pair["disagrees"] for pair in sides[1]["pairs"]) > 0
