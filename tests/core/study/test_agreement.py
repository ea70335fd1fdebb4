"""Dahlberg, technical error, intraclass correlation, offsets and ANOVA against references and known truth."""

from __future__ import annotations

import numpy as np
import pytest

from gp_core.errors import GpError
from gp_core.study.agreement import (
    intraclass_correlation,
    offset_tests,
    procrustes_anova,
    summarise_errors,
)

SHROUT_FLEISS = np.array(
    [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]], dtype=float
)
"""Table 2 of their paper: six targets by four judges."""


def test_the_published_example_of_the_intraclass_correlation() -> None:
    found = intraclass_correlation(SHROUT_FLEISS)
    assert (round(found.icc2, 2), round(found.icc3, 2)) == (0.29, 0.71)
    np.testing.assert_allclose(found.icc2_95, (0.02, 0.76), atol=0.005)
    np.testing.assert_allclose(found.icc3_95, (0.34, 0.95), atol=0.005)


@pytest.mark.parametrize(("n", "k", "seed"), [(5, 2, 0), (8, 3, 1), (30, 2, 2), (12, 5, 3)])
def test_intraclass_correlations_are_those_of_pingouin(n: int, k: int, seed: int) -> None:
    pingouin = pytest.importorskip("pingouin")
    pandas = pytest.importorskip("pandas")
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(n, 1)) + 0.5 * rng.normal(size=(1, k)) + 0.4 * rng.normal(size=(n, k))
    rows = [{"target": i, "rater": j, "score": values[i, j]} for i in range(n) for j in range(k)]
    table = pingouin.intraclass_corr(pandas.DataFrame(rows), "target", "rater", "score").round(9)
    of = {str(row["Type"]).replace("(A,1)", "2").replace("(C,1)", "3"): row for _, row in table.iterrows()}
    interval = next(name for name in table.columns if "95" in name)
    found = intraclass_correlation(values)
    for name in ("icc2", "icc3"):
        row = of[name.upper()]
        assert getattr(found, name) == pytest.approx(row["ICC"], abs=1e-8)
        np.testing.assert_allclose(
            getattr(found, f"{name}_95"), row[interval], atol=0.0051
        )  # it rounds these


def test_coordinates_of_one_rating_each_are_pooled() -> None:
    rng = np.random.default_rng(5)
    values = rng.normal(size=(10, 1, 1)) + 0.5 * rng.normal(size=(10, 3, 1))
    alone = intraclass_correlation(values[..., 0])
    thrice = intraclass_correlation(np.repeat(values, 3, axis=2), independent=1)
    np.testing.assert_allclose([thrice.icc2, *thrice.icc3_95], [alone.icc2, *alone.icc3_95])
    with pytest.raises(GpError, match="two targets or more by two raters or more"):
        intraclass_correlation(values[:, :1])


def test_errors_of_known_size_are_found() -> None:
    rng = np.random.default_rng(1)
    pairs = [rng.normal(10, 5, 3) + rng.normal(0, 0.1, (2, 3)) for _ in range(2000)]
    found = summarise_errors(pairs)
    assert found is not None
    assert found.tem_mm == pytest.approx(found.dahlberg_mm, rel=1e-12), "with two labels a point"
    assert found.sd_mm == pytest.approx(0.1, rel=0.03)
    assert found.tem_95_mm[0] < 0.1 * np.sqrt(3) < found.tem_95_mm[1]
    assert found.mean_mm == pytest.approx(0.1 * np.sqrt(2) * 2 * np.sqrt(2 / np.pi), rel=0.03)
    many = summarise_errors([rng.normal(0, 0.1, (4, 3)) for _ in range(500)])
    assert many is not None
    assert (many.n_pairs, many.sd_mm) == (3000, pytest.approx(0.1, rel=0.03))
    assert summarise_errors([np.zeros((1, 3))]) is None


