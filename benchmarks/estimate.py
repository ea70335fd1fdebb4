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
    str(_ROOT / "tests" / "core"),
]

from atlas_cases import draw_side, draw_specimens  # noqa: E402
from reference_jrmpc import reference_jrmpc  # noqa: E402

import gp_core  # noqa: E402
from gp_core.pose.jrmpc_estimator import training_sides  # noqa: E402

_FIRST = """
import time, numpy, gp_core
a = gp_core.Atlas.published()
touches = {code: a[code] + 0.4 * numpy.sin(7 * a[code]) for code in gp_core.PROBE}
start = time.perf_counter()
gp_core.estimate_pose(touches, "L", a)
print(1000 * (time.perf_counter() - start))
"""


def _best(run: Callable[[], object], repeats: int) -> float:
    """Fastest of several runs, ms: the one that the rest of the machine disturbed least."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return 1000 * min(times)


def _robust(atlas: gp_core.Atlas, rng: np.random.Generator) -> dict[str, float]:
    """Time `robust` estimates of careful and of rough touches; of these the worst of several, ms.

    Rough ones are fitted from other starts, from the other side, and with names exchanged. The first
    estimate of a process runs uncompiled, the second loads the compiled code.
    """
    ten = tuple(code for code in gp_core.EXTERNAL if code != "IN")
    animal = draw_side(atlas, rng)
    words = [sys.executable, "-c", _FIRST]
    first = subprocess.run(words, capture_output=True, check=True, cwd=_ROOT, text=True)
    times = {"the first of a process, rough": float(first.stdout)}
    for codes in (gp_core.PROBE, ten):
        for noise, word in ((0.1, "careful"), (0.4, "rough")):
            touches = [
                {code: p + noise * rng.normal(size=3) for code, p in animal.as_mapping(codes).items()}
                for _ in range(8)
            ]
            best = [_best(lambda t=t: gp_core.estimate_pose(t, "L", atlas), 100) for t in touches]
            times[f"estimate_pose, robust, {len(codes)} {word}"] = max(best)
    return times


def main() -> None:
    """Print the table."""
    atlas = gp_core.Atlas.published()
    rng = np.random.default_rng(0)
    animals = draw_specimens(atlas, 12, rng)
    probe = animals.pop().side("L")
    touches = {code: p + 0.1 * rng.normal(size=3) for code, p in probe.as_mapping(gp_core.PROBE).items()}
    sets = [side.landmarks.array(gp_core.TRAINING) for side in training_sides(animals, gp_core.Side.LEFT)]
    sets.append(np.array(list(touches.values())))

    robust = _robust(atlas, rng)
    gp_core.estimate_pose(touches, "L", method="jrmpc", specimens=animals)
    joint = _best(lambda: gp_core.estimate_pose(touches, "L", method="jrmpc", specimens=animals), 50)
    plain = _best(lambda: reference_jrmpc(sets, max_iterations=60, gamma=0.05, epsilon=1e-9), 3)
    touched = gp_core.LandmarkSet.from_mapping(dict(list(touches.items())[:3]), "L", frame="tracker")
    gain = _best(lambda: gp_core.gains(touched, atlas), 50)
    words = [sys.executable, "-m", "gp_core.cli", "estimate", "docs/example/touches.csv", "--side", "L"]
    shell = _best(lambda: subprocess.run(words, capture_output=True, check=True, cwd=_ROOT), 3)
    nothing = _best(lambda: subprocess.run([sys.executable, "-c", "import numpy"], check=True), 3)

    print(f"{'one estimate':<34}{'ms':>9}{'ratio':>9}")
    print(f"{'plain NumPy JRMPC, registration':<34}{plain:9.2f}{1:9.2f}")
    print(f"{'estimate_pose, jrmpc':<34}{joint:9.2f}{joint / plain:9.3f}")
    for label, time_ms in robust.items():
        print(f"{label:<34}{time_ms:9.2f}{time_ms / plain:9.3f}")
    print(f"{'gains, eight features':<34}{gain:9.2f}{gain / plain:9.3f}")
    print(f"{'python -c import numpy':<34}{nothing:9.0f}{1:9.2f}")
    print(f"{'gp-core estimate from the shell':<34}{shell:9.0f}{shell / nothing:9.2f}")


if __name__ == "__main__":
    main()
