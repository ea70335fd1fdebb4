"""How fast one estimate is, against plain NumPy JRMPC in the same run, and how fast the command answers.

Run from the project's root: python benchmarks/estimate.py
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

_ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [
    str(_ROOT),
    str(_ROOT / "tests" / "core" / "registration"),
    str(_ROOT / "tests" / "core" / "atlas"),
]

from atlas_cases import draw_specimens  # noqa: E402
from reference_jrmpc import reference_jrmpc  # noqa: E402

import gp_core  # noqa: E402
from gp_core.atlas.jrmpc_pose import training_sides  # noqa: E402


def _best(run: Callable[[], object], repeats: int) -> float:
    """Fastest of several runs, ms: the one that the rest of the machine disturbed least."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return 1000 * min(times)


def main() -> None:
    """Print the table."""
    atlas = gp_core.Atlas.published()
    rng = np.random.default_rng(0)
    animals = draw_specimens(atlas, 12, rng)
    probe = animals.pop().side("L")
    touches = {code: p + 0.1 * rng.normal(size=3) for code, p in probe.as_mapping(gp_core.PROBE).items()}
    sets = [side.landmarks.array(gp_core.TRAINING) for side in training_sides(animals, gp_core.Side.LEFT)]
    sets.append(np.array(list(touches.values())))

    robust = _best(lambda: gp_core.estimate_pose(touches, "L", atlas), 300)
    gp_core.estimate_pose(touches, "L", method="jrmpc", specimens=animals)
    joint = _best(lambda: gp_core.estimate_pose(touches, "L", method="jrmpc", specimens=animals), 50)
    plain = _best(lambda: reference_jrmpc(sets, max_iterations=60, gamma=0.05, epsilon=1e-9), 3)
    words = [sys.executable, "-m", "gp_core.cli", "estimate", "docs/example/touches.csv", "--side", "L"]
    shell = _best(lambda: subprocess.run(words, capture_output=True, check=True, cwd=_ROOT), 3)
    nothing = _best(lambda: subprocess.run([sys.executable, "-c", "import numpy"], check=True), 3)

    print(f"{'one estimate':<34}{'ms':>9}{'ratio':>9}")
    print(f"{'plain NumPy JRMPC, registration':<34}{plain:9.2f}{1:9.2f}")
    print(f"{'estimate_pose, jrmpc':<34}{joint:9.2f}{joint / plain:9.3f}")
    print(f"{'estimate_pose, robust':<34}{robust:9.2f}{robust / plain:9.3f}")
    print(f"{'python -c import numpy':<34}{nothing:9.0f}{1:9.2f}")
    print(f"{'gp-core estimate from the shell':<34}{shell:9.0f}{shell / nothing:9.2f}")


if __name__ == "__main__":
    main()
