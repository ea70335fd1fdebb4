"""Time the study against plain NumPy in the same run, check that both agree, and show how cost grows.

Run from the top of a checkout: ``python benchmarks/study.py``. The animals are drawn from the published
atlas, so anybody can run it. "Plain" is JRMPC in NumPy, written the obvious way, one problem after the other.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "core" / "registration")]

from reference_jrmpc import reference_jrmpc  # type: ignore[import-not-found]  # noqa: E402

from gp_core import EXTERNAL, PROBE, TRAINING, Atlas, Side, Specimen  # noqa: E402
from gp_core.atlas.sampling import draw_animal  # noqa: E402
from gp_core.landmarks.features import index_of  # noqa: E402
from gp_core.pose.jrmpc_estimator import training_sides  # noqa: E402
from gp_core.registration.jrmpc import DEFAULTS, ESTIMATION, JrmpcSettings  # noqa: E402
from gp_core.study.backward_elimination import Codes, SelectionProblem  # noqa: E402
from gp_core.study.leave_one_out import Folds, folds_of  # noqa: E402
from gp_core.study.scoring import PoseErrors, angle_between_deg, jrmpc_errors  # noqa: E402
from gp_core.study.simulation import simulate_sides  # noqa: E402
from gp_core.study.subset_search import problem_of  # noqa: E402
from gp_core.study.trials import make_trial, window_arrays  # noqa: E402
from gp_core.validation import FloatArray  # noqa: E402

N_ANIMALS = 11
FULL_SEARCH = 168_652
"""Estimates of a search over all 20 features of 11 animals, both sides, as on the real sets."""

CO, CA = index_of("CO"), index_of("CA")


def main() -> None:
    """Print the tables; fail where a result differs."""
    animals = cohort(N_ANIMALS)
    print(f"{'case':<52}{'fits':>6}{'fast, ms/fit':>14}{'plain':>9}{'ratio':>7}{'off by':>9}")
    leave_one_out_case(animals)
    search_case(cohort(6))
    simulation_case(animals)
    print(f"\na full search, {FULL_SEARCH} fits, at its own sizes:", end=" ")
    full = full_search_seconds(animals)
    print(f"about {full:.0f} s on one core, {full / 2:.0f} s on two\n")
    growth()


def cohort(n: int) -> list[Specimen]:
    """Draw animals."""
    rng = np.random.default_rng(0)
    atlas = Atlas.published()
    return [draw_animal(atlas, rng=rng, name=f"D{i + 1:02}") for i in range(n)]


def leave_one_out_case(animals: Sequence[Specimen]) -> None:
    """Every side once, by both settings."""
    folds = folds_of(animals)
    for label, settings in (("estimation", ESTIMATION), ("defaults", DEFAULTS)):
        fast, fast_s = timed(partial(all_folds, Folds.errors, folds, settings), 5)
        plain, plain_s = timed(partial(all_folds, plain_fold, folds, settings), 1)
        row(f"leave-one-out, 11 animals, {label}", 22, fast_s, plain_s, off(fast, plain))


def all_folds(
    errors: Callable[[Folds, Codes, Codes, JrmpcSettings], PoseErrors],
    folds: Sequence[Folds],
    settings: JrmpcSettings,
) -> PoseErrors:
    """Return the errors of both sides with the paper's features."""
    return PoseErrors.joined([errors(fold, TRAINING, PROBE, settings) for fold in folds])


def search_case(animals: Sequence[Specimen]) -> None:
    """Run one step of the search: the six probe features, and each of them left out.

    Not down to three: so few points gather on one or two centres, which leaves their turn open, and then the
    last bit decides, in plain NumPy as well.
    """
    problems = problem_of(animals, "jrmpc", DEFAULTS), PlainProblem(tuple(folds_of(animals)), DEFAULTS)
    choices = [PROBE, *(tuple(c for c in PROBE if c != dropped) for dropped in PROBE)]
    (fast, fast_s), (plain, plain_s) = (
        timed(partial(scores, problem, choices), repeats)
        for problem, repeats in zip(problems, (3, 1), strict=True)
    )
    if np.argmin(fast[1:]) != np.argmin(plain[1:]):
        raise SystemExit("the fast search drops another feature than the plain one")
    fits = len(choices) * problems[0].n_sides
    row("search, one step, 6 animals, defaults", fits, fast_s, plain_s, float(np.abs(fast - plain).max()))


def scores(problem: SelectionProblem, choices: Sequence[Codes]) -> FloatArray:
    """Return E_T of some choices of probe features."""
    score = problem.scorer(TRAINING)
    return np.array(score(choices))


def simulation_case(animals: Sequence[Specimen]) -> None:
    """Estimate simulated sides from the labelled ones; plain NumPy does the first 20."""
    drawn = simulate_sides(animals, Side.LEFT, 1000, rng=np.random.default_rng(1))
    labelled = np.array([t.landmarks.points for t in training_sides(animals, Side.LEFT)])
    few = 20

    def fast_run() -> PoseErrors:
        touches, truths = window_arrays([make_trial(truth, PROBE) for truth in drawn])
        training = np.broadcast_to(labelled, (len(drawn), *labelled.shape))
        return jrmpc_errors(training, touches, truths, TRAINING, ESTIMATION)

    def plain_run() -> PoseErrors:
        touches, truths = window_arrays([make_trial(truth, PROBE) for truth in drawn[:few]])
        pairs = zip(touches, truths, strict=True)
        return PoseErrors.joined([plain_errors(labelled, *pair, TRAINING, ESTIMATION) for pair in pairs])

    fast, fast_s = timed(fast_run, 2)
    plain, plain_s = timed(plain_run, 1)
    first = PoseErrors(fast.e_co_mm[:few], fast.e_ma_deg[:few])
    row(
        "simulation, 11 animals, estimation",
        len(drawn),
        fast_s,
        plain_s * len(drawn) / few,
        off(first, plain),
    )


