"""Compare JRMPC with other ways to compute it, and the nested search with itself one problem at a time.

Run from the top of a checkout: ``python benchmarks/jrmpc_peers.py [--search]``. All take turns in one
process; CPU seconds, the median of the rounds. The peers: our own compiled code one problem at a time, as it
was before problems were computed in the lanes of a vector; NumPy that is batched with care, written here; and
the package ``jrmpc`` of PyPI, where it is installed. Another processor is tried by Numba's own settings:
``NUMBA_CPU_NAME=haswell NUMBA_CPU_FEATURES=+avx2,+fma,+bmi,+bmi2`` for one with AVX2.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from jrmpc import SIZES, study_problems  # noqa: E402 - the benchmark of that name
from study import cohort  # noqa: E402

from gp_core import PROBE  # noqa: E402
from gp_core.registration import jrmpc as ours  # noqa: E402
from gp_core.registration import jrmpc_kernels  # noqa: E402
from gp_core.registration.jrmpc import DEFAULTS, ESTIMATION, JrmpcSettings, jrmpc_batch  # noqa: E402
from gp_core.study.leave_one_out import Folds  # noqa: E402
from gp_core.study.nested_search import NestedReport, nested_search  # noqa: E402
from gp_core.validation import FloatArray  # noqa: E402

ROUNDS = 5


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--search", action="store_true", help="the nested search too, some minutes")
    options = parser.parse_args()
    problems = study_problems(np.random.default_rng(0))
    print(f"{'22 problems of the study':<28}{'ms a problem':>14}{'times ours':>12}{'off by':>10}")
    for title, settings in (("60 iterations", ESTIMATION), ("100 iterations, defaults", DEFAULTS)):
        print(title)
        compare(problems, settings)
    if options.search:
        compare_search()


def compare(problems: Sequence[list[FloatArray]], settings: JrmpcSettings) -> None:
    """Print a row for each way to compute the same problems."""
    packed = np.array([np.concatenate(sets) for sets in problems])

    def one_at_a_time() -> FloatArray:
        with lanes_unused():
            return jrmpc_batch(packed, SIZES, settings).rotations

    ways: dict[str, Callable[[], FloatArray]] = {
        "eight at a time": lambda: jrmpc_batch(packed, SIZES, settings).rotations,
        "one at a time": one_at_a_time,
        "batched NumPy": lambda: batched(problems, settings),
    }
    if (package := package_jrmpc()) is not None:
        ways["package jrmpc"] = lambda: np.array([package(sets, settings) for sets in problems])
    answers, seconds = taking_turns(ways)
    first, best = next(iter(answers.values())), next(iter(seconds.values()))
    for name, answer in answers.items():
        ms, off = 1e3 * seconds[name] / len(problems), float(np.abs(answer - first).max())
        print(f"  {name:<26}{ms:>14.3f}{seconds[name] / best:>12.2f}{off:>10.0e}", flush=True)


def taking_turns(
    ways: Mapping[str, Callable[[], Any]], rounds: int = ROUNDS
) -> tuple[dict[str, Any], dict[str, float]]:
    """Return what each way gives, and the median of its CPU seconds."""
    answers = {name: way() for name, way in ways.items()}  # compiled, loaded
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(rounds):
        for name, way in ways.items():
            begun = time.process_time()
            way()
            seconds[name].append(time.process_time() - begun)
    return answers, {name: float(np.median(taken)) for name, taken in seconds.items()}


@contextmanager
def lanes_unused() -> Iterator[None]:
    """Compute one problem at a time."""
    kept, ours._batch_kernels = ours._batch_kernels, lambda: jrmpc_kernels
    try:
        yield
    finally:
        ours._batch_kernels = kept


def package_jrmpc() -> Callable[[Sequence[FloatArray], JrmpcSettings], FloatArray] | None:
    """Return the package's function, called as ours; None where it is not installed."""
    here = sys.path[:]
    mine = sys.modules.pop("jrmpc")
    sys.path[:] = [place for place in here if place != str(ROOT / "benchmarks")]
    try:
        from jrmpc.numpy import jrmpc as theirs  # type: ignore[import-not-found]
    except ImportError:
        return None
    finally:
        sys.path[:], sys.modules["jrmpc"] = here, mine

    def run(sets: Sequence[FloatArray], settings: JrmpcSettings) -> FloatArray:
        centres = np.stack([points.mean(axis=0) for points in sets], axis=1)
        how = {
            "max_num_iter": settings.max_iterations,
            "gamma": settings.gamma,
            "epsilon": settings.epsilon,
            "Q_factor": 1.0,
        }
        return np.asarray(theirs([points.T for points in sets], centres, **how).R)

    return run


