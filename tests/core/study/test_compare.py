"""The comparison: the project's claim on drawn and real animals, and the laws of a fair one."""

from __future__ import annotations

import csv
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from study_cases import cohort

from gp_core import GpError, Specimen
from gp_core.study.compare import CONDITIONS, PROBES, ComparisonReport, Condition, compare
from gp_core.study.leave_one_out import leave_one_out


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def means(report: ComparisonReport) -> dict[tuple[str, str, str], tuple[float, float]]:
    return {
        (row.probe, row.condition.label, row.method): (
            float(row.errors.e_co_mm.mean()),
            float(row.errors.e_ma_deg.mean()),
        )
        for row in report.rows
    }


@pytest.fixture(scope="module")
def drawn() -> ComparisonReport:
    return compare(repeats=1, n_animals=6, rng=rng())


def test_robust_wins_where_touches_err(drawn: ComparisonReport) -> None:
    found = means(drawn)
    for probe in ("six", "ten"):
        for condition in ("noise 0.4", "one touch 3 off"):
            jrmpc, robust = found[probe, condition, "jrmpc"], found[probe, condition, "robust"]
            assert robust[0] < 0.7 * jrmpc[0]
            assert robust[1] < 0.75 * jrmpc[1]
    assert found["six", "noise 0", "robust"][0] < 1.1 * found["six", "noise 0", "jrmpc"][0]


def test_robust_wins_on_real_animals(real_specimens: list[Specimen]) -> None:
    hard = (Condition(0.4), Condition(0.1, 3.0))
    found = means(compare(real_specimens, repeats=1, rng=rng(), probes=["six"], conditions=hard))
    for condition in ("noise 0.4", "one touch 3 off"):
        jrmpc, robust = found["six", condition, "jrmpc"], found["six", condition, "robust"]
        assert robust[0] < 0.75 * jrmpc[0]
        assert robust[1] < 0.75 * jrmpc[1]


def test_without_errors_it_is_leave_one_out() -> None:
    animals = cohort(5)
    exact = (Condition(0.0),)
    found = means(compare(animals, repeats=1, rng=rng(), probes=["six"], conditions=exact))
    for method in ("jrmpc", "robust"):
        errors = leave_one_out(animals, method=method).errors
        e_co, e_ma = found["six", "noise 0", method]
        assert e_co == pytest.approx(errors.e_co_mm.mean(), abs=1e-9)
        assert e_ma == pytest.approx(errors.e_ma_deg.mean(), abs=1e-7)


def test_every_condition_is_there_for_both(drawn: ComparisonReport) -> None:
    assert len(drawn.rows) == len(PROBES) * len(CONDITIONS) * 2 == 36
    assert all(len(row.errors.e_co_mm) == 6 * 2 for row in drawn.rows)
    assert {(row.condition.noise_mm, row.condition.mistouch_mm) for row in drawn.rows} == {
        (0.0, 0.0), (0.1, 0.0), (0.2, 0.0), (0.4, 0.0), (0.1, 1.5), (0.1, 3.0),
    }  # fmt: skip


def test_workers_do_not_change_the_answer() -> None:
    animals = cohort(3)
    cases = (Condition(0.1), Condition(0.1, 1.5))
    alone = compare(animals, repeats=3, rng=rng(), conditions=cases)
    with ThreadPoolExecutor(2) as threads:
        other = compare(animals, repeats=3, rng=rng(), conditions=cases, executor=threads)
    for a, b in zip(alone.rows, other.rows, strict=True):
        assert np.array_equal(a.errors.e_co_mm, b.errors.e_co_mm)


def test_a_summary_is_of_all_errors(drawn: ComparisonReport) -> None:
    row = drawn.rows[0]
    summary, errors = row.as_dict()["e_co_mm"], np.sort(row.errors.e_co_mm)
    assert summary["mean"] == pytest.approx(errors.mean())
    assert summary["max"] == errors[-1]
    assert np.interp(0.95 * (len(errors) - 1), range(len(errors)), errors) == pytest.approx(summary["p95"])


def test_table_and_json_hold_the_same(drawn: ComparisonReport, tmp_path: Path) -> None:
    drawn.save_csv(tmp_path / "table.csv")
    with (tmp_path / "table.csv").open() as file:
        lines = list(csv.DictReader(file))
    rows = json.loads(json.dumps(drawn.as_dict(), allow_nan=False))["rows"]
    for line, row in zip(lines, rows, strict=True):
        assert line["method"] == row["method"]
        assert float(line["e_co_mm_p95"]) == row["e_co_mm"]["p95"]
        assert float(line["e_ma_deg_max"]) == row["e_ma_deg"]["max"]


def test_what_cannot_be_compared_is_refused() -> None:
    with pytest.raises(GpError, match="repeats must be 1 or more"):
        compare(repeats=0, rng=rng())
    with pytest.raises(GpError, match="at least 3 animals, got 2"):
        compare(n_animals=2, rng=rng())
    with pytest.raises(GpError, match="at least 3 labelled animals"):
        compare(cohort(2), rng=rng())
    with pytest.raises(
        GpError, match="touched features must be one of six, ten, five at random, got 'eight'"
    ):
        compare(cohort(3), rng=rng(), probes=["eight"])
