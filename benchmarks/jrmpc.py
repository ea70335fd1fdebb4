"""Time JRMPC against plain NumPy in the same run, and check that both give the same answer.

Run from the top of a checkout: ``python benchmarks/jrmpc.py``. The problems are made here, as large as those
of the study (10 sets of 16 points and one of 6) and as four scans of one surface (1200 points, 580 centres).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "core" / "registration")]

from reference_jrmpc import reference_jrmpc  # noqa: E402

from gp_core.registration.jrmpc import DEFAULTS, ESTIMATION, JrmpcSettings, jrmpc, jrmpc_batch  # noqa: E402
from gp_core.validation import FloatArray  # noqa: E402

SIZES = [16] * 10 + [6]
N_PROBLEMS = 22
N_SHOWN = 100  # reference iterations of the large case are scaled up from these


def main() -> None:
    """Print the table; fail where a result differs."""
    problems = study_problems(np.random.default_rng(0))
    single_cold(problems)
    print(f"{'case':<44}{'compiled':>12}{'plain NumPy':>14}{'ratio':>8}{'off by':>10}")
    for label, settings in (
        ("60 iterations, gamma 0.05", ESTIMATION),
        ("100 iterations, defaults", DEFAULTS),
    ):
        small_case(label, problems, settings)
    large_case(np.random.default_rng(1))


def single_cold(problems: Sequence[list[FloatArray]]) -> None:
    """First call of a process that has the kernels in the cache, then first call on another problem."""
    start = time.perf_counter()
    jrmpc([points[:5] for points in problems[0]])
    print(f"first call in this process, numba and cached kernels loaded: {time.perf_counter() - start:.2f} s")
    start = time.perf_counter()
    jrmpc(problems[1])
    print(f"first call on a new problem after that: {1e3 * (time.perf_counter() - start):.1f} ms\n")


def study_problems(rng: np.random.Generator) -> list[list[FloatArray]]:
    """Animals of one shape, each gently turned; the last set knows six points only."""
    problems = []
    for _ in range(N_PROBLEMS):
        shape = rng.normal(size=(16, 3)) * [4.0, 3.0, 2.0]
        problems.append([(shape + 0.2 * rng.normal(size=shape.shape))[:n] @ turn(rng, 0.2) for n in SIZES])
    return problems


def small_case(label: str, problems: Sequence[list[FloatArray]], settings: JrmpcSettings) -> None:
    """Time a batch and single calls, each per problem."""
    packed = [np.concatenate(sets) for sets in problems]
    options = {
        "max_iterations": settings.max_iterations,
        "gamma": settings.gamma,
        "epsilon": settings.epsilon,
    }
    batch, batch_s = timed(lambda: jrmpc_batch(packed, SIZES, settings), 5)
    single, single_s = timed(lambda: [jrmpc(sets, **options) for sets in problems], 3)
    plain, plain_s = timed(lambda: [reference_jrmpc(sets, **options) for sets in problems], 1)
    off_batch = max(distance(batch.rotations[b], plain[b].rotations) for b in range(N_PROBLEMS))
    off_single = max(distance(s.rotations, p.rotations) for s, p in zip(single, plain, strict=True))
    row(f"study, {label}, batch of 22", batch_s / N_PROBLEMS, plain_s / N_PROBLEMS, off_batch)
    row(f"study, {label}, single", single_s / N_PROBLEMS, plain_s / N_PROBLEMS, off_single)


def large_case(rng: np.random.Generator) -> None:
    """Four views of a bumpy surface; the reference runs fewer iterations and is scaled up."""
    directions = rng.normal(size=(580, 3))
    shape = surface(directions)
    views = [
        (surface(rng.normal(size=(1200, 3))) + 0.01 * rng.normal(size=(1200, 3))) @ turn(rng, 0.3)
        for _ in range(4)
    ]
    options: dict[str, Any] = {"gamma": 0.1, "epsilon": 1e-6}
    few = 5
    fast_few = jrmpc(views, shape, max_iterations=few, **options)
    plain, plain_s = timed(lambda: reference_jrmpc(views, shape, max_iterations=few, **options), 1)
    _, fast_s = timed(lambda: jrmpc(views, shape, max_iterations=N_SHOWN, **options), 3)
    off = max(distance(fast_few.rotations, plain.rotations), distance(fast_few.centres, plain.centres))
    row("4 x 1200 points, 580 centres, 100 iterations", fast_s, plain_s * N_SHOWN / few, off)


def surface(directions: FloatArray) -> FloatArray:
    """Points of an ellipsoid with bumps, in these directions."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    bumps = 1 + 0.2 * np.sin(5 * unit[:, :1]) * np.cos(4 * unit[:, 1:2])
    scaled: FloatArray = unit * bumps * [1.0, 0.8, 0.6]
    return scaled


def turn(rng: np.random.Generator, largest_angle: float) -> FloatArray:
    """Rotation by up to `largest_angle` (Cayley's formula)."""
    half = rng.uniform(-1, 1, 3) * np.tan(largest_angle / 2) / np.sqrt(3)
    cross = np.cross(np.eye(3), half)
    rotation: FloatArray = np.linalg.solve(np.eye(3) - cross, np.eye(3) + cross)
    return rotation


def timed(run: Callable[[], Any], repeats: int) -> tuple[Any, float]:
    """Return the result and the least time of some runs, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = run()
        times.append(time.perf_counter() - start)
    return result, min(times)


def distance(a: FloatArray, b: FloatArray) -> float:
    """Largest difference."""
    return float(np.abs(a - b).max())


def row(label: str, fast_s: float, plain_s: float, off: float) -> None:
    """Print one row; fail where the answers differ by more than 1e-6."""
    print(f"{label:<44}{1e3 * fast_s:>9.2f} ms{1e3 * plain_s:>11.1f} ms{plain_s / fast_s:>8.0f}{off:>10.0e}")
    if not off < 1e-6:
        raise SystemExit(f"{label}: the compiled answer is off by {off:.1e}")


if __name__ == "__main__":
    main()