def full_search_seconds(animals: Sequence[Specimen]) -> float:
    """Time a score at some sizes on the way down, and add up all steps of the search."""
    problem = problem_of(animals, "jrmpc", DEFAULTS)
    total = 0.0
    for n in range(20, 2, -1):
        features = CODES_BY_USE[:n]
        n_external = len([code for code in features if code in EXTERNAL])
        probe = tuple(code for code in features if code in EXTERNAL)[: max(3, (n_external + 3) // 2)]
        score = problem.scorer(features)
        _, seconds = timed(partial(score, [probe] * 6), 1)
        choices = 1 + sum(range(4, n_external + 1))
        total += seconds / 6 * choices * (n + 1 if n < 20 else 1)
    return total


CODES_BY_USE = ("CL", "MN", "RWA", "OS", "OI", "RWL", "RWP", "CA", "IN", "MH", "CB", "LLI", "CO", "DTM", "ZL",
                "FPA", "DTL", "RWM", "FPP", "CC")  # fmt: skip
"""The order in which the search on the real sets keeps features."""


def growth() -> None:
    """Print how the cost of one fit grows."""
    cases: list[tuple[str, list[int], Callable[[int], float]]] = [
        ("animals", [6, 11, 22, 44], lambda n: fit_ms(n, TRAINING, 60)),
        ("training features", [6, 10, 16, 20], lambda n: fit_ms(N_ANIMALS, CODES_BY_USE[:n], 60)),
        ("iterations", [15, 30, 60, 120], lambda n: fit_ms(N_ANIMALS, TRAINING, n)),
    ]
    print("ms a fit (six touched or fewer, epsilon 0.01 so that no iteration is saved)")
    for name, sizes, cost in cases:
        cells = "".join(f"{size:>8}: {cost(size):5.2f}" for size in sizes)
        print(f"  {name:<20}{cells}")


def fit_ms(n_animals: int, features: Codes, iterations: int) -> float:
    """Return the time of one registration, ms."""
    probe = [code for code in PROBE if code in features]
    settings = JrmpcSettings(max_iterations=iterations, gamma=0.05, epsilon=1e-2)
    folds = folds_of(cohort(n_animals))
    _, seconds = timed(lambda: [fold.errors(features, probe, settings) for fold in folds], 3)
    return 1e3 * seconds / (2 * n_animals)


@dataclass(frozen=True)
class PlainProblem:
    """Leave-one-out by plain NumPy, as the elimination takes it."""

    folds: tuple[Folds, ...]
    settings: JrmpcSettings

    @property
    def n_sides(self) -> int:
        """How many sides are estimated for one score."""
        return sum(len(fold.cochlea) for fold in self.folds)

    def scorer(self, training: Codes) -> Callable[[Sequence[Codes]], list[float]]:
        """Return what gives E_T of sets of probe features."""
        return lambda probes: [
            PoseErrors.joined([plain_fold(fold, training, probe, self.settings) for fold in self.folds]).e_t
            for probe in probes
        ]


def plain_fold(fold: Folds, features: Codes, probe: Codes, settings: JrmpcSettings) -> PoseErrors:
    """Do what `Folds.errors` does, one animal after the other."""
    errors = []
    for held_out in range(len(fold.cochlea)):
        others = np.delete(fold.cochlea, held_out, axis=0)
        points = fold.window[held_out]
        touches = points[[index_of(code) for code in probe]]
        errors.append(plain_errors(others, touches, points, features, settings))
    return PoseErrors.joined(errors)


def plain_errors(
    training: FloatArray, touches: FloatArray, truth: FloatArray, features: Codes, settings: JrmpcSettings
) -> PoseErrors:
    """Register one side by plain NumPy and measure its errors."""
    rows = [index_of(code) for code in features]
    found = reference_jrmpc([*training[:, rows], touches], **asdict(settings))
    moved = [
        p @ r.T + t for p, r, t in zip([*training, truth], found.rotations, found.translations, strict=True)
    ]
    mean, true = np.mean(moved[:-1], axis=0), moved[-1]
    e_ma = angle_between_deg(true[CA] - true[CO], mean[CA] - mean[CO])
    return PoseErrors(np.array([np.linalg.norm(true[CO] - mean[CO])]), np.array([e_ma]))


def timed(run: Callable[[], Any], repeats: int) -> tuple[Any, float]:
    """Return the result and the least time of some runs after a first one, s."""
    if repeats > 1:
        run()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = run()
        times.append(time.perf_counter() - start)
    return result, min(times)


def off(a: PoseErrors, b: PoseErrors) -> float:
    """Largest difference of the errors, mm and degrees."""
    return float(max(np.abs(a.e_co_mm - b.e_co_mm).max(), np.abs(a.e_ma_deg - b.e_ma_deg).max()))


def row(label: str, fits: int, fast_s: float, plain_s: float, difference: float) -> None:
    """Print one row; fail where the answers differ by more than 1e-6."""
    fast, plain = 1e3 * fast_s / fits, 1e3 * plain_s / fits
    print(f"{label:<52}{fits:>6}{fast:>14.3f}{plain:>9.1f}{plain / fast:>7.0f}{difference:>9.0e}")
    if not difference < 1e-6:
        raise SystemExit(f"{label}: the fast answer is off by {difference:.1e}")


if __name__ == "__main__":
    main()
