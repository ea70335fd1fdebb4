"""The search: the paper's answers, the laws of backward elimination, stopping and resuming."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from study_cases import cohort

from gp_core import CODES, EXTERNAL, PROBE, TRAINING, GpError, Specimen
from gp_core.registration.jrmpc import DEFAULTS, JrmpcSettings
from gp_core.study.backward_elimination import Codes, Elimination, SearchProgress, Ticker, probe_curve
from gp_core.study.checkpoint import Checkpoint
from gp_core.study.leave_one_out import folds_of, leave_one_out
from gp_core.study.parallel import open_executor
from gp_core.study.subset_search import SearchReport, problem_of, search_features

SMALL = ("CA", "CB", "CL", "LLI", "MN", "OS", "RWA", "RWP")
QUICK = JrmpcSettings(max_iterations=15)


@dataclass(frozen=True)
class Weighed:
    """A problem whose answer is known: features cost their weight, and below six it costs to drop any."""

    weights: tuple[tuple[str, float], ...]
    n_sides: int = 2

    def scorer(self, training: Codes) -> Callable[[Sequence[Codes]], list[float]]:
        weights = dict(self.weights)
        base = sum(weights.get(code, 1.0) for code in training) + 50.0 * max(0, 6 - len(training))
        return lambda probes: [base + 0.1 * sum(weights.get(c, 1.0) for c in probe) for probe in probes]


@dataclass(frozen=True)
class Indifferent:
    """A problem to which all features are one."""

    n_sides: int = 2

    def scorer(self, training: Codes) -> Callable[[Sequence[Codes]], list[float]]:
        return lambda probes: [1.0] * len(probes)


def test_of_equals_the_fewest_touches_are_taken() -> None:
    (step,) = Elimination(Indifferent(), None, Checkpoint(None, "key"), Ticker()).run(SMALL, len(SMALL))
    assert len(step.probe_curve) > 1
    assert len(step.probe) == 3


def eliminate(problem: Weighed, fewest: int = 3, path: Path | None = None) -> Elimination:
    return Elimination(problem, None, Checkpoint(path, "key"), Ticker())


def test_best_probe_features_are_the_papers(real_specimens: list[Specimen]) -> None:
    curve = probe_curve(problem_of(real_specimens, "jrmpc", DEFAULTS), TRAINING)
    assert [step.n for step in curve] == [10, 9, 8, 7, 6, 5, 4, 3]
    assert min(step.e_t for step in curve) == pytest.approx(19.55, abs=0.02)
    six = next(step for step in curve if step.n == 6)
    assert set(six.features) == set(PROBE)
    assert six.e_t == pytest.approx(19.56, abs=0.02)


@pytest.mark.slow
def test_last_drop_before_the_minimum_is_the_papers(real_specimens: list[Specimen]) -> None:
    start = [code for code in CODES if code not in ("CC", "FPP", "RWM")]
    with ThreadPoolExecutor(2) as threads:
        report = search_features(real_specimens, training=start, fewest_training=16, executor=threads)
    assert report.training[0].e_t == pytest.approx(20.05, abs=0.02)
    assert report.best.dropped == "DTL"
    assert set(report.best.features) == set(TRAINING)
    assert report.best.e_t == pytest.approx(19.55, abs=0.02)


def test_heaviest_features_are_dropped_first() -> None:
    weights = (("CC", 9.0), ("IN", 8.0), ("ZL", 7.0))
    steps = eliminate(Weighed(weights)).run(CODES, 3)
    assert [step.dropped for step in steps[:4]] == [None, "CC", "IN", "ZL"]
    assert [step.n for step in steps] == list(range(20, 2, -1))
    assert min(steps, key=lambda step: step.e_t).n == 6
    curve = steps[0].probe_curve
    assert curve[0].features == EXTERNAL
    assert set(curve[1].features) == set(EXTERNAL) - {"IN"}
    assert steps[0].probe == curve[-1].features


def test_each_step_drops_one_of_the_step_before() -> None:
    steps = eliminate(Weighed(())).run(CODES, 3)
    for before, after in pairwise(steps):
        assert set(before.features) - set(after.features) == {after.dropped}
        assert set(after.probe_curve[0].features) == {c for c in after.features if c in EXTERNAL}
    assert len(steps[-1].probe) == 3  # three external ones always stay


def test_score_is_that_of_leave_one_out() -> None:
    animals = cohort(4)
    report = search_features(animals, training=SMALL, fewest_training=7, settings=QUICK)
    for step in report.training:
        again = leave_one_out(animals, training=step.features, probe=step.probe, settings=QUICK)
        assert again.errors.e_t == pytest.approx(step.e_t, abs=1e-9)


def test_touched_features_scored_together_have_the_errors_of_each_alone() -> None:
    for fold in folds_of(cohort(4)):
        probes = [tuple(code for code in PROBE if code != left_out) for left_out in PROBE[:5]]
        together = fold.errors_of_each(SMALL, probes, QUICK)
        for probe, errors in zip(probes, together, strict=True):
            alone = fold.errors(SMALL, probe, QUICK)
            assert errors.e_co_mm.tolist() == alone.e_co_mm.tolist()
            assert errors.e_ma_deg.tolist() == alone.e_ma_deg.tolist()


def test_any_number_of_workers_gives_the_same() -> None:
    animals = cohort(4)
    run: dict[str, Any] = {"training": SMALL, "fewest_training": 7, "settings": QUICK}
    alone = search_features(animals, **run)
    with ThreadPoolExecutor(3) as threads, open_executor(2) as processes:
        for executor in (threads, processes):
            other = search_features(animals, executor=executor, **run)
            assert other.training == alone.training
            assert other.fits == alone.fits


def test_a_dask_cluster_gives_the_same() -> None:
    distributed = pytest.importorskip("distributed")
    animals = cohort(3)
    run: dict[str, Any] = {"training": SMALL, "fewest_training": 7, "settings": QUICK}
    alone = search_features(animals, **run)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        open_executor(scheduler=cluster.scheduler_address) as executor,
    ):
        assert executor is not None
        assert search_features(animals, executor=executor, **run).training == alone.training


class StopError(Exception):
    """What a caller raises to stop."""


def test_stopped_search_goes_on_where_it_was(tmp_path: Path) -> None:
    animals, file = cohort(4), tmp_path / "search.json"
    seen: list[SearchProgress] = []

    def search(progress: Callable[[SearchProgress], None]) -> SearchReport:
        return search_features(
            animals,
            training=SMALL,
            fewest_training=6,
            settings=QUICK,
            checkpoint=file,
            progress=progress,
        )

    def stop_at_five(progress: SearchProgress) -> None:
        if len(seen) == 5:
            raise StopError
        seen.append(progress)

    with pytest.raises(StopError):
        search(stop_at_five)
    resumed: list[SearchProgress] = []
    report = search(resumed.append)
    expected = search_features(animals, training=SMALL, fewest_training=6, settings=QUICK)
    assert report.training == expected.training
    assert report.fits == expected.fits
    assert len(resumed) == 1 + 8 + 7 - 6  # the candidate that was told last is kept too
    assert resumed[0].fits > seen[-1].fits
    assert resumed[-1].fraction == pytest.approx(1.0)
    assert resumed[-1].left == pytest.approx(0.0)


def test_progress_rises_to_the_whole() -> None:
    seen: list[SearchProgress] = []
    search_features(cohort(3), training=SMALL, fewest_training=6, settings=QUICK, progress=seen.append)
    fractions = [progress.fraction for progress in seen]
    assert fractions == sorted(fractions)
    assert all(progress.left >= 0 for progress in seen)
    assert "training features" in seen[0].text


def test_robust_chooses_probe_features_only() -> None:
    report = search_features(cohort(3), method="robust", training=SMALL)
    assert [step.n for step in report.training] == [8]
    assert [step.n for step in report.best.probe_curve] == [6, 5, 4, 3]
    assert "gamma" not in report.as_dict()["settings"]


def test_report_as_json() -> None:
    report = search_features(cohort(3), training=SMALL, fewest_training=7, settings=QUICK)
    content = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    assert content.keys() == {"training", "best", "fits", "seconds", "settings"}
    first, second = content["training"]
    assert first.keys() == {"n", "features", "dropped", "e_t", "probe", "probe_curve"}
    assert first["probe_curve"][0].keys() == {"n", "features", "e_t"}
    assert first["dropped"] is None
    assert second["dropped"] in first["features"]
    assert content["best"].keys() == {"n", "features", "probe", "e_t"}
    assert content["fits"] == sum(
        6 * (1 + sum(range(4, len([c for c in features if c in EXTERNAL]) + 1)))
        for features in [SMALL, *([c for c in SMALL if c != dropped] for dropped in SMALL)]
    )


def test_checkpoint_of_another_study_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "search.json"
    run: dict[str, Any] = {"training": SMALL, "fewest_training": 8, "checkpoint": file}
    search_features(cohort(3), settings=QUICK, **run)
    with pytest.raises(GpError, match=r"search.json: is the checkpoint of a study of other animals"):
        search_features(cohort(3, seed=1), settings=QUICK, **run)
    with pytest.raises(GpError, match="of other animals, features or settings"):
        search_features(cohort(3), **run)
    for text in ("", "[]", "{}", '{"gpCheckpoint": 1, "key": "x"}'):
        file.write_text(text)
        with pytest.raises(GpError, match=r"is not a checkpoint|is not JSON"):
            search_features(cohort(3), **run)


def test_what_cannot_be_searched_is_refused() -> None:
    animals = cohort(3)
    with pytest.raises(GpError, match="must end at 3 to 8 training features, got 9"):
        search_features(animals, training=SMALL, fewest_training=9)
    with pytest.raises(GpError, match="fewer than 3 that can be touched"):
        search_features(animals, training=["CA", "CB", "CL", "MN"])