def test_the_interval_of_the_technical_error_holds_the_truth() -> None:
    rng = np.random.default_rng(2)
    held = []
    for _ in range(400):
        found = summarise_errors([rng.normal(0, 0.1, (2, 3)) for _ in range(6)])
        assert found is not None
        held.append(found.tem_95_mm[0] < 0.1 * np.sqrt(3) < found.tem_95_mm[1])
    assert 0.92 < np.mean(held) < 0.98


def test_no_offset_is_called_one_as_rarely_as_it_says() -> None:
    rng = np.random.default_rng(3)
    called = []
    for _ in range(300):
        features = [{f"GP{i}": rng.normal(0, 0.1, (2, 3)) for i in range(7)} for _ in range(5)]
        called.append(min(test.p_corrected for test in offset_tests(features, rng)) <= 0.05)
    assert np.mean(called) < 0.08


def test_an_offset_is_found_and_no_p_is_smaller_than_it_can_be() -> None:
    rng = np.random.default_rng(4)
    features = [{f"GP{i}": rng.normal(0, 0.1, (2, 3)) for i in range(6)} for _ in range(19)]
    features[7] = {name: values + np.array([0, 0, 0.4]) for name, values in features[7].items()}
    found = offset_tests(features, rng)
    np.testing.assert_allclose(found[7].mean, [0, 0, 0.4], atol=0.1)
    assert found[7].p == found[7].p_corrected == 2 / 2**6
    assert min(test.p_corrected for i, test in enumerate(found) if i != 7) > 0.05
    many = {f"GP{i}": rng.normal(0.1, 0.1, (1, 3)) for i in range(20)}
    assert 0 < offset_tests([many], rng, 2000)[0].p < 0.01
    assert offset_tests([{}], rng) == []


def _shapes(rng: np.random.Generator, observer_mm: float) -> tuple[np.ndarray, list[str], list[str]]:
    individuals, observers, shapes = [], [], []
    bias = {name: rng.normal(0, observer_mm, (6, 3)) for name in "AB"}
    for i in range(5):
        shape = rng.normal(0, 1, (6, 3))
        for observer in "AB":
            for _ in range(2):
                individuals.append(f"GP{i}")
                observers.append(observer)
                shapes.append(shape + bias[observer] + rng.normal(0, 0.1, (6, 3)))
    return np.array(shapes), individuals, observers


def test_sums_of_squares_are_those_of_statsmodels() -> None:
    ols = pytest.importorskip("statsmodels.formula.api").ols
    anova_lm = pytest.importorskip("statsmodels.stats.anova").anova_lm
    pandas = pytest.importorskip("pandas")
    shapes, individuals, observers = _shapes(np.random.default_rng(6), 0.2)
    keep = [i for i in range(len(shapes)) if i not in (3, 8)]  # not balanced
    shapes, individuals, observers = (
        shapes[keep], [individuals[i] for i in keep], [observers[i] for i in keep]
    )  # fmt: skip
    rows, _ = procrustes_anova(shapes, individuals, observers)
    expected = np.zeros(4)
    for y in shapes.reshape(len(shapes), -1).T:
        table = pandas.DataFrame({"y": y, "individual": individuals, "observer": observers})
        expected += anova_lm(ols("y ~ C(individual) * C(observer)", table).fit(), typ=1)["sum_sq"].to_numpy()
    np.testing.assert_allclose([row.sum_of_squares for row in rows], expected, rtol=1e-9)
    assert [row.freedom for row in rows] == [4 * 12, 12, 4 * 12, 8 * 12]


def test_observers_that_differ_are_told_from_observers_that_do_not() -> None:
    rng = np.random.default_rng(7)
    p = {}
    for observer_mm in (0.0, 0.3):
        rows, repeatability = procrustes_anova(*_shapes(rng, observer_mm))
        p[observer_mm] = {row.source: row.p for row in rows}["observer"]
        assert repeatability is not None
        assert 0.8 < repeatability < 1
    assert p[0.3] < 1e-3 < p[0.0]