def batched(problems: Sequence[list[FloatArray]], settings: JrmpcSettings) -> FloatArray:
    """Run all problems at once in NumPy: sets padded to one size, and products of matrices."""
    n_sets, longest = len(problems[0]), max(SIZES)
    points = np.zeros((len(problems), n_sets, longest, 3))
    weights = np.zeros((n_sets, longest, 1))
    for j, size in enumerate(SIZES):
        weights[j, :size] = 1.0
        points[:, j, :size] = [sets[j] for sets in problems]
    counts = np.array(SIZES)[:, None]
    x = points.sum(axis=2) / counts
    t = x.mean(axis=1)[:, None] - x
    moved = points + t[:, :, None]
    real = np.concatenate([moved[:, weights[..., 0] > 0], x], axis=1)
    spread = ((real.max(axis=1) - real.min(axis=1)) ** 2).sum(axis=1)
    q = np.repeat(1 / spread[:, None], n_sets, axis=1)
    gamma = 1 / n_sets if settings.gamma is None else settings.gamma
    prior = 1 / (n_sets * (gamma + 1))
    beta = (gamma * q.mean(axis=1) / (2 * (gamma + 1)))[:, None, None, None]
    for _ in range(settings.max_iterations):
        a = prior * (q**1.5)[:, None, None] * np.exp(-0.5 * q[:, None, None] * squared(moved, x)) * weights
        a /= a.sum(axis=-1, keepdims=True) + beta
        total = a.sum(axis=2)
        w = np.swapaxes(points, 2, 3) @ a * q[:, None, None]
        precision = total * q[:, None]
        whole = precision.sum(axis=2)[..., None]
        mean_w, mean_x = w.sum(axis=3), precision @ x
        p = np.swapaxes(x, 1, 2)[:, None] @ np.swapaxes(w, 2, 3)
        p -= mean_x[..., :, None] * mean_w[..., None, :] / whole[..., None]
        u, _, vt = np.linalg.svd(p)
        u[..., 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
        rotations = u @ vt
        t = (mean_x - (rotations @ mean_w[..., None])[..., 0]) / whole
        moved = points @ np.swapaxes(rotations, 2, 3) + t[:, :, None]
        masses = total.sum(axis=1)
        x = (np.swapaxes(a, 2, 3) @ moved).sum(axis=1) / masses[..., None]
        spreads = (a * squared(moved, x)).sum(axis=(1, 2))
        q = 1 / (spreads / (3 * masses) + settings.epsilon)
    return rotations


def squared(moved: FloatArray, centres: FloatArray) -> FloatArray:
    """Return the squared distances of (B, M, N, 3) points and (B, K, 3) centres, (B, M, N, K)."""
    products = moved @ np.swapaxes(centres, 1, 2)[:, None]
    found: FloatArray = (moved**2).sum(axis=3, keepdims=True) + (centres**2).sum(axis=2)[:, None, None]
    found -= 2 * products
    return found


def compare_search() -> None:
    """Print what the nested search takes in lanes and one problem at a time, and that it finds the same."""
    animals = cohort(6)

    def search() -> NestedReport:
        return nested_search(animals, training=(*PROBE, "CA", "CB", "MH", "FPA"), fewest_training=9)

    nested_search(cohort(4), training=PROBE, fewest_training=6)
    ways = {"lanes": search, "before": lambda: before(search)}
    reports, seconds = taking_turns(ways, 2)
    now, then = (reports[name] for name in ways)
    same = [fold.probe for fold in now.folds] == [fold.probe for fold in then.folds]
    off = np.abs(now.errors.e_co_mm - then.errors.e_co_mm).max()
    ratio = seconds["lanes"] / seconds["before"]
    print(f"nested search, {now.fits} fits: {seconds['lanes']:.1f} s, before {seconds['before']:.1f} s")
    print(f"  ratio {ratio:.2f} (goal 0.5); same features: {same}; off by {off:.0e} mm")


def before(search: Callable[[], NestedReport]) -> NestedReport:
    """Search as before there were lanes: one problem at a time, and one set of touched features."""
    together = Folds.errors_of_each

    def each(fold: Folds, features: Any, probes: Any, settings: JrmpcSettings) -> Any:
        return [together(fold, features, [probe], settings)[0] for probe in probes]

    Folds.errors_of_each = each  # type: ignore[method-assign]
    try:
        with lanes_unused():
            return search()
    finally:
        Folds.errors_of_each = together  # type: ignore[method-assign]


if __name__ == "__main__":
    main()
