"""The table of distances: the published one, and its laws."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from study_cases import cohort, moved

from gp_core import CODES, GpError, Side, Specimen
from gp_core.landmarks.sets import LandmarkSet
from gp_core.study.distances import distances


def test_real_sets_give_the_published_table(shared_data: Path, real_specimens: list[Specimen]) -> None:
    table = distances(real_specimens)
    with (shared_data / "fig2_distances.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 190
    for row in rows:
        i, j = CODES.index(row["feature_a"]), CODES.index(row["feature_b"])
        for text, value in ((row["mean_mm"], table.mean[i, j]), (row["sd_mm"], table.sd[i, j])):
            decimals = len(text.partition(".")[2])
            assert round(float(value), decimals) == float(text), row


def test_spread_is_that_of_a_sample() -> None:
    animals = cohort(4)
    table = distances(animals)
    lengths = [np.linalg.norm(s["CA"] - s["MN"]) for a in animals for s in a.sides.values()]
    i, j = CODES.index("CA"), CODES.index("MN")
    assert table.mean[i, j] == pytest.approx(np.mean(lengths), abs=1e-12)
    assert table.sd[i, j] == pytest.approx(np.std(lengths, ddof=1), abs=1e-12)
    assert table.counts[i, j] == table.n_sides == 8


def test_where_an_animal_lies_does_not_count() -> None:
    animals = cohort(3)
    rng = np.random.default_rng(1)
    elsewhere = [moved(animal, rng) for animal in animals]
    table, other = distances(animals), distances(elsewhere)
    np.testing.assert_allclose(table.mean, other.mean, atol=1e-10)
    np.testing.assert_allclose(table.sd, other.sd, atol=1e-10)


def test_missing_features_count_where_they_are() -> None:
    animals = cohort(3)
    first = animals[0].side("L").with_point("ZL", None)
    table = distances([Specimen("D01", {Side.LEFT: first}), *animals[1:]])
    zl, ca, cb = (CODES.index(code) for code in ("ZL", "CA", "CB"))
    assert table.counts[zl, ca] == 4
    assert table.counts[cb, ca] == 5
    only = distances([Specimen("D01", {Side.LEFT: first})])
    assert np.isnan(only.mean[zl, ca])
    assert np.isnan(only.sd[cb, ca])
    assert {"ZL"}.isdisjoint(only.typical_sd())


def test_table_is_written_to_the_last_bit(tmp_path: Path) -> None:
    table = distances(cohort(2))
    table.save_csv(tmp_path / "table.csv")
    with (tmp_path / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 190
    for row in rows:
        i, j = CODES.index(row["feature_a"]), CODES.index(row["feature_b"])
        assert float(row["mean_mm"]) == table.mean[i, j]
        assert float(row["sd_mm"]) == table.sd[i, j]


def test_no_sides_are_refused() -> None:
    with pytest.raises(GpError, match="no labelled sides"):
        distances([])
    with pytest.raises(GpError, match="no labelled sides"):
        distances([Specimen("empty", {})])


def test_an_empty_side_gives_an_empty_table() -> None:
    table = distances([Specimen("blank", {Side.LEFT: LandmarkSet.empty("L")})])
    assert table.counts.max() == 0
    assert table.typical_sd() == {}
